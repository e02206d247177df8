"""What there is to see of one robot at one moment: all that drawing needs, and nothing of how it is computed."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caster_gym.mechanics.separation import Obstacles
from caster_gym.robot import Robot

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Scene:
    """One robot on its path, in the world frame W unless said otherwise."""

    robot: Robot
    time: float  # [s] since the episode began
    pose: Array  # (4,) x, y [m], cos β, sin β
    twist: Array  # (3,) vx, vy, ω in B [m/s, rad/s]
    directions: Array  # (N, 2) cos δ, sin δ of each rolling direction, in B
    torque: Array  # (2 N,) mean torques of the motors over the last control period [N m]
    ground_forces: Array  # (N, 2) of the floor on each wheel, along its rolling direction and to its left [N]
    path: Array  # (K, 2) [m]
    corridor: float  # [m] half width
    reference: Array  # (4,) pose that is to be reached
    obstacles: Obstacles
    impulse: Array  # (2,) of obstacles on the robot during the last control period [N s]
    impact_point: Array  # (2,) where the last of them acted [m]; NaN if there was none
    failed: bool  # the episode has terminated
