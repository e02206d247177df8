"""State and time step. Directions are unit vectors: (c, s)' = rate · (−s, c), so nothing wraps; no angle is needed."""

from typing import NamedTuple

from caster_gym.mechanics.caster import rates
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Scalar, Vector, each, flatten, pairs, where


class State(NamedTuple):
    """Where the robot is and how it moves."""

    position: tuple[Scalar, Scalar]  # of C, in W [m]
    heading: Direction  # (cos β, sin β) of the body x-axis, in W
    twist: Vector  # in B
    directions: tuple[Direction, ...]  # rolling direction of each caster, in B
    # Of a robot whose wheels may slip; else they follow from the twist, and nothing is kept. Section S.
    rates: tuple[tuple[Scalar, Scalar], ...] = ()  # yaw over ground and roll of each caster [rad/s]
    tilt: tuple[Scalar, ...] = ()  # [N m] x and y in B, by which inertia shifted the loads on the wheels just before


def pack_state(state: State) -> tuple[Scalar, ...]:
    """(x, y, cos β, sin β, vx, vy, ω, cos δ_1, sin δ_1, …), and if wheels may slip η̇_1, θ̇_1, …, the tilt."""
    body = state.position + state.heading + state.twist
    return body + flatten(state.directions) + flatten(state.rates) + state.tilt


def difference(number: Scalar) -> tuple[Scalar]:
    """0 for a finite number, else not a number."""
    return (number - number,)


def unpack_state(flat: tuple[Scalar, ...]) -> State:
    """Inverse of `pack_state` for wheels that roll without slip."""
    return State((flat[0], flat[1]), (flat[2], flat[3]), (flat[4], flat[5], flat[6]), pairs(flat[7:]), (), ())


def pair_where(condition: Scalar, yes: Direction, no: Direction) -> Direction:
    """`where` of two numbers."""
    return where(condition, yes[0], no[0]), where(condition, yes[1], no[1])


def state_where(condition: Scalar, yes: State, no: State) -> State:
    """The state `yes` where the condition holds, else `no`."""
    return State(
        pair_where(condition, yes.position, no.position),
        pair_where(condition, yes.heading, no.heading),
        each(where, (condition,), yes.twist, no.twist),
        each(pair_where, (condition,), yes.directions, no.directions),
        each(pair_where, (condition,), yes.rates, no.rates),
        each(where, (condition,), yes.tilt, no.tilt),
    )


def steering_turn(v: Vector, f: Direction, caster: CasterParameters) -> Direction:
    """Rate of change of a caster's rolling direction, in B. [1/s]"""
    _, _, delta = rates(v, f, caster)
    return -f[1] * delta, f[0] * delta  # (I1)


def derivative(
    state: State, torques: tuple[tuple[Scalar, Scalar], ...], wrench: Vector, robot: RobotParameters
) -> State:
    """Time derivative of a state, in the same layout."""
    c, s = state.heading
    vx, vy, omega = state.twist
    return State(
        (c * vx - s * vy, s * vx + c * vy),
        (-s * omega, c * omega),
        forward_dynamics(state.twist, state.directions, torques, wrench, robot),
        each(steering_turn, (state.twist,), state.directions, robot.casters),
        state.rates,
        state.tilt,
    )


def advance_pair(h: Scalar, a: Direction, rate: Direction) -> Direction:
    """a + h · rate."""
    return a[0] + h * rate[0], a[1] + h * rate[1]


def advance(state: State, h: Scalar, rate: State) -> State:
    """state + h · rate."""
    v, a = state.twist, rate.twist
    return State(
        advance_pair(h, state.position, rate.position),
        advance_pair(h, state.heading, rate.heading),
        (v[0] + h * a[0], v[1] + h * a[1], v[2] + h * a[2]),
        each(advance_pair, (h,), state.directions, rate.directions),
        state.rates,
        state.tilt,
    )


def unit(f: Direction) -> Direction:
    """f brought back to length 1 by one Newton step for 1/√(c² + s²), enough since a time step barely leaves it."""
    c, s = f
    scale = 1.5 - 0.5 * (c * c + s * s)  # (I2)
    return c * scale, s * scale


def rk4_step(
    state: State, torques: tuple[tuple[Scalar, Scalar], ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> State:
    """One step of the classical Runge–Kutta method under constant torques and wrench. Step h in s."""
    k1 = derivative(state, torques, wrench, robot)
    k2 = derivative(advance(state, 0.5 * h, k1), torques, wrench, robot)
    k3 = derivative(advance(state, 0.5 * h, k2), torques, wrench, robot)
    k4 = derivative(advance(state, h, k3), torques, wrench, robot)
    end = advance(advance(advance(advance(state, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)
    return State(end.position, unit(end.heading), end.twist, each(unit, (), end.directions), end.rates, end.tilt)
