"""Trajectories: tables of the platform's motion, sampled at a constant time step.

Points and vectors of the plane are complex numbers x + i y throughout this package.
"""

from dataclasses import dataclass

import numpy as np

from caster_gym.arrays import Array, Plane

COLUMNS = ("x", "y", "cos", "sin", "vx", "vy", "omega", "ax", "ay", "alpha")
MOST_TURN = 1.0  # [rad] of the heading in one time step
LEAST_STEPS = 10  # fewer samples do not show a motion that starts and ends at rest
MOST_STEPS = 400_000  # more than two hours at 20 ms; making the table then takes 200 MB


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A timed trajectory of C, in the world frame.

    samples (K + 1, 10), read-only, with columns COLUMNS: position [m], heading as a unit vector, velocity [m/s] and
    yaw rate [rad/s], acceleration [m/s²] and yaw acceleration [rad/s²], at the times 0, time_step, … K · time_step.

    >>> import caster_gym, numpy as np
    >>> t = np.arange(101) * 0.02  # [s]
    >>> no, one = np.zeros(101), np.ones(101)
    >>> columns = [0.1 * t**2, no, one, no, 0.2 * t, no, no, 0.2 * one, no, no]  # along x at 0.2 m/s²
    >>> trajectory = caster_gym.Trajectory("straight", time_step=0.02, samples=np.stack(columns, axis=1))
    >>> trajectory.duration
    2.0
    """

    name: str
    time_step: float  # [s]
    samples: Array
    description: str = ""  # what was made of the path, as far as that does not stand in it

    def __post_init__(self) -> None:
        samples = np.array(self.samples, dtype=np.float64)
        if samples.ndim != 2 or samples.shape[1] != len(COLUMNS) or len(samples) < 2:
            raise ValueError(f"samples of path {self.name!r} must have shape (K + 1, 10), got {samples.shape}")
        if not np.isfinite(samples).all():
            row, column = np.argwhere(~np.isfinite(samples))[0]
            raise ValueError(f"{COLUMNS[column]} of path {self.name!r} is {samples[row, column]} in sample {row}")
        check_time_step(self.time_step)
        heading = samples[:, 2] + 1j * samples[:, 3]
        turn = np.abs(np.angle(heading[1:] / heading[:-1]))
        if turn.max() > MOST_TURN:
            raise ValueError(
                f"the heading of path {self.name!r} turns by {turn.max():.2g} rad in the time step after "
                f"{turn.argmax() * self.time_step:.3g} s, more than {MOST_TURN:g} rad"
            )
        samples.flags.writeable = False
        object.__setattr__(self, "samples", samples)

    @property
    def duration(self) -> float:
        """Time from the first sample to the last. [s]"""
        return (len(self.samples) - 1) * self.time_step


def rounded_down(value: float, digits: int = 2) -> float:
    """A positive value to so many digits, as advice: not above the value."""
    digit = 10.0 ** (np.floor(np.log10(value)) + 1.0 - digits)
    whole = np.floor(value / digit * (1.0 + 1e-12))  # 0.3 / 0.1 is a little less than 3
    return float(f"{whole * digit:.12g}")


def rounded_up(value: float, digits: int = 3) -> float:
    """A positive value to so many digits, as advice: not below the value."""
    digit = 10.0 ** (np.floor(np.log10(value)) + 1.0 - digits)
    whole = np.ceil(value / digit * (1.0 - 1e-12))
    return float(f"{whole * digit:.12g}")


def check_time_step(time_step: float) -> None:
    """Refuse a time step [s] that is not a positive number."""
    if not (np.isfinite(time_step) and time_step > 0.0):
        raise ValueError(f"the time step of a path must be positive, got {time_step:g} s")


def whole_steps(duration: float, time_step: float) -> int:
    """Number of time steps nearest to a duration [s]."""
    check_time_step(time_step)
    if duration > MOST_STEPS * time_step:
        raise ValueError(
            f"a duration of {duration:g} s is more than {MOST_STEPS} time steps of {time_step:g} s; "
            f"at most {rounded_down(MOST_STEPS * time_step, 6):g} s would suffice"
        )
    steps = round(duration / time_step)
    if steps < LEAST_STEPS:
        raise ValueError(
            f"a duration of {duration:g} s is {steps} time steps of {time_step:g} s; "
            f"a path needs at least {LEAST_STEPS}, that is {LEAST_STEPS * time_step:g} s"
        )
    return steps


def rest_to_rest(steps: int, time_step: float) -> tuple[Array, Array, Array]:
    """Progress from 0 to 1 at each sample, its rate [1/s] and its acceleration [1/s²]: the quintic of chung2008 (61).

    Rate and acceleration are zero at both ends.
    """
    return rest_to_rest_at(np.arange(steps + 1) / steps, steps * time_step)


def rest_to_rest_at(tau: Array, duration: float) -> tuple[Array, Array, Array]:
    """The same at shares 0 … 1 of a duration [s]."""
    progress = tau**3 * (10.0 - 15.0 * tau + 6.0 * tau**2)
    rate = 30.0 * tau**2 * (1.0 - tau) ** 2 / duration
    acceleration = 60.0 * tau * (1.0 - tau) * (1.0 - 2.0 * tau) / duration**2
    return progress, rate, acceleration


def tabulate(motion: tuple[Plane, Plane, Plane], turning: tuple[Plane, Array, Array]) -> Array:
    """Samples (..., 10) of position, velocity, acceleration, and of heading (unit), yaw rate, yaw acceleration."""
    (p, v, a), (heading, omega, alpha) = motion, turning
    parts = (p.real, p.imag, heading.real, heading.imag, v.real, v.imag, omega, a.real, a.imag, alpha)
    return np.stack(np.broadcast_arrays(*parts), axis=-1)


def unit(direction: Plane) -> Plane:
    """Directions of length 1."""
    return np.asarray(direction / np.abs(direction), dtype=np.complex128)


def place(
    motion: tuple[Plane, Plane, Plane], heading: Plane, centre: tuple[float, float], rotation: float
) -> tuple[tuple[Plane, Plane, Plane], Plane]:
    """Motion and heading turned about the origin by `rotation` [rad], then moved by `centre` [m]."""
    turn = np.exp(1j * rotation)
    p, v, a = motion
    return (complex(*centre) + turn * p, turn * v, turn * a), turn * heading
