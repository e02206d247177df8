"""Advice on how to make a path drivable, found by trying, so that it holds."""

from collections.abc import Iterator
from typing import Protocol, Self

from caster_gym.paths.feasibility import SURE, greatest_use
from caster_gym.paths.trajectory import LEAST_STEPS, Trajectory
from caster_gym.robot import Robot

_FACTORS = tuple(2.0**power for power in range(8))  # by which a path is walked slower
_HALVINGS = 4  # of the last doubling, on a logarithmic scale: to 5 %


class Adaptable(Protocol):
    """A path that knows gentler versions of itself."""

    @property
    def duration(self) -> float: ...
    @property
    def remedy(self) -> str: ...
    def ease(self, factor: float) -> Self: ...
    def with_fixed_heading(self) -> Self | None: ...
    def widen(self) -> Iterator[tuple[Self, str]]: ...
    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]: ...


def timed_remedy(path: Adaptable, robot: Robot, time_step: float) -> str | None:
    """What a path needs to be a trajectory that the motors can drive, in words: "" for nothing, None if unknown."""
    fixed = path.with_fixed_heading()
    for one, words in ((path, []), (fixed, ["a fixed heading"])):
        if one is None:
            continue
        if _drivable(one, robot, time_step):
            return " and ".join(words)
        long_enough = max(1.0, LEAST_STEPS * time_step / one.duration)
        factors = [long_enough * factor for factor in _FACTORS]
        found = next((factor for factor in factors if _drivable(one.ease(factor), robot, time_step)), None)
        if found is not None:
            low = max(1.0, 0.5 * found)
            for _ in range(_HALVINGS):
                middle = (low * found) ** 0.5
                low, found = (low, middle) if _drivable(one.ease(middle), robot, time_step) else (middle, found)
            return " and ".join([*words, one.ease(found).remedy])
    return None


def _drivable(path: Adaptable, robot: Robot, time_step: float) -> bool:
    try:
        return greatest_use(path, time_step, robot) <= SURE
    except ValueError:
        return False
