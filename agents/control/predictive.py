"""Predictive control: torques that follow the previewed reference best over a horizon, by the exact mechanics.

Each control period the planned torques are shifted by a period and improved by a Gauss-Newton step around the motion
that they make of the present state, within the motors' limits; the first ones are applied. One step is enough as long
as the plan changes little from period to period (real-time iteration: Diehl, Bock and Schlöder, SIAM Journal on Control
and Optimization 43, 2005).
Derivation: docs/predictive.md.
"""

from collections.abc import Sequence
from typing import Annotated, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, PositiveInt

from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.analysis.actuation import warn_if_singular
from caster_gym.arrays import Array, Flags
from caster_gym.configuration import Positive
from caster_gym.control.box_riccati import Costs, Linearised, improve
from caster_gym.engines.native.derivatives import PeriodDerivatives
from caster_gym.engines.numpy_model import Model
from caster_gym.engines.time_step import longest_time_step, substeps_for
from caster_gym.envs.observation import ObservationLayout
from caster_gym.mechanics.motors import torque_range

OPENING = 8  # Gauss-Newton steps of a robot's first plan, which begins without torques


class PredictiveControl:
    """Follows the reference that the observation shows by planned torques.

    horizon: control periods that are planned. period [s] between actions. effort [m]: error of place that counts as
    much as the whole torque of a motor. time [s]: an error of speed counts as the error of place that it makes in this
    time. rounds: Gauss-Newton steps a period. Raises ValueError if observations preview less than the horizon.

    >>> import caster_gym, gymnasium, numpy
    >>> env = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate")
    >>> layout = caster_gym.ObservationLayout(caster_gym.load_robot("chung2008"), preview=(0.1, 0.2, 0.4))
    >>> controller = caster_gym.PredictiveControl(layout, period=0.02)
    >>> observation, info = env.reset(seed=0)
    >>> controller.reset(numpy.array([True]))
    >>> for _ in range(100):
    ...     observation, reward, terminated, truncated, info = env.step(controller.act(observation[None])[0])
    >>> info["position_error"] < 1e-5  # [m]
    True
    """

    name = "predictive control"

    def __init__(
        self,
        layout: ObservationLayout,
        period: float,
        horizon: int = 10,
        effort: float = 2e-4,
        time: float = 0.05,
        rounds: int = 1,
    ) -> None:
        self.layout, self.period, self.horizon, self.rounds = layout, period, horizon, rounds
        warn_if_singular(layout.robot)
        self._points = _points_for(layout, horizon * period)
        times: Array = period * np.arange(1.0, horizon + 1.0)
        self._places, self._speeds = interpolation(self._points, times)
        robot = layout.robot
        self._model = Model(robot)
        self._costs = Costs(float(self._model.characteristic_length), time, effort, 1.0)
        substeps = substeps_for(period, longest_time_step(robot))
        self._derivatives = PeriodDerivatives(robot, period / substeps, substeps)
        self._max_torque = robot.max_torques[robot.driven_indices]
        self._max_speed = robot.max_speeds[robot.driven_indices]
        gears = np.zeros((2 * robot.caster_count, 2 * robot.caster_count))
        for i, caster in enumerate(robot.casters):
            gears[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = np.transpose(caster.gear)
        self._spread = np.ascontiguousarray(gears[:, robot.driven_indices] * self._max_torque)
        self._plans: Array = np.zeros((0, horizon, len(self._max_torque)))
        self._new: Flags = np.zeros(0, dtype=np.bool_)

    def reset(self, mask: Flags) -> None:
        """Robots that begin an episode have no plan."""
        if len(mask) != len(self._new):
            self._new = np.ones(len(mask), dtype=np.bool_)
        self._new |= mask

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) for observations (robots, size)."""
        count = len(observations)
        if len(self._plans) != count:
            self._plans, self._new = np.zeros((count, *self._plans.shape[1:])), np.ones(count, dtype=np.bool_)
        states, wanted = self._states(observations), self._wanted(observations)
        if (new := self._new).any():
            plans = np.zeros_like(self._plans[new])
            for _ in range(OPENING):
                self._improve(plans, states[new], wanted[new])
            self._plans[new] = plans
        for _ in range(self.rounds):
            self._improve(self._plans, states, wanted)
        self._new = np.zeros(count, dtype=np.bool_)
        actions = self._plans[:, 0].astype(np.float32)
        self._plans[:, :-1] = self._plans[:, 1:]
        return actions

    def _improve(self, plans: Array, states: Array, wanted: Array) -> None:
        """Improve plans (robots, K, m) of robots in these states by one Gauss-Newton step."""
        shape = self.horizon, *states.shape
        path, by_state = np.empty((shape[0] + 1, *shape[1:])), np.empty((*shape, shape[-1]))
        by_torque = np.empty((*shape, len(self._spread)))
        torques = np.einsum("rkm,jm->rkj", plans, self._spread)  # the same for a robot alone and in a batch
        path[0] = states
        for k in range(self.horizon):
            end, by_state[k], by_torque[k], _ = self._derivatives.at(path[k], torques[:, k])
            directions = end[:, 7:].reshape(len(end), -1, 2)
            directions *= 1.5 - 0.5 * np.square(directions).sum(
                axis=-1, keepdims=True
            )  # of casters that flip in a step
            path[k + 1] = end
        low, high = self._limits(path[:-1])
        improve(plans, Linearised(path, by_state, by_torque), self._spread, low, high, wanted, self._costs)

    def _limits(self, path: Array) -> tuple[Array, Array]:
        """Least and greatest torque shares (robots, K, m) at the motors' speeds along a path (K, robots, rows)."""
        steering = np.arctan2(path[..., 8::2], path[..., 7::2])
        wrenches = self._model.motor_wrenches(steering)  # a motor's wrench and its speed have the same row
        speeds = np.einsum("kri,krim->krm", path[..., 4:7], wrenches) / self._max_torque
        low, high = torque_range(speeds, np.ones_like(speeds), self._max_speed)
        return np.ascontiguousarray(low.swapaxes(0, 1)), np.ascontiguousarray(high.swapaxes(0, 1))

    def _states(self, observations: NDArray[np.float32]) -> Array:
        """States (robots, 7 + 2 N), each in a frame that is the robot's own now."""
        directions = self.layout.physical(observations, "directions").reshape(len(observations), -1, 2)
        directions = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
        states = np.zeros((len(observations), 7 + 2 * directions.shape[1]))
        states[:, 2] = 1.0
        states[:, 4:7] = self.layout.physical(observations, "twist")
        states[:, 7:] = directions.reshape(len(observations), -1)
        return states

    def _wanted(self, observations: NDArray[np.float32]) -> Array:
        """The reference (robots, K, 7) after each period: x, y, cos, sin, and velocities, in the same frame."""
        see = self.layout.physical
        heading = see(observations, "heading_error")
        turn = np.arctan2(heading[:, 1], heading[:, 0])[:, None]
        place = np.concatenate([see(observations, "position_error"), turn], axis=1)
        shown = [place, see(observations, "twist") + see(observations, "twist_error")]
        shown.append(see(observations, "reference_acceleration"))
        for ahead in self._points:
            point = see(observations, f"preview_{ahead:g}s")
            more = np.arctan2(point[:, 3], point[:, 2])[:, None] - place[:, 2:]
            place = np.concatenate([point[:, :2], place[:, 2:] + np.arctan2(np.sin(more), np.cos(more))], axis=1)
            shown += [place, point[:, 4:]]
        given = np.stack(shown, axis=1)  # (robots, conditions, 3)
        places, speeds = (np.einsum("kc,rci->rki", one, given) for one in (self._places, self._speeds))
        directions = [np.cos(places[..., 2:]), np.sin(places[..., 2:])]
        return np.concatenate([places[..., :2], *directions, speeds], axis=-1)


