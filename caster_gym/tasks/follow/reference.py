"""Paths walked at the robot's own pace: the reference source of the following task."""

from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.native.layout import write_point, write_reference
from caster_gym.envs.plan import SPAN, PlaceName, Plan, Span, joined
from caster_gym.envs.rows import check_names
from caster_gym.envs.tracking import Reference, point_of
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import entries, minimum
from caster_gym.paths.specification import AnyPath
from caster_gym.paths.time_law import row_times
from caster_gym.robot import Robot
from caster_gym.tasks.follow.course import (
    ROW,
    Row,
    at_rest,
    chord_share,
    course_reference,
    nearest_share,
    progress_share,
)
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.task import Way

if TYPE_CHECKING:
    import torch

    from caster_gym.tasks.follow.tensor import TorchCourses


_POINT = ROW.x, ROW.y


class Courses(NamedTuple):
    """Paths in space, with a time law."""

    samples: Any  # float64 (rows of all courses, 10) as in `Row`
    spans: Any  # int64 (paths, 3) as in `caster_gym.envs.plan.Span`
    spacings: Any  # float64 (paths,) [m] between rows
    horizons: Any  # float64 (previewed points,) [m] ahead
    window: Any  # [m] how far ahead the nearest point is sought
    stride: Any  # [m] progress that counts in full, per control period
    arrival: Any  # [m] before its end, a path counts as done
    arrival_scale: Any  # [m] distance from the end that halves what staying there is worth
    free_heading: Any  # 1 if the heading is free, else 0
    weights: Any = np.zeros(0)  # float64 (weights,), as in FollowWeights

    @property
    def place(self) -> PlaceName:
        """Of starts."""
        return "progress"

    def still(self) -> Self:
        """The same under which progress stays: nothing is sought."""
        return self._replace(window=0.0)

    def on_tensors(self, dtype: "torch.dtype", device: "torch.device") -> "TorchCourses":
        """The same for a batch of tensors."""
        from caster_gym.tasks.follow.tensor import TorchCourses  # late: most do without Torch

        return TorchCourses(self, dtype, device)


def lay_out(robot: Robot, paths: tuple[AnyPath, ...], parameters: FollowParameters) -> tuple[Courses, list[Way]]:
    """The courses of all paths, with their time laws."""
    from caster_gym.paths.course import COURSE_COLUMNS, build_courses  # late: only those who follow need it

    check_names(Row._fields, "the fields of Row", COURSE_COLUMNS, "the columns of a Course")
    courses = build_courses(paths, robot, parameters.speed_limit, parameters.free_heading, margin=parameters.margin)
    samples, rows = joined([course.samples for course in courses])
    first, last = rows.T
    periods = np.ceil([parameters.allowance * course.duration / parameters.control_period for course in courses])
    source = Courses(
        samples,
        np.stack(Span(first, last, periods.astype(np.int64)), axis=1),
        np.array([course.spacing for course in courses]),
        np.array(parameters.preview),
        parameters.window,
        parameters.stride,
        parameters.arrival,
        parameters.arrival_scale,
        float(parameters.free_heading),
    )
    return source, [
        Way(
            course.name,
            course.samples,
            course.samples[:, [ROW.x, ROW.y, ROW.cos, ROW.sin]],
            lambda k, spacing=course.spacing: f"after {k * spacing:.2f} m",  # type: ignore[misc]
            course.description,
        )
        for course in courses
    ]


def facts(plan: Plan) -> dict[str, NDArray[np.float64]]:
    """Of each path (paths,): goal, the progress with which it is done [m], and law, the time that its law takes [s]."""
    source = plan.source
    lengths = (source.spans[:, SPAN.last] - source.spans[:, SPAN.first]) * source.spacings
    squares = [table[:, ROW.square_speed] for table in plan.tables]
    laws = [row_times(one, spacing)[-1] for one, spacing in zip(squares, source.spacings, strict=True)]
    return {"goal": lengths - source.arrival, "law": np.array(laws)}


def _row(samples: Any, i: Any) -> Row:
    return Row(*entries(samples, i, ROW))


def _nearest(position: Any, path: Any, before: Any, source: Courses) -> float:
    """Arc length of the point nearest to the robot, from `before` to a window ahead. [m]"""
    x, y = position
    span, spacing = Span(*entries(source.spans, path, SPAN)), source.spacings[path]
    base, last = span.first, span.last
    first = min(base + int(before / spacing), last - 1)
    end = min(first + int(source.window / spacing) + 2, last)
    best, chosen, guess = 1e300, first, 0.0
    for i in range(first, end):
        a, b = entries(source.samples, i, _POINT), entries(source.samples, i + 1, _POINT)
        share, distance = chord_share(a, b, x, y)
        if distance < best:
            best, chosen, guess = distance, i, share
    share = nearest_share(_row(source.samples, chosen), _row(source.samples, chosen + 1), guess, spacing, x, y)
    if share >= 1.0 and chosen + 1 < end:  # beside the row itself chords on the outer side of a bend are equally near
        chosen += 1
        share = nearest_share(_row(source.samples, chosen), _row(source.samples, chosen + 1), 0.0, spacing, x, y)
    reached = min((chosen - base + share) * spacing, before + source.window)
    return float(max(reached, before))


def _reference_at(path: Any, arc: Any, state: State, source: Courses) -> Reference:
    """Reference at an arc length [m]; at rest at the end of the path, and turned like the robot if that is free.

    A robot without a heading (0, 0) is one that has not started.
    """
    span, spacing = Span(*entries(source.spans, path, SPAN)), source.spacings[path]
    base, last = span.first, span.last
    i = min(base + int(arc / spacing), last - 1)
    share = min(arc / spacing - (i - base), 1.0)
    reference = course_reference(_row(source.samples, i), _row(source.samples, i + 1), share, spacing)
    if arc >= (last - base) * spacing:
        reference = at_rest(reference)
    c, s = state.heading
    if source.free_heading * (c * c + s * s) > 0.5:
        r = reference
        reference = Reference(r.x, r.y, c, s, r.vx, r.vy, 0.0, r.ax, r.ay, 0.0)
    return reference


def fetch(block: Any, lane: Any, row: Any, state: State, _clock: Any, path: Any, before: Any, source: Courses) -> Any:
    """Write reference and previewed points of a robot where it is on its path; see `fetch_reference`."""
    span = Span(*entries(source.spans, path, SPAN))
    length = (span.last - span.first) * source.spacings[path]
    progress = 0.0 if before < 0.0 else _nearest(state.position, path, before, source)
    reference = _reference_at(path, progress, state, source)
    write_reference(block, lane, row, reference)
    for i in range(len(source.horizons)):
        coming = _reference_at(path, minimum(progress + source.horizons[i], length), state, source)
        write_point(block, lane, row, i, point_of(coming))
    last = _row(source.samples, span.last)
    return progress, progress_share(progress, before, length, state.position, last, source)
