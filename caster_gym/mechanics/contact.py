"""A time step among obstacles: impacts found inside it, impulses, and contacts that last. docs/equations.md, section O.

A step is cut into segments that end where the robot first touches something. At such an end impulses act at all
contacts until none approaches. A contact that lasts is a force over the segment instead, as great as keeps it from
approaching, so that the robot slides and rests without bouncing. Whatever happens, the number of segments is bounded,
and the robot only ever moves to where it has been found free: what time is left then is not walked.

What a robot does in the open and how it answers to impulses, with wheels that roll or slip, is told by `grip_or_slip`.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics.contact_impulses import hold
from caster_gym.mechanics.first_contact import FOUND, first_contact, sweep_between
from caster_gym.mechanics.grip_or_slip import impact, power, response, step_with_use_apart
from caster_gym.mechanics.ground import FloorUse
from caster_gym.mechanics.integration import State, difference, pack_state, state_where, unit
from caster_gym.mechanics.linear import rotate, scale, scale_pair
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Scalar, Vector, add, anywhere, each, maximum, minimum, total, where
from caster_gym.mechanics.separation import TOUCH, Hull, Obstacles, contact_points, separation

SEGMENTS = 24  # of a time step at most
LIVELY = 8  # segments after which nothing bounces any more
LIFTS = 8  # sweeps over all obstacles that the robot has sunk into


class Touch(NamedTuple):
    """What the obstacles did to the robot during a time step."""

    impulse: tuple[Scalar, Scalar]  # [N s] in W
    pressing: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in W, where the last impact was; what it was before, if there was none
    impacts: Scalar  # how many faster than RESTING
    asks: FloorUse  # the most that is asked of the floor at the start of a segment
    held: Vector  # [N, N, N m] wrench of lasting contacts on the robot in the last segment, at C, in B
    work: Scalar  # [J] of the motors
    impact_traction: Scalar  # [-] greatest share of the floor's friction that a wheel used in an impact


def lift(state: State, hull: Hull, obstacles: Obstacles, first: Any, end: Any) -> tuple[State, Scalar]:
    """The state moved and turned out of obstacles that it has sunk into, and the gap to the nearest one before.

    Robots between two obstacles get out of both by turning, hence the sweeps.
    """
    x, y = state.position
    c, s = state.heading
    around = 1.0 / (hull.reach * hull.reach)
    nearest = 1e9 + 0.0 * x
    for i in range(LIFTS):
        sunk = nearest < -1e9
        for k in range(first, end):
            apart = separation((x, y), (c, s), hull, obstacles, k)
            nearest = minimum(apart.gap, nearest) if i == 0 else nearest
            deep = apart.gap < -FOUND
            if not anywhere(deep):
                continue
            (ax, ay), (bx, by) = contact_points((x, y), (c, s), apart, hull, obstacles, k)
            arm = 0.5 * ((ax + bx) * (c * apart.ny - s * apart.nx) - (ay + by) * (c * apart.nx + s * apart.ny))
            out = where(deep, -apart.gap / (1.0 + arm * arm * around), 0.0 * x)
            turn = out * arm * around
            x, y = x + out * apart.nx, y + out * apart.ny
            turned = unit((c - s * turn, s + c * turn))
            c, s = where(deep, turned[0], c), where(deep, turned[1], s)
            sunk = sunk | deep
        if not anywhere(sunk):
            break
    return State((x, y), (c, s), state.twist, state.directions, state.rates, state.tilt), nearest


def holding_force(
    state: State,
    torques: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    h: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
    surface: Any,
) -> tuple[Vector, Scalar]:
    """Wrench in B of lasting contacts that keeps them from approaching over h seconds, and its normal impulse. (O10)"""
    free, answer = response(state, torques, wrench, h, robot, surface)
    (c, s), omega = state.heading, state.twist[2]
    heading = unit((c - s * omega * h, s + c * omega * h))
    held, normal = hold(free, state, heading, answer, hull, obstacles, first, end)
    rate = 1.0 / maximum(h, 1e-9)
    return scale(rate, held), normal


def land(
    state: State,
    lands: Scalar,
    restitution: Scalar,
    touch: Touch,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
    surface: Any,
) -> tuple[State, Touch]:
    """State and record after the impulses on those who land."""
    bounced, hits, used = impact(state, restitution, robot, hull, obstacles, first, end, surface)
    c, s = state.heading
    jx, jy = rotate(state.heading, (hits.wrench[0], hits.wrench[1]))
    px, py = hits.point
    at = (state.position[0] + c * px - s * py, state.position[1] + s * px + c * py)
    acted = lands & (hits.normal > 0.0)
    struck = lands & (hits.impacts > 0.0)
    return state_where(lands, bounced, state), Touch(
        (touch.impulse[0] + where(acted, jx, 0.0 * jx), touch.impulse[1] + where(acted, jy, 0.0 * jy)),
        touch.pressing + where(acted, hits.normal, 0.0 * jx),
        (where(struck, at[0], touch.point[0]), where(struck, at[1], touch.point[1])),
        touch.impacts + where(struck, 1.0 + 0.0 * jx, 0.0 * jx),
        touch.asks,
        touch.held,
        touch.work,
        where(struck, maximum(used, touch.impact_traction), touch.impact_traction),
    )


def guarded_step(
    state: State,
    torques: tuple[tuple[Scalar, Scalar], ...],
    wrench: Vector,
    h: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
    surface: Any = None,
) -> tuple[State, Touch]:
    """One step of h seconds like `free_step`, among the obstacles first … end − 1."""
    nothing = 0.0 * (state.twist[0] + h)
    left, trial, landing = h + nothing, h + nothing, nothing
    none = (nothing, nothing, nothing)
    asked = FloorUse(nothing, nothing)
    touch = Touch((nothing, nothing), nothing, (nothing, nothing), nothing, asked, none, nothing, nothing)
    for i in range(SEGMENTS):
        lifted, nearest = lift(state, hull, obstacles, first, end)
        push, pressing = (nothing, nothing, nothing), nothing
        if anywhere(nearest < TOUCH):
            push, pressing = holding_force(lifted, torques, wrench, trial, robot, hull, obstacles, first, end, surface)
        target, asks = step_with_use_apart(lifted, torques, add(wrench, push), trial, robot, surface)
        (doubt,) = total(each(difference, (), pack_state(target)))
        hit = trial
        if anywhere(landing < 0.5):
            hit = first_contact(sweep_between(lifted, target, trial, hull.reach), trial, hull, obstacles, first, end)
        short = (landing < 0.5) & (hit < trial) & (doubt == 0.0)  # numbers that are not finite are walked into
        walks = where(short, nothing, left) > 0.0
        lands = walks & (landing > 0.5)
        share = where(walks, trial, nothing)
        impulse = scale_pair(share, rotate(target.heading, (push[0], push[1])))
        touch = Touch(
            add(touch.impulse, impulse),
            touch.pressing + where(walks, pressing, nothing),
            touch.point,
            touch.impacts,
            FloorUse(
                where(walks, maximum(asks.traction, touch.asks.traction), touch.asks.traction),
                where(walks, maximum(asks.lifted, touch.asks.lifted), touch.asks.lifted),
            ),
            each(where, (walks,), push, touch.held),
            touch.work
            + 0.5 * share * (power(lifted, torques, robot, surface) + power(target, torques, robot, surface)),
            touch.impact_traction,
        )
        state = state_where(walks, target, state)
        if anywhere(lands):
            bounce = obstacles.restitution + nothing if i < LIVELY else nothing
            state, touch = land(state, lands, bounce, touch, robot, hull, obstacles, first, end, surface)
        left = where(walks, left - trial, left)
        landing = where(short, 1.0 + nothing, nothing)
        trial = where(short, hit, left)
        if not anywhere(left > 0.0):
            break
    return state, touch
