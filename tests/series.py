"""Episodes made by hand."""

import numpy as np

from caster_gym.agents.comparison.evaluation import Episodes

PERIOD = 0.5
STEPS = 6  # three seconds
MOTORS = 4
DRIVEN = [0, 2]


def column(*values):
    """A series of one episode."""
    return np.array(values, dtype=np.float64)[:, None]


def episodes(lengths=(STEPS,), goal=np.nan, law=np.nan, **changed):
    """Episodes of zeros that last so many steps, with NaN behind; what is changed is stretched to its full shape."""
    count = len(lengths)
    widths = {"torque": (MOTORS,), "share": (MOTORS,), "command": (len(DRIVEN),), "pose": (4,), "reference": (4,)}
    series = {}
    facts = ("names", "period", "driven", "failed", "allowed", "goal", "law")
    for name in Episodes._fields:
        if name not in facts:
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
        goal=np.broadcast_to(np.asarray(goal, dtype=np.float64), count),
        law=np.broadcast_to(np.asarray(law, dtype=np.float64), count),
    )
