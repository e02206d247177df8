"""Episodes made by hand."""

import numpy as np

from caster_gym.tasks.episodes import Episodes

PERIOD = 0.5
STEPS = 6  # three seconds
MOTORS = 4
DRIVEN = [0, 2]


def column(*values):
    """A series of one episode."""
    return np.array(values, dtype=np.float64)[:, None]


def episodes(lengths=(STEPS,), goal=np.nan, law=np.nan, **changed):
    """Episodes of zeros that last so many steps, with NaN behind; what is changed is stretched to its full shape."""
    count, facts = len(lengths), {"goal": goal, "law": law}
    widths = {"torque": (MOTORS,), "share": (MOTORS,), "command": (len(DRIVEN),), "pose": (4,), "reference": (4,)}
    series = {}
    others = ("names", "period", "driven", "failed", "allowed", "facts")
    for name in Episodes._fields:
        if name not in others:
            shape = (STEPS, count, *widths.get(name, ()))
            series[name] = np.array(np.broadcast_to(changed.pop(name, 0.0), shape), dtype=np.float64)
            for episode, length in enumerate(lengths):
                series[name][length:, episode] = np.nan
    assert not changed, f"episodes have no {set(changed)}"
    return Episodes(
        ("path",) * count,
        PERIOD,
        **series,
        driven=DRIVEN,
        failed=np.array([length < STEPS for length in lengths]),
        allowed=np.full(count, STEPS),
        facts={name: np.broadcast_to(np.asarray(it, dtype=np.float64), count) for name, it in facts.items()},
    )
