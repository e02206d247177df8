"""Messages about recordings whose columns contradict each other or the robot."""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from caster_gym.identification.kinematic_laws import Law, Laws, Size
from caster_gym.identification.mends import Mend, listed
from caster_gym.identification.recording import Recording
from caster_gym.robot import Robot

SURE = 6.0  # standard deviations from which a size differs from the described one
_ALIKE = 4e-3  # [-] by which sizes of casters differ that are one size


class Finding(NamedTuple):
    """What is wrong with a recording."""

    words: str
    mend: Mend | None


def size_words(sizes: Sequence[Size], robot: Robot, names: Sequence[str] = ()) -> str:
    """What differs from the robot file, by how much, and what to do about it beside estimating the named unknowns."""
    factors = [size for size in sizes if size.name.startswith(("vx", "yaw"))]
    parts = [
        f"{size.name} {'are' if ' and ' in size.name else 'is'} {1.0 / size.shown:.4g} times what the poses show "
        f"(± {SURE / 3.0 * size.deviation / size.shown**2:.1g}): multiply by {size.shown:.4g}"
        for size in factors
    ]
    own = together([size for size in sizes if size not in factors], robot)
    for size in own:
        unit = "rad" if size.name.startswith("steering") else "m"
        half = SURE / 3.0 * size.deviation
        parts.append(f"{size.name} is {size.shown:.5g} ± {half:.1g} {unit}, not {size.described:.5g} {unit}")
    words = "The recording contradicts what is known of the robot: as rolling shows, " + "; ".join(parts) + "."
    if own:
        asked = " ".join(f"--unknown {name}" for name in (*names, *(size.name for size in own)))
        given = ", ".join(f"{size.name}: {size.shown:.5g}" for size in own)
        words += f" Estimate this too, with {asked}, or say that it is known, with --set 'start={{{given}}}'."
    return words


def together(sizes: Sequence[Size], robot: Robot) -> list[Size]:
    """Sizes, one in place of those of all casters where these agree."""
    joined: list[Size] = []
    for kind in dict.fromkeys(size.name.rpartition("_")[0] for size in sizes):
        own = [size for size in sizes if size.name.rpartition("_")[0] == kind]
        shown, deviations = np.array([(size.shown, max(size.deviation, 1e-12)) for size in own]).T
        apart = max(SURE * deviations.max(), _ALIKE * np.abs(shown).min())
        alike = len({size.described for size in own}) == 1 and float(np.ptp(shown)) < apart
        if len(own) == robot.caster_count and alike and kind != "steering_zero":
            weights = deviations**-2.0
            mean = float(shown @ weights / weights.sum())
            joined.append(Size(kind, own[0].described, mean, float(weights.sum() ** -0.5)))
        else:
            joined.extend(own)
    return joined


def small_words(sizes: Sequence[Size]) -> str:
    """Differences too small to refuse the recording for."""
    facts = ", ".join(
        f"{size.name} by {1.0 / size.shown - 1.0:+.2%}"
        if size.name.startswith(("vx", "yaw"))
        else f"{size.name} by {size.shown - size.described:+.2g} {'rad' if size.name.startswith('steering') else 'm'}"
        for size in sizes
    )
    return f"Rolling shows small differences from the robot file, which the estimates suffer from: {facts}."


def mend_words(before: Laws, mend: Mend, after: Laws) -> str:
    """What contradicts what, the mistake that explains it, and what to do."""
    pairs = [(old, new) for old, new in zip(before.laws, after.laws, strict=True) if old.broken]
    old, new = (math.sqrt(sum(law.misfit for law in laws) / len(laws)) for laws in zip(*pairs, strict=True))
    columns = [column for law, _ in pairs for column in law.columns]
    return (
        f"The recording contradicts itself: {_subject(columns)} not fit the others; of the motion that rolling ties "
        f"together, {old:.0%} is left over. It looks as if {mend.wrong}; {old / new:.0f} times less is left over then. "
        f"To mend it, {mend.advice}."
    )


def hopeless_words(laws: Sequence[Law], recording: Recording) -> str:
    """What contradicts what, where no mistake explains it."""
    words = (
        f"The recording contradicts itself: {_subject([column for law in laws for column in law.columns])} not fit the "
        "pose, and no single mistake that we know (casters in another order, sign, unit, frame, zero, rows late or "
        "early) explains it."
    )
    angles = recording.steering
    still = [name for i, name in enumerate(columns_of("steering", recording)) if not np.ptp(angles[:, i])]
    still += [] if np.ptp(recording.pose, axis=0).any() else ["the pose"]
    return f"{words} {listed(still)} never change{'s' * (len(still) == 1)}." if still else words


def _subject(columns: Sequence[str]) -> str:
    return f"{listed(columns)} {'does' if len(columns) == 1 else 'do'}"


def columns_of(name: str, recording: Recording) -> list[str]:
    """steering_1, … or rolling_1, …"""
    return [f"{name}_{i + 1}" for i in range(recording.steering.shape[1])]
