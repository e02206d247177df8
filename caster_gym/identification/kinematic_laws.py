"""The laws of rolling that a recording's columns must obey, and the errors in them, window by window.

A wheel's direction in the world is φ = β + δ − ζ, with ζ its steering zero (shown minus true angle), and its steering
axis stands at P = (x, y) + R(β) (x_i, y_i). (K1) and (K2), integrated over a window of samples, are laws of columns
alone, without a derivative and without time:

    trail · Δφ = ∫ f⊥(φ) · dP                     steering                                       (R1)
    radius · Δθ = ∫ f(φ) · dP − offset · Δφ       rolling                                        (R2)
    Δ(x, y) = ∫ R(β) (vx, vy) dt,  Δβ = ∫ ω dt    twist, in B                                    (R3)

f⊥ turned by ζ is cos ζ f⊥ + sin ζ f, so that trail and zero follow from (R1) by linear least squares, and the radius
from (R2). Noise is known from fifth differences, to which smooth motion adds nothing.
"""

import math
from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.identification.recording import Recording
from caster_gym.robot import Robot

_TURNED = 0.3  # [rad] that wheels turn within a window, about
_SHORTEST, _FEWEST = 4, 8  # samples in a window, and windows
_PRIOR = 0.3  # [-] standard deviation of trail, zero and radius, before the recording is looked at
_WIDEST = 2.0  # times larger or smaller than described, beyond which a trail or a radius is not believed
_WIDEST_ZERO = 0.6  # [rad] and a steering zero
_EVIDENCE = 9.0  # times the noise's, what a law speaks of must be to say anything
_MORE = 2.5  # times what noise leaves, from which a law is broken
_SMALL = 1e-3  # [-] that is left of a law, below which it is not broken
_INTEGRATION = 1e-5  # [-] of a law's own size, squared: what samples far apart leave of it
_NOTHING_IN_COMMON = 0.5  # [-] of both sides of a law that is left, from which it tells no size
_ALIKE = 0.9  # [-] squared correlation from which angles go with ways
_TOO_FAST = 3.0  # times the top speed
_ROWS_FOR_NOISE = 1000
_ASIDE = 1e-3  # [-] of its way by which a wheel may seem to go aside


class Law(NamedTuple):
    """How well a law holds in a recording."""

    columns: tuple[str, ...]  # that it speaks of, beside the pose
    misfit: float  # [-] squares that are left, of those of both sides; 1: the sides have nothing in common
    noise: float  # [-] what noise alone leaves
    silent: bool  # the robot hardly moved in what the law speaks of

    @property
    def broken(self) -> bool:
        """What is left is neither noise nor small."""
        return not self.silent and self.misfit > max(_MORE * self.noise, _SMALL)


class Size(NamedTuple):
    """A number of the robot as the recording has it."""

    name: str  # trail_2, steering_zero_2, radius_2; "vx and vy", "yaw_rate": factors that poses show them to lack
    described: float
    shown: float
    deviation: float  # standard deviation of what is shown


class Laws(NamedTuple):
    """All laws, and the sizes that they were best fulfilled with."""

    laws: tuple[Law, ...]
    sizes: tuple[Size, ...]

    @property
    def cost(self) -> float:
        """Sum of the logarithms of misfits, as far down as noise lets them be, and of how far sizes are off.

        The latter tells units apart that differ by little more than a size may: degrees, and ways of wheels of 25 mm.
        """
        left = sum(0.0 if law.silent else math.log(max(law.misfit, law.noise, _INTEGRATION)) for law in self.laws)
        off = sum(abs(math.log(size.shown / size.described)) for size in self.sizes if size.described > 0.0)
        return left + off


