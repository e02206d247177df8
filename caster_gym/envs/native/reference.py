"""What leads the robot, as compiled code reads it: a timetable run by the clock, or courses walked at one's own pace.

`guide_robot` fetches what a robot is to do next, `judge` says what it has done is worth. Both are chosen by the type of
the guide while compiling, so that a task pays for nothing that only the other one needs.
"""

from typing import Any, NamedTuple

from numba.extending import overload, register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed, teach
from caster_gym.engines.native.lanes import LANES, counting, write
from caster_gym.envs import following, tracking
from caster_gym.envs.following import (
    FollowWeights,
    Row,
    arrived_share,
    at_rest,
    course_reference,
    follow_terms,
    nearest_share,
)
from caster_gym.envs.tracking import Endings, Reference, Weights, endings, mean_effort, reward_terms, tracking_errors
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import each, maximum, minimum

REFERENCE_ROWS = len(Reference._fields)
POINT_ROWS = 7

_WEIGHTS = (0.0,) * len(Weights._fields)
_FOLLOW_WEIGHTS = (0.0,) * len(FollowWeights._fields)

teach(tracking)
teach(following)


class Timetable(NamedTuple):
    """Trajectories in time."""

    samples: Any  # float64 (rows of all trajectories, 10), as in caster_gym.paths.trajectory
    spans: Any  # int64 (paths, 3): first and last row, control periods of an episode
    horizons: Any  # int64 (previewed points,): control periods ahead
    weights: Any  # float64 (weights,), as in Weights: taken apart in every call, an array costs less than its numbers


class Courses(NamedTuple):
    """Paths in space, with a time law."""

    samples: Any  # float64 (rows of all courses, 10), as in caster_gym.paths.course
    spans: Any  # int64 (paths, 3): first and last row, control periods of an episode
    spacings: Any  # float64 (paths,) [m] between rows
    horizons: Any  # float64 (previewed points,) [m] ahead
    window: Any  # [m] how far ahead the nearest point is sought
    stride: Any  # [m] progress that counts in full, per control period
    arrival: Any  # [m] before its end, a path counts as done
    arrival_scale: Any  # [m] distance from the end that halves what staying there is worth
    free_heading: Any  # 1 if the heading is free, else 0
    weights: Any  # float64 (weights,), as in FollowWeights


def borrowed_guide(guide: Any) -> Any:
    """The guide with its arrays borrowed, in compiled code."""
    return guide


def guide_robot(block: Any, lane: Any, row: Any, state: State, clock: Any, path: Any, before: Any, guide: Any) -> Any:
    """Write reference and previewed points of a robot from a row on; returns its progress [m] and the share of it.

    before: progress [m] so far, negative at the start of an episode.
    """
    fetch = _by_the_clock if isinstance(guide, Timetable) else _at_its_pace
    return fetch(block, lane, row, state, clock, path, before, guide)


def weights_of(guide: Any) -> Any:
    """What the task of a guide is worth, by name."""
    return _weights_in_time(guide) if isinstance(guide, Timetable) else _weights_on_path(guide)


def judge(state: Any, reference: Any, torques: Any, record: Any, situation: Any, robot: Any, weights: Any) -> Any:
    """Errors, endings, and the reward's terms."""
    verdict = _judge_in_time if isinstance(weights, Weights) else _judge_on_path
    return verdict(state, reference, torques, record, situation, robot, weights)


@register_jitable(**INLINE)
def _by_the_clock(
    block: Any, lane: Any, row: Any, _state: State, clock: Any, path: Any, _before: Any, guide: Timetable
) -> Any:
    base, end = guide.spans[path, 0], guide.spans[path, 1]
    now = min(base + clock, end)
    for j in range(REFERENCE_ROWS):
        block[(row + j) * LANES + lane] = guide.samples[now, j]
    row += REFERENCE_ROWS
    for p in range(len(guide.horizons)):
        then = min(base + clock + guide.horizons[p], end)
        for j in range(POINT_ROWS):
            block[(row + p * POINT_ROWS + j) * LANES + lane] = guide.samples[then, j]
    return 0.0, 0.0


