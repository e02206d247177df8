"""Motors that fail on the way."""

from typing import Literal

import numpy as np

from caster_gym.arrays import Indices
from caster_gym.envs.randomness import uniforms
from caster_gym.robot import check_joints
from caster_gym.wrappers.feature import Actions, Feature, Place, Quantities, Runtime, Size, between


class MotorFailure(Feature):
    """From some instant of each episode on, motors give no torque; their joints turn freely, with rotor and friction.

    Put it first in the list, next to the environment: what it changes is the torque, not what was asked.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import MotorFailure, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), MotorFailure(motors=("roll_1",), after=3.0))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["motor_failure"] = "motor_failure"
    motors: tuple[str, ...] = ()  # joints, as roll_1 or steer_2; none: one driven joint, drawn by episode
    after: Size = (0.0, 5.0)  # [s] from the start of the episode, in whole control periods

    def runtime(self, place: Place) -> Runtime:
        """Motors of every robot. Raises ValueError for joints that the robot does not have or drive."""
        robot = place.engine.robot
        if self.motors:
            check_joints(self.motors, robot.caster_count)
        if passive := [one for one in self.motors if one not in robot.driven]:
            raise ValueError(
                f"motor_failure: joint {passive[0]!r} of robot {robot.name!r} has no motor that could fail; driven are "
                f"{', '.join(robot.driven)}"
            )
        return _MotorFailure(self, place)


class _MotorFailure(Runtime):
    def __init__(self, feature: MotorFailure, place: Place) -> None:
        self._place, self._after = place, feature.after
        driven = place.engine.robot.driven
        self._named = np.array([joint in feature.motors for joint in driven])
        self._fails = np.tile(self._named, (place.count, 1))
        self._first = np.zeros(place.count, dtype=np.int64)  # control period without torque

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        shares = uniforms(self._place.seeds[robots], np.arange(2))
        self._first[robots] = np.rint(between(self._after, shares[:, 0]) / self._place.period).astype(np.int64)
        if not self._named.any():
            drawn = (shares[:, 1] * len(self._named)).astype(np.int64)
            self._fails[robots] = drawn[:, None] == np.arange(len(self._named))

    def act(self, actions: Actions) -> Actions:
        over = (self._place.clocks >= self._first)[:, None]
        given: Actions = np.where(self._fails & over, np.float32(0.0), actions)
        return given
