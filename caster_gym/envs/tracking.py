"""Tracking a reference, on generic scalars: errors, endings, report, and kernels of rewards.

Like the mechanics, this is written once: the single environment and the batch compile the same lines. Quantities with
suffix _W are in the world frame, all others in the body frame B. Rational kernels 1 / (1 + e²/ℓ²) keep rewards bounded
and free of roots and exponentials.
"""

from typing import Any, NamedTuple

from caster_gym.envs.report import Deviation, Endings, Pose, Record, Report, Situation
from caster_gym.envs.rows import check_names, numbered, span
from caster_gym.mechanics.actuation import conditioning
from caster_gym.mechanics.integration import State, difference, pack_state
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, each, greatest, sqrt, total, where
from caster_gym.paths.trajectory import COLUMNS


class Reference(NamedTuple):
    """What the trajectory asks at one time, in the world frame; one row of a `caster_gym.paths.Trajectory`."""

    x: Scalar  # [m]
    y: Scalar
    cos: Scalar  # heading
    sin: Scalar
    vx: Scalar  # [m/s]
    vy: Scalar
    omega: Scalar  # [rad/s]
    ax: Scalar  # [m/s²]
    ay: Scalar
    alpha: Scalar  # [rad/s²]


class Point(NamedTuple):
    """A coming point of the trajectory: the first fields of its reference."""

    x: Scalar  # [m]
    y: Scalar
    cos: Scalar  # heading
    sin: Scalar
    vx: Scalar  # [m/s]
    vy: Scalar
    omega: Scalar  # [rad/s]


REFERENCE_ROWS, POINT_ROWS = len(Reference._fields), len(Point._fields)
REFERENCE = numbered(Reference)
POSE = span((REFERENCE.x, REFERENCE.y, REFERENCE.cos, REFERENCE.sin))  # of a trajectory's columns
check_names(Reference._fields, "the fields of Reference", COLUMNS, "the columns of a Trajectory")
check_names(Point._fields, "the fields of Point", Reference._fields[:POINT_ROWS], "the first of Reference")


def point_of(reference: Reference) -> Point:
    """Where a reference is and how fast it moves."""
    return Point(*reference[:POINT_ROWS])


class Errors(NamedTuple):
    """Reference minus robot, in the body frame."""

    ahead: Scalar  # [m]
    left: Scalar  # [m]
    cos: Scalar  # of the heading error
    sin: Scalar
    vx: Scalar  # [m/s]
    vy: Scalar
    omega: Scalar  # [rad/s]


def to_body(heading: Direction, x_W: Scalar, y_W: Scalar) -> tuple[Scalar, Scalar]:
    """Components in B of a vector in W."""
    c, s = heading
    return c * x_W + s * y_W, c * y_W - s * x_W


def tracking_errors(state: State, reference: Reference) -> Errors:
    """Where and how fast the reference is, seen from the robot."""
    c, s = state.heading
    ahead, left = to_body(state.heading, reference.x - state.position[0], reference.y - state.position[1])
    vx, vy = to_body(state.heading, reference.vx, reference.vy)
    return Errors(
        ahead,
        left,
        c * reference.cos + s * reference.sin,
        c * reference.sin - s * reference.cos,
        vx - state.twist[0],
        vy - state.twist[1],
        reference.omega - state.twist[2],
    )


def kernel(square: Scalar, scale: Scalar) -> Scalar:
    """1 / (1 + e²/ℓ²) of a squared error."""
    return 1.0 / (1.0 + square / (scale * scale))


def both_kernels(square: Scalar, scale: Scalar, coarse: Scalar) -> Scalar:
    """Mean of a fine kernel, for precision, and a coarse one, for a slope far away."""
    return 0.5 * (kernel(square, scale) + kernel(square, coarse * scale))


def turn_square(errors: Errors) -> Scalar:
    """Squared chord of the heading error. [rad²]"""
    return 2.0 * (1.0 - errors.cos)


def distance_square(errors: Errors) -> Scalar:
    """Squared distance to the reference. [m²]"""
    return errors.ahead * errors.ahead + errors.left * errors.left


