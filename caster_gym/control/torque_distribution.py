"""Which torques of the driven motors give a wanted wrench: least squares within the motors' limits.

    u       motor torques as shares of their greatest             [-]
    B       wrench at C of each motor at its greatest torque, moments divided by a length L    [N]
    F       wanted wrench, its moment divided by L                 [N]

minimise |B u − F|² + λ |u|² subject to low <= u <= high. Without active limits this is the damped pseudo-inverse,
solved for all robots at once; the others are quadratic programs of daqp (Arnström, Bemporad and Axehill, IEEE
Transactions on Automatic Control 67, 2022).
"""

from typing import Any

import daqp
import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
WELL_CONDITIONED = 0.05  # σ_min / σ_max of B below which damping sets in
STRONGEST_DAMPING = 0.02  # of σ_max, at a singular configuration
REGULARISATION = 1e-5  # of σ_max, always: it picks the smallest of equally good torques


def distribute(b: Array, wrench: Array, low: Array, high: Array) -> Array:
    """Torque shares u (robots, motors) for B (robots, 3, motors), F (robots, 3) and limits (robots, motors)."""
    damping = damping_of(b)
    gram = b @ b.mT + damping[:, None, None] * np.eye(3)
    free = (b.mT @ np.linalg.solve(gram, wrench[..., None]))[..., 0]
    shares: Array = np.clip(free, low, high)
    for robot in np.flatnonzero(np.any(shares != free, axis=1)):
        shares[robot] = bounded_least_squares(b[robot], wrench[robot], low[robot], high[robot], damping[robot])
    return shares


def damping_of(b: Array) -> Array:
    """λ (robots,): grows as B comes near a singular configuration (Nakamura and Hanafusa, ASME JDSMC 108, 1986)."""
    singular = np.linalg.svd(b, compute_uv=False)
    greatest = np.maximum(singular[:, 0], 1e-12)
    nearness = 1.0 - np.minimum(singular[:, -1] / greatest / WELL_CONDITIONED, 1.0)
    damping: Array = ((STRONGEST_DAMPING * nearness) ** 2 + REGULARISATION**2) * greatest**2
    return damping


def bounded_least_squares(b: Array, wrench: Array, low: Array, high: Array, damping: float) -> Array:
    """u of one robot. Raises RuntimeError if the solver fails, which a strictly convex problem does not let it do."""
    scale = float(np.abs(b).max()) ** 2 or 1.0
    hessian = (b.T @ b + damping * np.eye(b.shape[1])) / scale
    gradient = -(b.T @ wrench) / scale
    nothing: Any = np.zeros((0, b.shape[1]))
    low, high = np.ascontiguousarray(low), np.ascontiguousarray(np.maximum(high, low))  # daqp does not read strides
    shares, _, status, _ = daqp.solve(hessian, gradient, nothing, high, low)
    if status < 1:
        raise RuntimeError(f"torque distribution failed with daqp status {status} for a wrench of {wrench}")
    return np.clip(np.asarray(shares, dtype=np.float64), low, high)
