"""Can the driven motors push the robot whatever its casters' angles? Their worst conditioning says so. (A1)

The equations of motion never become singular, but a set of driven joints can. A driven rolling joint pushes along the
line through its pivot and its wheel's centre, a driven steering joint along the wheel's axle: where all these lines
meet in a point or are parallel, no motor pushes in some direction. Kim et al. (2001), III; docs/equations.md, A.
"""

import warnings
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot

SINGULAR = 0.01  # [-] below it the weakest push is less than a hundredth of the strongest, too weak to steer by
DEGREES_OF_FREEDOM = 3

_SAMPLES = (16, 512)  # batches × samples: the best of each batch starts a descent, lest all start in one basin
_DESCENT: Any = {"gtol": 1e-6, "maxiter": 50}  # of BFGS: L-BFGS-B spins in threaded BLAS, 10 s on a busy machine
_ZERO = 1e-7  # [-] conditioning is the root of an eigenvalue, so rounding alone makes 1e-8; nothing lies below zero
_DIFFERENCE = 1e-6  # [rad] of central differences; conditioning² is smooth at its zeros, where conditioning has a kink


class ActuationWarning(UserWarning):
    """The driven joints cannot push the robot in some direction at some steering angles."""


@lru_cache(maxsize=128)
def worst_conditioning(robot: Robot) -> tuple[float, tuple[float, ...]]:
    """Least conditioning σ_min/σ_max of the driven motors over all steering angles, and angles (N) where it stands.

    Angles in rad, in (−π, π]. The search is global by sampling and local by descent, with fixed seeds: the value is
    attained at the angles, and another search may find a slightly lower one. Zeros come out as rounding, about 1e-8.
    """
    from scipy.optimize import minimize

    model = Model(robot)
    samples = np.random.default_rng(0).uniform(-np.pi, np.pi, (*_SAMPLES, robot.caster_count))
    values = model.conditioning(samples)
    starts = samples[np.arange(len(samples)), values.argmin(axis=1)]
    scale = max(float(values.min()) ** 2, 1e-12)  # makes the objective of order 1, where the tolerances mean something

    def squared(steering: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
        steps = _DIFFERENCE * np.eye(len(steering))
        around = model.conditioning(np.concatenate(([steering], steering + steps, steering - steps))) ** 2 / scale
        forward, backward = np.split(around[1:], 2)
        return float(around[0]), (forward - backward) / (2.0 * _DIFFERENCE)

    least, worst = float("inf"), starts[0]
    for start in starts[values.min(axis=1).argsort()]:
        end = minimize(squared, start, jac=True, method="BFGS", options=_DESCENT).x
        value = abs(float(model.conditioning(end)))
        if value < least:
            least, worst = value, end
        if least < _ZERO:
            break
    return least, tuple(float(np.pi - (np.pi - angle) % (2.0 * np.pi)) for angle in worst)


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
