"""Computed torque: feedback linearisation in operational space, and torques within the motors' limits.

    e, ė     reference minus robot: position, heading, and their rates, components in B
    a        wanted acceleration a_ref + k_d ė + k_p e, a derivative in the world            [m/s², rad/s²]
    v        twist (vx, vy, ω) at C, in B                                                    [m/s, m/s, rad/s]
    F        M v̇ + h + friction, with v̇ the rate of the twist's components that a means
    T        control period, over which torques are held                                     [s]

With the exact model every error obeys ë + k_d ė + k_p e = 0 while no motor is at its limit. Torques that are held turn
with the robot and on casters that steer, and so everything is taken in the middle of the period. Derivation:
docs/control.md, section T.
"""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.arrays import Array
from caster_gym.control.torque_distribution import distribute
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import ObservationLayout
from caster_gym.mechanics.motors import torque_range
from caster_gym.robot import Robot

LEAST_HORIZON = 0.02  # [s] of a preview whose places tell the jerk: rounding of 1e-8 m becomes 0.03 m/s³

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
    return Gains(float((1.0 - p) ** 2 / period**2), float((1.0 - p) * (3.0 + p) / (2.0 * period)))  # (T2)


def known_model(robot: Robot, known: KnownModel) -> Model:
    """What the controller knows of the robot; the incomplete ones are those that the literature uses."""
    if known == "exact":
        return Model(robot)
    if known == "without D1":
        return Model(robot, dynamics="chung2008")
    if known == "without wheels":
        return Model(robot.without_wheels())
    raise ValueError(f"known must be 'exact', 'without D1' or 'without wheels', got {known!r}")


class Motion(NamedTuple):
    """How robots move at some time of a control period."""

    turn: Array  # (robots,) heading gained since its start [rad]
    twist: Array  # (robots, 3)
    steering: Array  # (robots, casters) [rad]


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
        cos_sin = self.layout.physical(observations, "directions").reshape(len(observations), -1, 2)
        steering = np.arctan2(cos_sin[..., 1], cos_sin[..., 0])
        twist = self.layout.physical(observations, "twist")
        shares = self._shares(steering, twist, *self._accelerations(observations, twist))
        return shares.astype(np.float32)

    def _shares(
        self, steering: Array, twist: Array, reference: Array, wanted: Array, disturbance: Array | None = None
    ) -> Array:
        """Torques (robots, driven joints) as shares of the greatest, for accelerations (robots, 3) as below.

        disturbance (robots, 3): a wrench that pushes the robots in their frames [N, N, N m].
        """
        middle = self._ahead(steering, twist, reference, 0.5 * self.period)
        rate = _seen_after(middle.turn, wanted) - frame_rate(middle.twist)
        force = self._model.inverse_dynamics(middle.steering, middle.twist, rate)
        if disturbance is not None:
            force -= disturbance
        b = self._model.motor_wrenches(middle.steering)
        speeds = (middle.twist[:, None] @ b)[:, 0] / self._max_torque  # a motor's wrench and speed have the same row
        low, high = torque_range(speeds, np.ones_like(speeds), self._max_speed)
        b[:, 2] /= self._model.characteristic_length
        force[:, 2] /= self._model.characteristic_length
        return distribute(b, force, low, high)

    def _ahead(self, steering: Array, twist: Array, acceleration: Array, time: float) -> Motion:
        """How robots move after some time [s] of an acceleration (robots, 3), constant in the world, given in B now."""

        def turn_and_twist(t: float) -> tuple[Array, Array]:
            turn = t * (twist[:, 2] + 0.5 * t * acceleration[:, 2])
            return turn, _seen_after(turn, twist + t * acceleration)

        half = 0.5 * time
        halfway = steering + half * self._model.rates(steering, twist)[2]
        steering_rates = self._model.rates(halfway, turn_and_twist(half)[1])[2]
        return Motion(*turn_and_twist(time), steering + time * steering_rates)  # (T3)

    def _accelerations(self, observations: NDArray[np.float32], twist: Array) -> tuple[Array, Array]:
        """Accelerations (robots, 3) of the reference, and the wanted ones, which bring errors down as the gains say."""
        see = self.layout.physical
        heading = see(observations, "heading_error")
        turn = np.arctan2(heading[:, 1], heading[:, 0])
        error = np.concatenate([see(observations, "position_error"), turn[:, None]], axis=1)
        rate = see(observations, "twist_error")
        jerk = self._jerk(observations, twist + rate)
        return self._feedback(error, rate, twist, see(observations, "reference_acceleration"), jerk)

    def _feedback(
        self, error: Array, rate: Array, twist: Array, acceleration: Array, jerk: Array
    ) -> tuple[Array, Array]:
        """The same from errors and their rates, and the acceleration and jerk of the reference, each (robots, 3)."""
        reference = acceleration + 0.5 * self.period * jerk  # in the middle
        turning = frame_rate(np.column_stack([reference[:, :2], twist[:, 2]]))
        rate = rate - self.period**2 / 12.0 * (jerk - turning)  # (T4)
        return reference, reference + self.gains.damping * rate + self.gains.stiffness * error  # (T1)

    def _jerk(self, observations: NDArray[np.float32], velocity: Array) -> Array:
        """Jerk (robots, 3) of the reference, which the preview shows; zero without a preview.

        velocity (robots, 3) of the reference. With Δp and Δv what place and velocity of the nearest previewed point, h
        ahead, differ from those of constant acceleration, a jerk that is j now and changes linearly makes
        Δp = h³/6 j + h⁴/24 j̇ and Δv = h²/2 j + h³/6 j̇, so that j = 24 Δp/h³ − 6 Δv/h². Where h is not known exactly, or
        so short that Δp drowns in the observation's single precision, the jerk is taken to be constant: j = 2 Δv/h².
        """
        see = self.layout.physical
        if not self.layout.preview:
            return np.zeros_like(velocity)
        now = see(observations, "reference_acceleration")
        ahead = min(self.layout.preview)
        point = see(observations, f"preview_{ahead:g}{self.layout.unit}")
        horizon = np.full((len(now), 1), ahead)
        if self.layout.unit == "m":
            speeds = np.hypot(*velocity[:, :2].T) + np.hypot(*point[:, 4:6].T)
            horizon[:, 0] = np.maximum(2.0 * ahead / np.maximum(speeds, 1e-9), self.period)
        faster = point[:, 4:] - velocity - horizon * now
        if self.layout.unit == "m" or ahead < LEAST_HORIZON:
            constant: Array = 2.0 * faster / horizon**2
            return constant
        cos, sin = see(observations, "heading_error").T
        turn = np.arctan2(point[:, 3] * cos - point[:, 2] * sin, point[:, 2] * cos + point[:, 3] * sin)
        moved = np.column_stack([point[:, :2] - see(observations, "position_error"), turn])
        farther = moved - horizon * velocity - 0.5 * horizon**2 * now
        jerk: Array = 24.0 * farther / horizon**3 - 6.0 * faster / horizon**2
        return jerk


def frame_rate(twist: Array) -> Array:
    """ω × v (robots, 3), by which the rate of a vector (vx, vy) exceeds that of its components in a frame of rate ω."""
    vx, vy, omega = twist.T
    return np.stack([-omega * vy, omega * vx, np.zeros_like(omega)], axis=1)


def _seen_after(turn: Array, vector: Array) -> Array:
    """Components (robots, 3) of a vector in the frame of robots that have turned [rad] since they were given."""
    c, s = np.cos(turn), np.sin(turn)
    x, y, z = vector.T
    return np.stack([c * x + s * y, c * y - s * x, z], axis=1)