@register_jitable(**INLINE)
def _entry(numbers: Any, i: Any) -> Any:
    return numbers[i]


@register_jitable(**INLINE)
def _numbers(numbers: Any, like: Any) -> Any:
    """As many numbers of an array as the tuple `like` has items."""
    return each(_entry, (numbers,), counting(like))


@register_jitable(**INLINE)
def _row(samples: Any, i: Any) -> Row:
    return (
        samples[i, 0],
        samples[i, 1],
        samples[i, 2],
        samples[i, 3],
        samples[i, 4],
        samples[i, 5],
        samples[i, 6],
        samples[i, 7],
        samples[i, 8],
        samples[i, 9],
    )


@register_jitable(**INLINE)
def _nearest(position: Any, path: Any, before: Any, guide: Courses) -> float:
    """Arc length of the point nearest to the robot, from `before` to a window ahead. [m]"""
    x, y = position
    base, last, spacing = guide.spans[path, 0], guide.spans[path, 1], guide.spacings[path]
    first = min(base + int(before / spacing), last - 1)
    end = min(first + int(guide.window / spacing) + 2, last)
    best, chosen, guess = 1e300, first, 0.0
    for i in range(first, end):
        ax, ay = guide.samples[i, 0], guide.samples[i, 1]
        bx, by = guide.samples[i + 1, 0] - ax, guide.samples[i + 1, 1] - ay
        share = ((x - ax) * bx + (y - ay) * by) / (bx * bx + by * by)
        share = min(max(share, 0.0), 1.0)
        dx, dy = x - ax - share * bx, y - ay - share * by
        distance = dx * dx + dy * dy
        if distance < best:
            best, chosen, guess = distance, i, share
    share = nearest_share(_row(guide.samples, chosen), _row(guide.samples, chosen + 1), guess, spacing, x, y)
    if share >= 1.0 and chosen + 1 < end:  # beside the row itself chords on the outer side of a bend are equally near
        chosen += 1
        share = nearest_share(_row(guide.samples, chosen), _row(guide.samples, chosen + 1), 0.0, spacing, x, y)
    reached = min((chosen - base + share) * spacing, before + guide.window)
    return float(max(reached, before))


@register_jitable(**INLINE)
def _reference_at(path: Any, arc: Any, state: State, guide: Courses) -> Reference:
    """Reference at an arc length [m]; at rest at the end of the path, and turned like the robot if that is free.

    A robot without a heading (0, 0) is one that has not started.
    """
    base, last, spacing = guide.spans[path, 0], guide.spans[path, 1], guide.spacings[path]
    i = min(base + int(arc / spacing), last - 1)
    share = min(arc / spacing - (i - base), 1.0)
    reference = course_reference(_row(guide.samples, i), _row(guide.samples, i + 1), share, spacing)
    if arc >= (last - base) * spacing:
        reference = at_rest(reference)
    c, s = state.heading
    if guide.free_heading * (c * c + s * s) > 0.5:
        r = reference
        reference = Reference(r.x, r.y, c, s, r.vx, r.vy, 0.0, r.ax, r.ay, 0.0)
    return reference


@register_jitable(**INLINE)
def _at_its_pace(
    block: Any, lane: Any, row: Any, state: State, _clock: Any, path: Any, before: Any, guide: Courses
) -> Any:
    length = (guide.spans[path, 1] - guide.spans[path, 0]) * guide.spacings[path]
    progress = 0.0 if before < 0.0 else _nearest(state.position, path, before, guide)
    reference = _reference_at(path, progress, state, guide)
    r = reference
    write(block, lane, row, (r.x, r.y, r.cos, r.sin, r.vx, r.vy, r.omega, r.ax, r.ay, r.alpha))
    for p in range(len(guide.horizons)):
        r = _reference_at(path, minimum(progress + guide.horizons[p], length), state, guide)
        point = (r.x, r.y, r.cos, r.sin, r.vx, r.vy, r.omega)
        write(block, lane, row + REFERENCE_ROWS + p * POINT_ROWS, point)
    share = minimum((progress - maximum(before, 0.0)) / guide.stride, 1.0)
    if progress >= length - guide.arrival:
        x, y = state.position
        last = _row(guide.samples, guide.spans[path, 1])
        share = maximum(share, arrived_share(x, y, last, guide.arrival_scale))
    return progress, share


