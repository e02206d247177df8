"""Obstacles and floor as compiled code takes them; None leaves out the code that handles them."""

from typing import Any

from numba.extending import register_jitable

from caster_gym.engines.native.compiler import INLINE, borrowed
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.scalars import either
from caster_gym.mechanics.separation import Hull, Obstacles


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
