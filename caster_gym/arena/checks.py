"""Whether a path is free of obstacles."""

from collections.abc import Callable

import numpy as np

from caster_gym.arena.arena import Arena, HalfPlane
from caster_gym.arena.clearance import ROUNDING, separations
from caster_gym.arena.packing import pack
from caster_gym.arrays import Array
from caster_gym.mechanics.separation import Hull


def check_free(
    arena: Arena,
    hull: Hull,
    poses: Array,
    name: str,
    start_margin: float = 0.0,
    where: Callable[[int], str] = "at pose {}".format,
) -> None:
    """Refuse an arena that is in the way of a path, or of its start.

    poses (K, 4) of the path: x, y [m], cos β, sin β. start_margin [m] is how far any point of the robot may be
    displaced when it starts; where(k) says in words where pose k is along the path. Raises ValueError that names the
    path, the obstacle, the place and the gap.
    """
    if not arena.obstacles:
        return
    gaps, _ = separations(hull, pack([arena])[0], poses)
    k, nearest = np.unravel_index(gaps.argmin(), gaps.shape)
    obstacle, shape = arena.obstacles[nearest]
    if gaps[k, nearest] < -ROUNDING:
        fault = "leaves the arena through" if isinstance(shape, HalfPlane) else "runs into"
        raise ValueError(
            f"path {name!r} {fault} {obstacle}: {where(int(k))}, at ({poses[k, 0]:.3f}, {poses[k, 1]:.3f}) m, "
            f"the robot overlaps it by {-gaps[k, nearest]:.3g} m"
        )
    nearest = gaps[0].argmin()
    if gaps[0, nearest] < start_margin - ROUNDING:
        raise ValueError(
            f"path {name!r} starts too near to {arena.obstacles[nearest][0]}: the gap is {gaps[0, nearest]:.3g} m, and "
            f"{start_margin:.3g} m are needed for the displacements of the start; move the obstacle, or lower "
            f"start_offset and start_turn"
        )
