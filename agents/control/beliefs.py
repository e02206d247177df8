"""What a controller believes of delays, sensors and disturbances: typed, or taken from the features of the plant."""

from collections.abc import Sequence
from math import hypot, isclose, sqrt

import numpy as np
from pydantic import NonNegativeFloat

from caster_gym.configuration import Frozen
from caster_gym.robot import Robot
from caster_gym.wrappers.feature import Feature, limits
from caster_gym.wrappers.latency import ActionDelay, MotorLag, Periods
from caster_gym.wrappers.plants import WheelErrors
from caster_gym.wrappers.sensors import SensorNoise, SteeringOffset

_NOISES = ("position", "heading", "speed", "yaw_rate", "steering", "joint_rate")


class Prediction(Frozen):
    """How late actions arrive, and how slowly motors follow them."""

    delay: Periods = 0  # [control periods]
    lag: NonNegativeFloat = 0.0  # [s] time constant
    mismatch: bool = False  # whether they may differ from those of the plant


class Sensors(Frozen):
    """Standard deviations of what is measured, anew in every control period, as `sensor_noise` has them."""

    position: NonNegativeFloat = 0.0  # [m] along each axis
    heading: NonNegativeFloat = 0.0  # [rad]
    speed: NonNegativeFloat = 0.0  # [m/s] of vx and vy
    yaw_rate: NonNegativeFloat = 0.0  # [rad/s]
    steering: NonNegativeFloat = 0.0  # [rad] of every steering angle
    joint_rate: NonNegativeFloat = 0.0  # [rad/s] of every rolling and steering rate
    wheels: NonNegativeFloat = 0.0  # [-] share by which speeds counted from wheels err: wrong radii, zeros of steering

    @property
    def noisy(self) -> bool:
        """Whether any of them has noise."""
        return self != Sensors()


class Beliefs(Frozen):
    """All that an estimate of the robot's state stands on."""

    prediction: Prediction = Prediction()
    sensors: Sensors | None = None  # None: what is measured is taken as it is
    unmodelled: NonNegativeFloat = (
        1.0  # [N] standard deviation of a force that no model knows, anew in every control period
    )
    drift: NonNegativeFloat = 0.0  # [N/√s] of a force that stays, and wanders; 0: there is none


def prediction_of(features: Sequence[Feature]) -> Prediction:
    """The delay and the lag of a plant; where they are drawn by episode, those in the middle."""
    delays, lags = _latencies(features)
    return Prediction(
        delay=int(sum((low + high) // 2 for low, high in delays)), lag=sum(0.5 * (low + high) for low, high in lags)
    )


def check_prediction(believed: Prediction, features: Sequence[Feature]) -> None:
    """Raise ValueError unless the plant may have the delay and the lag that are believed, or a mismatch is meant."""
    if believed.mismatch:
        return
    for name, value, ranges, unit in zip(
        ("delay", "lag"), (believed.delay, believed.lag), _latencies(features), ("control periods", "s"), strict=True
    ):
        low, high = sum(one for one, _ in ranges), sum(one for _, one in ranges)
        if not (low <= value <= high or isclose(value, low) or isclose(value, high)):
            there = f"{low:g}" if low == high else f"{low:g} … {high:g}"
            raise ValueError(
                f"'predict' has a {name} of {value:g} {unit}, that of the plant is {there} {unit}: write 'predict: "
                "scenario' to take the plant's, or 'mismatch: true' beside it if that is meant"
            )


def sensors_of(features: Sequence[Feature], robot: Robot) -> Sensors:
    """The sensors of a plant, with root mean squares of what is drawn by episode."""
    noises = [feature for feature in features if isinstance(feature, SensorNoise)]
    zeros = [_root_mean_square(one.angle) for one in features if isinstance(one, SteeringOffset)]
    radius = float(np.mean([caster.radius for caster in robot.casters]))
    radii = [_root_mean_square(one.radius) / radius for one in features if isinstance(one, WheelErrors)]
    known = {name: hypot(*(getattr(one, name) for one in noises)) for name in _NOISES}
    return Sensors(**known, wheels=hypot(*zeros, *radii))


def _root_mean_square(value: float | tuple[float, float]) -> float:
    low, high = limits(value)
    return sqrt((low * low + low * high + high * high) / 3.0)


def _latencies(features: Sequence[Feature]) -> tuple[list[tuple[float, float]], list[tuple[float, float]]]:
    """Ranges of the delays [control periods] and of the lags' time constants [s] among features."""
    delays = [limits(one.periods) for one in features if isinstance(one, ActionDelay)]
    lags = [limits(one.time_constant) for one in features if isinstance(one, MotorLag)]
    return delays, lags