def twist_square(errors: Errors, speed_scale: Scalar, yaw_rate_scale: Scalar) -> Scalar:
    """Squared twist error in units of its scales. [-]"""
    moving = (errors.vx * errors.vx + errors.vy * errors.vy) / (speed_scale * speed_scale)
    return moving + errors.omega * errors.omega / (yaw_rate_scale * yaw_rate_scale)


def impact_share(pressing: Scalar, scale: Scalar) -> Scalar:
    """How bad an impact was, 0 … 1: half at an impulse of `scale`."""
    return pressing / (pressing + scale)


def not_finite(state: State) -> Scalar:
    """1 if any number of the state is infinite or no number, else 0."""
    (doubt,) = total(each(difference, (), pack_state(state)))
    return where(doubt == 0.0, 0.0, 1.0)


def left_corridor(errors: Errors, corridor: Scalar) -> Scalar:
    """1 if the position error exceeds the corridor, else 0."""
    return where(distance_square(errors) > corridor * corridor, 1.0, 0.0)


def touched(record: Record, touching_ends: Scalar) -> Scalar:
    """1 if the robot touched an obstacle although that ends the episode, else 0."""
    return where(record.pressing * touching_ends > 0.0, 1.0, 0.0)


def relative_effort(torque: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Sum of squared torques as shares of their limits, and number of driven motors, of one caster."""
    roll, steer = torque[0] / caster.roll_max_torque, torque[1] / caster.steer_max_torque
    return roll * roll + steer * steer, caster.roll_active + caster.steer_active


def mean_effort(torques: tuple[tuple[Scalar, Scalar], ...], robot: RobotParameters) -> Scalar:
    """Mean square of the motor torques as shares of their limits, 0 … 1."""
    squares, driven = total(each(relative_effort, (), torques, robot.casters))
    return squares / driven


class Moment(NamedTuple):
    """One robot at the end of a control period: all that rewards and endings may depend on."""

    state: State
    reference: Reference
    errors: Errors
    effort: Scalar  # mean square of the torques as shares of their limits, 0 … 1
    record: Record
    situation: Situation


def endings(moment: Moment, weights: Any) -> Endings:
    """Whether an episode ends here: outside the corridor, not finite, or touching an obstacle where that ends it."""
    return Endings(
        left_corridor(moment.errors, weights.corridor),
        not_finite(moment.state),
        touched(moment.record, weights.touching_ends),
    )


def unless(failed: Scalar, term: Scalar) -> Scalar:
    """The term, or 0 in a step that ends the episode."""
    return where(failed > 0.5, 0.0, term)


def evaluate_by(
    state: Any,
    reference: Any,
    torques: Any,
    record: Any,
    situation: Any,
    robot: Any,
    weights: Any,
    endings: Any,
    reward: Any,
) -> Any:
    """Errors, endings, and the reward's terms, all 0 where the episode ends, from the functions of a task."""
    errors = tracking_errors(state, reference)
    moment = Moment(state, reference, errors, mean_effort(torques, robot), record, situation)
    ended = endings(moment, weights)
    return errors, ended, each(unless, (greatest(ended),), reward(moment, weights)[:])


def report(
    state: State,
    reference: Reference,
    errors: Errors,
    record: Record,
    situation: Situation,
    ended: Endings,
    robot: RobotParameters,
) -> Report:
    """Errors and diagnostics of the present state after a control period."""
    return Report(
        ended,
        Deviation(sqrt(distance_square(errors)), errors.sin, errors.cos, conditioning(state.directions, robot)),
        Pose(*state.position, *state.heading),
        Pose(reference.x, reference.y, reference.cos, reference.sin),
        record,
        situation,
    )


def start(
    reference: Reference, offset: tuple[Scalar, Scalar], turn: Direction, directions: tuple[Direction, ...]
) -> State:
    """A start at rest: beside the trajectory's first point by an offset in its frame, turned from its heading."""
    c, s = reference.cos, reference.sin
    x, y = offset
    return State(
        (reference.x + c * x - s * y, reference.y + s * x + c * y),
        (c * turn[0] - s * turn[1], s * turn[0] + c * turn[1]),
        (0.0 * c, 0.0 * c, 0.0 * c),
        directions,
        (),
        (),
    )
