"""Sensors with noise, bias and misaligned encoders.

Noise enters where a robot measures, in its pose, twist, steering angles and joint rates, and all parts of an
observation that are computed from a measurement follow it (`misjudging`).
"""

from typing import Literal

import numpy as np
from pydantic import NonNegativeFloat

from caster_gym.arrays import Array
from caster_gym.envs.observation import OBSERVATION_LIMIT
from caster_gym.envs.randomness import uniforms
from caster_gym.wrappers.draws import normals
from caster_gym.wrappers.feature import Feature, Observations, Place, Quantities, Range, Robots, Runtime, between
from caster_gym.wrappers.misjudging import Misjudged, turn


class SensorNoise(Feature):
    """Normal noise of every control period, and biases that stay for an episode; numbers are standard deviations.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import SensorNoise, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), SensorNoise(position=0.002, heading=0.005))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["sensor_noise"] = "sensor_noise"
    position: NonNegativeFloat = 0.0  # [m] of the measured place, along each axis
    heading: NonNegativeFloat = 0.0  # [rad] of the measured heading
    speed: NonNegativeFloat = 0.0  # [m/s] of the measured vx and vy
    yaw_rate: NonNegativeFloat = 0.0  # [rad/s]
    steering: NonNegativeFloat = 0.0  # [rad] of every steering angle
    joint_rate: NonNegativeFloat = 0.0  # [rad/s] of every rolling and steering rate
    position_bias: NonNegativeFloat = 0.0  # [m]
    heading_bias: NonNegativeFloat = 0.0  # [rad]
    speed_bias: NonNegativeFloat = 0.0  # [m/s]
    yaw_rate_bias: NonNegativeFloat = 0.0  # [rad/s]

    def runtime(self, place: Place) -> Runtime:
        """Sensors of every robot."""
        return _SensorNoise(self, place)


class SteeringOffset(Feature):
    """Steering encoders that show every angle turned by a constant: known zeros, and what is drawn for each caster.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import SteeringOffset, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), SteeringOffset(angle=(-0.02, 0.02)))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["steering_offset"] = "steering_offset"
    angle: Range = (-0.02, 0.02)  # [rad] shown minus true angle
    zeros: tuple[float, ...] = ()  # [rad] of each caster, to which `angle` is added, such as `identify` finds them

    def runtime(self, place: Place) -> Runtime:
        """Encoders of every robot. Raises ValueError for another number of zeros than the robot has casters."""
        casters = place.engine.robot.caster_count
        if self.zeros and len(self.zeros) != casters:
            raise ValueError(
                f"steering_offset needs as many zeros as robot {place.engine.robot.name!r} has casters, {casters}, or "
                f"none, got {len(self.zeros)}"
            )
        return _SteeringOffset(self, place)


class _SteeringOffset(Runtime):
    def __init__(self, feature: SteeringOffset, place: Place) -> None:
        self._range, self._place = feature.angle, place
        self._zeros = np.array(feature.zeros or (0.0,))
        self._directions = place.part("directions").place
        casters = place.engine.robot.caster_count
        self._casters = np.arange(casters)
        self._cos, self._sin = np.ones((place.count, casters)), np.zeros((place.count, casters))

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        angles = self._zeros + between(self._range, uniforms(self._place.seeds[robots], self._casters))
        self._cos[robots], self._sin[robots] = np.cos(angles), np.sin(angles)

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        shown = observations.copy()
        turn(shown, self._directions.start + 2 * self._casters, self._cos[robots], self._sin[robots])
        return shown


class _SensorNoise(Runtime):
    """Errors e are measured minus true: place and twist in B, then heading, steering angles and joint rates."""

    def __init__(self, feature: SensorNoise, place: Place) -> None:
        self._place = place
        layout, casters = place.engine.layout, place.engine.robot.caster_count
        body = [feature.position] * 2 + [feature.heading] + [feature.speed] * 2 + [feature.yaw_rate]
        self._noise = np.array(body + [feature.steering] * casters + [feature.joint_rate] * (2 * casters))
        self._bias = np.zeros(len(self._noise))
        self._bias[:6] = (
            [feature.position_bias] * 2 + [feature.heading_bias] + [feature.speed_bias] * 2 + [feature.yaw_rate_bias]
        )
        self._noisy, self._biased = np.flatnonzero(self._noise), np.flatnonzero(self._bias)
        self._wrong = frozenset(int(i) for i in (*self._noisy, *self._biased))
        self._constant = np.zeros((place.count, len(self._noise)))
        self._directions = place.part("directions").place.start + 2 * np.arange(casters)
        self._rates = place.part("joint_rates")
        self._misjudge = Misjudged(layout).misjudge

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        drawn = normals(self._place.seeds[robots], self._biased)
        self._constant[np.ix_(robots, self._biased)] = self._bias[self._biased] * drawn

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        if not self._wrong:
            return observations
        errors = self._errors(robots)
        shown = observations.astype(np.float64)
        if {0, 1, 2, 3, 4, 5} & self._wrong:
            self._misjudge(shown, errors[:, :6], 2 in self._wrong)
        casters = len(self._directions)
        if 6 in self._wrong:
            angles = errors[:, 6 : 6 + casters]
            turn(shown, self._directions, np.cos(angles), np.sin(angles))
        if 6 + casters in self._wrong:
            shown[:, self._rates.place] += errors[:, 6 + casters :] / self._rates.scale
        return np.clip(shown, -OBSERVATION_LIMIT, OBSERVATION_LIMIT).astype(np.float32)

    def _errors(self, robots: Robots) -> Array:
        """e (robots, 6 + 3 N) of the present control period."""
        errors = self._constant[robots].copy()
        if self._noisy.size:
            clocks = self._place.clocks[robots, None]
            indices = len(self._noise) * (clocks + 1) + self._noisy  # the first ones are those of the biases
            errors[:, self._noisy] += self._noise[self._noisy] * normals(self._place.seeds[robots], indices)
        return errors
