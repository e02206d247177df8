"""Time step of the robot whose wheels may slip. docs/equations.md, section S.

Explicit midpoint for all that is smooth; friction of the floor is found implicitly at the end of each of both stages,
so that wheels that are held stay at rest at the floor, and slip starts, ends and turns back without chatter.
"""

from typing import NamedTuple

from caster_gym.mechanics.caster_masses import friction_slopes, implicit_shares
from caster_gym.mechanics.dynamics import platform_bias, platform_inertia
from caster_gym.mechanics.floor_friction import (
    NO_TIME,
    TINY,
    Footing,
    Grip,
    Limit,
    cut_impulses,
    final_impulses,
    floor_stiffness,
    impulse_limit,
    impulses_change,
    lessen,
    newton_round,
    slide_ratio,
    used_share,
)
from caster_gym.mechanics.free_casters import (
    Border,
    OwnInertia,
    balance,
    border,
    edge_inertia,
    felt_force,
    floor_mobility,
    floor_rows,
    follow,
    free_response,
    joint_forces,
    own_inertia,
    push_back,
    slip_velocity,
    turning_forces,
)
from caster_gym.mechanics.ground import wheel_loads
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import rotate, scale, scale_pair, shift, subtract
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Symmetric,
    Vector,
    add,
    clip,
    each,
    maximum,
    sqrt,
    total,
    where,
)
from caster_gym.mechanics.slip_energy import explained_share
from caster_gym.mechanics.slip_state import move, slips_of, with_velocities
from caster_gym.mechanics.slip_tilt import tilt_after

Pair = tuple[Scalar, Scalar]


class Footfall(NamedTuple):
    """What the floor did to the wheels in a time step, one number or pair a wheel."""

    slips: tuple[Pair, ...]  # [m/s] velocity over the floor along f and f⊥ at the end
    forces: tuple[Pair, ...]  # [N] of the floor along f and f⊥, mean over the step
    loads: tuple[Scalar, ...]  # [N]
    uses: tuple[Scalar, ...]  # [-] share of the friction that the floor has
    answer: Symmetric  # what answers to another push at C meanwhile: held wheels with the robot, others alone


class Stage(NamedTuple):
    """All that the friction solve needs of a robot over some time."""

    time: Scalar  # [s]
    inertia: Symmetric  # of the platform with casters that answer freely
    force: Vector  # [N s, N s, N m s] known impulse at the platform
    footings: tuple[Footing, ...]
    owns: tuple[OwnInertia, ...]
    edges: tuple[Border, ...]
    free: tuple[Pair, ...]  # [rad/s] rates at the end while the platform moves on and the floor lets go


def lasting_slide(before: Pair, halfway: Pair, free: Pair) -> Pair:
    """Velocity that an impulse opposes, less what it changes: the mean of a step where a slide lasts, else the end's.

    Twice the mean, which has the same direction. A slide lasts if half a step takes less than a quarter of it. (S15)
    """
    x, y = halfway[0] - before[0], halfway[1] - before[1]
    square = before[0] * before[0] + before[1] * before[1]
    nothing = 0.0 * square
    lasts = clip(2.0 - 16.0 * (x * x + y * y) / maximum(square, TINY), nothing, 1.0 + nothing)
    return free[0] + lasts * before[0], free[1] + lasts * before[1]


def oppose(footings: Footing, against: Pair) -> Footing:
    """A footing whose impulse opposes another velocity."""
    return Footing(against, footings.rows, footings.mobility)


def free_of(foot: Footing) -> Pair:
    """u without the floor. [m/s]"""
    return foot.free


def footing(free: Pair, rows: tuple[Vector, Vector], mobility: tuple[Scalar, Scalar, Scalar]) -> Footing:
    """A footing of its parts."""
    return Footing(free, rows, mobility)


def stage(
    time: Scalar,
    start: State,
    middle: State,
    ahead: tuple[Direction, ...],
    known: Vector,
    torques: tuple[Pair, ...],
    wrench: Vector,
    robot: RobotParameters,
) -> Stage:
    """A robot over some seconds from `start`, with inertia and forces in `middle` and wheels that end along `ahead`.

    known: impulse at the platform besides. (S8)
    """
    slopes = each(friction_slopes, (middle.twist[2], robot.platform.coulomb_speed), middle.rates, robot.casters)
    owns = each(own_inertia, (), each(implicit_shares, (time,), slopes, robot.casters), robot.casters)
    edges = each(border, (), middle.directions, owns, robot.casters)
    given = each(joint_forces, (start.twist[2],), torques, start.rates, slopes)
    taken = each(turning_forces, (middle.twist,), middle.directions, middle.rates, robot.casters)
    forces = each(balance, (), given, taken)
    free = each(free_response, (time,), start.rates, owns, forces)
    felt, h = total(each(felt_force, (), edges, forces)), platform_bias(middle.twist, robot.platform)
    footings = each(
        footing,
        (),
        each(slip_velocity, (start.twist,), ahead, free, robot.casters),
        each(floor_rows, (), ahead, edges, robot.casters),
        each(floor_mobility, (), owns, robot.casters),
    )
    return Stage(
        time,
        add(platform_inertia(robot.platform), total(each(edge_inertia, (), edges))),
        shift(time, known, subtract(add(felt, wrench), h)),
        footings,
        owns,
        edges,
        free,
    )


