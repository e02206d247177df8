"""Whether the driven motors can push the robot at any casters' angles: their worst conditioning. (A1)

The equations of motion never become singular, but a set of driven joints can. A driven rolling joint pushes along the
line through its pivot and its wheel's centre, a driven steering joint along the wheel's axle: where all these lines
meet in a point or are parallel, no motor pushes in some direction. Kim et al. (2001), III; docs/equations.md, A.
"""

import warnings
from collections.abc import Callable
from functools import lru_cache

import numpy as np

from caster_gym.analysis.frames import wrap_angle
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot

SINGULAR = 0.01  # [-] below it the weakest push is less than a hundredth of the strongest, too weak to steer by
DEGREES_OF_FREEDOM = 3

_SAMPLES = (16, 512)  # batches × samples: the best of each batch starts a descent, lest all start in one basin
_STEPS = 40  # of a descent; near its end each doubles the digits
_ZERO = 1e-16  # [-] of conditioning², where rounding alone may lead; nothing lies below zero
_HOPELESS = 1e6  # [-] damping so strong that steps cannot lead down any more
_DIFFERENCE = 1e-4  # [rad] of differences; conditioning² is smooth at its zeros, where conditioning has a kink


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
    ends = _descended(lambda steering: np.square(model.conditioning(steering)), starts)
    values = model.conditioning(ends)
    worst = wrap_angle(ends[values.argmin()])
    return float(values.min()), tuple(worst.tolist())


def _descended(function: Callable[[Array], Array], points: Array) -> Array:
    """Where Newton's damped steps lead from all points (P, N) at once, never upwards, until one of them is at zero.

    The derivatives are differences. (SciPy's minimisers would do, one point after the other; but they take longer to
    import than an environment to make its first step, and every new environment searches.)
    """
    values, damping = function(points), np.ones(len(points))
    for _ in range(_STEPS):
        gradients, curvatures = _differences(function, points)
        slopes, axes = np.linalg.eigh(curvatures)
        along = np.einsum("pij,pi->pj", axes, gradients) / (np.abs(slopes) + damping[:, None] + _DIFFERENCE**2)
        tried = points - np.einsum("pij,pj->pi", axes, along)
        reached = function(tried)
        better = reached < values
        points, values = np.where(better[:, None], tried, points), np.where(better, reached, values)
        damping *= np.where(better, 0.1, 10.0)
        if values.min() < _ZERO or damping.min() > _HOPELESS:
            break
    return points


def _differences(function: Callable[[Array], Array], points: Array) -> tuple[Array, Array]:
    """Gradients (P, N) and second derivatives (P, N, N) of a function of points (P, N)."""
    step = _DIFFERENCE * np.eye(points.shape[1])
    ahead, behind = function(points[:, None] + step), function(points[:, None] - step)
    i, j = step[:, None], step  # both of them at once
    here = points[:, None, None]
    rising = function(here + i + j) - function(here + i - j) - function(here - i + j) + function(here - i - j)
    return (ahead - behind) / (2.0 * _DIFFERENCE), rising / (4.0 * _DIFFERENCE**2)


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
