"""How a robot whose wheels may slip accelerates and answers to impulses, from the parts that its time step is made of.

The step itself, `caster_gym.mechanics.slip.slip_step`, is implicit and needs no accelerations.
"""

from caster_gym.mechanics.caster_masses import friction_slopes, without_friction
from caster_gym.mechanics.dynamics import platform_bias, platform_inertia
from caster_gym.mechanics.free_casters import (
    Forces,
    Pair,
    balance,
    border,
    edge_inertia,
    felt_force,
    follow,
    free_response,
    joint_forces,
    own_inertia,
    pivot_rows,
    turning_forces,
)
from caster_gym.mechanics.linear import scale, shift, solve, subtract
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import Direction, Symmetric, Vector, add, each, total


def slip_inertia(directions: tuple[Direction, ...], robot: RobotParameters) -> Symmetric:
    """What answers to an impulse on the platform while all wheels slip freely. (S4)"""
    shares = each(without_friction, (), robot.casters)
    owns = each(own_inertia, (), shares, robot.casters)
    edges = each(border, (), directions, owns, robot.casters)
    return add(platform_inertia(robot.platform), total(each(edge_inertia, (), edges)))


def carry_casters(
    change: Vector, directions: tuple[Direction, ...], rates: tuple[Pair, ...], robot: RobotParameters
) -> tuple[Pair, ...]:
    """Rates of all casters after an impulse on the platform alone that changed its twist. (S4)"""
    shares = each(without_friction, (), robot.casters)
    owns = each(own_inertia, (), shares, robot.casters)
    edges = each(border, (), directions, owns, robot.casters)
    return each(follow, (change,), rates, edges)


def floor_push(f: Direction, force: Pair, caster: CasterParameters) -> Forces:
    """What a force of the floor along f and f⊥ does to one caster and the platform."""
    along, across = pivot_rows(f, caster)
    p, q = force
    return Forces(
        -caster.offset * p - caster.trail * q,
        -caster.radius * p,
        shift(q, scale(p, along), across),
    )


def add_forces(a: Forces, b: Forces) -> Forces:
    """Two forces together."""
    return Forces(a.at_eta + b.at_eta, a.at_theta + b.at_theta, add(a.at_platform, b.at_platform))


def slip_dynamics(
    v: Vector,
    directions: tuple[Direction, ...],
    rates: tuple[Pair, ...],
    torques: tuple[Pair, ...],
    floor: tuple[Pair, ...],
    wrench: Vector,
    robot: RobotParameters,
) -> tuple[Vector, tuple[Pair, ...]]:
    """Rates of change of twist and casters' rates under joint torques, forces of the floor along f and f⊥, a wrench.

    Friction of joints and contact patches' scrub are those of the rates. (S7)
    """
    owns = each(own_inertia, (), each(without_friction, (), robot.casters), robot.casters)
    edges = each(border, (), directions, owns, robot.casters)
    slopes = each(friction_slopes, (v[2], robot.platform.coulomb_speed), rates, robot.casters)
    given = each(joint_forces, (v[2],), torques, rates, slopes)
    taken = each(turning_forces, (v,), directions, rates, robot.casters)
    forces = each(
        add_forces, (), each(balance, (), given, taken), each(floor_push, (), directions, floor, robot.casters)
    )
    felt = total(each(felt_force, (), edges, forces))
    h = platform_bias(v, robot.platform)
    whole = add(platform_inertia(robot.platform), total(each(edge_inertia, (), edges)))
    v_rate = solve(whole, subtract(add(felt, wrench), h))
    still = each(no_rates, (), rates)
    return v_rate, each(follow, (v_rate,), each(free_response, (1.0,), still, owns, forces), edges)


def no_rates(rates: Pair) -> Pair:
    """Zero, of the kind of some rates."""
    return 0.0 * rates[0], 0.0 * rates[1]
