"""Paths without times: their geometry, and how fast the robot's motors can drive them."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from caster_gym.arrays import Array, Plane
from caster_gym.paths.advice import timed_remedy
from caster_gym.paths.arc_length import LINE_COLUMNS, CoarseSpacingError, Line, NoLineError, between, line_along
from caster_gym.paths.specification import AnyPath, PathLike, distinct_names, read_paths
from caster_gym.paths.splines import Spline
from caster_gym.paths.time_law import fastest_laws, row_times
from caster_gym.paths.timed import Timed
from caster_gym.paths.trajectory import MOST_STEPS, Trajectory, check_time_step, tabulate
from caster_gym.robot import Robot

COURSE_COLUMNS = (*LINE_COLUMNS, "square_speed")

SPACING = 0.02  # [m] of rows, where the path allows it
FINEST_SPACING = 0.001  # [m] finer rows would be many; no robot drives an arc of 2 mm
_TRIES = 3  # of spacings, each of which suits the samples of the one before
_TIMED_STEP = 0.02  # [s] at which a path is tried as a trajectory: the period of the environments
_MOST_FIRST_SAMPLES = 4_000  # a heading that still jumps turns on the spot
_MOST_TRIED_SAMPLES = 100_000  # of a path that advice tries: about 500 m at 2 cm, 25 m at 1 mm
_FEWEST_SAMPLES = 1000  # of a path's own trajectory, from which its line is made
_STEP = 0.5  # [-] of the spacing: greatest way between them; a cubic of 1 cm errs by 0.01 µm at a radius of 15 cm


@dataclass(frozen=True, eq=False)
class Course:
    """A path of C in the world frame by its arc length, and the law at which it is driven from rest to rest.

    samples (K + 1, 10), read-only, with columns COURSE_COLUMNS: point [m], unit tangent, curvature, positive to the
    left [1/m], heading as a unit vector, its slope dψ/ds [rad/m] and d²ψ/ds² [rad/m²], and ṡ² of the law [m²/s²], at
    the arc lengths 0, spacing, … K · spacing. Between rows ṡ² is linear (s̈ is constant), the point follows the cubic
    with the tangents of both rows, and the rest is linear, directions made unit again.
    """

    name: str
    spacing: float  # [m]
    samples: Array
    description: str = ""  # what was made of the path, as far as that does not stand in it

    def __post_init__(self) -> None:
        samples = np.array(self.samples, dtype=np.float64)
        if samples.ndim != 2 or samples.shape[1] != len(COURSE_COLUMNS) or len(samples) < 2:
            raise ValueError(f"samples of course {self.name!r} must have shape (K + 1, 10), got {samples.shape}")
        if not np.isfinite(samples).all():
            row, column = np.argwhere(~np.isfinite(samples))[0]
            raise ValueError(f"{COURSE_COLUMNS[column]} of course {self.name!r} is {samples[row, column]} in row {row}")
        _check_positive("spacing", self.spacing, "m")
        samples.flags.writeable = False
        object.__setattr__(self, "samples", samples)

    @property
    def length(self) -> float:
        """Arc length from the first row to the last. [m]"""
        return (len(self.samples) - 1) * self.spacing

    @property
    def duration(self) -> float:
        """Time that the law takes from rest to rest. [s]"""
        return float(row_times(self.samples[:, -1], self.spacing)[-1])

    def trajectory(self, time_step: float) -> Trajectory:
        """The course driven at its law, sampled at a constant time step [s]; the last sample rests at the end."""
        check_time_step(time_step)
        times, square = row_times(self.samples[:, -1], self.spacing), self.samples[:, -1]
        steps = int(np.ceil(times[-1] / time_step - 1e-9))
        if steps > MOST_STEPS:
            raise ValueError(
                f"course {self.name!r} takes {times[-1]:.3g} s, over {MOST_STEPS} steps of {time_step:g} s"
            )
        t = np.minimum(np.arange(steps + 1) * time_step, times[-1])
        first = np.clip(np.searchsorted(times, t, side="right") - 1, 0, len(times) - 2)
        since, speed = t - times[first], np.sqrt(square[first])
        acceleration = (square[first + 1] - square[first]) / (2.0 * self.spacing)
        way = (speed + 0.5 * acceleration * since) * since
        rows = between(self.samples[:, :-1], self.spacing, np.clip(way / self.spacing, 0.0, 1.0), first)
        rate, growth = speed + acceleration * since, acceleration
        rate[-1] = growth[-1] = 0.0
        point, tangent, heading = (rows[:, i] + 1j * rows[:, i + 1] for i in (0, 2, 5))
        curvature, bend, bend_slope = rows[:, 4], rows[:, 7], rows[:, 8]
        motion = point, rate * tangent, (growth + 1j * rate**2 * curvature) * tangent
        turning: tuple[Plane, Array, Array] = heading, bend * rate, bend * growth + bend_slope * rate**2
        return Trajectory(self.name, time_step, tabulate(motion, turning))


def build_courses(
    path: PathLike,
    robot: Robot,
    speed_limit: float,
    free_heading: bool = False,
    spacing: float | None = None,
    margin: float = 0.8,
) -> tuple[Course, ...]:
    """The courses of all paths; how long the paths themselves take does not matter.

    speed_limit [m/s] of C along the path. free_heading: the heading stays what it is at the start. spacing [m] between
    rows, changed a little so that it divides each length; None: 2 cm, or finer, down to 1 mm, for a path that turns
    too sharply or is too short for that. margin: share of the motors' torque and speed that the law may use.

    Raises ValueError for a path that stands still, stops or turns back on its way, turns too sharply for the spacing,
    or along which the robot cannot move; the message says where, and what would suffice instead.
    """
    _check_positive("speed_limit", speed_limit, "m/s")
    if spacing is not None:
        _check_positive("spacing", spacing, "m")
    if not 0.0 < margin <= 1.0:
        raise ValueError(f"margin must be above 0 and at most 1, got {margin:g}")
    lines: list[Line] = []
    for specification in read_paths(path):
        way = specification.geometry() if isinstance(specification, Timed) else specification
        made = _lines(way, robot, spacing, free_heading, specification)
        lines.extend(line if way is specification else line._replace(name=specification.shape) for line in made)
    names = distinct_names([line.name for line in lines])
    lines = [line._replace(name=name) for line, name in zip(lines, names, strict=True)]
    laws = fastest_laws(lines, robot, speed_limit, margin)
    return tuple(
        Course(line.name, line.spacing, np.column_stack([line.rows, law]), line.description)
        for line, law in zip(lines, laws, strict=True)
    )


def _lines(
    specification: AnyPath, robot: Robot, spacing: float | None, free_heading: bool, source: AnyPath
) -> list[Line]:
    """The lines of one specification; ValueError says what would make one that there is none of.

    source: the path that is written, of whose poses the specification may be the way.
    """
    try:
        return _lines_as_they_are(specification, spacing, free_heading)
    except _RefusedError as error:
        coarse = isinstance(error.reason, CoarseSpacingError)
        if coarse and spacing is not None:
            raise ValueError(str(error)) from error
        remedies = [] if free_heading or not _makes_lines(specification, True) else ["a free heading"]
        wider = next((words for one, words in _wider(specification, source) if _makes_lines(one, free_heading)), None)
        remedies += [wider] if wider else []
        advice = f"; {' or '.join(remedies)} would suffice" if remedies else ""
        timed = timed_remedy(source, robot, _TIMED_STEP)
        if timed is not None:
            by = "at its own times" if isinstance(source, Timed) else "in the time of its 'duration'"
            how = f"with {timed}" if timed else f"as it is, {by}"
            advice += f"; CasterTrack drives it {how}"
        what = str(error).replace(repr(specification.shape), repr(source.shape))
        raise ValueError(f"{what}{advice}") from error


def _wider(specification: AnyPath, source: AnyPath) -> Iterator[tuple[AnyPath, str]]:
    """Wider versions of a specification, as its source would give them."""
    for one, words in specification.widen():
        if isinstance(source, Timed) and isinstance(one, Spline):
            yield source.model_copy(update={"tolerance": one.tolerance}).geometry(), words
        else:
            yield one, words


class _RefusedError(ValueError):
    """Why a path makes no course."""

    def __init__(self, name: str, reason: ValueError, free_of_spacing: bool) -> None:
        what = reason.what if free_of_spacing and isinstance(reason, CoarseSpacingError) else str(reason)
        super().__init__(f"path {name!r} makes no course: {what}")
        self.reason = reason


def _makes_lines(specification: AnyPath, free_heading: bool) -> bool:
    try:
        return bool(_lines_as_they_are(specification, None, free_heading, _MOST_TRIED_SAMPLES))
    except ValueError:
        return False


def _lines_as_they_are(
    specification: AnyPath, spacing: float | None, free_heading: bool, most: int = MOST_STEPS
) -> list[Line]:
    """The lines of one specification, from trajectories of at most so many samples; spacing None: one that does."""
    if free_heading and isinstance(specification, Spline):
        specification = specification.without_headings()
    coarse = SPACING if spacing is None else spacing
    lines: list[Line] = []
    name: str = specification.shape
    try:
        trajectories = _sampled(specification, coarse, most)
        for k, trajectory in enumerate(trajectories):
            name = trajectory.name
            tried = coarse
            for _ in range(_TRIES):
                try:
                    fine = trajectory if tried == coarse else _sampled(specification, tried, most)[k]
                    lines.append(line_along(fine, tried, free_heading))
                    break
                except CoarseSpacingError as error:
                    if spacing is not None or tried == FINEST_SPACING or len(fine.samples) > most:
                        raise
                    tried = max(error.spacing, FINEST_SPACING)
            else:
                raise NoLineError(f"it turns more sharply than rows of {FINEST_SPACING:g} m show")
    except ValueError as error:
        raise _RefusedError(name, error, spacing is None) from error
    return lines


def _sampled(specification: AnyPath, spacing: float, most: int) -> tuple[Trajectory, ...]:
    """Trajectories of a specification whose samples lie nearer to each other than rows of a line.

    A path that is too long for that has as many as a trajectory may have; one that needs more than a smaller number is
    refused.
    """
    samples = _FEWEST_SAMPLES
    while True:
        try:
            trajectories = specification.trajectories(specification.duration / samples)
            break
        except ValueError:  # perhaps its heading turns too much within a sample
            if samples >= _MOST_FIRST_SAMPLES:
                raise
            samples *= 4
    ways = max(float(np.hypot(*t.samples[:, 4:6].T).max()) * t.time_step for t in trajectories)
    if ways > _STEP * spacing:
        samples = min(int(np.ceil(samples * ways / (_STEP * spacing))), MOST_STEPS)
        if samples > most:
            raise NoLineError(f"it needs more than {most} samples")
        trajectories = specification.trajectories(specification.duration / samples)
    return trajectories


def _check_positive(name: str, value: float, unit: str) -> None:
    if not (np.isfinite(value) and value > 0.0):
        raise ValueError(f"{name} must be positive, got {value:g} {unit}")
