"""A time step among obstacles: impacts found inside it, impulses, and contacts that last. docs/equations.md, section O.

A step is cut into segments that end where the robot first touches something. At such an end impulses (C1)–(C4) act at
all contacts in turn until none approaches. A contact that lasts is a force over the segment instead, as great as keeps
it from approaching, so that the robot slides and rests without bouncing. Whatever happens, the number of segments is
bounded, and the robot only ever moves to where it has been found free: what time is left then is not walked.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.impulse import collide
from caster_gym.mechanics.integration import State, pack_state, rk4_step, unit, unpack_state
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Vector,
    add,
    anywhere,
    each,
    entry,
    maximum,
    minimum,
    sqrt,
    where,
)
from caster_gym.mechanics.separation import (
    TOUCH,
    Hull,
    Obstacles,
    Separation,
    contact_points,
    lowest,
    separation,
)

SLOP = 2e-5  # [m] depth that a segment may add where the robot touches already
RESTING = 0.01  # [m/s] slower contacts do not bounce
STILL = 1e-6  # [m/s] slower contacts do not approach
SEGMENTS = 24  # of a time step at most
LIVELY = 8  # segments after which nothing bounces any more
SWEEPS = 60  # over all contacts, at one moment
LIFTS = 8  # sweeps over all obstacles that the robot has sunk into
ADVANCES = 40  # of a search for the first contact
_FOUND = 1e-6  # [m] accuracy of that search, and depth that does not matter


class Touch(NamedTuple):
    """What the obstacles did to the robot during a time step."""

    impulse: tuple[Scalar, Scalar]  # [N s] in W
    pressing: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in W, where the last impact was; what it was before, if there was none
    impacts: Scalar  # how many


class Sweep(NamedTuple):
    """Pose during a segment: cubic polynomials of time, in W, with the values and rates of both its ends."""

    x: tuple[Scalar, Scalar, Scalar, Scalar]
    y: tuple[Scalar, Scalar, Scalar, Scalar]
    c: tuple[Scalar, Scalar, Scalar, Scalar]
    s: tuple[Scalar, Scalar, Scalar, Scalar]
    acceleration: Scalar  # [m/s²] bound for every point of the robot


class Pressure(NamedTuple):
    """Impulses of obstacles on the robot."""

    wrench: Vector  # [N s, N s, N m s] in B
    normal: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in B, of the last one


def cubic(
    h: Scalar, start: Scalar, rate: Scalar, end: Scalar, end_rate: Scalar
) -> tuple[Scalar, Scalar, Scalar, Scalar]:
    """Coefficients of Hermite's cubic over h seconds, lowest first."""
    mean = (end - start) / h
    return start, rate, (3.0 * mean - 2.0 * rate - end_rate) / h, (rate + end_rate - 2.0 * mean) / (h * h)


def value(p: tuple[Scalar, Scalar, Scalar, Scalar], t: Scalar) -> Scalar:
    """The polynomial at t."""
    return p[0] + t * (p[1] + t * (p[2] + t * p[3]))


def slope(p: tuple[Scalar, Scalar, Scalar, Scalar], t: Scalar) -> Scalar:
    """Its derivative at t."""
    return p[1] + t * (2.0 * p[2] + t * 3.0 * p[3])


def greatest_bend(
    p: tuple[Scalar, Scalar, Scalar, Scalar], q: tuple[Scalar, Scalar, Scalar, Scalar], h: Scalar
) -> Scalar:
    """Greatest length of the second derivative of (p, q), which is linear in time: that at either end."""
    first = 4.0 * (p[2] * p[2] + q[2] * q[2])
    px, qx = p[2] + 3.0 * h * p[3], q[2] + 3.0 * h * q[3]
    return sqrt(maximum(first, 4.0 * (px * px + qx * qx)))


def sweep_between(start: State, end: State, h: Scalar, reach: Scalar) -> Sweep:
    """The pose between two states that are h seconds apart. (O5)"""
    h = maximum(h, 1e-9)
    (c0, s0), (c1, s1) = start.heading, end.heading
    (u0, v0, w0), (u1, v1, w1) = start.twist, end.twist
    x = cubic(h, start.position[0], c0 * u0 - s0 * v0, end.position[0], c1 * u1 - s1 * v1)
    y = cubic(h, start.position[1], s0 * u0 + c0 * v0, end.position[1], s1 * u1 + c1 * v1)
    c, s = cubic(h, c0, -s0 * w0, c1, -s1 * w1), cubic(h, s0, c0 * w0, s1, c1 * w1)
    return Sweep(x, y, c, s, greatest_bend(x, y, h) + reach * greatest_bend(c, s, h))


