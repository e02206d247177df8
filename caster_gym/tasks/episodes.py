"""Time series of episodes, from which tasks take their metrics."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array


class Episodes(NamedTuple):
    """Time series of episodes (steps, episodes, …), NaN after an episode has ended; and facts of each (episodes,)."""

    names: tuple[str, ...]  # of the path of each episode
    period: float  # [s]
    position_error: Array  # [m]
    heading_error: Array  # [rad]
    torque: Array  # (steps, episodes, 2 N) of the motors [N m]
    share: Array  # the same as shares of their greatest torques
    command: Array  # (steps, episodes, driven motors) shares asked for, in −1 … 1; of wrapped robots, those given
    pose: Array  # (steps, episodes, 4): x, y, cos β, sin β in W
    reference: Array  # the same of the reference
    reward: Array  # of the task alone
    progress: Array  # [m]
    impacts: Array  # in each control period
    normal_impulse: Array  # [N s] likewise
    clearance: Array  # [m] inf where there is no obstacle
    driven: list[int]  # indices of the driven motors
    failed: NDArray[np.bool_]  # (episodes,)
    allowed: NDArray[np.int64]  # (episodes,) control periods of an episode that does not fail
    facts: Mapping[str, Array]  # (episodes,) what else a task knows of its paths, see `Task.facts`
