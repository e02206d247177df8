"""Errors of the motions at the steps whose speed is measured: ours and MuJoCo's, driven strongly for 4 s."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym import Robot
from scripts.mujoco_peer import distance, end
from scripts.mujoco_robot import DURATION, driven, slip, strong_drives, without_dry_friction
from scripts.speed_peers import MUJOCO_STEP
from scripts.speed_robots import COARSE_STEP, RK4_STEP

REFERENCE_STEP = 1e-4  # [s] RK4 is then as exact as float64 allows
DRAWS = 12
SLIPS = 4  # of them whose slip is looked at, which is slow


class Accuracy(NamedTuple):
    """Distances of C from where it ought to be at the end, one for each drive. [m]"""

    ours: dict[float, NDArray[np.float64]]  # by RK4 step [s]
    mujoco: NDArray[np.float64]
    slips: list[float]  # [-] of MuJoCo's wheels

    @property
    def over(self) -> NDArray[np.float64]:
        """MuJoCo's error over ours at the environments' own step, drive by drive."""
        return self.mujoco / self.ours[RK4_STEP]


def measure_accuracy(robot: Robot, draws: int = DRAWS) -> Accuracy:
    """Drive a robot strongly, several times, against a reference at a tiny step; dry friction is left out."""
    smooth = without_dry_friction(robot)
    drives = strong_drives(smooth, draws)
    reference = driven(smooth, drives, REFERENCE_STEP)[-1, :, :2]
    theirs = np.array([end(smooth, drive.state, drive.torque, MUJOCO_STEP) for drive in drives])
    return Accuracy(
        {step: distance(driven(smooth, drives, step)[-1, :, :2], reference) for step in (RK4_STEP, COARSE_STEP)},
        distance(theirs, reference),
        [slip(smooth, drive.state, drive.torque, MUJOCO_STEP, DURATION) for drive in drives[:SLIPS]],
    )
