"""Where a set of driven joints is singular, seen as geometry: their lines of action meet in a point or are parallel.

A motor that turns one joint alone pushes the platform along a line, in B:

    rolling    through the pivot A and the wheel's centre O
    steering   along the wheel's axle, through O

    line       ℓ = (u_x, u_y, m): unit direction u and moment m = O × u about C          [-, -, m]
    L          length that makes moments comparable with forces                          [m]
    gap        how far the lines are from meeting, 0 where they do or are parallel       [-]

This is about joints, and so about motors that turn one joint each; where a gear couples both motors of a caster, it
holds of casters with both or none driven. Source: Kim et al. (2001), III; docs/analysis.md, section L.
"""

from collections.abc import Sequence
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.analysis.checked import finite
from caster_gym.arrays import Array
from caster_gym.design.joint_sets import kind_and_caster, named_joints
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.parameters import CasterParameters, robot_parameters
from caster_gym.robot import Robot

MEETS = 1e-9  # [-] gap up to which lines meet, share of L beyond 1/MEETS of which they are parallel: far above rounding
_UNIT = 1e-6  # [-] by which the directions of given lines may miss unit length
_ONE_LINE = 1e-12  # [-] lines nearer to each other than this are one and the same


class Meeting(NamedTuple):
    """How nearly lines meet in a point or are parallel; batch axes (...) as of the lines."""

    gap: Array  # (...) [-] fastest motion of a line along itself under `twist`; 0 where singular
    twist: Array  # (..., 3) in B with v² + (Lω)² = 1: the motion that the two best-conditioned lines do not feel
    point: Array  # (..., 2) [m] in B, where those two meet, which is the centre of that motion; NaN if parallel
    direction: Array  # (..., 2) unit vector across its velocity at C: along the lines if they are parallel

    @property
    def parallel(self) -> NDArray[np.bool_]:
        """(...) do the two best-conditioned lines not meet?"""
        return np.isnan(self.point[..., 0])

    @property
    def singular(self) -> NDArray[np.bool_]:
        """(...) do all lines meet in the point, or are they all parallel, within `MEETS`?"""
        met: NDArray[np.bool_] = self.gap <= MEETS
        return met


def action_lines(robot: Robot, steering: ArrayLike, joints: str | Sequence[str] = "all") -> Array:
    """Lines of action (..., J, 3) of the named joints at steering angles (..., N) [rad], in the order given.

    Raises ValueError for an unknown joint, and for steering of the wrong last axis or not finite.
    """
    angles = finite("steering", steering, robot.caster_count)
    casters = robot_parameters(robot).casters
    lines = []
    for kind, i in map(kind_and_caster, named_joints(robot, joints)):
        lines.append(_line(kind, angles[..., i], casters[i]))
    return np.stack(lines, axis=-2)


def meeting(lines: ArrayLike, length: float) -> Meeting:
    """Do lines (..., J, 3) all meet in one point or are they all parallel, and how nearly?

    length: L [m], such as `Model.characteristic_length`. Two lines always meet or are parallel, as does one alone.
    The smallest singular value σ of the matrix of the lines, its moments divided by L, is the gap up to a factor:
    gap/√3 ≤ σ ≤ √(J − 2) gap for J ≥ 3 lines. Raises ValueError for lines of another shape, not finite or
    without a direction of unit length, and for a length that is not positive.
    """
    given = np.asarray(lines, dtype=np.float64)
    if given.ndim < 2 or given.shape[-1] != 3 or given.shape[-2] == 0:
        raise ValueError(f"lines must have shape (..., J, 3) with one line or more, got {given.shape}")
    sizes = np.hypot(finite("lines", given, 3)[..., 0], given[..., 1])
    if (np.abs(sizes - 1.0) > _UNIT).any():
        worst = sizes.flat[np.abs(sizes - 1.0).argmax()]
        raise ValueError(f"lines must begin with unit vectors, got one of length {worst:g}")
    if not (np.isfinite(length) and length > 0.0):
        raise ValueError(f"length must be positive and finite, got {length}")
    scaled = given / (1.0, 1.0, length)
    first, second = np.array(list(combinations_with_replacement(range(given.shape[-2]), 2))).T
    crossings = np.cross(scaled[..., first, :], scaled[..., second, :])  # homogeneous points, one for each pair
    sizes = np.linalg.norm(crossings, axis=-1)
    best = sizes.argmax(axis=-1)[..., None]
    size = np.take_along_axis(sizes, best, axis=-1)
    crossing = np.take_along_axis(crossings, best[..., None], axis=-2)[..., 0, :]
    across = np.stack([-scaled[..., 0, 1], scaled[..., 0, 0], np.zeros(scaled.shape[:-2])], axis=-1)
    motion = np.where(size > _ONE_LINE, crossing / np.maximum(size, _ONE_LINE), across)
    gap = np.abs(scaled @ motion[..., None])[..., 0].max(axis=-1)  # (L4)
    vx, vy, turning = motion[..., 0], motion[..., 1], motion[..., 2]  # turning is L ω
    with np.errstate(divide="ignore", invalid="ignore"):
        point = np.where(np.abs(turning)[..., None] > MEETS, np.stack([-vy, vx], axis=-1) * length, np.nan)
        point = point / turning[..., None]  # (L3): v vanishes at the centre of rotation
        direction = np.stack([vy, -vx], axis=-1) / np.hypot(vx, vy)[..., None]
    return Meeting(gap, motion / (1.0, 1.0, length), point, direction)


def smallest_singular_value(robot: Robot, steering: ArrayLike, joints: str | Sequence[str] = "all") -> Array:
    """σ_min (...) of the joints' rows of the Jacobian, each scaled to a unit line, moments divided by L. [-]

    Zero where the joints cannot push in some direction, and for fewer than three joints.
    """
    model = Model(robot)
    rows = model.jacobian(steering, named_joints(robot, joints))
    lines = rows / np.linalg.norm(rows[..., :2], axis=-1, keepdims=True)
    if lines.shape[-2] < 3:
        return np.zeros(lines.shape[:-2])
    values: Array = np.linalg.svd(lines / (1.0, 1.0, model.characteristic_length), compute_uv=False)
    return values[..., -1]


def _line(kind: str, angle: Array, caster: CasterParameters) -> Array:
    f = (np.cos(angle), np.sin(angle))
    o_x, o_y = wheel_centre(f, caster)
    if kind == "roll":
        to_pivot = np.stack([caster.x - o_x, caster.y - o_y], axis=-1)
        u = to_pivot / np.linalg.norm(to_pivot, axis=-1, keepdims=True)  # (L1)
    else:
        u = np.stack([-f[1], f[0]], axis=-1)  # (L2)
    return np.concatenate([u, (o_x * u[..., 1] - o_y * u[..., 0])[..., None]], axis=-1)
