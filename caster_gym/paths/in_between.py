"""Motions between two moments with known position, velocity and acceleration.

The place is the quintic that has all three at both ends. The velocity is the cubic that has its own and the
accelerations, so that places which do not quite agree with velocities change neither. The acceleration is that of the
cubic, a parabola; but tables whose accelerations jump, as plans of constant accelerations have them, are followed by no
parabola: it would swing beyond them by half of the jump. There accelerations go straight from one moment to the next.

    room     by how much an acceleration may leave that straight line in the middle, as its neighbours bend
"""

import numpy as np

from caster_gym.arrays import Array

_BENT = 1.5 / 8.0  # [-] a parabola leaves the line by 1/8 of the second difference; half as much more if that changes


def motion_between(
    start: tuple[Array, Array, Array], end: tuple[Array, Array, Array], time: Array, share: Array, room: Array
) -> tuple[Array, Array, Array]:
    """Place, velocity and acceleration at shares 0 … 1 of a time [s] between the same three at both ends."""
    (p, v, a), (p_end, v_end, a_end) = start, end
    first, last, more, u = time**2 * a, time**2 * a_end, time * (v_end - v), share
    lack, v_lack, a_lack = p_end - p - time * v - 0.5 * first, more - first, last - first
    c3 = 10.0 * lack - 4.0 * v_lack + 0.5 * a_lack
    c4 = -15.0 * lack + 7.0 * v_lack - a_lack
    c5 = 6.0 * lack - 3.0 * v_lack + 0.5 * a_lack
    place = p + u * (time * v + u * (0.5 * first + u * (c3 + u * (c4 + u * c5))))
    bent = 6.0 * (v_end - v) / time - 3.0 * (a + a_end)  # of the parabola, which leaves the line by bent · u (1 − u)
    velocity = v + time * u * (a + u * (0.5 * (a_end - a + bent) - u * bent / 3.0))
    return place, velocity, a + u * (a_end - a) + u * (1.0 - u) * np.clip(bent, -4.0 * room, 4.0 * room)


def room_for(first: Array, last: Array) -> Array:
    """Room between two accelerations with second differences there: none where they bend in different senses."""
    room: Array = _BENT * np.where(first * last > 0.0, np.minimum(np.abs(first), np.abs(last)), 0.0)
    return room
