"""Actions with another meaning than torques: corrections of another agent, twists, joint speeds.

Inner loops run at the control period, on the observation that reaches them and nothing else.
"""

import copy
from typing import Any, ClassVar, Literal

import numpy as np
from gymnasium.spaces import Box
from pydantic import Field, field_validator

from caster_gym.arrays import Array, Indices
from caster_gym.configuration import Positive
from caster_gym.control.episodes import remembers, reset_of
from caster_gym.states import State
from caster_gym.wrappers.feature import Actions, Feature, Observations, Place, Quantities, Robots, Runtime
from caster_gym.wrappers.inner_loop import InnerLoop
from caster_gym.wrappers.twist_loop import TwistLoop


class ResidualTorque(Feature):
    """Actions correct those of another agent: what is done is clip(agent's action + share · action).

    The agent is any object with `act(observations) -> actions`, both (robots, …). One that remembers what it saw and
    did has a method `reset(mask)`, which tells it which robots begin an episode; each environment has a copy of it.

    >>> import caster_gym, gymnasium
    >>> from caster_gym.wrappers import ResidualTorque, wrap
    >>> layout = caster_gym.ObservationLayout(caster_gym.load_robot("chung2008"), preview=(0.1, 0.2, 0.4))
    >>> controller = caster_gym.ComputedTorque(layout, natural_frequency=30.0, period=0.02)
    >>> env = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate")
    >>> env = wrap(env, ResidualTorque(agent=controller, share=0.1))  # an action of 0 is computed torque alone
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
        reset_of(agent)
        return agent

    def runtime(self, place: Place) -> Runtime:
        """The agent beside the actions."""
        return _Residual(self, place)


class TwistCommands(Feature):
    """Actions are twists (vx, vy, ω) as shares of the greatest ones, which an inner loop tracks with torques.

    frame "body": vx and vy are along the axes of B. A constant command stays as it is in B, while the robot turns; one
    that turns in B from action to action by no more than the robot does against it is expected to go on so, up to a
    direction of the world that is turned into B before every action. frame "world": vx and vy are along those of W,
    which the loop turns into B at the heading of info["pose"].

    With the robot's model at hand, what is left to a wanted twist falls as exp(−bandwidth · t) while no motor is at its
    limit. A twist that the motors cannot hold is reduced as a whole, to the greatest multiple that they can hold; the
    way towards it likewise.

    >>> import gymnasium
    >>> from caster_gym.wrappers import TwistCommands, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), TwistCommands(max_speed=0.5))
    >>> observation, info = env.reset(seed=0)
    >>> env.action_space.shape  # vx, vy, ω instead of six torques
    (3,)
    """

    kind: Literal["twist_commands"] = "twist_commands"
    redefines_actions: ClassVar[bool] = True
    frame: Literal["body", "world"] = "body"  # of vx and vy
    max_speed: Positive = 1.0  # [m/s] along each axis
    max_yaw_rate: Positive = 2.0  # [rad/s]
    bandwidth: Positive = 20.0  # [1/s]

    def runtime(self, place: Place) -> Runtime:
        """The inner loop."""
        return TwistLoop(self, place)


class JointSpeeds(Feature):
    """Actions are speeds of the driven motors as shares of their top speeds, which inner loops track with torques.

    torque = gain · (wanted speed − speed), with gain = m (1 − exp(−bandwidth · T)) / (T ‖S‖). m is the inertia that the
    motor alone would have to accelerate at the present steering angles, S that of all motors against each other,
    S_ij = w_iᵀ M⁻¹ w_j √(m_i m_j), w the motors' wrenches per torque. As ‖S‖ (Frobenius) is no less than the greatest
    eigenvalue of S, no motion closes faster on its target than exp(−bandwidth · t), and none overshoots, however long
    the control period T is: it holds what happens in it apart from the turning of the casters.

    >>> import gymnasium
    >>> from caster_gym.wrappers import JointSpeeds, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), JointSpeeds())
    >>> observation, info = env.reset(seed=0)
    >>> env.action_space.shape  # one speed for each driven motor
    (6,)
    """

    kind: Literal["joint_speeds"] = "joint_speeds"
    redefines_actions: ClassVar[bool] = True
    bandwidth: Positive = 50.0  # [1/s]

    def runtime(self, place: Place) -> Runtime:
        """The inner loops."""
        return _SpeedLoops(self, place)


class _Residual(Runtime):
    constants = frozenset({"_agent"})

    def __init__(self, feature: ResidualTorque, place: Place) -> None:
        self._remembers = remembers(feature.agent)
        self._agent = copy.deepcopy(feature.agent) if self._remembers else feature.agent
        self._reset, self._share = reset_of(self._agent), feature.share
        self._seen = np.zeros((place.count, place.engine.layout.size), dtype=np.float32)

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        mask = np.zeros(len(self._seen), dtype=np.bool_)
        mask[robots] = True
        self._reset(mask)

    def get_state(self) -> State:
        if self._remembers:
            raise TypeError(f"{self._called} keeps an agent with memory, {self._agent!r}, whose state cannot be saved")
        return super().get_state()

    def act(self, actions: Actions) -> Actions:
        given = np.asarray(self._agent.act(self._seen.copy()), dtype=np.float64)
        if given.shape != actions.shape:
            raise ValueError(f"the agent's actions must have shape {actions.shape}, got {given.shape}")
        residual = self._share * np.clip(actions.astype(np.float64), -1.0, 1.0)
        return np.clip(given + residual, -1.0, 1.0).astype(np.float32)

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        self._seen[robots] = observations
        return observations


class _SpeedLoops(InnerLoop):
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
