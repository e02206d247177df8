"""Two plants behind the same functions: wheels that roll without slip, and wheels on a floor of finite friction.

surface is None where the floor grips; an engine knows that before the arithmetic starts, and compiles one plant only.
"""

from typing import Any

from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.contact_impulses import Pressure, press
from caster_gym.mechanics.dynamics import forward_dynamics, inertia
from caster_gym.mechanics.floor import Surface
from caster_gym.mechanics.free_casters import Pair
from caster_gym.mechanics.ground import FloorUse, floor_use, impact_traction, lifts
from caster_gym.mechanics.integration import State, rk4_step
from caster_gym.mechanics.linear import shift, subtract
from caster_gym.mechanics.motors import joint_power
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Scalar, Symmetric, Vector, apart, each, either, greatest, total
from caster_gym.mechanics.separation import Hull, Obstacles
from caster_gym.mechanics.slip import Footfall, slip_step
from caster_gym.mechanics.slip_impact import answered_impact, held_answer, impact_footing
from caster_gym.mechanics.slip_state import with_velocities

IMPACT_ROUNDS = 6  # in which impulses of the obstacles and of the floor agree to some thousandths


def free_step(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters, surface: Any
) -> State:
    """One step of h seconds in the open."""
    end: State = either(surface, rk4_step, slipping_step, (state, torques, wrench, h, robot))
    return end


def slipping_step(
    surface: Surface, state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> State:
    """`slip_step` without what the floor did."""
    end, _ = slip_step(state, torques, wrench, h, surface.frictions, robot)
    return end


def step_with_use(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters, surface: Any
) -> tuple[State, FloorUse]:
    """The same, and what the floor was asked."""
    given = state, torques, wrench, h, robot
    found: tuple[State, FloorUse] = either(surface, rolling_step_with_use, slipping_step_with_use, given)
    return found


def step_with_use_apart(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters, surface: Any
) -> tuple[State, FloorUse]:
    """The same as part of a step among obstacles, which is compiled for one robot at a time."""
    given = state, torques, wrench, h, robot
    found: tuple[State, FloorUse] = either(surface, rolling_step_with_use, slipping_step_with_use_apart, given)
    return found


def rolling_step_with_use(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[State, FloorUse]:
    """What it is asked at the start."""
    asks = floor_use(state.twist, state.directions, torques, wrench, robot)
    return rk4_step(state, torques, wrench, h, robot), asks


def slipping_step_with_use(
    surface: Surface, state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[State, FloorUse]:
    """What it gave; it gives no more than it has."""
    end, footfall = slip_step(state, torques, wrench, h, surface.frictions, robot)
    return end, use_of(footfall)


def slipping_step_with_use_apart(
    surface: Surface, state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[State, FloorUse]:
    """What it gave."""
    end, footfall = apart(slip_step, (state, torques, wrench, h, surface.frictions, robot))
    return end, use_of(footfall)


def use_of(footfall: Footfall) -> FloorUse:
    """Greatest share of the floor's friction that a wheel used, and how many wheels it did not carry."""
    (lifted,) = total(each(lifts, (), footfall.loads))
    return FloorUse(greatest(footfall.uses), lifted)


def response(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters, surface: Any
) -> tuple[Vector, Symmetric]:
    """Twist that a robot would reach in h seconds, and what answers to a push meanwhile."""
    found: tuple[Vector, Symmetric] = either(
        surface, rolling_response, slipping_response, (state, torques, wrench, h, robot)
    )
    return found


def rolling_response(
    state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[Vector, Symmetric]:
    """To first order in h."""
    rate = forward_dynamics(state.twist, state.directions, torques, wrench, robot)
    return shift(h, state.twist, rate), inertia(state.directions, robot)


def slipping_response(
    surface: Surface, state: State, torques: tuple[Pair, ...], wrench: Vector, h: Scalar, robot: RobotParameters
) -> tuple[Vector, Symmetric]:
    """Wheels that the floor holds answer with the robot, others alone."""
    end, footfall = apart(slip_step, (state, torques, wrench, h, surface.frictions, robot))
    return end.twist, footfall.answer


def all_joint_rates(state: State, robot: RobotParameters, surface: Any) -> tuple[Pair, ...]:
    """Rolling and steering rate of each caster. [rad/s]"""
    found: tuple[Pair, ...] = either(surface, rolling_joint_rates, slipping_joint_rates, (state, robot))
    return found


def rolling_joint_rates(state: State, robot: RobotParameters) -> tuple[Pair, ...]:
    """As they follow from the twist."""
    return each(joint_rates, (state.twist,), state.directions, robot.casters)


def slipping_joint_rates(_surface: Surface, state: State, _robot: RobotParameters) -> tuple[Pair, ...]:
    """The casters' own."""
    return each(own_joint_rates, (state.twist[2],), state.rates)


def own_joint_rates(omega: Scalar, rates: Pair) -> Pair:
    """Rolling and steering rate of one caster. [rad/s]"""
    return rates[1], rates[0] - omega


def power(state: State, torques: tuple[Pair, ...], robot: RobotParameters, surface: Any) -> Scalar:
    """Mechanical power of all motors under torques at the joints. [W]"""
    (whole,) = total(each(joint_power, (), all_joint_rates(state, robot, surface), torques))
    return whole


def impact(
    state: State,
    restitution: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
    surface: Any,
) -> tuple[State, Pressure, Scalar]:
    """State after impulses at all contacts, these, and the greatest share of the floor's friction that a wheel used."""
    given = state, restitution, robot, hull, obstacles, first, end
    found: tuple[State, Pressure, Scalar] = either(surface, rolling_impact, slipping_impact, given)
    return found


def rolling_impact(
    state: State, restitution: Scalar, robot: RobotParameters, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[State, Pressure, Scalar]:
    """The wheels keep rolling, whatever the floor must hold."""
    after, hits = press(state, inertia(state.directions, robot), restitution, hull, obstacles, first, end)
    used = impact_traction(subtract(after, state.twist), state.directions, robot)
    return with_velocities(state, after, state.rates, state.tilt), hits, used


def slipping_impact(
    surface: Surface,
    state: State,
    restitution: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
) -> tuple[State, Pressure, Scalar]:
    """The floor holds wheels as far as it can over the contact time; it and the obstacles act in turns to agree."""
    floor = impact_footing(state, surface, robot)
    v = state.twist
    nothing = 0.0 * v[0]
    none = (nothing, nothing, nothing)
    change, slides, hits = none, floor.slides, Pressure(none, nothing, (nothing, nothing), nothing)
    for _ in range(IMPACT_ROUNDS):
        start, answer, slides = held_answer(change, slides, floor, v)
        before = with_velocities(state, start, state.rates, state.tilt)
        after, hits = press(before, answer, restitution, hull, obstacles, first, end)
        change = subtract(after, v)
    ended, used = answered_impact(hits.wrench, change, slides, floor, state, robot)
    return ended, hits, used
