"""What would make a path one that can be driven: found by trying, so that the advice holds."""

from collections.abc import Iterator, Sequence
from typing import Protocol, Self

from caster_gym.paths.feasibility import motor_use
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

_FACTORS = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 64.0)  # by which a path is walked slower


class Adaptable(Protocol):
    """A path that knows gentler versions of itself."""

    @property
    def remedy(self) -> str: ...
    def eased(self, factor: float) -> Self: ...
    def with_fixed_heading(self) -> Self | None: ...
    def wider(self) -> Iterator[tuple[Self, str]]: ...
    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]: ...


def timed_remedy(path: Adaptable, robot: Robot, time_step: float) -> str | None:
    """What a path needs to be a trajectory that the motors can drive, in words: "" for nothing, None if unknown."""
    fixed = path.with_fixed_heading()
    for factor in _FACTORS:
        for one, words in ((path, ""), (fixed, "a fixed heading")):
            if one is not None:
                slower = one.eased(factor) if factor > 1.0 else one
                if _drivable(slower, robot, time_step):
                    return " and ".join([*([words] if words else []), *([slower.remedy] if factor > 1.0 else [])])
    return None


def _drivable(path: Adaptable, robot: Robot, time_step: float) -> bool:
    try:
        trajectories: Sequence[Trajectory] = path.trajectories(time_step)
    except ValueError:
        return False
    return bool((motor_use(trajectories, robot).use <= 1.0).all())
