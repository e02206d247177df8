"""Smooth random trajectories: wandering curves of different speeds and turns, some of which reverse.

A path is drawn as the direction θ of its tangent and the speed v along it, both smooth in time, so that its tangent is
defined everywhere, at rest and where it reverses too. Position is the integral of v exp(iθ).
"""

from collections.abc import Iterator
from typing import Annotated, Literal, Self, get_args

import numpy as np
from pydantic import Field, NonNegativeInt, model_validator

from caster_gym.arrays import Array, Plane
from caster_gym.configuration import Frozen, Positive
from caster_gym.paths.angles import Rotation
from caster_gym.paths.trajectory import Trajectory, place, rest_to_rest, rounded_down, tabulate, whole_steps

RandomHeading = Literal["tangent", "fixed", "spinning", "profile"]

_WAVES = 3  # harmonics of each smooth function
_DRAWS = 6 * _WAVES + 10  # uniform numbers that make one path
_SLOWEST = 0.3  # [-] of the limits; each path draws its share of them between this and 1


class RandomPaths(Frozen):
    """Random paths from the centre, at rest at both ends. Path k is the same for every count."""

    shape: Literal["random_paths"] = "random_paths"
    count: Annotated[int, Field(gt=0, le=100_000)] = 16
    seed: NonNegativeInt = 0
    duration: Positive = 10.0  # [s] of each
    extent: Positive = 3.0  # [m] greatest distance from the start
    max_speed: Positive = 0.8  # [m/s]
    max_acceleration: Positive = 1.0  # [m/s²]
    max_yaw_rate: Positive = 1.5  # [rad/s] of the heading and of the tangent
    heading: Literal["any"] | RandomHeading = "any"  # "any" draws one for each path
    reversing: Annotated[float, Field(ge=0.0, le=1.0)] = 0.25  # [-] share that changes between forwards and backwards
    # [m] least radius of the tangent's turns, and least way over turn of the heading; None sets no bound
    min_radius: Positive | None = None
    centre: tuple[float, float] = (0.0, 0.0)  # [m] where all of them start, in the world
    rotation: Rotation = 0.0  # [rad] of all of them about that point, headings included

    @model_validator(mode="after")
    def _radius_only_where_none_reverses(self) -> Self:
        if self.min_radius is not None and self.reversing > 0.0:
            raise ValueError(
                f"a min_radius of {self.min_radius:g} m needs reversing 0, got {self.reversing:g}: "
                f"where a path reverses it turns on the spot"
            )
        return self

    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]:
        """All paths, timed. Time step in s."""
        steps = whole_steps(self.duration, time_step)
        draws = _Draws(np.random.default_rng(self.seed).random((self.count, _DRAWS)))
        turning = self._turning(draws.wander(), steps, time_step)
        v, v_rate = _speeds(draws, self.reversing, steps, time_step)
        share = draws.between(_SLOWEST, 1.0)
        # a path whose tangent turns less gets no farther than straight ahead, and needs no more acceleration
        straight, straight_rate = v.astype(np.complex128), v_rate.astype(np.complex128)
        farthest = _integral(straight, straight_rate, time_step)
        least = share * self._largest(farthest, straight, v_rate + 1j * v * turning[1])
        tangent, omega, alpha = self._widened(turning, least * v)
        direction = np.exp(1j * tangent)
        velocity, acceleration = v * direction, (v_rate + 1j * v * omega) * direction
        position = _integral(velocity, acceleration, time_step)
        size = share * self._largest(position, velocity, acceleration)
        angle, rate, growth = self._headings(draws, steps, time_step, (tangent, omega, alpha), size * v)
        motion = (size * position, size * velocity, size * acceleration)
        motion, heading = place(motion, np.exp(1j * angle), self.centre, self.rotation)
        samples = tabulate(motion, (heading, rate, growth))
        return tuple(Trajectory(f"{self.shape} {k}", time_step, table) for k, table in enumerate(samples))

    def _largest(self, position: Plane, velocity: Plane, acceleration: Plane) -> Array:
        """Greatest factor (P, 1) that every limit allows."""
        limits = (self.extent, self.max_speed, self.max_acceleration)
        peaks = [np.abs(part).max(axis=1, keepdims=True) for part in (position, velocity, acceleration)]
        return np.asarray(np.min([limit / peak for limit, peak in zip(limits, peaks, strict=True)], axis=0))

    def _turning(self, coefficients: Array, steps: int, time_step: float) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration (P, K + 1) of smooth functions of the progress, slowed to max_yaw_rate."""
        progress, rate, acceleration = rest_to_rest(steps, time_step)
        start, (angle, first, second) = coefficients[:, :1], _series(coefficients[:, 1:], progress)
        omega = first * rate
        peak = np.abs(omega).max(axis=1, keepdims=True)
        slower = self.max_yaw_rate / np.maximum(peak, self.max_yaw_rate)
        return start + slower * angle, slower * omega, slower * (second * rate**2 + first * acceleration)

    def _widened(self, turning: tuple[Array, Array, Array], speed: Array) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration with all turns scaled down until they keep to min_radius at these speeds."""
        if self.min_radius is None:
            return turning
        angle, omega, alpha = turning
        # 1 / radius; ends are at rest
        sharpest = np.max(np.abs(omega[:, 1:-1]) / speed[:, 1:-1], axis=1, keepdims=True)
        gentler = 1.0 / np.maximum(self.min_radius * sharpest, 1.0)
        return angle[:, :1] + gentler * (angle - angle[:, :1]), gentler * omega, gentler * alpha

    def _headings(
        self, draws: "_Draws", steps: int, time_step: float, along: tuple[Array, Array, Array], speed: Array
    ) -> tuple[Array, Array, Array]:
        """Angle, rate and acceleration (P, K + 1) of the body x-axis, of the kind asked for or drawn."""
        kinds = get_args(RandomHeading)
        kind = np.floor(draws.between(0.0, len(kinds)))
        if self.heading != "any":
            kind = np.full_like(kind, kinds.index(self.heading))
        coefficients = draws.wander()
        coefficients[:, 1:2] *= np.where(kind == kinds.index("fixed"), 0.0, 1.0)
        coefficients[:, 2:] *= np.where(kind == kinds.index("profile"), 1.0, 0.0)
        own = self._widened(self._turning(coefficients, steps, time_step), speed)
        a, b, c = (np.where(kind == kinds.index("tangent"), t, o) for t, o in zip(along, own, strict=True))
        return a, b, c

    def ease(self, factor: float) -> Self:
        """The same paths under limits divided by a factor above 1, kept to two digits, rounded down."""
        names = ("max_speed", "max_acceleration", "max_yaw_rate")
        return self.model_copy(update={name: rounded_down(getattr(self, name) / factor) for name in names})

    def with_fixed_heading(self) -> Self | None:
        """The same paths, along which the heading does not turn."""
        return self.model_copy(update={"heading": "fixed"})

    def widen(self) -> Iterator[tuple[Self, str]]:
        """Paths that turn less sharply, and what they take, in words."""
        for radius in (0.05, 0.1, 0.2, 0.5, 1.0, 2.0):
            if radius > (self.min_radius or 0.0):
                words = f"a min_radius of {radius:g} m{' and reversing 0' if self.reversing else ''}"
                yield self.model_copy(update={"min_radius": radius, "reversing": 0.0}), words

    @property
    def remedy(self) -> str:
        """The limits of these paths, as advice."""
        return (
            f"max_speed {self.max_speed:g} m/s, max_acceleration {self.max_acceleration:g} m/s² "
            f"and max_yaw_rate {self.max_yaw_rate:g} rad/s"
        )


