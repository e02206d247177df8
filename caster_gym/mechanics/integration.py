"""State and time step. Directions are unit vectors: (c, s)' = rate · (−s, c), so nothing wraps; no angle is needed."""

from collections.abc import Callable
from typing import Any, NamedTuple

from caster_gym.mechanics.caster import rates
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.linear import rotate, shift, shift_pair
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


def state_at_rest(casters: int) -> State:
    """A state at the origin in which everything points along x, of a robot whose wheels roll without slip."""
    return State((0.0, 0.0), (1.0, 0.0), (0.0, 0.0, 0.0), ((1.0, 0.0),) * casters)


def pack_state(state: State) -> tuple[Scalar, ...]:
    """(x, y, cos β, sin β, vx, vy, ω, cos δ_1, sin δ_1, …), and if wheels may slip η̇_1, θ̇_1, …, the tilt."""
    body = state.position + state.heading + state.twist
    return body + flatten(state.directions) + flatten(state.rates) + state.tilt


BODY_ROWS = len(pack_state(state_at_rest(0)))  # numbers of a state before the casters' directions


def state_rows(casters: int, slips: bool) -> int:
    """How many numbers `pack_state` gives of a robot with so many casters, whose wheels may slip or not."""
    rolling = BODY_ROWS + 2 * casters
    return rolling + 2 * casters + 2 if slips else rolling


def difference(number: Scalar) -> tuple[Scalar]:
    """0 for a finite number, else not a number."""
    return (number - number,)


def unpack_state(flat: tuple[Scalar, ...]) -> State:
    """Inverse of `pack_state` for wheels that roll without slip."""
    return State((flat[0], flat[1]), (flat[2], flat[3]), (flat[4], flat[5], flat[6]), pairs(flat[BODY_ROWS:]), (), ())


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
        rotate(state.heading, (vx, vy)),
        (-s * omega, c * omega),
        forward_dynamics(state.twist, state.directions, torques, wrench, robot),
        each(steering_turn, (state.twist,), state.directions, robot.casters),
        state.rates,
        state.tilt,
    )


def advance(state: State, h: Scalar, rate: State) -> State:
    """state + h · rate."""
    return State(
        shift_pair(h, state.position, rate.position),
        shift_pair(h, state.heading, rate.heading),
        shift(h, state.twist, rate.twist),
        each(shift_pair, (h,), state.directions, rate.directions),
        state.rates,
        state.tilt,
    )


def unit(f: Direction) -> Direction:
    """f brought back to length 1 by one Newton step for 1/√(c² + s²), enough since a time step barely leaves it."""
    c, s = f
    scale = 1.5 - 0.5 * (c * c + s * s)  # (I2)
    return c * scale, s * scale


def runge_kutta(
    rate: Callable[..., Any], move: Callable[..., Any], start: Any, h: Scalar, given: tuple[Any, ...]
) -> Any:
    """Where a motion from `start` is after h seconds, by the classical Runge–Kutta method.

    rate(state, *given): its derivative. move(state, h, rate): state + h · rate.
    """
    k1 = rate(start, *given)
    k2 = rate(move(start, 0.5 * h, k1), *given)
    k3 = rate(move(start, 0.5 * h, k2), *given)
    k4 = rate(move(start, h, k3), *given)
    return move(move(move(move(start, h / 6.0, k1), h / 3.0, k2), h / 3.0, k3), h / 6.0, k4)


def rk4_step(
    state: State, torques: tuple[tuple[Scalar, Scalar], ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> State:
    """One step under constant torques and wrench. Step h in s."""
    end = runge_kutta(derivative, advance, state, h, (torques, wrench, robot))
    return State(end.position, unit(end.heading), end.twist, each(unit, (), end.directions), end.rates, end.tilt)
