"""Computed torque: feedback linearisation in operational space, and torques within the motors' limits.

    e, ė     reference minus robot: position, heading, and their rates, components in B
    a        wanted acceleration a_ref + k_d ė + k_p e                [m/s², rad/s²]
    F        M v̇ + h + friction, with v̇ the rate of the twist's components that a means

With the exact model every error obeys ë + k_d ė + k_p e = 0 while no motor is at its limit.
"""

from collections.abc import Mapping, Sequence
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field

from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.arrays import Array
from caster_gym.configuration import Positive
from caster_gym.control.torque_distribution import distribute
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import ObservationLayout
from caster_gym.mechanics.motors import torque_range
from caster_gym.robot import Robot

KnownModel = Literal["exact", "without D1", "without wheels"]


class Gains(NamedTuple):
    """Feedback gains k_p [1/s²] and k_d [1/s]."""

    stiffness: float
    damping: float


def gains(natural_frequency: float, period: float) -> Gains:
    """Gains that put both poles of a double integrator, held over a period [s], at exp(−ω_n · period).

    A controller that holds its output sees e_{k+1} = e_k + T ė_k + ½T² u and ė_{k+1} = ė_k + T u; matching the
    characteristic polynomial to (z − p)² gives the gains below, critically damped however long the period is.
    """
    p = np.exp(-natural_frequency * period)
    return Gains(float((1.0 - p) ** 2 / period**2), float((1.0 - p) * (3.0 + p) / (2.0 * period)))


def known_model(robot: Robot, known: KnownModel) -> Model:
    """What the controller knows of the robot; the incomplete ones are those that the literature uses."""
    if known == "exact":
        return Model(robot)
    if known == "without D1":
        return Model(robot, dynamics="chung2008")
    if known == "without wheels":
        return Model(robot.without_wheels())
    raise ValueError(f"known must be 'exact', 'without D1' or 'without wheels', got {known!r}")


class ComputedTorque:
    """Model-based tracking of the reference that the observation shows.

    natural_frequency [rad/s] of the errors, period [s] between actions.

    >>> import caster_gym, gymnasium
    >>> env = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate")
    >>> layout = caster_gym.ObservationLayout(caster_gym.load_robot("chung2008"), preview=(0.1, 0.2, 0.4))
    >>> controller = caster_gym.ComputedTorque(layout, natural_frequency=30.0, period=0.02)
    >>> observation, info = env.reset(seed=0)
    >>> for _ in range(100):
    ...     observation, reward, terminated, truncated, info = env.step(controller.act(observation[None])[0])
    >>> info["position_error"] < 1e-4  # [m]
    True
    """

    def __init__(
        self, layout: ObservationLayout, natural_frequency: float, period: float, known: KnownModel = "exact"
    ) -> None:
        if natural_frequency <= 0.0:
            raise ValueError(f"natural_frequency must be positive, got {natural_frequency}")
        warn_if_singular(layout.robot)
        self.layout, self.period, self.known = layout, period, known
        self.gains = gains(natural_frequency, period)
        self._model = known_model(layout.robot, known)
        robot = layout.robot
        self._max_torque = robot.max_torques[robot.driven_indices]
        self._max_speed = robot.max_speeds[robot.driven_indices]

    @property
    def name(self) -> str:
        """Name with the model that the controller knows."""
        return "computed torque" if self.known == "exact" else f"computed torque {self.known}"

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) for observations (robots, size)."""
        see = self.layout.physical
        cos_sin = see(observations, "directions").reshape(len(observations), -1, 2)
        steering = np.arctan2(cos_sin[..., 1], cos_sin[..., 0])
        twist = see(observations, "twist")
        force = self._model.inverse_dynamics(steering, twist, self._twist_rate(observations, twist))
        b = self._model.motor_wrenches(steering)
        speeds = (twist[:, None] @ b)[:, 0] / self._max_torque  # a motor's wrench and its speed have the same row
        low, high = torque_range(speeds, np.ones_like(speeds), self._max_speed)
        b[:, 2] /= self._model.characteristic_length
        force[:, 2] /= self._model.characteristic_length
        return distribute(b, force, low, high).astype(np.float32)

    def _twist_rate(self, observations: NDArray[np.float32], twist: Array) -> Array:
        """Rate of the twist's components (robots, 3) that brings the errors down as the gains say."""
        see = self.layout.physical
        heading = see(observations, "heading_error")
        turn = np.arctan2(heading[:, 1], heading[:, 0])
        error = np.concatenate([see(observations, "position_error"), turn[:, None]], axis=1)
        rate = see(observations, "twist_error")
        wanted = self._mean_acceleration(observations, twist + rate)
        wanted = wanted + self.gains.damping * rate + self.gains.stiffness * error
        wanted[:, 0] += twist[:, 2] * twist[:, 1]
        wanted[:, 1] -= twist[:, 2] * twist[:, 0]
        return wanted

    def _mean_acceleration(self, observations: NDArray[np.float32], velocity: Array) -> Array:
        """Reference acceleration (robots, 3) in the middle of the coming period; the preview shows its jerk."""
        now = self.layout.physical(observations, "reference_acceleration")
        if not self.layout.preview:
            return now
        ahead = min(self.layout.preview)
        later = self.layout.physical(observations, f"preview_{ahead:g}{self.layout.unit}")[:, 4:]
        horizon = np.full((len(now), 1), ahead)
        if self.layout.unit == "m":
            speeds = np.hypot(*velocity[:, :2].T) + np.hypot(*later[:, :2].T)
            horizon[:, 0] = np.maximum(2.0 * ahead / np.maximum(speeds, 1e-9), self.period)
        jerk = 2.0 * (later - velocity - horizon * now) / horizon**2
        mean: Array = now + 0.5 * self.period * jerk
        return mean


class ComputedTorqueSettings(ControllerSettings):
    """Model-based control; its natural frequency is the one of those listed that does best on validation paths."""

    usual_names: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("natural_frequency", "bandwidth"),
            "it is chosen among the 'natural_frequencies' listed, e.g. natural_frequencies: [10.0]",
        ),
        **dict.fromkeys(
            ("kp", "kd"), "gains follow from the natural frequency: list it as natural_frequencies: [10.0]"
        ),
    }
    algorithm: Literal["computed torque"]
    known: KnownModel = "exact"
    natural_frequencies: Annotated[tuple[Positive, ...], Field(min_length=1)] = (5.0, 10.0, 15.0, 20.0, 30.0)

    def controller(self, layout: ObservationLayout, period: float) -> ComputedTorque:
        """The controller with the first natural frequency."""
        return ComputedTorque(layout, self.natural_frequencies[0], period, self.known)

    def candidates(self) -> Sequence[Self]:
        """The same settings with each natural frequency alone."""
        return [self.model_copy(update={"natural_frequencies": (one,)}) for one in self.natural_frequencies]