def interpolation(points: Sequence[float], times: Array) -> tuple[Array, Array]:
    """Matrices (times, conditions) that give places and speeds at some times [s] from what a preview shows.

    Conditions are place, speed and acceleration now, then place and speed at each of the points [s]; one polynomial has
    all of them.
    """
    longest = max(points)
    degree = 2 * len(points) + 3

    def row(time: float, derivative: int) -> Array:
        powers = np.arange(degree)
        factors = np.prod([powers - k for k in range(derivative)], axis=0) if derivative else np.ones(degree)
        scaled = np.where(powers >= derivative, (time / longest) ** np.maximum(powers - derivative, 0), 0.0)
        found: Array = factors * scaled / longest**derivative
        return found

    conditions = [row(0.0, 0), row(0.0, 1), row(0.0, 2)]
    conditions += [row(point, derivative) for point in points for derivative in (0, 1)]
    inverse = np.linalg.inv(np.array(conditions))
    places = np.array([row(time, 0) for time in times]) @ inverse
    speeds = np.array([row(time, 1) for time in times]) @ inverse
    return places, speeds


def _points_for(layout: ObservationLayout, horizon: float) -> tuple[float, ...]:
    """The previewed points that a horizon [s] needs: all up to the first one behind it. [s]"""
    if layout.unit != "s":
        raise ValueError("predictive control follows a reference in time, and this task previews one along its path")
    points = sorted(layout.preview)
    if not points or points[-1] < horizon * (1.0 - 1e-9):
        shown = f"{points[-1]:g} s" if points else "nothing"
        shorter = "it a shorter 'horizon', or " if points else ""
        raise ValueError(
            f"predictive control plans {horizon:g} s ahead, and observations preview {shown}: give {shorter}the task a "
            "longer 'preview'"
        )
    last = next(i for i, point in enumerate(points) if point >= horizon * (1.0 - 1e-9))
    return tuple(points[: last + 1])


class PredictiveSettings(ControllerSettings):
    """Predictive control; its effort is the one of those listed that does best on validation paths."""

    algorithm: Literal["predictive"]
    horizon: Annotated[PositiveInt, Field(le=100)] = 10  # control periods that are planned
    efforts: Annotated[tuple[Positive, ...], Field(min_length=1)] = (
        2e-4,
        1e-3,
        5e-3,
    )  # [m] error that a whole torque counts as
    time: Positive = 0.05  # [s] in which an error of speed makes the error of place that it counts as
    rounds: PositiveInt = 1  # Gauss-Newton steps a period

    def controller(self, layout: ObservationLayout, period: float) -> PredictiveControl:
        """The controller with the first effort."""
        return PredictiveControl(layout, period, self.horizon, self.efforts[0], self.time, self.rounds)

    def candidates(self) -> Sequence[Self]:
        """The same settings with each effort alone."""
        return [self.model_copy(update={"efforts": (one,)}) for one in self.efforts]
