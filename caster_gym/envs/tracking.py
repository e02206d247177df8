"""Tracking a reference, on generic scalars: errors, endings, observation, report, and kernels of rewards.

Like the mechanics, this is written once: the single environment and the batch compile the same lines. Quantities with
suffix _W are in the world frame, all others in the body frame B. Rational kernels 1 / (1 + e²/ℓ²) keep rewards bounded
and free of roots and exponentials.
"""

from typing import Any, NamedTuple, TypeAlias

from caster_gym.mechanics.actuation import conditioning
from caster_gym.mechanics.contact import Touch
from caster_gym.mechanics.integration import State, difference, pack_state
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.plant import Drive
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    clip,
    each,
    flatten,
    maximum,
    minimum,
    sqrt,
    total,
    where,
)

POSITION_UNIT = 0.1  # [m] an observed position error of 1
PREVIEW_UNIT = 0.5  # [m] an observed distance to a previewed point of 1
SPEED_UNIT = 1.0  # [m/s] also of a wheel's rim and of a pivot around its wheel
SPEED_ERROR_UNIT = 0.25  # [m/s]
YAW_RATE_UNIT = 2.0  # [rad/s]
YAW_RATE_ERROR_UNIT = 0.5  # [rad/s]
ACCELERATION_UNIT = 2.0  # [m/s²]
YAW_ACCELERATION_UNIT = 4.0  # [rad/s²]
GAP_UNIT = 0.25  # [m] to an obstacle
GAP_LIMIT = 1.0  # [m] obstacles farther away look as if they were there
ASKS = 7  # row of a Record from which on stands what was asked of the floor
IMPACT_TRACTION = 12  # and the row of what impacts asked
OBSERVATION_LIMIT = 20.0  # observed quantities are clipped here, far beyond what a robot in its corridor reaches

Point: TypeAlias = tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
Neighbour: TypeAlias = tuple[Scalar, Scalar, Scalar]  # gap [m] and unit normal, towards the robot, in W


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


class Errors(NamedTuple):
    """Reference minus robot, in the body frame."""

    ahead: Scalar  # [m]
    left: Scalar  # [m]
    cos: Scalar  # of the heading error
    sin: Scalar
    vx: Scalar  # [m/s]
    vy: Scalar
    omega: Scalar  # [rad/s]


class Record(NamedTuple):
    """What happened during a control period."""

    power: Scalar  # [W] mean of all motors
    impulse_x: Scalar  # [N s] of obstacles on the robot, in W
    impulse_y: Scalar
    pressing: Scalar  # [N s] sum of all normal impulses
    point_x: Scalar  # [m] of the last impact, in W
    point_y: Scalar
    impacts: Scalar  # how many
    traction: Scalar  # [-] greatest share of the floor's friction that a wheel used at the start of a time step
    lifted: Scalar  # most wheels that left the floor at once
    held_x: Scalar  # [N, N, N m] wrench of lasting contacts on the robot at the end, at C, in B
    held_y: Scalar
    held_moment: Scalar
    impact_traction: Scalar  # [-] greatest share of the floor's friction that a wheel used in an impact


class Situation(NamedTuple):
    """Where the robot is on its way."""

    progress: Scalar  # [m] arc length reached, where the task measures it
    share: Scalar  # of the progress that the period allows, 0 … 1
    clearance: Scalar  # [m] gap to the nearest obstacle


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


def record_of(done: Record, drive: Drive, touch: Touch, share: Scalar) -> Record:
    """A record with a time step among obstacles, which is a share of the control period."""
    hit = touch.impacts > 0.0
    return Record(
        done.power + share * drive.power,
        done.impulse_x + touch.impulse[0],
        done.impulse_y + touch.impulse[1],
        done.pressing + touch.pressing,
        where(hit, touch.point[0], done.point_x),
        where(hit, touch.point[1], done.point_y),
        done.impacts + touch.impacts,
        maximum(drive.asks.traction, done.traction),
        maximum(drive.asks.lifted, done.lifted),
        *touch.held,
        maximum(touch.impact_traction, done.impact_traction),
    )


