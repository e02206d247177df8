"""Trajectories with given times: recorded, planned by other programs, or typed as poses with times."""

from collections.abc import Iterator
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, Self

import numpy as np
from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.arrays import Array
from caster_gym.configuration import Frozen, Positive
from caster_gym.paths.angles import AngleUnit, Rotation, ZeroAxis, plain_lists, read_angles, unwrapped
from caster_gym.paths.in_between import motion_between, room_for
from caster_gym.paths.points import check_long
from caster_gym.paths.splines import Spline
from caster_gym.paths.trajectory import (
    LEAST_STEPS,
    MOST_STEPS,
    Trajectory,
    check_time_step,
    place,
    rounded_up,
    tabulate,
)

TimedPose = tuple[float, float, float] | tuple[float, float, float, float]
Rates = tuple[float, float, float, float, float, float]

_APART = 8.0  # [-] of the noise: what is left of it in smoothed poses does not make a way
_SLOW = 0.05  # [-] of the greatest speed, below which the direction of motion is not told by it


class Timed(Frozen):
    """Poses at times of their own, and a smooth motion through them.

    Many poses are taken for a record: their rounding and noise are smoothed away. Few are passed exactly, with a rest
    at both ends and wherever two poses in succession are the same.
    """

    longest_list: ClassVar[int] = MOST_STEPS + 1
    shape: Literal["timed"] = "timed"
    # (time, x, y) [s, m, m] or (time, x, y, heading) [s, m, m, rad or `unit`], in ascending order
    poses: Annotated[tuple[TimedPose, ...], Field(min_length=2)]
    file: Annotated[str | None, Field(exclude=True)] = None  # that holds them, see docs/files.md; read at once
    unit: AngleUnit | None = None  # of the headings
    zero_axis: Annotated[ZeroAxis | None, Field(exclude=True)] = None  # from which the file counts headings
    # vx, vy, omega, ax, ay, alpha in W [m/s, rad/s, m/s², rad/s²] at each pose; None: from a spline
    rates: tuple[Rates, ...] | None = None
    tolerance: NonNegativeFloat | None = None  # [m] root mean square by which the motion may miss; None: as they need
    ends: Literal["rest", "free"] | None = None  # at both ends; None: at rest for less than 20 poses
    stretch: Positive = 1.0  # [-] times are multiplied by this
    centre: tuple[float, float] = (0.0, 0.0)  # [m] where the origin of the poses lies, in the world
    rotation: Rotation = 0.0  # [rad] of all of them about that point, headings included

    @model_validator(mode="before")
    @classmethod
    def _read(cls, content: Any) -> Any:
        if not isinstance(content, dict):
            return content
        if content.get("file") is not None:
            if "poses" in content:
                raise ValueError("give either 'poses' or a 'file' of them, not both")
            from caster_gym.paths.files import read_poses  # late: most paths have no file

            found = read_poses(Path(str(content["file"])), content.get("unit"), content.get("zero_axis"))
            rest = {key: value for key, value in content.items() if key != "unit"}
            return {**rest, **found, "file": str(content["file"])}
        poses = plain_lists(content.get("poses"))
        check_long(poses, "pose", (3, 4))
        check_long(content.get("rates"), "rates of pose", (6,))
        if not isinstance(poses, list) or not all(isinstance(pose, list) and len(pose) == 4 for pose in poses):
            return {**content, "poses": poses} if poses is not None else content
        angles, unit = read_angles([pose[3] for pose in poses], content.get("unit"), "a heading")
        turned = [[*pose[:3], angle] for pose, angle in zip(poses, angles, strict=True)]
        return {**{key: value for key, value in content.items() if key != "unit"}, "poses": turned, **unit}

    @model_validator(mode="after")
    def _poses_make_a_motion(self) -> Self:
        if len({len(pose) for pose in self.poses}) > 1:
            raise ValueError("either every pose has a heading or none has")
        if self.rates is not None and (len(self.rates) != len(self.poses) or not self._has_headings):
            raise ValueError(f"rates need a pose with a heading each, got {len(self.rates)} for {len(self.poses)}")
        times = self._times
        if (np.diff(times) <= 0.0).any():
            k = int((np.diff(times) <= 0.0).argmax()) + 1
            raise ValueError(
                f"times must grow from pose to pose, got {self.poses[k][0]:g} s after {self.poses[k - 1][0]:g} s "
                f"in pose {k + 1}"
            )
        return self

    @property
    def _has_headings(self) -> bool:
        return len(self.poses[0]) == 4

    @property
    def _times(self) -> Array:
        """Times of the poses since the first. [s]"""
        times = np.array([pose[0] for pose in self.poses])
        return np.asarray(times - times[0], dtype=np.float64)

    @property
    def duration(self) -> float:
        """Time from the first pose to the last. [s]"""
        return float(self._times[-1]) * self.stretch

    def trajectories(self, time_step: float) -> tuple[Trajectory, ...]:
        """The one trajectory, at the times of the poses, and at the last whole time step before the last of them."""
        check_time_step(time_step)
        steps = int(min(np.floor(self.duration / time_step + 1e-6), MOST_STEPS + 1))
        if steps > MOST_STEPS:
            raise ValueError(f"{self.duration:g} s are more than {MOST_STEPS} time steps of {time_step:g} s")
        if steps < LEAST_STEPS:
            raise ValueError(
                f"{self.duration:g} s are {steps} time steps of {time_step:g} s; a path needs at least {LEAST_STEPS}, "
                f"that is a stretch of {rounded_up(LEAST_STEPS * time_step / float(self._times[-1])):g}"
            )
        moving = self._motion(np.minimum(np.arange(steps + 1) * time_step / self.stretch, self._times[-1]))
        value, first, second = (part / self.stretch**order for order, part in enumerate(moving))
        motion = (value[:, 0] + 1j * value[:, 1], first[:, 0] + 1j * first[:, 1], second[:, 0] + 1j * second[:, 1])
        motion, heading = place(motion, np.exp(1j * value[:, 2]), self.centre, self.rotation)
        table = tabulate(motion, (heading, first[:, 2], second[:, 2]))
        return (Trajectory(self.shape, time_step, table, self.description),)

    def _motion(self, times: Array) -> Array:
        """x, y, heading and their first two derivatives (3, T, 3), before stretching."""
        at, table = self._times, np.asarray(self.poses)[:, 1:]
        if self.rates is not None:
            return _hermite(at, table, np.asarray(self.rates), times)
        place_noise, turn_noise = self._noise
        way = self._through(at, table[:, :2], place_noise, times)
        if self._has_headings:
            turn = self._through(at, unwrapped(table[:, 2])[:, None], turn_noise, times)
        else:
            turn = self._along(at, table, place_noise, times)
        return np.concatenate([way, turn], axis=2)

    @property
    def _noise(self) -> tuple[float, float]:
        """Standard deviations of the errors of positions [m] and headings [rad] that are smoothed away."""
        from caster_gym.paths.timed_motion import noise_of  # SciPy takes a while to import

        at, table = self._times, np.asarray(self.poses)[:, 1:]
        if self.tolerance == 0.0:
            return 0.0, 0.0
        turn = noise_of(at, unwrapped(table[:, 2])[:, None]) if self._has_headings else 0.0
        return noise_of(at, table[:, :2]) if self.tolerance is None else self.tolerance, turn

    def _through(self, at: Array, values: Array, noise: float, times: Array) -> Array:
        from caster_gym.paths.timed_motion import DENSE, motion_through, smooth_motion

        if noise > 0.0 and len(at) >= DENSE:
            return smooth_motion(at, values, noise, times)
        rests = len(at) < DENSE if self.ends is None else self.ends == "rest"
        return motion_through(at, values, rests, times)

    def _along(self, at: Array, table: Array, noise: float, times: Array) -> Array:
        """Headings in the direction of motion; where that is slow, they turn evenly from the one before to the next."""
        between = np.linspace(0.0, at[-1], 4 * len(at) + 1)
        velocity = self._through(at, table[:, :2], noise, between)[1] @ np.array([1.0, 1j])
        clear = np.abs(velocity) > _SLOW * np.abs(velocity).max()
        if not clear.any():
            return np.zeros((3, len(times), 1))
        from caster_gym.paths.timed_motion import smooth_motion

        angle = np.interp(between, between[clear], np.unwrap(np.angle(velocity[clear])))
        return smooth_motion(between, angle[:, None], 1e-3, times)

    @property
    def description(self) -> str:
        """What was made of the poses."""
        told = [f"timed path of {len(self.poses)} poses in {self.duration:.4g} s"]
        place_noise, turn_noise = (0.0, 0.0) if self.rates is not None else self._noise
        if place_noise > 0.0:
            why = "as their rounding and noise are" if self.tolerance is None else "as its tolerance allows"
            told.append(f"smoothed, at {place_noise:.2g} m from them (root mean square), {why}")
        if turn_noise > 0.0:
            told.append(f"headings smoothed, at {turn_noise:.2g} rad from those given (root mean square)")
        return "; ".join(told)

    def geometry(self) -> Spline:
        """The way through the poses, whatever their times are: rests and repeated poses say nothing."""
        table = np.asarray(self.poses)[:, 1:]
        if self._has_headings:
            table[:, 2] = unwrapped(table[:, 2])
        place_noise, turn_noise = self._noise
        fields: dict[str, Any] = {"centre": self.centre, "rotation": self.rotation}
        if place_noise > 0.0:
            smooth = self._motion(self._times)[0]
            table = smooth[_apart(smooth[:, :2], _APART * place_noise), : table.shape[1]]
            fields["tolerance"] = 2.0**0.5 * place_noise  # of the distance, from that of each coordinate
        if self._has_headings:
            fields.update(unit="rad", turns="as_written", heading_tolerance=turn_noise or None)
        return Spline(waypoints=table.tolist(), **fields)

    def with_fixed_heading(self) -> Self | None:
        """The same way without a turn; None where headings are given."""
        if self._has_headings:
            return None
        return self.model_copy(update={"poses": tuple((*pose[:3], 0.0) for pose in self.poses)})

    def widen(self) -> Iterator[tuple[Self, str]]:
        """None: poses are where they are."""
        yield from ()

    def ease(self, factor: float) -> Self:
        """The same poses, later by a factor above 1; the stretch keeps three digits, rounded up."""
        return self.model_copy(update={"stretch": rounded_up(self.stretch * factor)})

    @property
    def remedy(self) -> str:
        """The stretch of this path, as advice."""
        return f"a stretch of at least {self.stretch:g}"


