"""How hard the robot hits a wall, by the direction in which it moves. Derivation: docs/analysis.md, section U.

A robot that moves without turning runs a point P of its body head-on into a frictionless wall. What answers is the
effective mass of P in that direction; its curve over all directions tells how the wheels shape an impact.

    steering    angles δ of the casters                                            [rad]    (..., N)
    direction   of the motion, against the body x-axis                             [rad]    () or (K,)
    point       P in B; C by default                                               [m]      (2,)
    W           contact mobility of P: its velocity per unit of impulse at it      [1/kg]   (..., 2, 2)
    Λ           effective mass of P in a direction                                 [kg]     (...) or (..., K)
    ε           elongation: |ε| is 0 for a circle and nears 1 for a needle; half
                its argument is the direction of the greatest Λ                    [-]      (...), complex

Axes are told in [0, π): a direction and its opposite are hit alike.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.dynamics import caster_inertia
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import each
from caster_gym.robot import Robot

ComplexArray = NDArray[np.complex128]

CENTRE = (0.0, 0.0)  # C, in B


class Extremes(NamedTuple):
    """The least and the greatest effective mass [kg] over all directions, and the axes [rad] along which they stand."""

    least: Array
    greatest: Array
    along_least: Array
    along_greatest: Array

    @property
    def ratio(self) -> Array:
        """Greatest over least, 1 for a circle. [-]"""
        return np.asarray(self.greatest / self.least)


def contact_mobility(model: Model, steering: ArrayLike, point: ArrayLike = CENTRE) -> Array:
    """W (..., 2, 2) of a point [1/kg], while the wheels roll on without slip."""
    x, y = _point(point)
    rows = np.array([[1.0, 0.0, -y], [0.0, 1.0, x]])  # velocity of the point from the twist
    w: Array = rows @ np.linalg.solve(model.inertia(steering), rows.T)  # (U1)
    return w


def effective_mass(model: Model, steering: ArrayLike, direction: ArrayLike, point: ArrayLike = CENTRE) -> Array:
    """Λ [kg] of a point in a direction or in K of them: (...) or (..., K)."""
    angle = np.asarray(direction, dtype=np.float64)
    if angle.ndim > 1 or not np.isfinite(angle).all():
        raise ValueError(f"direction must be a finite angle in rad or a list of them, got {direction!r}")
    n = np.stack((np.cos(angle), np.sin(angle)), -1)
    w = contact_mobility(model, steering, point)
    quadratic = np.einsum("...ij,ki,kj->...k", w, np.atleast_2d(n), np.atleast_2d(n))
    masses = 1.0 / quadratic  # (U2)
    return np.asarray(masses[..., 0] if angle.ndim == 0 else masses)


def impulse(
    model: Model,
    steering: ArrayLike,
    direction: ArrayLike,
    restitution: float,
    speed: float = 1.0,
    point: ArrayLike = CENTRE,
) -> Array:
    """Size of the impulse [N s] from a wall across the direction that is hit at a speed [m/s]: (...) or (..., K).

    Raises ValueError for a restitution outside 0 … 1 and for a speed that is negative or not finite.
    """
    e = _restitution(restitution)
    if not (np.isfinite(speed) and speed >= 0.0):
        raise ValueError(f"speed must be finite and not negative, got {speed!r}")
    return np.asarray((1.0 + e) * speed * effective_mass(model, steering, direction, point))  # (U2)


def extremes(model: Model, steering: ArrayLike, point: ArrayLike = CENTRE) -> Extremes:
    """Least and greatest effective mass and their axes, each (...); the axes of a circle mean nothing."""
    w = contact_mobility(model, steering, point)
    mean, half = _mean(w), _anisotropy(w)
    size, axis = np.abs(half), 0.5 * np.angle(half)  # (U3)
    turn = 0.5 * np.pi
    return Extremes(1.0 / (mean + size), 1.0 / (mean - size), axis % np.pi, (axis + turn) % np.pi)


def elongation(model: Model, steering: ArrayLike, point: ArrayLike = CENTRE) -> ComplexArray:
    """ε (...): |ε| = (ratio − 1)/(ratio + 1), arg ε / 2 is the direction of the greatest effective mass."""
    w = contact_mobility(model, steering, point)
    return np.asarray(-_anisotropy(w) / _mean(w))  # (U3)


def ellipse_gap(ratio: ArrayLike) -> Array:
    """By what share the curve of Λ bulges, where it does most, over the ellipse with its half axes. [-]"""
    rho = np.asarray(ratio, dtype=np.float64)
    if not (rho > 0.0).all():
        raise ValueError(f"ratio must be positive, got {ratio!r}")
    return np.asarray((rho + 1.0) / (2.0 * np.sqrt(rho)) - 1.0)  # (U4)


def anisotropy(model: Model, steering: ArrayLike) -> tuple[ComplexArray, ComplexArray]:
    """What elongates the curve at C [kg], each (...): the casters directly, and the coupling of M with the yaw.

    The curve is a circle where both add up to zero.
    """
    m = model.inertia(steering)
    towards_yaw = m[..., 0, 2] + 1j * m[..., 1, 2]
    return _anisotropy(m[..., :2, :2]), np.asarray(-0.5 * towards_yaw**2 / m[..., 2, 2])  # (U5)


def caster_weights(robot: Robot) -> ComplexArray:
    """k_i (N,) [kg]: what each caster adds to the direct part is k_i exp(2i δ_i). Real and positive: heavy along f."""
    parts = each(caster_inertia, (), ((1.0, 0.0),) * robot.caster_count, robot_parameters(robot).casters)
    return np.array([0.5 * (xx - yy) + 1j * xy for xx, xy, _, yy, _, _ in parts])  # (U6)


def loss_share(model: Model, steering: ArrayLike, direction: ArrayLike, restitution: float) -> Array:
    """Share of the kinetic energy that a wall takes of the robot in a head-on impact at C, (...) or (..., K)."""
    e = _restitution(restitution)
    mass = effective_mass(model, steering, direction)
    angle = np.asarray(direction, dtype=np.float64)
    n = np.atleast_2d(np.stack((np.cos(angle), np.sin(angle)), -1))
    carried = np.einsum("...ij,ki,kj->...k", model.inertia(steering)[..., :2, :2], n, n)
    return np.asarray((1.0 - e * e) * mass / (carried[..., 0] if angle.ndim == 0 else carried))  # (U8)


def _mean(matrix: Array) -> Array:
    """Mean of the eigenvalues of symmetric 2×2 matrices."""
    return np.asarray(0.5 * (matrix[..., 0, 0] + matrix[..., 1, 1]))


def _anisotropy(matrix: Array) -> ComplexArray:
    """Half the difference of the eigenvalues, at twice the angle of the greater one's axis."""
    return np.asarray(0.5 * (matrix[..., 0, 0] - matrix[..., 1, 1]) + 1j * matrix[..., 0, 1])


def _point(point: ArrayLike) -> tuple[float, float]:
    p = np.asarray(point, dtype=np.float64)
    if p.shape != (2,) or not np.isfinite(p).all():
        raise ValueError(f"point must be two finite coordinates x, y [m], got {point!r}")
    return float(p[0]), float(p[1])


def _restitution(restitution: float) -> float:
    if not 0.0 <= restitution <= 1.0:
        raise ValueError(f"restitution must lie in 0 … 1, got {restitution!r}")
    return restitution
