"""Actions that mean something else than torques: corrections of another agent, twists, joint speeds.

Inner loops run at the control period, on the observation that reaches them and nothing else.
"""

from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium.spaces import Box
from pydantic import Field, PositiveFloat, field_validator

from caster_gym.control.torque_distribution import distribute
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.motors import torque_range
from caster_gym.wrappers.feature import Actions, Array, Feature, Observations, Place, Robots, Runtime


class ResidualTorque(Feature):
    """Actions correct those of another agent: what is done is clip(agent's action + share · action).

    The agent is any object with `act(observations) -> actions`, both (robots, …), that remembers nothing.
    """

    kind: Literal["residual_torque"] = "residual_torque"
    redefines_actions: ClassVar[bool] = True
    agent: Any = Field(repr=False)
    share: float = Field(default=0.2, gt=0.0, le=2.0)  # [-] of the greatest torques

    @field_validator("agent")
    @classmethod
    def _agent_acts(cls, agent: Any) -> Any:
        if not callable(getattr(agent, "act", None)):
            raise ValueError("must be an object with a method act(observations), given in Python")
        return agent

    def runtime(self, place: Place) -> Runtime:
        """The agent beside the actions."""
        return _Residual(self, place)


class TwistCommands(Feature):
    """Actions are twists (vx, vy, ω) in B as shares of the greatest ones, which an inner loop tracks with torques.

    The robot's model at hand, a wanted twist is approached as exp(−bandwidth · t) while no motor is at its limit.
    """

    kind: Literal["twist_commands"] = "twist_commands"
    redefines_actions: ClassVar[bool] = True
    max_speed: PositiveFloat = 1.0  # [m/s] along each axis
    max_yaw_rate: PositiveFloat = 2.0  # [rad/s]
    bandwidth: PositiveFloat = 20.0  # [1/s]

    def runtime(self, place: Place) -> Runtime:
        """The inner loop."""
        return _TwistLoop(self, place)


class JointSpeeds(Feature):
    """Actions are speeds of the driven motors as shares of their top speeds, which inner loops track with torques.

    torque = gain · (wanted speed − speed), with gain = m (1 − exp(−bandwidth · T)) / (T ‖S‖). m is the inertia that the
    motor alone would have to accelerate at the present steering angles, S that of all motors against each other,
    S_ij = w_iᵀ M⁻¹ w_j √(m_i m_j), w the motors' wrenches per torque. As ‖S‖ (Frobenius) is no less than the greatest
    eigenvalue of S, no motion closes faster on its target than exp(−bandwidth · t), and none overshoots, however long
    the control period T is: it holds what happens in it apart from the turning of the casters.
    """

    kind: Literal["joint_speeds"] = "joint_speeds"
    redefines_actions: ClassVar[bool] = True
    bandwidth: PositiveFloat = 50.0  # [1/s]

    def runtime(self, place: Place) -> Runtime:
        """The inner loops."""
        return _SpeedLoops(self, place)


class _Residual(Runtime):
    def __init__(self, feature: ResidualTorque, place: Place) -> None:
        self._agent, self._share = feature.agent, feature.share
        self._seen = np.zeros((place.count, place.engine.layout.size), dtype=np.float32)

    def act(self, actions: Actions) -> Actions:
        given = np.asarray(self._agent.act(self._seen.copy()), dtype=np.float64)
        if given.shape != actions.shape:
            raise ValueError(f"the agent's actions must have shape {actions.shape}, got {given.shape}")
        residual = self._share * np.clip(actions.astype(np.float64), -1.0, 1.0)
        return np.clip(given + residual, -1.0, 1.0).astype(np.float32)

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        self._seen[robots] = observations
        return observations


class _InnerLoop(Runtime):
    """What loops read of the observation, and the motors they drive."""

    def __init__(self, place: Place, bandwidth: float) -> None:
        robot = place.engine.robot
        self._layout = place.engine.layout
        self._model = Model(robot)
        self._gain = -np.expm1(-bandwidth * place.period) / place.period  # [1/s]
        self._driven = [robot.joints.index(joint) for joint in robot.driven]
        motors = [motor for caster in robot.casters for motor in (caster.roll, caster.steer)]
        self._max_torque = np.array([motor.max_torque for motor in motors])[self._driven]
        self._max_speed = np.array([motor.max_speed for motor in motors])[self._driven]
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


class _TwistLoop(_InnerLoop):
    def __init__(self, feature: TwistCommands, place: Place) -> None:
        super().__init__(place, feature.bandwidth)
        self._greatest = np.array([feature.max_speed, feature.max_speed, feature.max_yaw_rate])
        self.action_space = Box(-1.0, 1.0, (3,), np.float32)

    def act(self, actions: Actions) -> Actions:
        wanted = np.clip(actions.astype(np.float64), -1.0, 1.0) * self._greatest
        force = self._model.inverse_dynamics(self._steering, self._twist, self._gain * (wanted - self._twist))
        wrenches = self._model.motor_wrenches(self._steering)
        low, high = torque_range(self._speeds, np.ones_like(self._speeds), self._max_speed)
        wrenches[:, 2] /= self._model.characteristic_length
        force[:, 2] /= self._model.characteristic_length
        return distribute(wrenches, force, low, high).astype(np.float32)


class _SpeedLoops(_InnerLoop):
    def __init__(self, feature: JointSpeeds, place: Place) -> None:
        super().__init__(place, feature.bandwidth)
        self.action_space = Box(-1.0, 1.0, (len(self._driven),), np.float32)

    def act(self, actions: Actions) -> Actions:
        wanted = np.clip(actions.astype(np.float64), -1.0, 1.0) * self._max_speed
        inertias = self._inertias()
        torque = self._gain * inertias * (wanted - self._speeds)
        shares: Actions = np.clip(torque / self._max_torque, -1.0, 1.0).astype(np.float32)
        return shares

    def _inertias(self) -> Array:
        """m / ‖S‖ of each motor (robots, motors). [kg m²]"""
        w = self._model.motor_wrenches(self._steering) / self._max_torque
        mobility = w.mT @ np.linalg.solve(self._model.inertia(self._steering), w)
        alone: Array = 1.0 / np.diagonal(mobility, axis1=1, axis2=2)
        s = np.square(mobility) * alone[:, :, None] * alone[:, None, :]
        together: Array = np.sqrt(s.sum(axis=(1, 2)))
        return alone / together[:, None]
