"""Checks the arrays that users give to a model, and converts them to the scalars of the mechanics and back."""

import reprlib
from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, Generic, TypeVar

import numpy as np

from caster_gym.mechanics.scalars import Direction, Vector, pairs
from caster_gym.robot import Robot

Numbers = TypeVar("Numbers")  # arrays of the engine


def listed_robots(robots: Robot | Sequence[Robot], count: int | None) -> list[Robot]:
    """One robot for all, or one for each, with the same number of casters."""
    listed = [robots] * (1 if count is None else count) if isinstance(robots, Robot) else list(robots)
    if not listed or (count is not None and len(listed) != count):
        raise ValueError(f"a batch needs one robot for all or {count or 'at least 1'} of them, got {len(listed)}")
    sizes = {robot.caster_count for robot in listed}
    if len(sizes) > 1:
        raise ValueError(f"all robots of a batch must have the same number of casters, got {sorted(sizes)}")
    return listed


class ModelInputs(ABC, Generic[Numbers]):
    """Arrays (..., last) taken apart along their last axis; engines on other kinds of arrays override parts of it."""

    robot: Robot
    _arrays: Any = np

    def _array(self, name: str, value: Any, last: int) -> Any:
        """The value as an array of finite numbers whose last axis has the right length."""
        array = self._numbers(name, value)
        self._check_shape(name, array, last)
        if not np.isfinite(array).all():
            raise ValueError(f"{name} must be finite, got {array[~np.isfinite(array)][0]}")
        return array

    def _numbers(self, name: str, value: Any) -> Any:
        """The value as an array."""
        try:
            return np.asarray(value, dtype=np.float64)
        except (ValueError, TypeError) as error:
            raise ValueError(f"{name} must hold real numbers, got {reprlib.repr(value)}") from error

    @staticmethod
    def _check_shape(name: str, array: Any, last: int) -> None:
        if array.ndim == 0 or array.shape[-1] != last:
            raise ValueError(f"{name} must have a last axis of {last}, got shape {tuple(array.shape)}")

    def _components(self, name: str, value: Any, last: int) -> tuple[Any, ...]:
        array = self._array(name, value, last)
        return tuple(array[..., i] for i in range(last))

    def _vector(self, name: str, value: Any) -> Vector:
        x, y, z = self._components(name, value, 3)
        return x, y, z

    def _wrench(self, wrench: Any) -> Vector:
        return (0.0, 0.0, 0.0) if wrench is None else self._vector("wrench", wrench)

    def _unit(self, angle: Any) -> Direction:
        return self._arrays.cos(angle), self._arrays.sin(angle)

    def _directions(self, steering: Any) -> tuple[Direction, ...]:
        return tuple(self._unit(angle) for angle in self._components("steering", steering, self.robot.caster_count))

    def _torques(self, torque: Any) -> tuple[tuple[Any, Any], ...]:
        return pairs(self._components("torque", torque, 2 * self.robot.caster_count))

    def _in_range(self, name: str, value: Any, low: float, high: float) -> Any:
        number = self._numbers(name, value)
        wrong = ~((number >= low) & (number <= high))  # so that what is no number is wrong too
        if bool(wrong.any()):
            raise ValueError(f"{name} must lie in {low:g} … {high:g}, got {float(number[wrong][0]):g}")
        return number

    def _follow(self, angle: Any, f: Direction) -> Any:
        """The angle of a direction, on the turn nearest to the angle before."""
        c, s = self._unit(angle)
        return angle + self._arrays.atan2(f[1] * c - f[0] * s, f[0] * c + f[1] * s)

    @abstractmethod
    def _scalar(self, value: Any) -> Numbers:
        """One number for each robot of the batch, as an array."""

    @abstractmethod
    def _stack(self, parts: Any, axis: int = -1) -> Numbers:
        """Parts, made of one shape, along a new axis."""
