"""Impulses at all contacts of a pose: of impacts, and of contacts that last. docs/equations.md, section O.

What answers to impulses is an argument `m`, the inertia M(δ) of a robot whose wheels roll without slip.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics import contact_table as row
from caster_gym.mechanics.contact_table import contact_of, gather
from caster_gym.mechanics.impulse import Mobility, add_impulses, impact
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot, multiply, shift, subtract
from caster_gym.mechanics.scalars import (
    Direction,
    Scalar,
    Symmetric,
    Vector,
    absolute,
    add,
    anywhere,
    clip,
    each,
    maximum,
    minimum,
    sqrt,
    where,
)
from caster_gym.mechanics.separation import Hull, Obstacles

RESTING = 0.01  # [m/s] slower contacts do not bounce
STILL = 1e-6  # [m/s] slower contacts do not approach
ROUNDS = 8  # of impulses at one moment; nothing bounces in the last
SWEEPS = 400  # over all contacts, at one moment
SETTLED, COARSE = 1e-9, 1e-6  # [m/s] changes at which sweeps end; the latter in single precision
# Share of what all contacts together can bear that a sweep corrects, and share of its last change that it repeats: the
# first settles nearly everything, the second what settles slowly, the third what sways.
_SHARES, _LATER, _LAST = ((1.5, 0.3), (1.5, 0.7), (0.5, 0.7)), 80, 240
_TINY, _HUGE = 1e-30, 1e30


class Pressure(NamedTuple):
    """Impulses of obstacles on the robot."""

    wrench: Vector  # [N s, N s, N m s] in B
    normal: Scalar  # [N s] sum of all normal impulses
    point: tuple[Scalar, Scalar]  # [m] in B, of the last impact; the middle of what several press at once
    impacts: Scalar  # 1 if any contact approached faster than RESTING, else 0


def settle(v: Vector, table: Any, count: int, friction: Scalar) -> Vector:
    """Twist after joint impulses at all contacts, which the table then holds.

    Normal impulses stay between their bounds; within them no contact ends approaching, and one that recedes does not
    press. Friction holds, or acts against sliding. All contacts change at once in each sweep, so that their order does
    not matter, by no more than what all together can bear. (O7)
    """
    nothing = 0.0 * v[0]
    for j in range(count):
        for q in range(row.ALONG, row.CHANGE_ACROSS + 1):
            table[row.FIELDS * j + q] = nothing
    settled = where((1.0 + nothing) + SETTLED > 1.0, SETTLED, COARSE)
    goes_on = nothing < 1.0  # a robot of a batch stops where it would stop alone
    for sweep in range(SWEEPS):
        share, momentum = _SHARES[0] if sweep < _LATER else _SHARES[1] if sweep < _LAST else _SHARES[2]
        changing, after = nothing > 1.0, v
        for j in range(count):
            one, at = contact_of(table, j), row.FIELDS * j
            acts = goes_on & (table[at + row.TOUCHES] > 0.5)
            along, across = table[at + row.ALONG], table[at + row.ACROSS]
            kept = momentum * table[at + row.CHANGE_ALONG]
            j_n = along + kept - share * dot(one.n, v) / table[at + row.SCALE_ALONG]
            j_n = clip(j_n, table[at + row.LEAST], table[at + row.MOST])
            limit = friction * j_n
            kept = momentum * table[at + row.CHANGE_ACROSS]
            j_t = clip(across + kept - share * dot(one.t, v) / table[at + row.SCALE_ACROSS], -limit, limit)
            d_n, d_t = where(acts, j_n - along, nothing), where(acts, j_t - across, nothing)
            table[at + row.ALONG], table[at + row.CHANGE_ALONG] = along + d_n, d_n
            table[at + row.ACROSS], table[at + row.CHANGE_ACROSS] = across + d_t, d_t
            after = add_impulses(after, d_n, one.m_n, d_t, one.m_t)
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
        along, across = table[row.FIELDS * j + row.ALONG], table[row.FIELDS * j + row.ACROSS]
        x, y, z = add_impulses((x, y, z), along, one.n, across, one.t)
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
        one, before = contact_of(table, j), table[row.FIELDS * j + row.BEFORE]
        w = Mobility(dot(one.n, one.m_n), dot(one.n, one.m_t), dot(one.t, one.m_t))
        j_n, j_t = impact(before, dot(one.t, v), w, restitution, obstacles.friction, obstacles.law)
        acts = before < -STILL
        after = each(where, (acts,), add_impulses(v, j_n, one.m_n, j_t, one.m_t), after)
        wrench = each(where, (acts,), add_impulses((nothing, nothing, nothing), j_n, one.n, j_t, one.t), wrench)
        normal = where(acts, j_n, normal)
    approaches = nothing > 1.0
    for j in range(count):
        touches = table[row.FIELDS * j + row.TOUCHES] > 0.5
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
            at = row.FIELDS * j
            pressed = share * table[at + row.LEAST] if stage == 2 else table[at + row.ALONG]
            table[at + row.LEAST] = nothing if stage == 0 else pressed
            table[at + row.MOST] = _HUGE + nothing if stage == 0 else pressed
        reached = settle(compressed, table, count, friction)
        push, along = sum_of(table, count, nothing)
        gained = nothing
        for j in range(count):
            n = contact_of(table, j).n
            gained = gained + 0.5 * (dot(n, compressed) + dot(n, reached)) * table[row.FIELDS * j + row.ALONG]
        if stage == 0:
            lost = maximum(0.5 * (dot(v, multiply(m, v)) - dot(reached, multiply(m, reached))), nothing)
            work = clip(-gained, nothing, lost)
            compressed, wrench, normal = reached, push, along
            if not anywhere(restitution > 0.0):
                break
        else:
            share = where(gained > 0.0, restitution * sqrt(work / maximum(gained, _TINY)), restitution)
            extra, more = push, along
    step = subtract(reached, compressed)
    half, square = dot(step, multiply(m, compressed)), dot(step, multiply(m, step))
    room = half + sqrt(half * half + 2.0 * lost * square)
    kept = minimum(2.0 * lost / maximum(room, _TINY), 1.0)  # (O9): as much of the step as the energy allows
    return Blow(shift(kept, compressed, step), shift(kept, wrench, extra), normal + kept * more)


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
            at = row.FIELDS * j
            table[at + row.BEFORE] = where(table[at + row.TOUCHES] > 0.5, dot(contact_of(table, j).n, v), nothing)
            active = active + where(table[at + row.BEFORE] < -STILL, 1.0 + nothing, nothing)
            fastest = minimum(table[at + row.BEFORE], fastest)
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
            at = row.FIELDS * j
            strength = where(jointly, _TINY + table[at + row.ALONG], 1.0)
            weight = where(table[at + row.BEFORE] < -RESTING, strength, nothing)
            at_x, at_y = at_x + weight * table[at + row.POINT], at_y + weight * table[at + row.POINT + 1]
            weights = weights + weight
        strikes = weights > 0.0
        total = where(strikes, weights, 1.0 + nothing)
        point = (where(strikes, at_x / total, point[0]), where(strikes, at_y / total, point[1]))
        struck = where(strikes, 1.0 + nothing, struck)
        v = each(where, (acts,), blow.after, v)
        wrench = add(wrench, each(where, (acts,), blow.wrench, (nothing, nothing, nothing)))
        normal = normal + where(acts, blow.normal, nothing)
    return v, Pressure(wrench, normal, point, struck)


def hold(
    v: Vector, state: State, heading: Direction, m: Symmetric, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[Vector, Scalar]:
    """Impulses of lasting contacts on a robot that would else reach the twist v: wrench in B, and their normal sum.

    v and the impulses are taken in the directions of `heading`. Contacts that approach faster than RESTING in `state`
    are left alone. (O10)
    """
    nothing = 0.0 * v[0]
    table, count = gather(state, heading, m, hull, obstacles, first, end)
    for j in range(count):
        lasts = dot(contact_of(table, j).n, state.twist) > -RESTING
        table[row.FIELDS * j + row.TOUCHES] = where(lasts, table[row.FIELDS * j + row.TOUCHES], nothing)
        table[row.FIELDS * j + row.LEAST], table[row.FIELDS * j + row.MOST] = nothing, _HUGE + nothing
    settle(v, table, count, obstacles.friction)
    return sum_of(table, count, nothing)
