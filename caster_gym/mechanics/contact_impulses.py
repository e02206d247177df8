"""Impulses at all contacts of a pose: of impacts, and of contacts that last. docs/equations.md, section O.

What answers to impulses is an argument `m`, the inertia M(δ) of a robot whose wheels roll without slip.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics.impulse import Mobility, contact_rows, impact, pushed
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot, multiply, solve
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Symmetric,
    Vector,
    absolute,
    anywhere,
    clip,
    each,
    maximum,
    memory,
    minimum,
    sqrt,
    where,
)
from caster_gym.mechanics.separation import TOUCH, Hull, Obstacles, contact_points, separation

RESTING = 0.01  # [m/s] slower contacts do not bounce
STILL = 1e-6  # [m/s] slower contacts do not approach
ROUNDS = 8  # of impulses at one moment; nothing bounces in the last
SWEEPS = 240  # over all contacts, at one moment
SETTLED, COARSE = 1e-9, 1e-6  # [m/s] changes at which sweeps end; the latter in single precision
_STEP = 1.5  # of a sweep; below 1 none can overshoot, from 2 on all may
_MOMENTUM, _MORE, _LATE = 0.3, 0.7, 80  # share of the last change that a sweep repeats, and more of it from sweep 80 on
_SAME = 1e-9  # [m] points of one obstacle that are nearer are one
_TINY, _HUGE = 1e-30, 1e30

_FIELDS = 24  # of a contact: its rows, then
_POINT, _TOUCHES, _BEFORE = 12, 14, 15  # place in B [m], 1 or 0, speed along the normal before the impulses [m/s]
_LEAST, _MOST = 16, 17  # bounds of its normal impulse [N s]
_ALONG, _ACROSS, _CHANGE_ALONG, _CHANGE_ACROSS = 18, 19, 20, 21  # impulses, and how the last sweep changed them [N s]
_SCALE_ALONG, _SCALE_ACROSS = 22, 23  # bounds for the speeds [m/s] that all impulses of 1 N s give it together


class Pressure(NamedTuple):
    """Impulses of obstacles on the robot."""

    wrench: Vector  # [N s, N s, N m s] in B
    normal: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in B, of the last impact; the middle of what several press at once
    impacts: Scalar  # 1 if any contact approached faster than RESTING, else 0


class Contact(NamedTuple):
    """One point where the robot may touch an obstacle: N and T, and what a unit of impulse along them changes."""

    n: Vector
    t: Vector
    m_n: Vector
    m_t: Vector


def gather(
    state: State, heading: Direction, m: Symmetric, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[Any, int]:
    """Both contact points of each obstacle that the robot touches, in the directions of `heading`, and their number.

    A row of _FIELDS entries each; those of a batch where another robot touches are marked as not touching.
    """
    nothing = 0.0 * state.position[0]
    table = memory(nothing, 2 * _FIELDS * (end - first))
    count = 0
    c, s = heading
    for k in range(first, end):
        apart = separation(state.position, state.heading, hull, obstacles, k)
        touching = apart.gap < TOUCH
        if not anywhere(touching):
            continue
        normal = (c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx)
        points = contact_points(state.position, heading, apart, hull, obstacles, k)
        width = absolute(points[1][0] - points[0][0]) + absolute(points[1][1] - points[0][1])
        for i in range(2):
            acts = touching & ((width > _SAME) | (i == 0))
            n, t = contact_rows(points[i], normal)
            m_n, m_t = solve(m, n), solve(m, t)
            at = _FIELDS * count
            for q in range(3):
                table[at + q], table[at + 3 + q] = n[q], t[q]
                table[at + 6 + q], table[at + 9 + q] = m_n[q], m_t[q]
            table[at + _POINT], table[at + _POINT + 1] = points[i]
            table[at + _TOUCHES] = where(acts, 1.0 + nothing, nothing)
            count += 1
    for j in range(count):
        one, at = contact_of(table, j), _FIELDS * j
        along, across = nothing, nothing
        for k in range(count):
            other, there = contact_of(table, k), table[_FIELDS * k + _TOUCHES]
            along = along + there * (absolute(dot(one.n, other.m_n)) + absolute(dot(one.n, other.m_t)))
            across = across + there * (absolute(dot(one.t, other.m_n)) + absolute(dot(one.t, other.m_t)))
        touches = table[at + _TOUCHES] > 0.5
        table[at + _SCALE_ALONG] = where(touches, along, 1.0 + nothing)
        table[at + _SCALE_ACROSS] = where(touches, across, 1.0 + nothing)
    return table, count


def contact_of(table: Any, j: int) -> Contact:
    """Contact j of a table."""
    at = _FIELDS * j
    return Contact(
        (table[at], table[at + 1], table[at + 2]),
        (table[at + 3], table[at + 4], table[at + 5]),
        (table[at + 6], table[at + 7], table[at + 8]),
        (table[at + 9], table[at + 10], table[at + 11]),
    )


def settle(v: Vector, table: Any, count: int, friction: Scalar) -> Vector:
    """Twist after joint impulses at all contacts, which the table then holds.

    Normal impulses stay between their bounds; within them no contact ends approaching, and one that recedes does not
    press. Friction holds, or acts against sliding. All contacts change at once in each sweep, so that their order does
    not matter, by no more than what all together can bear. (O7)
    """
    nothing = 0.0 * v[0]
    for j in range(count):
        for q in range(_ALONG, _CHANGE_ACROSS + 1):
            table[_FIELDS * j + q] = nothing
    settled = where((1.0 + nothing) + SETTLED > 1.0, SETTLED, COARSE)
    goes_on = nothing < 1.0  # a robot of a batch stops where it would stop alone
    for sweep in range(SWEEPS):
        momentum = _MOMENTUM if sweep < _LATE else _MORE
        changing, after = nothing > 1.0, v
        for j in range(count):
            one, at = contact_of(table, j), _FIELDS * j
            acts = goes_on & (table[at + _TOUCHES] > 0.5)
            along, across = table[at + _ALONG], table[at + _ACROSS]
            j_n = along + momentum * table[at + _CHANGE_ALONG] - _STEP * dot(one.n, v) / table[at + _SCALE_ALONG]
            j_n = clip(j_n, table[at + _LEAST], table[at + _MOST])
            limit = friction * j_n
            j_t = across + momentum * table[at + _CHANGE_ACROSS] - _STEP * dot(one.t, v) / table[at + _SCALE_ACROSS]
            j_t = clip(j_t, -limit, limit)
            d_n, d_t = where(acts, j_n - along, nothing), where(acts, j_t - across, nothing)
            table[at + _ALONG], table[at + _CHANGE_ALONG] = along + d_n, d_n
            table[at + _ACROSS], table[at + _CHANGE_ACROSS] = across + d_t, d_t
            after = pushed(after, d_n, one.m_n, d_t, one.m_t)
            change = maximum(absolute(d_n) * dot(one.n, one.m_n), absolute(d_t) * dot(one.t, one.m_t))
            changing = changing | (change > settled)
        v = after
        goes_on = goes_on & changing
        if not anywhere(goes_on):
            break
    return v


def sum_of(table: Any, count: int, nothing: Scalar) -> tuple[Vector, Scalar]:
    """Wrench in B of the impulses in a table, and the sum of the normal ones."""
    x, y, z, normal = nothing, nothing, nothing, nothing
    for j in range(count):
        one = contact_of(table, j)
        along, across = table[_FIELDS * j + _ALONG], table[_FIELDS * j + _ACROSS]
        x, y, z = pushed((x, y, z), along, one.n, across, one.t)
        normal = normal + along
    return (x, y, z), normal


class Blow(NamedTuple):
    """What impulses at one moment did."""

    after: Vector  # twist
    wrench: Vector  # [N s, N s, N m s] in B
    normal: Scalar  # [N s] sum of all normal impulses


def strike_alone(v: Vector, table: Any, count: int, restitution: Scalar, obstacles: Obstacles) -> tuple[Blow, Scalar]:
    """The one contact that approaches struck by the law of a single contact; and whether another approaches then."""
    nothing = 0.0 * v[0]
    after, wrench, normal = v, (nothing, nothing, nothing), nothing
    for j in range(count):
        one, before = contact_of(table, j), table[_FIELDS * j + _BEFORE]
        w = Mobility(dot(one.n, one.m_n), dot(one.n, one.m_t), dot(one.t, one.m_t))
        j_n, j_t = impact(before, dot(one.t, v), w, restitution, obstacles.friction, obstacles.law)
        acts = before < -STILL
        after = each(where, (acts,), pushed(v, j_n, one.m_n, j_t, one.m_t), after)
        wrench = each(where, (acts,), pushed((nothing, nothing, nothing), j_n, one.n, j_t, one.t), wrench)
        normal = where(acts, j_n, normal)
    approaches = nothing > 1.0
    for j in range(count):
        touches = table[_FIELDS * j + _TOUCHES] > 0.5
        approaches = approaches | (touches & (dot(contact_of(table, j).n, after) < -STILL))
    return Blow(after, wrench, normal), approaches


def strike_together(v: Vector, m: Symmetric, table: Any, count: int, restitution: Scalar, friction: Scalar) -> Blow:
    """All contacts struck jointly: compression until none approaches, then expansion with impulses in proportion. (O8)

    Expansion is tried with the impulses of compression, to see how much normal work they would regain, then done with
    as much of them as regains e² of what compression took.
    """
    nothing = 0.0 * v[0]
    compressed, lost, work, share = v, nothing, nothing, nothing
    wrench, normal = (nothing, nothing, nothing), nothing
    reached, extra, more = v, wrench, nothing
    for stage in range(3):
        for j in range(count):
            at = _FIELDS * j
            pressed = share * table[at + _LEAST] if stage == 2 else table[at + _ALONG]
            table[at + _LEAST] = nothing if stage == 0 else pressed
            table[at + _MOST] = _HUGE + nothing if stage == 0 else pressed
        reached = settle(compressed, table, count, friction)
        push, along = sum_of(table, count, nothing)
        gained = nothing
        for j in range(count):
            n = contact_of(table, j).n
            gained = gained + 0.5 * (dot(n, compressed) + dot(n, reached)) * table[_FIELDS * j + _ALONG]
        if stage == 0:
            lost = maximum(0.5 * (dot(v, multiply(m, v)) - dot(reached, multiply(m, reached))), nothing)
            work = clip(-gained, nothing, lost)
            compressed, wrench, normal = reached, push, along
            if not anywhere(restitution > 0.0):
                break
        else:
            share = where(gained > 0.0, restitution * sqrt(work / maximum(gained, _TINY)), restitution)
            extra, more = push, along
    step = (reached[0] - compressed[0], reached[1] - compressed[1], reached[2] - compressed[2])
    half, square = dot(step, multiply(m, compressed)), dot(step, multiply(m, step))
    room = half + sqrt(half * half + 2.0 * lost * square)
    kept = minimum(2.0 * lost / maximum(room, _TINY), 1.0)  # (O9): as much of the step as the energy allows
    return Blow(
        (compressed[0] + kept * step[0], compressed[1] + kept * step[1], compressed[2] + kept * step[2]),
        (wrench[0] + kept * extra[0], wrench[1] + kept * extra[1], wrench[2] + kept * extra[2]),
        normal + kept * more,
    )


def press(
    state: State, m: Symmetric, restitution: Scalar, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[Vector, Pressure]:
    """Twist after impulses at all contacts, in rounds until none approaches; and these impulses.

    One contact that approaches is struck by the law of a single contact, several are struck jointly, as is one whose
    impulse would make another approach. Contacts that approach slower than RESTING do not bounce.
    """
    v = state.twist
    nothing = 0.0 * v[0]
    wrench, normal, point, struck = (nothing, nothing, nothing), nothing, (nothing, nothing), nothing
    table, count = gather(state, state.heading, m, hull, obstacles, first, end)
    for turn in range(ROUNDS):
        active, fastest = nothing, nothing
        for j in range(count):
            at = _FIELDS * j
            table[at + _BEFORE] = where(table[at + _TOUCHES] > 0.5, dot(contact_of(table, j).n, v), nothing)
            active = active + where(table[at + _BEFORE] < -STILL, 1.0 + nothing, nothing)
            fastest = minimum(table[at + _BEFORE], fastest)
        acts = active > 0.5
        bounce = where(fastest < -RESTING, restitution + nothing, nothing) if turn < ROUNDS - 1 else nothing
        if not anywhere(acts):
            break
        blow, others = strike_alone(v, table, count, bounce, obstacles)
        jointly = acts & (others | (active > 1.5))
        if anywhere(jointly):
            together = strike_together(v, m, table, count, bounce, obstacles.friction)
            blow = Blow(
                each(where, (jointly,), together.after, blow.after),
                each(where, (jointly,), together.wrench, blow.wrench),
                where(jointly, together.normal, blow.normal),
            )
        at_x, at_y, weights = nothing, nothing, nothing
        for j in range(count):
            at = _FIELDS * j
            weight = where(table[at + _BEFORE] < -RESTING, where(jointly, _TINY + table[at + _ALONG], 1.0), nothing)
            at_x, at_y = at_x + weight * table[at + _POINT], at_y + weight * table[at + _POINT + 1]
            weights = weights + weight
        strikes = weights > 0.0
        total = where(strikes, weights, 1.0 + nothing)
        point = (where(strikes, at_x / total, point[0]), where(strikes, at_y / total, point[1]))
        struck = where(strikes, 1.0 + nothing, struck)
        v = each(where, (acts,), blow.after, v)
        push = each(where, (acts,), blow.wrench, (nothing, nothing, nothing))
        wrench = (wrench[0] + push[0], wrench[1] + push[1], wrench[2] + push[2])
        normal = normal + where(acts, blow.normal, nothing)
    return v, Pressure(wrench, normal, point, struck)


def hold(
    v: Vector,
    state: State,
    heading: Direction,
    m: Symmetric,
    hull: Hull,
    obstacles: Obstacles,
    first: Any,
    end: Any,
) -> tuple[Vector, Scalar]:
    """Impulses of lasting contacts on a robot that would else reach the twist v: wrench in B, and their normal sum.

    v and the impulses are taken in the directions of `heading`. Contacts that approach faster than RESTING in `state`
    are left alone. (O10)
    """
    nothing = 0.0 * v[0]
    table, count = gather(state, heading, m, hull, obstacles, first, end)
    for j in range(count):
        lasts = dot(contact_of(table, j).n, state.twist) > -RESTING
        table[_FIELDS * j + _TOUCHES] = where(lasts, table[_FIELDS * j + _TOUCHES], nothing)
        table[_FIELDS * j + _LEAST], table[_FIELDS * j + _MOST] = nothing, _HUGE + nothing
    settle(v, table, count, obstacles.friction)
    return sum_of(table, count, nothing)
