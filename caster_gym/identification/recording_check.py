"""Checks whether the columns of a recording can belong to one rolling robot, before the fit.

Rolling ties pose, steering angles, rolling angles and twist together, whatever the torques are
(`caster_gym.identification.kinematic_laws`). Where they contradict each other, the usual mistakes are tried one at a
time (`caster_gym.identification.mends`), and the one that mends the recording is named. Needs NumPy alone.
"""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from caster_gym.identification.acting import shown_errors
from caster_gym.identification.contradictions import SURE, Finding, hopeless_words, mend_words, size_words, small_words
from caster_gym.identification.kinematic_laws import Laws, Size, laws_of, rolling_ratios, window_of
from caster_gym.identification.log_faults import held_columns, torques_missing, torques_too_large
from caster_gym.identification.mends import Mend, mends, scaled_up, turned
from caster_gym.identification.recording import Recording
from caster_gym.identification.unknowns import robot_with
from caster_gym.robot import Robot

_MOST_ROWS = 2000  # in which mistakes are looked for, the liveliest of the recording
_FACTOR = 3.2  # by which a mend must lessen what is left of all laws together
_HOPELESS = 0.5  # [-] of both sides of a law that is left where columns have little in common
_APART = 0.02  # [-] of a trail or a radius, from which estimates would be wrong too
_ASKEW = 0.5 * math.pi / 180.0  # [rad] of a steering zero, the same
_ODD_UNIT = 0.1  # [-] for each column, by which a unit of its own must fit better than one that is known
_WHOLE_TURN = 0.6  # [rad] of a steering zero that is a convention and not an error

_ANYHOW = " To fit the recording as it is, --set check=false."


class ContradictionError(ValueError):
    """A recording that contradicts itself or the robot that it is said to be of."""


def check_recording(
    recording: Recording, robot: Robot, names: Sequence[str] = (), starts: Mapping[str, float] | None = None
) -> tuple[str, ...]:
    """Raise ContradictionError for a recording that contradicts itself or the robot; returns sentences to beware of.

    names: of unknowns that will be estimated, which may differ from the robot's; starts: values that differ from it.
    """
    believed, values = robot_with(robot, starts or {}), starts or {}
    errors = shown_errors(robot, values, 6 + robot.caster_count)
    shown = {"pose": errors[:3], "twist": errors[3:6], "steering": errors[6:]}
    as_true = recording.change_columns(lambda name, columns: columns - shown[name] if name in shown else columns)
    found = contradiction(as_true, believed)
    if found is None and not any("strength" in name for name in (*names, *values)):
        found = torques_too_large(recording, robot)
    if found is not None:
        raise ContradictionError(found.words + _ANYHOW)
    sizes = [size for size in different(as_true, believed) if not _is_asked(size.name, names)]
    coarse = [size for size in sizes if _is_coarse(size)]
    if coarse:
        raise ContradictionError(size_words(coarse, believed, names) + _ANYHOW)
    return (small_words(sizes),) if sizes else ()


def different(recording: Recording, robot: Robot) -> list[Size]:
    """Trails, radii, steering zeros and factors of the twist that are surely not as described."""
    return [
        size
        for size in laws_of(recording, robot, window_of(recording)).sizes
        if abs(size.shown - size.described) > SURE * size.deviation
    ]


def contradiction(recording: Recording, robot: Robot) -> Finding | None:
    """The columns that contradict each other, and the one mistake, if any is found, that explains it."""
    found = held_columns(recording) or torques_missing(recording)
    if found is not None:
        return found
    width = window_of(recording)
    laws = laws_of(recording, robot, width)
    if not any(law.broken for law in laws.laws):
        return None
    part = _liveliest(recording, robot)
    before = laws_of(part, robot, width)
    suspects = _suspects(laws)
    known = [mend for mend in (*_own_zeros(before), *mends(part, robot)) if mend.of in suspects]
    ratios = rolling_ratios(part, robot, width) if "rolling" in suspects else {}
    best = _best(known, part, robot, before, width)
    own = _best([scaled_up(ratios)] if ratios else [], part, robot, before, width)
    if own is not None and (best is None or own[1].cost < best[1].cost - _ODD_UNIT * len(ratios)):
        best = own
    if best is not None and before.cost - best[1].cost > 2.0 * math.log(_FACTOR):
        return Finding(mend_words(before, *best), best[0])
    hopeless = [law for law in laws.laws if law.broken and law.misfit > _HOPELESS]
    return Finding(hopeless_words(hopeless, recording), None) if hopeless else None


def _best(known: Sequence[Mend], part: Recording, robot: Robot, before: Laws, width: int) -> tuple[Mend, Laws] | None:
    """The mistake whose mend leaves least of all laws."""
    best: tuple[Mend, Laws] | None = None
    for mend in known:
        after = laws_of(mend.mended(part), robot, width)
        if not _is_worse(before, after) and (best is None or after.cost < best[1].cost):
            best = mend, after
    return best


def _suspects(laws: Laws) -> set[str]:
    """Columns that may be wrong. Where steering and pose agree, these are innocent."""
    broken = {law.columns[0].partition("_")[0] for law in laws.laws if law.broken}
    if "steering" in broken:
        return {"pose", "steering", "time"}
    telling = any(law.columns[0].startswith("steering") and not law.silent for law in laws.laws)
    own = {"rolling": {"rolling"}, "vx": {"twist", "time"}, "yaw": {"twist", "time"}, "time": {"time", "pose"}}
    return set().union(*(own[name] for name in broken), set() if telling else {"pose", "steering"})


def _is_worse(before: Laws, after: Laws) -> bool:
    """A mend must not break what held."""
    pairs = zip(before.laws, after.laws, strict=True)
    return any(new.broken and not old.broken for old, new in pairs)


def _own_zeros(laws: Laws) -> list[Mend]:
    """Steering angles that are measured from elsewhere, by as much as shows."""
    zeros = {
        int(size.name.rpartition("_")[2]) - 1: size.shown
        for size in laws.sizes
        if size.name.startswith("steering_zero") and abs(size.shown) > _WHOLE_TURN
    }
    return [turned(zeros)] if zeros else []


def _liveliest(recording: Recording, robot: Robot) -> Recording:
    """The part of a long recording in which the robot moves most."""
    if len(recording.pose) <= _MOST_ROWS:
        return recording
    reach = robot.pivot_reach
    steps = np.abs(np.diff(recording.steering, axis=0)).sum(axis=1) + np.abs(
        np.diff(recording.pose, axis=0)
    ) @ np.array([1.0 / reach, 1.0 / reach, 1.0])
    sums = np.concatenate([[0.0], np.cumsum(steps)])
    first = int((sums[_MOST_ROWS - 1 :] - sums[: len(sums) - _MOST_ROWS + 1]).argmax())
    rows = slice(first, first + _MOST_ROWS)
    return recording.change_columns(lambda _, columns: columns[rows])


def _is_coarse(size: Size) -> bool:
    """Whether estimates would be wrong too."""
    if size.name.startswith("steering_zero"):
        return abs(size.shown) > _ASKEW
    return abs(size.shown / size.described - 1.0) > _APART


def _is_asked(name: str, names: Sequence[str]) -> bool:
    names_too = {"vx and vy": ("vx_bias", "vy_bias"), "yaw_rate": ("yaw_rate_bias",)}.get(name, ())
    if name.startswith("steering_zero"):
        names_too = ("heading_zero",)  # which looks as if all steering angles were off
    return name in names or name.rpartition("_")[0] in names or bool(set(names_too) & set(names))