def free_time(sweep: Sweep, t: Scalar, apart: Separation, threshold: Scalar, hull: Hull) -> Scalar:
    """Time from t during which no corner gets nearer than the threshold along the present axis. [s]

    A corner i recedes at u_i and accelerates towards the obstacle by at most A: its gap stays above
    g_i + u_i τ − ½ A τ².
    """
    c, s = value(sweep.c, t), value(sweep.s, t)
    c_rate, s_rate = slope(sweep.c, t), slope(sweep.s, t)
    away = apart.nx * slope(sweep.x, t) + apart.ny * slope(sweep.y, t)
    nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
    low = lowest(nx, ny, hull)
    least = 1e9 + 0.0 * t
    for i in range(len(hull.corners)):
        px, py = entry(hull.corners, i, 0), entry(hull.corners, i, 1)
        room = maximum(apart.gap - threshold + (nx * px + ny * py - low), 0.0)
        u = away + apart.nx * (c_rate * px - s_rate * py) + apart.ny * (s_rate * px + c_rate * py)
        root = sqrt(u * u + 2.0 * sweep.acceleration * room)
        least = minimum(2.0 * room / maximum(root - u, 1e-300), least)  # (O6)
    return least


def first_contact(sweep: Sweep, h: Scalar, hull: Hull, obstacles: Obstacles, first: Any, end: Any) -> Scalar:
    """Time of the first contact during a segment of h seconds; h or more if there is none. [s]

    The search never steps over a contact. Where the robot touches already, it may sink by another SLOP.
    """
    earliest = h
    for k in range(first, end):
        t, threshold = 0.0 * h, 0.0 * h
        for i in range(ADVANCES):
            position, heading = (value(sweep.x, t), value(sweep.y, t)), (value(sweep.c, t), value(sweep.s, t))
            apart = separation(position, heading, hull, obstacles, k)
            if i == 0:
                threshold = minimum(0.0, apart.gap - SLOP)
            moving = (t < earliest) & (apart.gap > threshold + _FOUND)
            if not anywhere(moving):
                break
            free = free_time(sweep, t, apart, threshold, hull)
            t = where(moving, minimum(t + free, earliest), t)
        earliest = minimum(t, earliest)
    return earliest


