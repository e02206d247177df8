"""Impacts of the robot whose wheels may slip. docs/equations.md, section S.

The wheels answer to an impulse on the platform as the floor lets them: over the contact time it holds a wheel by no
more than friction · load · time. A wheel that slides already is not held; its friction acts over the time step anyway.
"""

from typing import NamedTuple

from caster_gym.mechanics.caster_masses import without_friction
from caster_gym.mechanics.contact_impulses import RESTING
from caster_gym.mechanics.dynamics import platform_inertia
from caster_gym.mechanics.floor import Surface
from caster_gym.mechanics.floor_friction import (
    Footing,
    Grip,
    Limit,
    final_impulses,
    floor_stiffness,
    grip,
    impulse_limit,
    slide_of,
    used_share,
)
from caster_gym.mechanics.free_casters import (
    Border,
    OwnInertia,
    Pair,
    border,
    edge_inertia,
    floor_mobility,
    floor_rows,
    follow,
    own_inertia,
    push_back,
)
from caster_gym.mechanics.ground import wheel_loads
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import length, scale, shift, solve
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Scalar, Symmetric, Vector, add, clip, each, greatest, total
from caster_gym.mechanics.slip import footing, impulse_of
from caster_gym.mechanics.slip_state import slips_of, with_velocities


class ImpactFooting(NamedTuple):
    """How all wheels meet the floor in an impact."""

    inertia: Symmetric  # of the platform with casters that answer freely
    footings: tuple[Footing, ...]
    limits: tuple[Limit, ...]
    slides: tuple[Scalar, ...]  # rho to start with
    owns: tuple[OwnInertia, ...]
    edges: tuple[Border, ...]


def fading_limit(contact_time: Scalar, friction: Scalar, load: Scalar, u: Pair) -> Limit:
    """Greatest impulse of the floor on a wheel over the contact time; none on one that slides already."""
    slides = length(u)
    fades = clip(2.0 - slides / RESTING, 0.0 * slides, 1.0 + 0.0 * slides)
    return impulse_limit(contact_time, friction * load * fades)  # (S16)


def zero_slide(limit: Limit) -> Scalar:
    """rho of a wheel that is held."""
    return 0.0 * limit.most


def impact_footing(state: State, surface: Surface, robot: RobotParameters) -> ImpactFooting:
    """How the wheels of a robot that is about to be struck meet the floor."""
    owns = each(own_inertia, (), each(without_friction, (), robot.casters), robot.casters)
    edges = each(border, (), state.directions, owns, robot.casters)
    before = slips_of(state, robot)
    rows = each(floor_rows, (), state.directions, edges, robot.casters)
    loads = wheel_loads(state.directions, state.tilt, robot)
    limits = each(fading_limit, (surface.contact_time,), surface.frictions, loads, before)
    return ImpactFooting(
        add(platform_inertia(robot.platform), total(each(edge_inertia, (), edges))),
        each(footing, (), before, rows, each(floor_mobility, (), owns, robot.casters)),
        limits,
        each(zero_slide, (), limits),
        owns,
        edges,
    )


def at_rest_impulse(foot: Footing, wheel: Grip) -> Vector:
    """Impulse on the platform of a wheel's friction if the twist does not change, for the stiffness that it has."""
    a, b = foot.rows
    xx, xy, yy = wheel.stiffness
    p, q = -xx * foot.free[0] - xy * foot.free[1], -xy * foot.free[0] - yy * foot.free[1]
    return shift(q, scale(p, a), b)


def held_answer(
    change: Vector, slides: tuple[Scalar, ...], floor: ImpactFooting, v: Vector
) -> tuple[Vector, Symmetric, tuple[Scalar, ...]]:
    """Twist before the obstacles' impulse, and what answers to it, for wheels that slide as after a change."""
    grips = each(grip, (change, 1.0), floor.footings, floor.limits, slides)
    answer = add(floor.inertia, total(each(floor_stiffness, (), floor.footings, grips)))
    before = solve(answer, total(each(at_rest_impulse, (), floor.footings, grips)))
    return add(v, before), answer, each(slide_of, (), grips)


def answered_impact(
    wrench: Vector,
    change: Vector,
    slides: tuple[Scalar, ...],
    floor: ImpactFooting,
    state: State,
    robot: RobotParameters,
) -> tuple[State, Scalar]:
    """State after an impulse of obstacles at C, and the greatest share of the floor's friction that a wheel used."""
    change, grips = final_impulses(change, (floor.inertia, wrench, floor.footings, floor.limits), slides)
    answers = each(push_back, (), each(impulse_of, (), grips), floor.owns, robot.casters)
    rates = each(follow, (change,), each(add, (), state.rates, answers), floor.edges)
    uses = each(used_share, (), grips, floor.limits)
    return with_velocities(state, add(state.twist, change), rates, state.tilt), greatest(uses)