@register_jitable(**INLINE)
def _weights_in_time(guide: Timetable) -> Weights:
    return Weights(*_numbers(guide.weights, _WEIGHTS))


@register_jitable(**INLINE)
def _weights_on_path(guide: Courses) -> FollowWeights:
    return FollowWeights(*_numbers(guide.weights, _FOLLOW_WEIGHTS))


@register_jitable(**INLINE)
def _judge_in_time(
    state: State, reference: Reference, torques: Any, record: Any, _situation: Any, robot: Any, weights: Weights
) -> Any:
    errors = tracking_errors(state, reference)
    ended = endings(state, errors, record, weights.corridor, weights.touching_ends)
    terms = reward_terms(errors, mean_effort(torques, robot), record, _any_of(ended), weights)
    return errors, ended, (terms.position, terms.heading, terms.speed, terms.effort, terms.impact, terms.alive)


@register_jitable(**INLINE)
def _judge_on_path(
    state: State, reference: Reference, torques: Any, record: Any, situation: Any, robot: Any, weights: FollowWeights
) -> Any:
    errors = tracking_errors(state, reference)
    ended = endings(state, errors, record, weights.corridor, weights.touching_ends)
    effort = mean_effort(torques, robot)
    terms = follow_terms(errors, situation.share, effort, record, _any_of(ended), weights)
    return errors, ended, (terms.progress, terms.cross_track, terms.heading, terms.effort, terms.impact, terms.alive)


@register_jitable(**INLINE)
def _any_of(ended: Endings) -> Any:
    return maximum(maximum(ended.left_corridor, ended.not_finite), ended.touched)


def _runs_by_the_clock(guide: Any) -> bool:
    """Whether the compiler's type of a guide is that of a timetable."""
    return guide.instance_class is Timetable


@overload(guide_robot, jit_options=INLINE, strict=False)
def _guide_robot(block: Any, lane: Any, row: Any, state: Any, clock: Any, path: Any, before: Any, guide: Any) -> Any:
    if _runs_by_the_clock(guide):
        return lambda block, lane, row, state, clock, path, before, guide: _by_the_clock(
            block, lane, row, state, clock, path, before, guide
        )
    return lambda block, lane, row, state, clock, path, before, guide: _at_its_pace(
        block, lane, row, state, clock, path, before, guide
    )


@overload(weights_of, jit_options=INLINE, strict=False)
def _weights_of(guide: Any) -> Any:
    if _runs_by_the_clock(guide):
        return lambda guide: _weights_in_time(guide)
    return lambda guide: _weights_on_path(guide)


@overload(judge, jit_options=INLINE, strict=False)
def _judge(state: Any, reference: Any, torques: Any, record: Any, situation: Any, robot: Any, weights: Any) -> Any:
    if weights.instance_class is Weights:
        return lambda state, reference, torques, record, situation, robot, weights: _judge_in_time(
            state, reference, torques, record, situation, robot, weights
        )
    return lambda state, reference, torques, record, situation, robot, weights: _judge_on_path(
        state, reference, torques, record, situation, robot, weights
    )


@overload(borrowed_guide, jit_options=INLINE, strict=False)
def _borrowed_guide(guide: Any) -> Any:
    if _runs_by_the_clock(guide):
        return lambda guide: Timetable(
            borrowed(guide.samples), borrowed(guide.spans), borrowed(guide.horizons), borrowed(guide.weights)
        )
    return lambda guide: Courses(
        borrowed(guide.samples),
        borrowed(guide.spans),
        borrowed(guide.spacings),
        borrowed(guide.horizons),
        guide.window,
        guide.stride,
        guide.arrival,
        guide.arrival_scale,
        guide.free_heading,
        borrowed(guide.weights),
    )
