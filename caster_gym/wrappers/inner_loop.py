"""What inner loops share: states of the robot, decoded from observations, and its nominal model."""

import numpy as np

from caster_gym.engines.numpy_model import Model
from caster_gym.wrappers.feature import Observations, Place, Robots, Runtime


class InnerLoop(Runtime):
    """What loops read of the observation, and the motors they drive."""

    constants = frozenset({"_layout", "_model"})

    def __init__(self, place: Place, bandwidth: float) -> None:
        robot = place.engine.robot
        self._layout = place.engine.layout
        self._model = Model(robot)
        self._gain = -np.expm1(-bandwidth * place.period) / place.period  # [1/s]
        self._driven = robot.driven_indices
        self._max_torque = robot.max_torques[self._driven]
        self._max_speed = robot.max_speeds[self._driven]
        self._gears = np.array([caster.gear for caster in robot.casters])
        self._steering = np.zeros((place.count, robot.caster_count))
        self._twist = np.zeros((place.count, 3))
        self._speeds = np.zeros((place.count, len(self._driven)))

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        see = self._layout.physical
        directions = see(observations, "directions")
        self._steering[robots] = np.arctan2(directions[:, 1::2].copy(), directions[:, ::2].copy())
        self._twist[robots] = see(observations, "twist")
        rates = see(observations, "joint_rates").reshape(len(observations), -1, 1, 2)
        speeds = self._gears[:, :, 0] * rates[..., 0] + self._gears[:, :, 1] * rates[..., 1]
        self._speeds[robots] = speeds.reshape(len(observations), -1)[:, self._driven]
        return observations
