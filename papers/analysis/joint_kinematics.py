"""First and second order kinematics of each caster as a chain from the floor to the platform. docs/analysis.md, J.

A caster's joints are q = (η, θ, δ): yaw of its link over ground, rolling, steering. Arrays have one entry per caster on
the axis N, and the batch of `steering` leads.

    g     inverse Jacobian, rates q̇ from the twist         (..., N, 3, 3)       rows η, θ, δ; columns vx, vy, ω
    G     forward Jacobian, twist from the rates q̇         (..., N, 3, 3)       rows vx, vy, ω; columns η, θ, δ
    H     forward Hessian H[k, j, l] = ∂G[k, j] / ∂q_l     (..., N, 3, 3, 3)    ν̇_k = G q̈ + q̇ᵀ H[k] q̇
    H°    the same of the acceleration of C                (..., N, 3, 3, 3)
    h     inverse Hessian                                  (..., N, 3, 3, 3)    q̈_j = g ν̇ + νᵀ h[j] ν

A twist rate ν̇ is the derivative of the twist's components in B. steering (..., N) are the angles δ [rad]; every
function raises ValueError if it has another last axis or is not finite.
"""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.analysis.checked import finite
from caster_gym.arrays import Array
from caster_gym.mechanics.caster import rate_rows, wheel_centre
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import Direction, each
from caster_gym.robot import Robot

ETA, THETA, DELTA = 0, 1, 2
HEADING = np.array([1.0, 0.0, -1.0])  # ∂β/∂q: the platform turns at ω = η̇ − δ̇
_TURN = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 0.0]])  # ẑ × of a twist's velocity


def inverse_jacobian(robot: Robot, steering: ArrayLike) -> Array:
    """g (..., N, 3, 3): the rates η̇, θ̇, δ̇ of every caster from the twist. It exists at every steering angle."""
    rows = each(rate_rows, (), _directions(robot, steering), robot_parameters(robot).casters)
    return _stack([_stack([_stack(row, -1) for row in of_caster], -2) for of_caster in rows], -3)


def forward_jacobian(robot: Robot, steering: ArrayLike) -> Array:
    """G (..., N, 3, 3): the twist from the rates η̇, θ̇, δ̇ of any one caster; det G = d r."""
    directions = _directions(robot, steering)
    matrix = np.zeros((*np.shape(steering), 3, 3))
    for i, ((c, s), caster) in enumerate(zip(directions, robot_parameters(robot).casters, strict=True)):
        ox, oy = wheel_centre((c, s), caster)
        matrix[..., i, 0, ETA], matrix[..., i, 1, ETA] = oy, -ox  # (J2)
        matrix[..., i, 0, THETA], matrix[..., i, 1, THETA] = caster.radius * c, caster.radius * s  # (J2)
        matrix[..., i, 0, DELTA], matrix[..., i, 1, DELTA] = -caster.y, caster.x  # (J2)
    matrix[..., 2, :] = HEADING  # (J2)
    return matrix


def forward_hessian(robot: Robot, steering: ArrayLike) -> Array:
    """H (..., N, 3, 3, 3), indices k of the twist, j and l of the joints: how G changes, in components of B."""
    directions = _directions(robot, steering)
    hessian = np.zeros((*np.shape(steering), 3, 3, 3))
    for i, ((c, s), caster) in enumerate(zip(directions, robot_parameters(robot).casters, strict=True)):
        ox, oy = wheel_centre((c, s), caster)
        hessian[..., i, 0, ETA, DELTA] = ox - caster.x  # (J5)
        hessian[..., i, 1, ETA, DELTA] = oy - caster.y  # (J5)
        hessian[..., i, 0, THETA, DELTA] = -caster.radius * s  # (J5)
        hessian[..., i, 1, THETA, DELTA] = caster.radius * c  # (J5)
    return hessian


def inertial_hessian(robot: Robot, steering: ArrayLike) -> Array:
    """H° (..., N, 3, 3, 3): as H for the acceleration of C over ground, along the axes of B, and for ω̇."""
    turning = _TURN @ forward_jacobian(robot, steering)
    hessian: Array = forward_hessian(robot, steering) + turning[..., None] * HEADING  # (J6)
    return hessian


def inverse_hessian(robot: Robot, steering: ArrayLike) -> Array:
    """h (..., N, 3, 3, 3), indices j of the joint, m and n of the twist: q̈_j = g_j ν̇ + νᵀ h[j] ν."""
    g, hessian = inverse_jacobian(robot, steering), forward_hessian(robot, steering)
    planes = np.einsum("...jk,...kpq->...jpq", g, hessian)
    turned: Array = -np.swapaxes(g, -1, -2)[..., None, :, :] @ planes @ g[..., None, :, :]  # (J8)
    return turned


def _directions(robot: Robot, steering: ArrayLike) -> tuple[Direction, ...]:
    angles = finite("steering", steering, robot.caster_count)
    return tuple((np.cos(angles[..., i]), np.sin(angles[..., i])) for i in range(robot.caster_count))


def _stack(parts: list[Array] | tuple[Array, ...], axis: int) -> Array:
    return np.stack(np.broadcast_arrays(*parts), axis)