def timed_path(trajectory: Trajectory) -> Timed:
    """The path that gives a trajectory again, sample by sample, and a smooth motion between its samples."""
    t = trajectory.samples
    heading = np.unwrap(np.arctan2(t[:, 3], t[:, 2]))
    times = trajectory.time_step * np.arange(len(t))
    poses = np.column_stack([times, t[:, 0], t[:, 1], heading])
    return Timed.model_validate({"poses": poses.tolist(), "rates": t[:, 4:].tolist(), "unit": "rad"})


def _apart(points: Array, least: float) -> list[int]:
    """Points (K, 2) that are so far [m] from the one taken before, without those that waver around a place."""
    taken = [0]
    for k, point in enumerate(points):
        if np.hypot(*(point - points[taken[-1]])) >= least:
            taken.append(k)
    return taken


def _hermite(at: Array, values: Array, rates: Array, times: Array) -> Array:
    """Quintics between poses with given velocities and accelerations (K, 6): value and two derivatives (3, T, 3)."""
    k = np.clip(np.searchsorted(at, times + 1e-9 * at[-1], side="right") - 1, 0, len(at) - 2)
    h, share = at[k + 1] - at[k], np.clip((times - at[k]) / (at[k + 1] - at[k]), 0.0, 1.0)
    start, end = ((values[i], rates[i, :3], rates[i, 3:]) for i in (k, k + 1))
    return np.stack(motion_between(start, end, h[:, None], share[:, None], _room(at, rates[:, 3:])[k]))


def _room(at: Array, acceleration: Array) -> Array:
    """What accelerations (K, M) may do between poses (K - 1, M), beside going straight from one to the next."""
    h = np.diff(at)[:, None]
    if len(h) < 2:
        return np.full_like(acceleration[1:], np.inf)
    bent = 2.0 * np.diff(np.diff(acceleration, axis=0) / h, axis=0) / (h[1:] + h[:-1])
    first, last = np.concatenate([bent[:1], bent]), np.concatenate([bent, bent[-1:]])
    return room_for(h**2 * first, h**2 * last)
