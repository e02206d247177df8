"""Geometric paths, each a curve p(u) that is walked from u = 0 to the number of laps at the quintic time law."""

from abc import abstractmethod
from collections.abc import Callable, Iterator
from typing import Annotated, ClassVar, Literal, Self, TypeAlias

import numpy as np
from pydantic import Field, model_validator

from caster_gym.arrays import Array, Plane
from caster_gym.configuration import Frozen, Positive
from caster_gym.paths.angles import Rotation
from caster_gym.paths.headings import Fixed, Heading, Slopes, Tangent
from caster_gym.paths.trajectory import (
    Trajectory,
    place,
    rest_to_rest_at,
    rounded_down,
    rounded_up,
    tabulate,
    whole_steps,
)

Curve: TypeAlias = Callable[[Array], Slopes]
Turn: TypeAlias = Callable[[Array, Slopes], tuple[Array, Array, Array]]


SIZES = tuple(digit * 10.0**power for power in range(-3, 3) for digit in (1.0, 2.0, 5.0))  # [m] that advice tries


class Shape(Frozen):
    """A curve, how often and how long it is walked, and where it lies. At rest at both ends."""

    _sizes: ClassVar[tuple[str, ...]]  # fields in m that make it larger

    shape: str
    duration: Positive = 10.0  # [s] of all laps together, rounded to whole time steps
    laps: Annotated[int, Field(gt=0, le=1000)] = 1
    heading: Heading = Tangent()
    centre: tuple[float, float] = (0.0, 0.0)  # [m] where the origin of the shape lies, in the world
    rotation: Rotation = 0.0  # [rad] of the whole path about that point, headings included

    @abstractmethod
    def curve(self, u: Array) -> Slopes:
        """p [m] and its first three derivatives at u, before placing; one lap takes u from 0 to 1."""

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """Heading before placing [rad] and its first two derivatives by share, u / laps; so are the slopes."""
        return self.heading.turn(share, slopes)

    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]:
        """The one timed trajectory of this path. Time step in s."""
        steps = whole_steps(self.duration, time_step)
        table = self._walked(self.curve, self.turn, self.laps, np.arange(steps + 1) / steps, steps * time_step)
        return (Trajectory(self.shape, time_step, table, self.description),)

    def _walked(self, curve: Curve, turn: Turn, laps: int, tau: Array, duration: float) -> Array:
        """Samples (T, 10) of a curve and its headings, walked from rest to rest, at shares 0 … 1 of a duration [s]."""
        share, rate, acceleration = rest_to_rest_at(tau, duration)
        p, first, second, third = (slope * laps**n for n, slope in enumerate(curve(share * laps)))
        angle, turned, bend = turn(share, (p, first, second, third))
        motion = (p, first * rate, second * rate**2 + first * acceleration)
        motion, heading = place(motion, np.exp(1j * angle), self.centre, self.rotation)
        turning = (heading, turned * rate, bend * rate**2 + turned * acceleration)
        return tabulate(motion, turning)

    @property
    def description(self) -> str:
        """What was made of the specification, as far as that does not stand in it."""
        return "; ".join([self.shape, *self.heading.notes])

    def ease(self, factor: float) -> Self:
        """The same path, walked slower by a factor above 1; its duration keeps three digits, rounded up."""
        return self.model_copy(update={"duration": rounded_up(self.duration * factor)})

    def with_fixed_heading(self) -> Self | None:
        """The same path, along which the heading does not turn; None where its headings are its own."""
        return self.model_copy(update={"heading": Fixed()})

    def widen(self) -> Iterator[tuple[Self, str]]:
        """The same path in larger sizes, and what each takes, in words."""
        now = max(np.max(getattr(self, name)) for name in self._sizes)
        for size in SIZES:
            if size > now:
                sizes = {name: _enlarged(size / now, getattr(self, name)) for name in self._sizes}
                yield self.model_copy(update=sizes), " and ".join(f"{name} {value} m" for name, value in sizes.items())

    @property
    def remedy(self) -> str:
        """The duration of this path, as advice."""
        return f"a duration of at least {self.duration:g} s"


def _enlarged(factor: float, size: float | tuple[float, ...]) -> float | tuple[float, ...]:
    """A size or sizes times a factor, rounded to three digits."""
    if isinstance(size, tuple):
        return tuple(float(f"{factor * one:.3g}") for one in size)
    return float(f"{factor * size:.3g}")


def harmonic(u: Array, amplitude: float, order: int, phase: float) -> list[Array]:
    """amplitude · cos(2π order u + phase) and its first three derivatives."""
    w = 2.0 * np.pi * order
    return [amplitude * w**n * np.cos(w * u + phase + 0.5 * np.pi * n) for n in range(4)]


