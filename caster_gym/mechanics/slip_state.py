"""States of robots whose wheels may slip, with the rates of the casters and the tilt as numbers of their own."""

from caster_gym.mechanics.caster import rates
from caster_gym.mechanics.free_casters import Pair, slip_velocity
from caster_gym.mechanics.integration import BODY_ROWS, State
from caster_gym.mechanics.linear import rotate, shift_pair
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector, each, pairs


def unpack_slip_state(flat: tuple[Scalar, ...]) -> State:
    """Inverse of `pack_state` for wheels that may slip."""
    half = (BODY_ROWS + len(flat) - 2) // 2  # directions and rates are as many
    return State(
        (flat[0], flat[1]),
        (flat[2], flat[3]),
        (flat[4], flat[5], flat[6]),
        pairs(flat[BODY_ROWS:half]),
        pairs(flat[half:-2]),
        (flat[-2], flat[-1]),
    )


def rolling_state(state: State, robot: RobotParameters) -> State:
    """A state without rates as one of wheels that do not slip yet, with loads as at rest."""
    nothing = 0.0 * state.twist[0]
    rates = each(rolling_rates, (state.twist,), state.directions, robot.casters)
    return State(state.position, state.heading, state.twist, state.directions, rates, (nothing, nothing))


def rolling_rates(v: Vector, f: Direction, caster: CasterParameters) -> Pair:
    """Yaw over ground and roll of a caster that rolls without slip. [rad/s]"""
    eta, theta, _ = rates(v, f, caster)
    return eta, theta


def turn_by(f: Direction, angle: Scalar) -> Direction:
    """A direction turned by an angle, of second order in it, and no longer or shorter than it was."""
    t = 0.5 * angle
    scale = 1.0 / (1.0 + t * t)
    c, s = (1.0 - t * t) * scale, 2.0 * t * scale  # (S9)
    return c * f[0] - s * f[1], s * f[0] + c * f[1]


def steer(h: Scalar, omega: Scalar, f: Direction, rates: Pair) -> Direction:
    """Rolling direction in B after h seconds."""
    return turn_by(f, h * (rates[0] - omega))


def move(h: Scalar, state: State, along: State) -> State:
    """The state h seconds on with the velocities of another; its own velocities as they are."""
    vx, vy, omega = along.twist
    position = shift_pair(h, state.position, rotate(along.heading, (vx, vy)))
    directions = each(steer, (h, omega), state.directions, along.rates)
    return State(position, turn_by(state.heading, h * omega), state.twist, directions, state.rates, state.tilt)


def with_velocities(state: State, twist: Vector, rates: tuple[Pair, ...], tilt: Pair) -> State:
    """The state with other velocities."""
    return State(state.position, state.heading, twist, state.directions, rates, tilt)


def slips_of(state: State, robot: RobotParameters) -> tuple[Pair, ...]:
    """Velocities of all wheels over the floor along f and f⊥. [m/s]"""
    return each(slip_velocity, (state.twist,), state.directions, state.rates, robot.casters)
