"""Can the driven motors push the robot whatever its casters' angles? Their worst conditioning says so. (A1)

The equations of motion never become singular, but a set of driven joints can. A driven rolling joint pushes along the
line through its pivot and its wheel's centre, a driven steering joint along the wheel's axle: where all these lines
meet in a point or are parallel, no motor pushes in some direction. Kim et al. (2001), III; docs/equations.md, A.
"""

import warnings
from collections.abc import Callable
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot

SINGULAR = 0.01  # [-] below it the weakest push is less than a hundredth of the strongest, too weak to steer by
DEGREES_OF_FREEDOM = 3

_SAMPLES = (16, 512)  # batches × samples: the best of each batch starts a descent, lest all start in one basin
_ROUNDS = 40  # Newton steps; most searches need ten
_ZERO = 1e-7  # [-] conditioning is the root of an eigenvalue, so rounding alone makes 1e-8; nothing lies below zero
_DIFFERENCE = 1e-4  # [rad] of differences of conditioning², which is smooth at its zeros, where conditioning has a kink

Array = NDArray[np.float64]


class ActuationWarning(UserWarning):
    """The driven joints cannot push the robot in some direction at some steering angles."""


@lru_cache(maxsize=128)
def worst_conditioning(robot: Robot) -> tuple[float, tuple[float, ...]]:
    """Least conditioning σ_min/σ_max of the driven motors over all steering angles, and angles (N) where it stands.

    Angles in rad, in (−π, π]. The search is global by sampling and local by descent, with fixed seeds: the value is
    attained at the angles, and another search may find a slightly lower one. Zeros come out as rounding, about 1e-8.
    """
    model = Model(robot)
    samples = np.random.default_rng(0).uniform(-np.pi, np.pi, (*_SAMPLES, robot.caster_count))
    starts = samples[np.arange(len(samples)), model.conditioning(samples).argmin(axis=1)]
    ends = _descend(starts, lambda steering: model.conditioning(steering) ** 2)
    values = model.conditioning(ends)
    steering = ends[values.argmin()]
    return float(values.min()), tuple(float(np.pi - (np.pi - angle) % (2.0 * np.pi)) for angle in steering)


def _descend(points: Array, function: Callable[[Array], Array]) -> Array:
    """Points (P, n) moved downhill by damped Newton steps on differences, until one is at zero or all are at rest."""
    n = points.shape[1]
    axes = _DIFFERENCE * np.eye(n)
    pairs = (axes[:, None] + axes).reshape(-1, n)
    stencil = np.concatenate((np.zeros((1, n)), axes, -axes, pairs, -pairs))
    damping = np.full(len(points), 1e-3)  # [-] of the greatest curvature
    for _ in range(_ROUNDS):
        value, plus, minus, both_plus, both_minus = np.split(
            function(points[:, None] + stencil), np.cumsum([1, n, n, n * n]), axis=1
        )
        gradient = (plus - minus) / (2.0 * _DIFFERENCE)
        single, both = plus + minus, (both_plus + both_minus).reshape(-1, n, n)
        hessian = (both - single[:, :, None] - single[:, None, :] + 2.0 * value[:, :, None]) / (2.0 * _DIFFERENCE**2)
        curvatures, directions = np.linalg.eigh(hessian)
        stiffness = np.abs(curvatures) + damping[:, None] * np.abs(curvatures).max(axis=1, keepdims=True) + 1e-300
        steps = -np.einsum("pij,pj,pkj,pk->pi", directions, 1.0 / stiffness, directions, gradient)
        lower = function(points + steps) < value[:, 0]
        points = np.where(lower[:, None], points + steps, points)
        damping = np.where(lower, 0.1, 10.0) * damping
        if value.min() < _ZERO**2 or (damping > 1e6).all():
            break
    return points


def warn_if_singular(robot: Robot) -> None:
    """Warn with an `ActuationWarning` if the driven joints cannot push the robot at some steering angles.

    "Cannot" is a worst conditioning below `SINGULAR`; fewer than three driven joints never can.
    """
    names = ", ".join(robot.driven)
    if len(robot.driven) < DEGREES_OF_FREEDOM:
        warnings.warn(
            f"robot {robot.name!r} is driven by {names} alone: fewer than three joints cannot push a platform in all "
            f"its three degrees of freedom, at any steering angles",
            ActuationWarning,
            stacklevel=2,
        )
        return
    value, steering = worst_conditioning(robot)
    if value < SINGULAR:
        angles = ", ".join(f"{np.degrees(angle):.1f}°" for angle in steering)
        warnings.warn(
            f"robot {robot.name!r} driven by {names} cannot push itself in every direction: its conditioning falls to "
            f"{value:.2g} (1 is isotropic, 0 singular), for instance at the steering angles ({angles})",
            ActuationWarning,
            stacklevel=2,
        )
