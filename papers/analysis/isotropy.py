"""How evenly a set of joints moves the platform at given steering angles. docs/analysis.md, section Q."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.analysis.checked import finite
from caster_gym.arrays import Array
from caster_gym.design.isotropy import positive, three_or_more, tops_of
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import Robot


def isotropy(
    robot: Robot, steering: ArrayLike, joints: Sequence[str], top_twist: ArrayLike, top_rates: ArrayLike
) -> Array:
    """Local index σ_min/σ_max (...) of the normalised Jacobian at steering (..., N) [rad].

    It is the same for the matrix that gives the twist from the rates, the pseudo-inverse. Raises ValueError for unknown
    joints, for fewer than three, and for tops that are not positive.
    """
    names = three_or_more(robot, joints)
    twist, rates = tops_of("top_twist", top_twist, 3), tops_of("top_rates", top_rates, len(names))
    normalised = Model(robot).jacobian(steering, names) * twist / rates.T  # (Q1)
    singular = np.linalg.svd(normalised, compute_uv=False)
    index: Array = singular[..., -1] / singular[..., 0]  # (Q2)
    return index


def balanced_isotropy(
    robot: Robot, steering: ArrayLike, casters: Sequence[int], top_speed: float, top_yaw_rate: float
) -> Array:
    """Local index (...) of both joints of these casters (from 1) if all r θ̇_max and d δ̇_max are the same.

    Then only the places of the wheels' centres matter, not how the wheels stand. steering (..., N) [rad], top_speed
    [m/s] in every direction, top_yaw_rate [rad/s]. Raises ValueError for fewer than two casters, for unknown ones,
    for wheels with a lateral offset, and for steering of the wrong last axis or not finite.
    """
    known = range(1, robot.caster_count + 1)
    if len(set(casters)) < max(2, len(casters)) or any(number not in known for number in casters):
        raise ValueError(f"name two or more different casters from 1 to {robot.caster_count}, got {list(casters)}")
    if any(robot.casters[number - 1].offset != 0.0 for number in casters):
        raise ValueError(f"robot {robot.name!r} has wheels with a lateral offset: their rolling and steering interfere")
    speed, yaw = positive("top_speed", top_speed), positive("top_yaw_rate", top_yaw_rate)
    angles, parameters = finite("steering", steering, robot.caster_count), robot_parameters(robot)
    centres = np.array(
        [
            wheel_centre((np.cos(angles[..., i]), np.sin(angles[..., i])), parameters.casters[i])
            for i in (number - 1 for number in casters)
        ]
    )  # (casters, 2, ...)
    squares, mean = np.mean(np.sum(centres**2, axis=1), axis=0), np.mean(centres, axis=0)
    v, w = speed**2, yaw**2 * squares
    apart = np.sqrt((v - w) ** 2 + 4.0 * v * yaw**2 * np.sum(mean**2, axis=0))
    index: Array = np.sqrt(np.maximum(v + w - apart, 0.0) / (v + w + apart))  # (Q8)
    return index
