"""How much an observer trusts its sensors and its model, axis by axis. Derivation: docs/control.md, section X."""

from typing import NamedTuple, Self

import numpy as np

from caster_gym.agents.control.beliefs import Beliefs, Sensors
from caster_gym.agents.control.kalman import Axis, gains_of, steady_share
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model

FINEST = 1e-6  # [m], [rad], of speeds per period: noise of the best sensors, which single precision already has
TYPICAL_SPEED = 0.5  # [m/s] at which speeds counted from wheels err by the errors of their directions
AT_FIRST = 1.0  # [s] drift over that time is how large a disturbance may be when an episode begins


class ObserverGains(NamedTuple):
    """Gains from what is measured minus predicted to what is believed of it."""

    body: Array  # (periods, 3 axes of B, 3, 2) from place and speed to place, speed and acceleration of a disturbance
    steering: Array  # (casters,)
    wheels: Array  # (3,) share of the wheels in the measured twist; the rest is that of the speed sensors


def observer_gains(model: Model, period: float, beliefs: Beliefs) -> ObserverGains:
    """Gains of a robot; forces become accelerations by its inertia at steering angles of 0."""
    sensors, length, casters = beliefs.sensors or Sensors(), model.characteristic_length, model.robot.casters
    inertia = model.inertia(np.zeros(len(casters)))
    radius = float(np.mean([caster.radius for caster in casters]))
    speeds = _Speeds.of(sensors, radius, length, len(casters), FINEST / period)
    found = []
    for place, speed, mass in (
        (sensors.position, speeds.together[0], inertia[0, 0]),
        (sensors.heading, speeds.together[2], inertia[2, 2] / length),  # a moment is a force at that length
    ):
        drift = beliefs.drift / mass
        found.append(
            gains_of(
                Axis(max(place, FINEST), speed, beliefs.unmodelled / mass, drift, drift * np.sqrt(AT_FIRST)), period
            )
        )
    longest = max(len(one.weights) for one in found)
    plane, yaw = (np.pad(one.weights, ((0, longest - len(one.weights)), (0, 0), (0, 0)), "edge") for one in found)
    steering = [
        steady_share(max(sensors.steering, FINEST), max(period * found[0].speed / caster.trail, FINEST))
        for caster in casters
    ]
    return ObserverGains(np.stack([plane, plane, yaw], axis=1), np.array(steering), speeds.wheels)


class _Speeds(NamedTuple):
    """What speed sensors and wheels tell of the twist (3,)."""

    wheels: Array  # share of the wheels
    together: Array  # standard deviation of both together

    @classmethod
    def of(cls, sensors: Sensors, radius: float, length: float, casters: int, finest: float) -> Self:
        """Speeds counted from wheels err by their rates, and by their directions in proportion to the speed. (X11)"""
        direct = np.maximum([sensors.speed, sensors.speed, sensors.yaw_rate], finest)
        directions = np.hypot(sensors.steering, sensors.wheels) * TYPICAL_SPEED
        counted = max(np.hypot(sensors.joint_rate * radius, directions) / np.sqrt(casters), finest)
        wheels = counted * np.array([1.0, 1.0, 1.0 / length])
        total = direct**2 + wheels**2
        return cls(direct**2 / total, direct * wheels / np.sqrt(total))
