"""Gaps between the robot and every obstacle, for whole arrays of poses."""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arena.arena import Arena
from caster_gym.arena.packing import hull_of, pack
from caster_gym.arrays import Array
from caster_gym.mechanics.separation import Hull, Obstacles, separation
from caster_gym.robot import Robot

ROUNDING = 1e-9  # [m] of gaps, on any floor


def distances(arena: Arena, robot: Robot, pose: ArrayLike) -> tuple[Array, Array]:
    """Gaps (..., K) [m] and unit normals (..., K, 2) from each obstacle to the robot, in W.

    pose (..., 3) holds x, y [m] and the heading β [rad]. The gap is negative where robot and obstacle overlap. The K
    obstacles are in the order of `arena.obstacles`.
    """
    poses = np.asarray(pose, dtype=np.float64)
    if poses.ndim == 0 or poses.shape[-1] != 3:
        raise ValueError(f"pose must have shape (..., 3), got {poses.shape}")
    if not np.isfinite(poses).all():
        raise ValueError(f"pose must be finite, got {poses[~np.isfinite(poses)][0]}")
    heading = poses[..., 2:]
    obstacles, _ = pack([arena])
    return separations(
        hull_of(robot), obstacles, np.concatenate([poses[..., :2], np.cos(heading), np.sin(heading)], -1)
    )


def separations(hull: Hull, obstacles: Obstacles, poses: Array) -> tuple[Array, Array]:
    """Gaps (..., K) [m] and unit normals (..., K, 2) at poses (..., 4) x, y [m], cos β, sin β."""
    x, y, c, s = (poses[..., i].reshape(-1) for i in range(4))
    table = np.empty((x.size, len(obstacles.spans), 3))
    for k in range(len(obstacles.spans)):
        apart = separation((x, y), (c, s), hull, obstacles, k)
        for column, part in enumerate(apart):
            table[:, k, column] = part
    table = table.reshape(*poses.shape[:-1], -1, 3) if table.size else np.empty((*poses.shape[:-1], table.shape[1], 3))
    return table[..., 0], table[..., 1:]