def relative_effort(torque: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Sum of squared torques as shares of their limits, and number of driven motors, of one caster."""
    roll, steer = torque[0] / caster.roll_max_torque, torque[1] / caster.steer_max_torque
    return roll * roll + steer * steer, caster.roll_active + caster.steer_active


def mean_effort(torques: tuple[tuple[Scalar, Scalar], ...], robot: RobotParameters) -> Scalar:
    """Mean square of the motor torques as shares of their limits, 0 … 1."""
    squares, driven = total(each(relative_effort, (), torques, robot.casters))
    return squares / driven


def observed(number: Scalar) -> Scalar:
    """A number within the observation space; one that is not a number becomes its lower end."""
    return clip(number, -OBSERVATION_LIMIT, OBSERVATION_LIMIT)


def preview_point(state: State, point: Point) -> Point:
    """A coming point of the trajectory seen from the robot: place, heading, velocity and yaw rate."""
    x, y, cos, sin, vx, vy, omega = point
    c, s = state.heading
    ahead, left = to_body(state.heading, x - state.position[0], y - state.position[1])
    forward, leftward = to_body(state.heading, vx, vy)
    return (
        ahead / PREVIEW_UNIT,
        left / PREVIEW_UNIT,
        c * cos + s * sin,
        c * sin - s * cos,
        forward / SPEED_UNIT,
        leftward / SPEED_UNIT,
        omega / YAW_RATE_UNIT,
    )


def caster_speeds(rates: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    """Rolling and steering rate of one caster as speeds of the rim and of the pivot around the wheel."""
    theta, delta = rates
    return theta * caster.radius / SPEED_UNIT, delta * caster.trail / SPEED_UNIT


def neighbour_seen(state: State, neighbour: Neighbour) -> Neighbour:
    """An obstacle seen from the robot: its gap, and the direction from it to the robot; far away, no direction."""
    gap, nx, ny = neighbour
    nx, ny = to_body(state.heading, nx, ny)
    near = gap < GAP_LIMIT
    return minimum(gap, GAP_LIMIT) / GAP_UNIT, where(near, nx, 0.0 * nx), where(near, ny, 0.0 * ny)


def observe(
    state: State,
    reference: Reference,
    errors: Errors,
    preview: tuple[Point, ...],
    nearest: tuple[Neighbour, ...],
    rates: tuple[tuple[Scalar, Scalar], ...],
    robot: RobotParameters,
) -> tuple[Scalar, ...]:
    """The observation; `caster_gym.envs.observation` names its parts. rates: θ̇, δ̇ of each caster [rad/s]."""
    vx, vy, omega = state.twist
    ax, ay = to_body(state.heading, reference.ax, reference.ay)
    numbers = (
        errors.ahead / POSITION_UNIT,
        errors.left / POSITION_UNIT,
        errors.cos,
        errors.sin,
        errors.vx / SPEED_ERROR_UNIT,
        errors.vy / SPEED_ERROR_UNIT,
        errors.omega / YAW_RATE_ERROR_UNIT,
        vx / SPEED_UNIT,
        vy / SPEED_UNIT,
        omega / YAW_RATE_UNIT,
        ax / ACCELERATION_UNIT,
        ay / ACCELERATION_UNIT,
        reference.alpha / YAW_ACCELERATION_UNIT,
    )
    casters = flatten(state.directions) + flatten(each(caster_speeds, (), rates, robot.casters))
    ahead = flatten(each(preview_point, (state,), preview))
    return each(observed, (), numbers + casters + ahead + flatten(each(neighbour_seen, (state,), nearest)))


class Endings(NamedTuple):
    """Why an episode has failed; each 1 or 0."""

    left_corridor: Scalar
    not_finite: Scalar
    touched: Scalar


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


def any_of(ended: Endings) -> Scalar:
    """1 if an episode ends, for whatever reason, else 0."""
    return maximum(maximum(ended.left_corridor, ended.not_finite), ended.touched)


def unless(failed: Scalar, term: Scalar) -> Scalar:
    """The term, or 0 in a step that ends the episode."""
    return where(failed > 0.5, 0.0, term)


class Report(NamedTuple):
    """What a step tells beside observation and reward, and beside motor torques and slips, which follow it."""

    endings: Endings
    position_error: Scalar  # [m]
    heading_sin: Scalar  # of the heading error
    heading_cos: Scalar
    conditioning: Scalar  # [-]
    terms: tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar]
    pose: tuple[Scalar, Scalar, Scalar, Scalar]  # x, y, cos β, sin β in W
    reference_pose: tuple[Scalar, Scalar, Scalar, Scalar]
    record: Record
    situation: Situation


def report(
    state: State,
    reference: Reference,
    errors: Errors,
    record: Record,
    situation: Situation,
    ended: Endings,
    terms: tuple[Scalar, Scalar, Scalar, Scalar, Scalar, Scalar],
    robot: RobotParameters,
) -> Report:
    """Errors and diagnostics of the present state after a control period."""
    return Report(
        ended,
        sqrt(distance_square(errors)),
        errors.sin,
        errors.cos,
        conditioning(state.directions, robot),
        terms,
        state.position + state.heading,
        (reference.x, reference.y, reference.cos, reference.sin),
        record,
        situation,
    )


def flat_report(
    told: Report, torques: tuple[tuple[Scalar, Scalar], ...], slips: tuple[Scalar, ...]
) -> tuple[Scalar, ...]:
    """The report, the motor torques and, where wheels may slip, their slips as one row."""
    errors = (told.position_error, told.heading_sin, told.heading_cos, told.conditioning)
    poses = told.pose + told.reference_pose
    ended = told.endings
    flags = (ended.left_corridor, ended.not_finite, ended.touched)
    return flags + errors + told.terms + poses + told.record[:] + told.situation[:] + flatten(torques) + slips


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