def impulse_of(wheel: Grip) -> Pair:
    """Impulse of the floor on a wheel along f and f⊥. [N s]"""
    return wheel.impulse


def rates_after(change: Vector, grips: tuple[Grip, ...], part: Stage, robot: RobotParameters) -> tuple[Pair, ...]:
    """Rates of all casters at the end of a stage that changes the twist."""
    answers = each(push_back, (), each(impulse_of, (), grips), part.owns, robot.casters)
    return each(follow, (change,), each(add, (), part.free, answers), part.edges)


def lasting_load(before: Scalar, load: Scalar) -> Scalar:
    """A load that is not negative, and zero for a wheel that had none half a step before. [N]"""
    nothing = 0.0 * load
    return where(before > 0.0, maximum(load, nothing), nothing)


def limit_of(time: Scalar, friction: Scalar, load: Scalar) -> Limit:
    """Greatest impulse of the floor on a wheel over some seconds."""
    return impulse_limit(time, friction * load)


def slide_against(before: Limit, after: Limit, slide: Scalar) -> Scalar:
    """rho of a wheel that slides as fast against another limit."""
    return slide * before.most * after.inverse


def lag_wrench(was: Pair, shall_be: Pair, caster: CasterParameters) -> Vector:
    """Wrench at C of the difference of two impulses at a pivot."""
    x, y = was[0] - shall_be[0], was[1] - shall_be[1]
    return x, y, caster.x * y - caster.y * x


def turning_lag(
    grips: tuple[Grip, ...],
    times: Scalar,
    middle: tuple[Direction, ...],
    ahead: tuple[Direction, ...],
    robot: RobotParameters,
) -> Vector:
    """What the floor's impulses along the directions of a step's middle have more than along those of its end. (S9)"""
    impulses = each(impulse_of, (), grips)
    was, shall_be = each(rotate, (), middle, impulses), each(rotate, (), ahead, impulses)
    return scale(times, total(each(lag_wrench, (), was, shall_be, robot.casters)))


def limit_grip(wheel: Grip, limit: Limit) -> Grip:
    """A wheel of the half step whose impulse is no more than half of what the whole step allows."""
    p, q = wheel.impulse
    one = 1.0 + 0.0 * p
    share = 1.0 / maximum(one, 2.0 * sqrt(p * p + q * q) * limit.inverse)
    return lessen(share, wheel)


def slip_step(
    state: State,
    torques: tuple[Pair, ...],
    wrench: Vector,
    h: Scalar,
    frictions: tuple[Scalar, ...],
    robot: RobotParameters,
) -> tuple[State, Footfall]:
    """One step of h seconds under constant torques and wrench; frictions: coefficients of the floor, a wheel each."""
    nothing = (0.0 * state.twist[0], 0.0 * state.twist[0], 0.0 * state.twist[0])
    half = 0.5 * h
    there = move(half, state, state)
    part = stage(half, state, state, there.directions, nothing, torques, wrench, robot)
    first_loads = wheel_loads(state.directions, state.tilt, robot)
    limits = each(limit_of, (half,), frictions, first_loads)
    slips = slips_of(state, robot)
    slides = each(slide_ratio, (), slips, limits)
    change = nothing
    problem = part.inertia, part.force, part.footings, limits
    change, slides = newton_round(change, 0.5, problem, slides)
    change, slides = newton_round(change, 0.0, problem, slides)
    change, grips = cut_impulses(change, problem, slides)
    rates = rates_after(change, grips, part, robot)
    middle = with_velocities(there, add(state.twist, change), rates, state.tilt)
    tilted = tilt_after(change, rates, state, middle, half, wrench, robot)
    loads = each(lasting_load, (), first_loads, wheel_loads(there.directions, tilted, robot))
    before, limits = limits, each(limit_of, (h,), frictions, loads)
    grips = each(limit_grip, (), grips, limits)
    change = impulses_change(problem, grips)
    rates = rates_after(change, grips, part, robot)
    middle = with_velocities(there, add(state.twist, change), rates, state.tilt)
    end = move(h, state, middle)
    known = turning_lag(grips, 2.0, middle.directions, end.directions, robot)
    part = stage(h, state, middle, end.directions, known, torques, wrench, robot)
    halfway = each(slip_velocity, (middle.twist,), middle.directions, rates, robot.casters)
    against = each(lasting_slide, (), slips, halfway, each(free_of, (), part.footings))
    footings = each(oppose, (), part.footings, against)
    slides = each(slide_against, (), before, limits, slides)
    problem = part.inertia, part.force, footings, limits
    change, slides = newton_round(scale(2.0, change), 0.5, problem, slides)
    change, slides = newton_round(change, 0.0, problem, slides)
    change, grips = final_impulses(change, problem, slides)
    rates = rates_after(change, grips, part, robot)
    share = explained_share(h, state, change, rates, end.directions, torques, wrench, robot)
    change, rates = subtract(scale(share, add(state.twist, change)), state.twist), each(scale_pair, (share,), rates)
    tilted = tilt_after(change, rates, state, middle, h, wrench, robot)
    end = with_velocities(end, add(state.twist, change), rates, tilted)
    slips = slips_of(end, robot)
    answer = add(part.inertia, total(each(floor_stiffness, (), footings, grips)))
    forces = each(scale_pair, (1.0 / maximum(h, NO_TIME),), each(impulse_of, (), grips))
    return end, Footfall(slips, forces, loads, each(used_share, (), grips, limits), answer)
