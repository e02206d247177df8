"""Which robots of a block must be stepped with care, because an obstacle may be near.

Each lane keeps its room: a lower bound on the gap to the nearest obstacle. A step that certainly uses up less than the
room is an ordinary one, so that robots in the open keep their speed; only the others measure gaps. Where there are no
obstacles at all, they are None, and the compiler leaves out everything that minds them.
"""

from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.integration import pack_state
from caster_gym.mechanics.scalars import Scalar, Vector, absolute, each, either, where
from caster_gym.mechanics.separation import Hull, Obstacles

CLOSE = 1e-4  # [m] room that a step must leave
_WORTHWHILE = 6.0  # steps whose way the room must last for, before it is measured again


@register_jitable(**INLINE)
def speed_bound(v: Vector, reach: Scalar) -> Scalar:
    """Bound for the speed of every point of the robot. [m/s]"""
    return absolute(v[0]) + absolute(v[1]) + reach * absolute(v[2])


@register_jitable(**INLINE)
def worth_measuring(room: Scalar, v: Vector, h: Scalar, reach: Scalar) -> Any:
    """Whether the room is so short that the true gap should be measured before the coming step."""
    return room < CLOSE + _WORTHWHILE * h * speed_bound(v, reach)


@register_jitable(**INLINE)
def settled(obstacles: Any, room: Any, state: Any, end: Any, h: Any, reach: Any) -> Any:
    """Where a robot is after an ordinary step that would lead to `end`: its packed state, its room, and 1 if it went.

    A robot that may touch something stays where it is, with a room of −1; its step is to be taken with care. The way of
    every point is bounded by the sum of both ends' speeds, twice their mean.
    """
    if obstacles is None:
        return pack_state(end), room, 1.0
    left = room - h * (speed_bound(state.twist, reach) + speed_bound(end.twist, reach))
    risky = left < CLOSE
    stays = each(where, (risky,), pack_state(state), pack_state(end))
    return stays, where(risky, -1.0, left), where(risky, 0.0, 1.0)


@register_jitable(**INLINE)
def reach_of(hull: Any) -> Any:
    """Reach of the hull [m], 0 without one; taken out of it before a loop over lanes, which else is no SIMD loop."""
    if hull is None:
        return 0.0
    return hull.reach


@register_jitable(**INLINE)
def borrowed_hull(hull: Any) -> Any:
    """The hull, if it is needed, with its arrays borrowed."""
    if hull is None:
        return None
    return Hull(borrowed(hull.faces), borrowed(hull.corners), hull.radius, hull.reach)


@register_jitable(**INLINE)
def borrowed_floor(floor: Any) -> Any:
    """The floor, if it is one of finite friction, with its arrays borrowed."""
    return either(floor, _nothing, _borrowed_floor, ())


@register_jitable(**INLINE)
def _nothing() -> None:
    """None."""
    return


@register_jitable(**INLINE)
def _borrowed_floor(floor: Any) -> FloorTable:
    return FloorTable(floor.contact_time, either(floor.patches, _nothing, borrowed, ()))


@register_jitable(**INLINE)
def borrowed_obstacles(obstacles: Any) -> Any:
    """The obstacles, if any, with their arrays borrowed."""
    if obstacles is None:
        return None
    return Obstacles(
        borrowed(obstacles.faces),
        borrowed(obstacles.corners),
        borrowed(obstacles.radii),
        borrowed(obstacles.spans),
        obstacles.restitution,
        obstacles.friction,
        obstacles.law,
    )