def oval(u: Array, along: float, across: float) -> Slopes:
    """Counter-clockwise from (along, 0)."""
    x, y = harmonic(u, along, 1, 0.0), harmonic(u, across, 1, -0.5 * np.pi)
    a, b, c, d = (x[n] + 1j * y[n] for n in range(4))
    return a, b, c, d


class Circle(Shape):
    """Counter-clockwise about the origin from (radius, 0): the path of chung2008, Fig. 5."""

    shape: Literal["circle"] = "circle"
    radius: Positive = 1.0  # [m]
    _sizes = ("radius",)

    def curve(self, u: Array) -> Slopes:
        return oval(u, self.radius, self.radius)


class Ellipse(Shape):
    """Counter-clockwise about the origin from (a, 0), at a constant rate of the eccentric anomaly."""

    shape: Literal["ellipse"] = "ellipse"
    duration: Positive = 12.0  # [s]
    semi_axes: tuple[Positive, Positive] = (1.5, 0.5)  # [m] (a, b) along x and y
    _sizes = ("semi_axes",)

    def curve(self, u: Array) -> Slopes:
        return oval(u, *self.semi_axes)


class Lemniscate(Shape):
    """Gerono's figure of eight, half as high as wide, from its crossing at the origin towards +x, +y."""

    shape: Literal["lemniscate"] = "lemniscate"
    duration: Positive = 12.0  # [s]
    width: Positive = 1.8  # [m]
    _sizes = ("width",)

    def curve(self, u: Array) -> Slopes:
        x = harmonic(u, 0.5 * self.width, 1, -0.5 * np.pi)
        y = harmonic(u, 0.25 * self.width, 2, -0.5 * np.pi)
        a, b, c, d = (x[n] + 1j * y[n] for n in range(4))
        return a, b, c, d


class RoundedSquare(Shape):
    """Counter-clockwise about the origin from the middle of the right side.

    In a corner the tangent turns by the quintic of the arc length, so that curvature and its slope are continuous.
    """

    shape: Literal["rounded_square"] = "rounded_square"
    duration: Positive = 12.0  # [s]
    side: Positive = 1.2  # [m]
    rounding: Positive = 0.4  # [m] that each corner takes from the ends of its sides, as a radius would
    _sizes = ("side", "rounding")

    @model_validator(mode="after")
    def _corners_fit(self) -> Self:
        if self.rounding > 0.5 * self.side:
            raise ValueError(
                f"the rounding must be at most half the side, {rounded_down(0.5 * self.side, 6):g} m, "
                f"got {self.rounding:g} m"
            )
        return self

    def widen(self) -> Iterator[tuple[Self, str]]:
        for size in SIZES:
            if self.rounding < size <= 0.5 * self.side:
                yield self.model_copy(update={"rounding": size}), f"rounding {size:g} m"
        yield from super().widen()

    def curve(self, u: Array) -> Slopes:
        half = 0.5 * self.side - self.rounding
        arc = self.rounding / _corner(np.ones(1)).imag[0]
        quarter = 2.0 * half + arc
        turned, share = np.divmod(4.0 * u, 1.0)
        way = share * quarter
        xi = np.clip((way - half) / arc, 0.0, 1.0)
        straight = 1j * np.minimum(way, half) - np.maximum(way - half - arc, 0.0)
        side = np.exp(0.5j * np.pi * turned)
        p = side * (0.5 * self.side + straight + arc * _corner(xi))
        tangent = side * np.exp(1j * _corner_angle(xi))
        curvature = 0.5 * np.pi * 30.0 * xi**2 * (1.0 - xi) ** 2 / arc
        slope = 0.5 * np.pi * 60.0 * xi * (1.0 - xi) * (1.0 - 2.0 * xi) / arc**2
        lap = 4.0 * quarter  # ds/du
        return p, lap * tangent, lap**2 * 1j * curvature * tangent, lap**3 * (1j * slope - curvature**2) * tangent


def _corner_angle(xi: Array) -> Array:
    """Direction of the tangent [rad] at a share of the corner's arc, from +y to −x."""
    return 0.5 * np.pi * (1.0 + xi**3 * (10.0 - 15.0 * xi + 6.0 * xi**2))


def _corner(xi: Array) -> Plane:
    """Way through a corner of unit arc length: ∫ exp(i angle), by Gauss's rule; its error is below rounding."""
    nodes, weights = np.polynomial.legendre.leggauss(20)
    inner = np.exp(1j * _corner_angle(0.5 * xi[:, None] * (1.0 + nodes)))
    return np.asarray(0.5 * xi * (inner @ weights), dtype=np.complex128)
