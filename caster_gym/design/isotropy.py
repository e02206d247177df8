"""How evenly a set of joints moves the platform: the kinematic isotropy of kim2001. docs/analysis.md, section Q.

Rates are taken as shares of their greatest, twists as well, so that the ratio of least to greatest singular value means
something: 1 moves equally well in every direction, 0 cannot move in one (or cannot be moved in it).

    top_twist   greatest vx, vy, ω of the platform              (3,) [m/s, m/s, rad/s]
    top_rates   greatest rates of the joints, in their order    (J,) [rad/s]
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.analysis.checked import finite
from caster_gym.arrays import Array
from caster_gym.design.isotropy_grid import mean_isotropy
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import Robot, check_joints

INTERVAL = float(np.radians(5.0))  # [rad] between the steering angles of kim2001's grid


def isotropy(
    robot: Robot, steering: ArrayLike, joints: Sequence[str], top_twist: ArrayLike, top_rates: ArrayLike
) -> Array:
    """Local index σ_min/σ_max (...) of the normalised Jacobian at steering (..., N) [rad].

    It is the same for the matrix that gives the twist from the rates, the pseudo-inverse. Raises ValueError for unknown
    joints, for fewer than three, and for tops that are not positive.
    """
    names = _three_or_more(robot, joints)
    twist, rates = _tops("top_twist", top_twist, 3), _tops("top_rates", top_rates, len(names))
    normalised = Model(robot).jacobian(steering, names) * twist / rates.T  # (Q1)
    singular = np.linalg.svd(normalised, compute_uv=False)
    index: Array = singular[..., -1] / singular[..., 0]  # (Q2)
    return index


def global_isotropy(
    robot: Robot, joints: Sequence[str], top_twist: ArrayLike, top_rates: ArrayLike, interval: float = INTERVAL
) -> float:
    """Mean of the local index over a grid of the steering angles that enter, every `interval` [rad] of the circle.

    Raises ValueError as `isotropy` does, and for an interval that does not divide the circle.
    """
    names = _three_or_more(robot, joints)
    twist, rates = _tops("top_twist", top_twist, 3), _tops("top_rates", top_rates, len(names))
    return float(mean_isotropy(robot_parameters(robot), names, twist, rates, _angle_count(interval))[0])


def global_isotropies(
    robot: Robot,
    joints: Sequence[str],
    radius: ArrayLike,
    trail: ArrayLike,
    top_twist: ArrayLike,
    top_rates: ArrayLike,
    interval: float = INTERVAL,
) -> Array:
    """The same (C,) for C designs and demands: radius (C,) and trail (C,) [m] replace those of every caster.

    top_twist (C, 3) and top_rates (C, J). What is given once, without the axis C, holds for all.
    """
    names = _three_or_more(robot, joints)
    twist, rates = _tops("top_twist", top_twist, 3, many=True), _tops("top_rates", top_rates, len(names), many=True)
    r, d = (np.atleast_1d(_positive(name, size)) for name, size in (("radius", radius), ("trail", trail)))
    lengths = {len(part) for part in (r, d, twist, rates)} - {1}
    if r.ndim > 1 or d.ndim > 1 or len(lengths) > 1:
        shapes = ", ".join(str(np.shape(part)) for part in (radius, trail, top_twist, top_rates))
        raise ValueError(
            "radius, trail, top_twist and top_rates must be given once or be equally many along their first axis, "
            f"got shapes {shapes}"
        )
    parameters = robot_parameters(robot)
    casters = tuple(caster._replace(radius=r[:, None], trail=d[:, None]) for caster in parameters.casters)
    return mean_isotropy(parameters._replace(casters=casters), names, twist, rates, _angle_count(interval))


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
    speed, yaw = _positive("top_speed", top_speed), _positive("top_yaw_rate", top_yaw_rate)
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


def _three_or_more(robot: Robot, joints: Sequence[str]) -> tuple[str, ...]:
    names = check_joints(tuple(joints), robot.caster_count)
    if len(names) < 3:
        raise ValueError(f"a platform has three degrees of freedom: name three joints or more, got {', '.join(names)}")
    return names


def _tops(name: str, value: ArrayLike, last: int, many: bool = False) -> Array:
    """Greatest twists (C, 3) or rates (C, J)."""
    array = _positive(name, value)
    if array.ndim not in ((1, 2) if many else (1,)) or array.shape[-1] != last:
        kind = "vx, vy and ω" if name == "top_twist" else "one for each joint"
        raise ValueError(f"{name} must have {last} numbers, {kind}, got shape {array.shape}")
    return np.atleast_2d(array)


def _positive(name: str, value: ArrayLike) -> Array:
    array = np.asarray(value, dtype=np.float64)
    wrong = ~(np.isfinite(array) & (array > 0.0))
    if wrong.any():
        raise ValueError(f"{name} must be positive and finite, got {array[wrong].flat[0]:g}")
    return array


def _angle_count(interval: float) -> int:
    """How many intervals the circle has."""
    count = 2.0 * np.pi / interval if np.isfinite(interval) and interval > 0.0 else 0.5
    if abs(count - round(count)) > 1e-6 * count:
        raise ValueError(
            f"the interval must divide the circle into whole parts, as 5° = {INTERVAL:.6f} does, got {interval:g} rad"
        )
    return round(count)