class _Draws:
    """A row of uniform numbers for each path, handed out column by column."""

    def __init__(self, numbers: Array) -> None:
        self._numbers = numbers
        self._next = 0

    def between(self, low: float, high: float, columns: int = 1) -> Array:
        """Numbers (P, columns), uniform between two bounds."""
        taken = self._numbers[:, self._next : self._next + columns]
        self._next += columns
        return low + (high - low) * taken

    def wander(self) -> Array:
        """Coefficients (P, 2 + 2 waves) of a random angle [rad]: its start, its drift, and waves about it."""
        start, drift = self.between(-np.pi, np.pi), self.between(-2.0 * np.pi, 2.0 * np.pi)
        return np.concatenate([start, drift, self.between(-1.0, 1.0) * self.between(-1.5, 1.5, 2 * _WAVES)], axis=1)


def _series(coefficients: Array, x: Array) -> tuple[Array, Array, Array]:
    """drift · x + Σ (a_k sin 2πkx + b_k (cos 2πkx − 1)) / k for each row (drift, a_1, b_1, …), and two derivatives."""
    value = coefficients[:, :1] * x
    first = np.broadcast_to(coefficients[:, :1], value.shape).copy()
    second = np.zeros_like(value)
    for k in range(1, _WAVES + 1):
        w = 2.0 * np.pi * k
        a, b = coefficients[:, 2 * k - 1, None] / k, coefficients[:, 2 * k, None] / k
        sin, cos = np.sin(w * x), np.cos(w * x)
        value += a * sin + b * (cos - 1.0)
        first += w * (a * cos - b * sin)
        second -= w * w * (a * sin + b * cos)
    return value, first, second


def _speeds(draws: _Draws, share: float, steps: int, time_step: float) -> tuple[Array, Array]:
    """Speed along the tangent and its rate (P, K + 1), before scaling: the quintic's bell times waves in time."""
    tau, duration = np.arange(steps + 1) / steps, steps * time_step
    _, bell, bell_rate = rest_to_rest(steps, time_step)
    reversing = draws.between(0.0, 1.0) < share
    waves = draws.between(-1.0, 1.0, 2 * _WAVES)
    most = np.abs(waves).sum(axis=1, keepdims=True)
    level = np.where(reversing, draws.between(-0.2, 0.2), 1.0)
    coefficients = np.concatenate([0.0 * level, waves * 0.4 / most], axis=1)
    wave, wave_rate, _ = _series(coefficients, tau)
    swing = level + wave
    return bell * swing, bell_rate * swing + bell * wave_rate / duration


def _integral(velocity: Plane, acceleration: Plane, time_step: float) -> Plane:
    """Position (P, K + 1) from 0 by the trapezoidal rule with end corrections; its error falls with time_step⁴."""
    v, a, h = velocity, acceleration, time_step
    ways = 0.5 * h * (v[:, 1:] + v[:, :-1]) + h * h / 12.0 * (a[:, :-1] - a[:, 1:])
    return np.concatenate([np.zeros_like(v[:, :1]), np.cumsum(ways, axis=1)], axis=1)