def press(
    v: Vector,
    state: State,
    heading: Direction,
    restitution: Scalar,
    fastest: Scalar,
    robot: RobotParameters,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
) -> tuple[Vector, Pressure]:
    """Twist after impulses at all contacts of a pose in turn, until none approaches; and these impulses.

    v and the impulses are taken in the directions of `heading`. Contacts whose approach in `state` is faster than
    `fastest` [m/s] are left alone, those slower than RESTING do not bounce.
    """
    nothing = 0.0 * v[0]
    wrench, normal, at = (nothing, nothing, nothing), nothing, (nothing, nothing)
    for _ in range(SWEEPS):
        approaching = nothing > 1.0
        for k in range(first, end):
            apart = separation(state.position, state.heading, hull, obstacles, k)
            touching = apart.gap < TOUCH
            if not anywhere(touching):
                continue
            c, s = heading
            nx, ny = c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx
            points = contact_points(state.position, heading, apart, hull, obstacles, k)
            for i in range(2):
                px, py = points[i]
                before = nx * (state.twist[0] - state.twist[2] * py) + ny * (state.twist[1] + state.twist[2] * px)
                now = nx * (v[0] - v[2] * py) + ny * (v[1] + v[2] * px)
                bounce = where(now < -RESTING, restitution, nothing)
                j_n, j_t, after = collide(v, state.directions, points[i], (nx, ny), bounce, obstacles.friction, robot)
                acts = touching & (before > -fastest) & (now < -STILL)
                v = each(where, (acts,), after, v)
                j_n, j_t = where(acts, j_n, nothing), where(acts, j_t, nothing)
                jx, jy = nx * j_n - ny * j_t, ny * j_n + nx * j_t
                wrench = (wrench[0] + jx, wrench[1] + jy, wrench[2] + px * jy - py * jx)
                normal = normal + j_n
                at = (where(acts, px, at[0]), where(acts, py, at[1]))
                approaching = approaching | acts
        if not anywhere(approaching):
            break
    return v, Pressure(wrench, normal, at)


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
            deep = apart.gap < -_FOUND
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
    return State((x, y), (c, s), state.twist, state.directions), nearest


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
) -> tuple[Vector, Scalar]:
    """Wrench in B of lasting contacts that keeps them from approaching over h seconds, and its normal impulse. (O7)"""
    v = state.twist
    a = forward_dynamics(v, state.directions, torques, wrench, robot)
    free = (v[0] + h * a[0], v[1] + h * a[1], v[2] + h * a[2])
    c, s = state.heading
    heading = unit((c - s * v[2] * h, s + c * v[2] * h))
    _, held = press(free, state, heading, 0.0 * h, RESTING, robot, hull, obstacles, first, end)
    rate = 1.0 / maximum(h, 1e-9)
    return (held.wrench[0] * rate, held.wrench[1] * rate, held.wrench[2] * rate), held.normal


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
) -> tuple[State, Touch]:
    """State and record after the impulses on those who land."""
    bounced, hits = press(state.twist, state, state.heading, restitution, 1e9, robot, hull, obstacles, first, end)
    twist = each(where, (lands,), bounced, state.twist)
    c, s = state.heading
    jx, jy = c * hits.wrench[0] - s * hits.wrench[1], s * hits.wrench[0] + c * hits.wrench[1]
    px, py = hits.point
    at = (state.position[0] + c * px - s * py, state.position[1] + s * px + c * py)
    acted = lands & (hits.normal > 0.0)
    return State(state.position, state.heading, twist, state.directions), Touch(
        (touch.impulse[0] + where(acted, jx, 0.0 * jx), touch.impulse[1] + where(acted, jy, 0.0 * jy)),
        touch.pressing + where(acted, hits.normal, 0.0 * jx),
        (where(acted, at[0], touch.point[0]), where(acted, at[1], touch.point[1])),
        touch.impacts + where(acted, 1.0 + 0.0 * jx, 0.0 * jx),
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
) -> tuple[State, Touch]:
    """One step of h seconds like `rk4_step`, among the obstacles first … end − 1."""
    nothing = 0.0 * (state.twist[0] + h)
    left, trial, landing = h + nothing, h + nothing, nothing
    touch = Touch((nothing, nothing), nothing, (nothing, nothing), nothing)
    for i in range(SEGMENTS):
        lifted, nearest = lift(state, hull, obstacles, first, end)
        push, pressing = (nothing, nothing, nothing), nothing
        if anywhere(nearest < TOUCH):
            push, pressing = holding_force(lifted, torques, wrench, trial, robot, hull, obstacles, first, end)
        target = rk4_step(lifted, torques, add(wrench, push), trial, robot)
        hit = trial
        if anywhere(landing < 0.5):
            hit = first_contact(sweep_between(lifted, target, trial, hull.reach), trial, hull, obstacles, first, end)
        short = (landing < 0.5) & (hit < trial)
        walks = where(short, nothing, left) > 0.0
        lands = walks & (landing > 0.5)
        c, s = target.heading
        share = where(walks, trial, nothing)
        impulse = (share * (c * push[0] - s * push[1]), share * (s * push[0] + c * push[1]))
        touch = Touch(
            add(touch.impulse, impulse), touch.pressing + where(walks, pressing, nothing), touch.point, touch.impacts
        )
        state = unpack_state(each(where, (walks,), pack_state(target), pack_state(state)))
        if anywhere(lands):
            bounce = obstacles.restitution + nothing if i < LIVELY else nothing
            state, touch = land(state, lands, bounce, touch, robot, hull, obstacles, first, end)
        left = where(walks, left - trial, left)
        landing = where(short, 1.0 + nothing, nothing)
        trial = where(short, hit, left)
        if not anywhere(left > 0.0):
            break
    return state, touch