def window_of(recording: Recording) -> int:
    """Samples from one end of a window to the other, over which wheels turn enough to be seen."""
    angles, longest = np.unwrap(recording.steering, axis=0), max(len(recording.pose) // _FEWEST, 1)
    width = min(_SHORTEST, longest)
    while 2 * width <= longest:
        ends = angles[::width]
        if float(np.sqrt((np.diff(ends, axis=0) ** 2).mean())) >= _TURNED:
            break
        width *= 2
    return width


def laws_of(recording: Recording, robot: Robot, width: int) -> Laws:
    """The laws of a recording, over windows of `width` samples."""
    parts = _Parts(recording, robot, width)
    laws, sizes = _steering(parts, robot)
    zeros = np.array([size.shown for size in sizes[1::2]])
    rolled, radii = _rolling(parts, robot, np.where(np.abs(zeros) < _WIDEST_ZERO, zeros, 0.0))
    carried, factors = _twist(parts)
    return Laws((*laws, *rolled, *carried, *_speed(parts, robot)), (*sizes, *radii, *factors))


class _Parts:
    """Windows of what the laws are made of. Arrays (W, N) unless said otherwise."""

    def __init__(self, recording: Recording, robot: Robot, width: int) -> None:
        self.recording, self.width = recording, width
        n = robot.caster_count
        heading = np.unwrap(recording.pose[:, 2])
        angles = np.unwrap(recording.steering, axis=0)
        direction = heading[:, None] + angles  # (K, N)
        c, s = np.cos(heading)[:, None], np.sin(heading)[:, None]
        x, y = (np.array([getattr(caster, axis) for caster in robot.casters]) for axis in ("x", "y"))
        self.reach = np.hypot(x, y)
        dx = np.diff(recording.pose[:, :1] + c * x - s * y, axis=0)  # (K − 1, N) of the steering axes
        dy = np.diff(recording.pose[:, 1:2] + s * x + c * y, axis=0)
        turns = np.diff(direction, axis=0)
        middle = direction[:-1] + 0.5 * turns
        chord = 1.0 / np.sinc(np.clip(turns, -3.0, 3.0) / (2.0 * np.pi))  # an arc, from its chord
        cos, sin = np.cos(middle) * chord, np.sin(middle) * chord
        self.turned = self.summed(turns)
        self.along = self.summed(cos * dx + sin * dy)
        self.across = self.summed(cos * dy - sin * dx)
        self.lengths = self.summed(dx**2 + dy**2)  # Σ |dP|²
        self.wiggles = self.summed(turns**2)
        self.heading = heading
        self.position_noise = white_noise(recording.pose[:, :2])
        self.heading_noise = white_noise(heading[:, None])
        steering_noise = np.array([white_noise(angles[:, i : i + 1]) for i in range(n)])
        self.direction_noise = steering_noise**2 + self.heading_noise**2
        self.pivot_noise = self.position_noise**2 + self.reach**2 * self.heading_noise**2
        # of ∫ f dP over each window, whatever f: its ends, and directions that are wrong in between
        self.path_noise = 2.0 * self.pivot_noise + self.direction_noise * self.lengths + self.pivot_noise * self.wiggles

    def summed(self, steps: Array) -> Array:
        """Sums (W, …) over windows of what happens from sample to sample (K − 1, …)."""
        count = len(steps) // self.width
        sums: Array = steps[: count * self.width].reshape(count, self.width, *steps.shape[1:]).sum(axis=1)
        return sums


def white_noise(signal: Array) -> float:
    """Standard deviation of white noise on signals (K, n), from the median of their fifth differences."""
    fifths = np.abs(np.diff(signal[:_ROWS_FOR_NOISE], 5, axis=0)) if len(signal) > 5 else np.zeros(1)
    return float(np.median(fifths) / (0.6745 * math.sqrt(252.0)))


def _law(columns: tuple[str, ...], left: Array, right: Array, noise: Array) -> Law:
    """Of both sides (W, …) of a law and the variance of their difference from noise."""
    size = float((left**2).sum() + (right**2).sum())
    share = float(noise.sum()) / max(size, 1e-300)
    misfit = float(((left - right) ** 2).sum()) / max(size, 1e-300)
    return Law(columns, min(misfit, 1.0), share, size <= 0.0 or share * _EVIDENCE > 1.0)


def _fitted(sides: Array, left: Array, start: Array, spread: Array, noise: Array) -> tuple[Array, Array]:
    """Coefficients (p,) and their covariance for left (W,) ≈ sides (W, p) @ coefficients.

    start (p,) ± spread (p,) is what is believed before; noise (W,) is the variance on the left.
    """
    weight = 1.0 / np.maximum(noise, 1e-300)
    information = (sides * weight[:, None]).T @ sides + np.diag(spread**-2.0)
    found = np.linalg.solve(information, (sides * weight[:, None]).T @ left + start / spread**2)
    rest = ((left - sides @ found) ** 2 * weight).sum() / max(len(left) - len(start), 1)
    return np.asarray(found, np.float64), np.asarray(np.linalg.inv(information) * max(float(rest), 1.0), np.float64)


def _steering(parts: _Parts, robot: Robot) -> tuple[list[Law], list[Size]]:
    """(R1): a law for each caster, and its trail and steering zero."""
    laws: list[Law] = []
    sizes: list[Size] = []
    for i, caster in enumerate(robot.casters):
        turned, across, along, d = parts.turned[:, i], parts.across[:, i], parts.along[:, i], caster.trail
        noise = parts.path_noise[:, i] + 2.0 * d**2 * parts.direction_noise[i]
        uneven = noise + _INTEGRATION * (across**2 + along**2 + (d * turned) ** 2)
        # turning on the left shows any zero, but noise of the way on the right makes trails too long
        both = np.stack([across, along], axis=1)
        rough, _ = _fitted(both, d * turned, np.array([1.0, 0.0]), np.full(2, _PRIOR), uneven)
        zero = math.atan2(rough[1], rough[0])
        sides = np.stack([turned, -along], axis=1)
        found, covariance = _fitted(sides, across, np.array([d, 0.0]), _PRIOR * np.array([d, 1.0]), uneven)
        if abs(zero) > _WIDEST_ZERO or not 1.0 / _WIDEST < found[0] / d < _WIDEST:
            found = np.array([d, 0.0])
        else:
            zero = math.atan(found[1])
        aside = (_ASIDE * along) ** 2  # where the robot goes straight, next to nothing is left of either side
        law = _law((f"steering_{i + 1}",), across + found[1] * along, found[0] * turned, noise + aside)
        known = not law.silent and law.misfit < _NOTHING_IN_COMMON
        laws.append(law)
        sizes.append(Size(f"trail_{i + 1}", d, found[0] * math.cos(zero) if known else d, math.sqrt(covariance[0, 0])))
        if not known and abs(zero) <= _WIDEST_ZERO:
            zero = 0.0
        sizes.append(Size(f"steering_zero_{i + 1}", 0.0, zero, math.sqrt(covariance[1, 1])))
    return laws, sizes


def _rolling(parts: _Parts, robot: Robot, zeros: Array) -> tuple[list[Law], list[Size]]:
    """(R2): a law for each caster, and its radius."""
    angles = parts.recording.rolling
    if angles is None:
        return [], []
    rolled, ways, laws, sizes = parts.summed(np.diff(angles, axis=0)), _ways(parts, robot, zeros), [], []
    for i, caster in enumerate(robot.casters):
        left, way, r = rolled[:, i], ways[:, i], caster.radius
        noise = parts.path_noise[:, i] + 2.0 * r**2 * white_noise(angles[:, i : i + 1]) ** 2
        law, radius, deviation = _scaled_law((f"rolling_{i + 1}",), way, left, r, noise)
        laws.append(law)
        sizes.append(Size(f"radius_{i + 1}", r, radius, deviation))
    return laws, sizes


def _ways(parts: _Parts, robot: Robot, zeros: Array) -> Array:
    """Ways (W, N) of the wheels along their rolling directions, in windows. [m]"""
    offsets = np.array([caster.offset for caster in robot.casters])
    return np.asarray(np.cos(zeros) * parts.along - np.sin(zeros) * parts.across - offsets * parts.turned, np.float64)


def rolling_ratios(recording: Recording, robot: Robot, width: int) -> dict[int, float]:
    """How many times larger, by caster (from 0), rolling angles are than the ways of wheels make them.

    Only of casters whose angles go with their ways, and by more than a radius may be off.
    """
    if recording.rolling is None:
        return {}
    parts = _Parts(recording, robot, width)
    ways, rolled = _ways(parts, robot, np.zeros(robot.caster_count)), parts.summed(np.diff(recording.rolling, axis=0))
    ratios: dict[int, float] = {}
    for i, caster in enumerate(robot.casters):
        way, angle = ways[:, i] / caster.radius, rolled[:, i]
        both, sizes = float(way @ angle), float((way @ way) * (angle @ angle))
        if both**2 > _ALIKE * sizes > 0.0:
            ratio = math.copysign(math.sqrt(float(angle @ angle) / float(way @ way)), both)
            if not 1.0 / _WIDEST < abs(ratio) < _WIDEST:
                ratios[i] = ratio
    return ratios


def _scaled_law(
    columns: tuple[str, ...], left: Array, right: Array, scale: float, noise: Array
) -> tuple[Law, float, float]:
    """left ≈ scale · right, with the scale as it shows, as long as that can be believed, and its standard deviation."""
    uneven = noise + _INTEGRATION * (left**2 + (scale * right) ** 2)
    found, covariance = _fitted(right[:, None], left, np.array([scale]), np.array([_PRIOR * scale]), uneven)
    shown = float(found[0]) if 1.0 / _WIDEST < found[0] / scale < _WIDEST else scale
    law = _law(columns, left, shown * right, noise)
    known = not law.silent and law.misfit < _NOTHING_IN_COMMON
    return law, shown if known else scale, math.sqrt(covariance[0, 0])


def _twist(parts: _Parts) -> tuple[list[Law], list[Size]]:
    """(R3), and by how much twists are too small."""
    recording = parts.recording
    if recording.twist is None:
        return [], []
    dt, c, s = recording.time_step, np.cos(parts.heading), np.sin(parts.heading)
    vx, vy, omega = recording.twist.T
    world = np.stack([c * vx - s * vy, s * vx + c * vy], axis=1)
    moved = parts.summed(np.diff(recording.pose[:, :2], axis=0))
    carried = parts.summed(0.5 * dt * (world[1:] + world[:-1]))
    turned = parts.summed(np.diff(parts.heading))
    spun = parts.summed(0.5 * dt * (omega[1:] + omega[:-1]))
    samples, heading = parts.width * dt**2, parts.heading_noise
    speeds = white_noise(recording.twist[:, :2])
    noise = 2.0 * parts.position_noise**2 + samples * speeds**2 + heading**2 * (moved**2).sum(axis=1)
    yaw_noise = np.full(len(spun), 2.0 * heading**2 + samples * white_noise(omega[:, None]) ** 2)
    moving, speed, speed_deviation = _scaled_law(("vx", "vy"), moved.ravel(), carried.ravel(), 1.0, np.repeat(noise, 2))
    turning, rate, rate_deviation = _scaled_law(("yaw_rate",), turned, spun, 1.0, yaw_noise)
    return [moving, turning], [
        Size("vx and vy", 1.0, speed, speed_deviation),
        Size("yaw_rate", 1.0, rate, rate_deviation),
    ]


def _speed(parts: _Parts, robot: Robot) -> list[Law]:
    """The wheels' speed must be one that motors reach."""
    seconds = parts.width * parts.recording.time_step
    speed = float(np.quantile(np.hypot(parts.along, parts.across), 0.9)) / seconds
    fast = speed > _TOO_FAST * robot.top_speed
    return [Law(("time",), 1.0 if fast else 0.0, 0.0, not fast)]
