"""Whether a robot lifts wheels when it drives off or brakes at full torque; (G5), (G7) of docs/equations.md."""

import warnings
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from caster_gym.analysis.frames import wrap_angle
from caster_gym.mechanics.dynamics import forward_dynamics
from caster_gym.mechanics.ground import tilt, wheel_loads
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import GRAVITY, robot_parameters
from caster_gym.mechanics.scalars import each
from caster_gym.robot import Robot

_DIRECTIONS = 64  # in which it is tried


class LiftWarning(UserWarning):
    """A robot that drives off or brakes at full torque lifts a wheel."""


class LeastLoad(NamedTuple):
    """The least load of a wheel of a robot that drives off or brakes at full torque, and how that comes about."""

    load: float  # [N] negative: the robot tips over
    wheel: int  # from 1
    acceleration: float  # [m/s²]
    direction: float  # [rad] of the acceleration, in B
    steering: float  # [rad] of all casters: they trail behind a robot that drives along this direction of B
    brakes: bool  # or drives off


@lru_cache(maxsize=128)
def least_load(robot: Robot) -> LeastLoad:
    """The least load over all directions in which a robot may drive off or brake.

    All casters trail in some direction of B, and all rolling motors give their greatest torque forwards, or backwards
    to brake, or as much as the floor's friction allows the whole robot.
    """
    parameters = robot_parameters(robot)
    angles = np.tile(2.0 * np.pi * np.arange(_DIRECTIONS) / _DIRECTIONS, 2)
    sense = np.repeat((1.0, -1.0), _DIRECTIONS)
    f = np.cos(angles), np.sin(angles)
    directions, still = (f,) * robot.caster_count, (0.0, 0.0, 0.0)
    motors = tuple((sense * caster.roll_active * caster.roll_max_torque, 0.0) for caster in parameters.casters)
    torques = each(joint_torques, (), motors, parameters.casters)
    rate = np.array(np.broadcast_arrays(*forward_dynamics(still, directions, torques, still, parameters)))
    size = np.hypot(rate[0], rate[1])
    rate *= np.minimum(1.0, parameters.platform.floor_friction * GRAVITY / np.maximum(size, 1e-300))
    loads = np.array(wheel_loads(directions, tilt(still, tuple(rate), directions, still, parameters), parameters))
    wheel, k = np.unravel_index(loads.argmin(), loads.shape)
    ahead, left = rate[:2, k]
    return LeastLoad(
        float(loads[wheel, k]),
        int(wheel) + 1,
        float(np.hypot(ahead, left)),
        float(np.arctan2(left, ahead)),
        float(wrap_angle(angles[k])),
        bool(sense[k] < 0.0),
    )


def warn_if_lifting(robot: Robot) -> None:
    """Warn if a wheel leaves the floor as the robot drives off or brakes at full torque."""
    least = least_load(robot)
    if least.load <= 0.0:
        along = f"along {np.degrees(least.steering):.0f}° with all casters trailing"
        how = f"brakes while driving {along}" if least.brakes else f"drives off {along}"
        warnings.warn(
            f"robot {robot.name!r}, whose platform has its mass centre {robot.platform.height:g} m above the floor, "
            f"lifts wheel {least.wheel} when it {how}: all rolling motors at full torque, as far as the floor allows, "
            f"change its velocity by {least.acceleration:.2g} m/s²; these equations keep all wheels on the floor, and "
            'info["wheels_lifted"] tells when they do not stay there',
            LiftWarning,
            stacklevel=3,
        )
