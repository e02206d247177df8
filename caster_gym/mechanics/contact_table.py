"""A table of all places where a robot may touch obstacles, for compiled code.

A contact is a row of FIELDS numbers; a table is flat memory of any kind of scalar, see `scalars.memory`.
"""

from typing import Any, NamedTuple

from caster_gym.mechanics.impulse import contact_rows
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.linear import dot, solve
from caster_gym.mechanics.scalars import Direction, Scalar, Symmetric, Vector, absolute, anywhere, memory, where
from caster_gym.mechanics.separation import TOUCH, Hull, Obstacles, contact_points, separation

FIELDS = 24  # of a contact: its rows, then
POINT, TOUCHES, BEFORE = 12, 14, 15  # place in B [m], 1 or 0, speed along the normal before the impulses [m/s]
LEAST, MOST = 16, 17  # bounds of its normal impulse [N s]
ALONG, ACROSS, CHANGE_ALONG, CHANGE_ACROSS = 18, 19, 20, 21  # impulses, and how the last sweep changed them [N s]
SCALE_ALONG, SCALE_ACROSS = 22, 23  # bounds for the speeds [m/s] that all impulses of 1 N s give it together

_SAME = 1e-9  # [m] contacts that are nearer are one


class Contact(NamedTuple):
    """One point where the robot may touch an obstacle: N and T, and what a unit of impulse along them changes."""

    n: Vector
    t: Vector
    m_n: Vector
    m_t: Vector


def distance(one: Contact, other: Contact) -> Scalar:
    """How far two contacts are from being the same, in place [m] and direction."""
    far = absolute(one.n[0] - other.n[0]) + absolute(one.n[1] - other.n[1])
    return far + absolute(one.n[2] - other.n[2]) + absolute(one.t[2] - other.t[2])


def gather(
    state: State, heading: Direction, m: Symmetric, hull: Hull, obstacles: Obstacles, first: Any, end: Any
) -> tuple[Any, int]:
    """Both contact points of each obstacle that the robot touches, in the directions of `heading`, and their number.

    A row of FIELDS entries each. Points that are there already, the second of a corner's for instance, are marked as
    not touching, as are those of a batch where another robot touches.
    """
    nothing = 0.0 * state.position[0]
    table = memory(nothing, 2 * FIELDS * (end - first))
    count = 0
    c, s = heading
    for k in range(first, end):
        apart = separation(state.position, state.heading, hull, obstacles, k)
        touching = apart.gap < TOUCH
        if not anywhere(touching):
            continue
        normal = (c * apart.nx + s * apart.ny, c * apart.ny - s * apart.nx)
        points = contact_points(state.position, heading, apart, hull, obstacles, k)
        for i in range(2):
            n, t = contact_rows(points[i], normal)
            m_n, m_t = solve(m, n), solve(m, t)
            at = FIELDS * count
            for q in range(3):
                table[at + q], table[at + 3 + q] = n[q], t[q]
                table[at + 6 + q], table[at + 9 + q] = m_n[q], m_t[q]
            table[at + POINT], table[at + POINT + 1] = points[i]
            table[at + TOUCHES] = where(touching, 1.0 + nothing, nothing)
            count += 1
    for j in range(count):
        for k in range(j):
            apart_by = distance(contact_of(table, j), contact_of(table, k))
            again = (apart_by < _SAME) & (table[FIELDS * k + TOUCHES] > 0.5)
            table[FIELDS * j + TOUCHES] = where(again, nothing, table[FIELDS * j + TOUCHES])
    for j in range(count):
        one, at = contact_of(table, j), FIELDS * j
        along, across = nothing, nothing
        for k in range(count):
            other, there = contact_of(table, k), table[FIELDS * k + TOUCHES]
            along = along + there * (absolute(dot(one.n, other.m_n)) + absolute(dot(one.n, other.m_t)))
            across = across + there * (absolute(dot(one.t, other.m_n)) + absolute(dot(one.t, other.m_t)))
        touches = table[at + TOUCHES] > 0.5
        table[at + SCALE_ALONG] = where(touches, along, 1.0 + nothing)
        table[at + SCALE_ACROSS] = where(touches, across, 1.0 + nothing)
    return table, count


def contact_of(table: Any, j: int) -> Contact:
    """Contact j of a table."""
    at = FIELDS * j
    return Contact(
        (table[at], table[at + 1], table[at + 2]),
        (table[at + 3], table[at + 4], table[at + 5]),
        (table[at + 6], table[at + 7], table[at + 8]),
        (table[at + 9], table[at + 10], table[at + 11]),
    )
