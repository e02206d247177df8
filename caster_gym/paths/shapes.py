"""Geometric paths, each a curve p(u) that is walked from u = 0 to the number of laps at the quintic time law."""

from abc import abstractmethod
from typing import Literal, Self

import numpy as np
from pydantic import PositiveFloat, PositiveInt, model_validator

from caster_gym.configuration import Frozen
from caster_gym.paths.headings import Heading, Slopes, Tangent
from caster_gym.paths.trajectory import Array, Plane, Trajectory, place, rest_to_rest, tabulate, whole_steps


class Shape(Frozen):
    """A curve, how often and how long it is walked, and where it lies. At rest at both ends."""

    shape: str
    duration: PositiveFloat = 10.0  # [s] of all laps together, rounded to whole time steps
    laps: PositiveInt = 1
    heading: Heading = Tangent()
    centre: tuple[float, float] = (0.0, 0.0)  # [m] where the origin of the shape lies, in the world
    rotation: float = 0.0  # [rad] of the whole path about that point, headings included

    @abstractmethod
    def curve(self, u: Array) -> Slopes:
        """p [m] and its first three derivatives at u, before placing; one lap takes u from 0 to 1."""

    def turn(self, share: Array, slopes: Slopes) -> tuple[Array, Array, Array]:
        """Heading before placing [rad] and its first two derivatives by share, u / laps; so are the slopes."""
        return self.heading.turn(share, slopes)

    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]:
        """The one timed trajectory of this path. Time step in s."""
        share, rate, acceleration = rest_to_rest(whole_steps(self.duration, time_step), time_step)
        p, first, second, third = (slope * self.laps**n for n, slope in enumerate(self.curve(share * self.laps)))
        angle, turn, bend = self.turn(share, (p, first, second, third))
        motion = (p, first * rate, second * rate**2 + first * acceleration)
        motion, heading = place(motion, np.exp(1j * angle), self.centre, self.rotation)
        turning = (heading, turn * rate, bend * rate**2 + turn * acceleration)
        return (Trajectory(self.shape, time_step, tabulate(motion, turning)),)

    def eased(self, factor: float) -> Self:
        """The same path, walked slower by a factor above 1; its duration keeps three digits, rounded up."""
        duration = self.duration * factor
        digit = 10.0 ** (np.floor(np.log10(duration)) - 2.0)
        return self.model_copy(update={"duration": float(f"{np.ceil(duration / digit) * digit:.12g}")})

    @property
    def remedy(self) -> str:
        """The duration of this path, as advice."""
        return f"a duration of at least {self.duration:g} s"


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
    radius: PositiveFloat = 1.0  # [m]

    def curve(self, u: Array) -> Slopes:
        return oval(u, self.radius, self.radius)


class Ellipse(Shape):
    """Counter-clockwise about the origin from (a, 0), at a constant rate of the eccentric anomaly."""

    shape: Literal["ellipse"] = "ellipse"
    duration: PositiveFloat = 12.0  # [s]
    semi_axes: tuple[PositiveFloat, PositiveFloat] = (1.5, 0.5)  # [m] (a, b) along x and y

    def curve(self, u: Array) -> Slopes:
        return oval(u, *self.semi_axes)


class Lemniscate(Shape):
    """Gerono's figure of eight, half as high as wide, from its crossing at the origin towards +x, +y."""

    shape: Literal["lemniscate"] = "lemniscate"
    duration: PositiveFloat = 12.0  # [s]
    width: PositiveFloat = 1.8  # [m]

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
    duration: PositiveFloat = 12.0  # [s]
    side: PositiveFloat = 1.2  # [m]
    rounding: PositiveFloat = 0.4  # [m] that each corner takes from the ends of its sides, as a radius would

    @model_validator(mode="after")
    def _corners_fit(self) -> Self:
        if self.rounding > 0.5 * self.side:
            raise ValueError(
                f"the rounding must be at most half the side, {0.5 * self.side:g} m, got {self.rounding:g} m"
            )
        return self

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
