"""Where robots are when an action arrives: measured, filtered and predicted by the model. docs/control.md, section X.

States are those of `Fleet`, relative to the frame R of the reference: x, y, cos, sin, twist in B, then cos δ, sin δ of
each caster. Nothing of one robot touches another one.
"""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.beliefs import Beliefs
from caster_gym.agents.control.observer_gains import observer_gains
from caster_gym.agents.control.planar import angle_between, short_way, turned, turned_direction
from caster_gym.agents.control.reference_ahead import Ahead, course_of
from caster_gym.arrays import Array, Flags
from caster_gym.engines.native.driven import DrivenRobots
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import ObservationLayout
from caster_gym.mechanics.integration import BODY_ROWS
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.wrappers.latency import lag_of


class Sight(NamedTuple):
    """What a controller sees of robots and of their reference, in B: (robots, 3), steering (robots, casters)."""

    steering: Array
    twist: Array
    error: Array  # reference minus robot [m, m, rad]
    rate: Array  # of the error: how much faster the reference is
    acceleration: Array  # of the reference
    jerk: Array  # of the reference
    disturbance: Array  # wrench that pushes the robot [N, N, N m]
    followed: Array  # (robots, motors) what lagging motors give, as shares of their greatest torques


class Estimator:
    """Keeps track of robots from one observation and action to the next.

    model: what is known of the robot; period [s] between actions. Raises ValueError for a delay that is longer than the
    preview, and for a reference that no clock leads.
    """

    def __init__(self, model: Model, layout: ObservationLayout, period: float, beliefs: Beliefs) -> None:
        delay, robot = beliefs.prediction.delay, model.robot
        self._model, self._layout, self._period, self._horizon = model, layout, period, delay * period
        if layout.unit != "s":
            raise ValueError(
                "'predict' and 'observe' need a reference that a clock leads, with a preview in s, got one in "
                f"{layout.unit} along a path"
            )
        if layout.preview and self._horizon > max(layout.preview):
            raise ValueError(
                f"'predict' must look no farther than the preview, which ends after {max(layout.preview):g} s, got a "
                f"delay of {delay} control periods, which are {self._horizon:g} s"
            )
        self.lag = lag_of(beliefs.prediction.lag, period)
        self._drive = DrivenRobots(robot, robot_parameters(robot, model.dynamics), period).after
        self._driven, self._joints, self._delay = layout.robot.driven_indices, 2 * robot.caster_count, delay
        self.observes, self._drifts = beliefs.sensors is not None, beliefs.drift > 0.0
        self._noisy = beliefs.sensors is not None and beliefs.sensors.noisy
        self._gains = observer_gains(model, period, beliefs)
        rates = next(part for part in layout.parts if part.name == "joint_rates")
        self._rims: Array = 1.0 / rates.scale  # [m] by which joint rates become speeds
        self._count = 0

    def reset(self, mask: Flags) -> None:
        """New episodes of some robots begin with the next observation."""
        if len(mask) != self._count:
            self._count = len(mask)
            self._clocks = np.zeros(self._count, dtype=np.int64)
            self._states = np.zeros((self._count, BODY_ROWS + self._joints))
            self._wrenches = np.zeros((self._count, 3))
            self._waiting = np.zeros((self._delay + 1, self._count, len(self._driven)))  # the oldest first
            self._followed = np.zeros((self._count, len(self._driven)))
            self._shown = np.zeros((self._count, self._layout.size), dtype=np.float32)
            self._ages = np.zeros(self._count)  # [control periods] of what is shown
            self._moved: Ahead | None = None  # where the reference is a period later, seen from where it is shown
        self._clocks[mask], self._wrenches[mask], self._followed[mask] = 0, 0.0, 0.0
        self._waiting[:, mask] = 0.0

    def look(self, observations: NDArray[np.float32]) -> Sight:
        """What will be seen when an action that is sent now arrives."""
        if len(observations) != self._count:
            raise ValueError(
                f"a controller that remembers {self._count} robots got observations of {len(observations)}: call its "
                "method reset first, with a mask of all of them"
            )
        shown = observations[:, : self._layout.size]
        lost = self._noisy & (self._clocks > 0) & (shown == self._shown).all(axis=1)  # noise never repeats itself
        self._shown, self._ages = shown.copy(), np.where(lost, self._ages + 1.0, 0.0)
        passed = self._period * self._ages
        course = course_of(self._layout, shown, passed.max() + self._horizon + self._period)
        measured = self._measured(shown)
        if self._moved is not None:
            held, self._followed = self._follow(self._waiting[0], self._followed)
            if self.observes:
                moved = self._move(self._states, held)
                rates = self._layout.physical(shown, "joint_rates")
                pushed = self._correct(_seen_from(self._moved, moved), measured, rates)
                self._states[lost], pushed[lost] = moved[lost], 0.0
                self._wrenches += pushed
        fresh = np.flatnonzero(self._clocks == 0) if self.observes else slice(None)
        self._states[fresh] = measured[fresh]
        self._moved = course.at(passed + self._period)
        self._clocks += 1
        return self._predict(course.at(passed + self._horizon))

    def sent(self, actions: NDArray[np.float32]) -> None:
        """Actions (robots, motors) that were sent after the last look."""
        self._waiting[:-1] = self._waiting[1:]
        self._waiting[-1] = actions

    def _predict(self, ahead: Ahead) -> Sight:
        state, followed = self._states, self._followed
        for action in self._waiting[1:]:
            held, followed = self._follow(action, followed)
            state = self._move(state, held)
        cos, sin, twist = state[:, 2], state[:, 3], state[:, 4:BODY_ROWS]
        error = turned(ahead.place - np.column_stack([state[:, :2], np.arctan2(sin, cos)]), cos, -sin)
        error[:, 2] = short_way(error[:, 2])
        return Sight(
            _steering(state),
            twist,
            error,
            turned(ahead.velocity, cos, -sin) - twist,
            turned(ahead.acceleration, cos, -sin),
            turned(ahead.jerk, cos, -sin),
            self._wrenches,
            followed,
        )

    def _measured(self, observations: NDArray[np.float32]) -> Array:
        """States (robots, 7 + 2 N) as the sensors show them."""
        see = self._layout.physical
        cos, sin = see(observations, "heading_error").T
        place = turned(np.pad(see(observations, "position_error"), ((0, 0), (0, 1))), cos, -sin)
        parts = -place[:, :2], np.column_stack([cos, -sin]), see(observations, "twist"), see(observations, "directions")
        states = np.concatenate(parts, axis=1)
        for first in (2, *range(BODY_ROWS, BODY_ROWS + self._joints, 2)):  # single precision: lengths of 1 ± 1e-7
            states[:, first : first + 2] /= np.hypot(states[:, first], states[:, first + 1])[:, None]
        return states

    def _follow(self, action: Array, followed: Array) -> tuple[Array, Array]:
        """What motors with a lag give in the mean over a period, and at its end."""
        remaining = followed - action
        return action + self.lag.mean * remaining, action + self.lag.end * remaining

    def _move(self, states: Array, shares: Array) -> Array:
        """States a period later, under torques (robots, motors) as shares of the greatest and the disturbance."""
        commands = np.zeros((len(states), self._joints))
        commands[:, self._driven] = shares
        return self._drive(states, commands, self._wrenches)

    def _correct(self, predicted: Array, measured: Array, joint_rates: Array) -> Array:
        """Weigh what was predicted and what is measured; returns what their difference adds to the disturbance. (X8)"""
        states, cos, sin = predicted.copy(), predicted[:, 2], predicted[:, 3]
        was, shown = (one[:, BODY_ROWS:].reshape(len(one), -1, 2) for one in (predicted, measured))
        directions = turned_direction(was, self._gains.steering * angle_between(was, shown))
        states[:, BODY_ROWS:] = directions.reshape(len(states), -1)
        twist = measured[:, 4:BODY_ROWS] + self._gains.wheels * (
            self._counted(_steering(states), joint_rates) - measured[:, 4:BODY_ROWS]
        )
        turn = angle_between(predicted[:, 2:4], measured[:, 2:4])
        place = turned(np.column_stack([measured[:, :2] - predicted[:, :2], turn]), cos, -sin)
        seen = np.stack([place, twist - predicted[:, 4:BODY_ROWS]], axis=2)  # (robots, 3 axes of B, 2)
        weights = self._gains.body[np.minimum(self._clocks, len(self._gains.body) - 1)]
        shift, faster, pushed = np.moveaxis((weights @ seen[..., None])[..., 0], 2, 0)
        states[:, :2] += turned(shift, cos, sin)[:, :2]
        states[:, 2:4] = turned_direction(predicted[:, 2:4], shift[:, 2])
        states[:, 4:BODY_ROWS] += faster
        self._states = states
        if not self._drifts:
            return np.zeros_like(pushed)
        return np.asarray((self._model.inertia(_steering(states)) @ pushed[..., None])[..., 0])  # (X9)

    def _counted(self, steering: Array, joint_rates: Array) -> Array:
        """Twists (robots, 3) by least squares of the speeds of rims and pivots that joint rates (robots, 2 N) are."""
        rows: Array = self._model.jacobian(steering) * self._rims[:, None]
        speeds = rows.mT @ (joint_rates * self._rims)[..., None]
        twist = np.linalg.solve(rows.mT @ rows, speeds)  # (X11)
        return np.asarray(twist[..., 0])


def _steering(states: Array) -> Array:
    """Steering angles (robots, casters). [rad]"""
    angles: Array = np.arctan2(states[:, BODY_ROWS + 1 :: 2], states[:, BODY_ROWS::2])
    return angles


def _seen_from(moved: Ahead, states: Array) -> Array:
    """States as seen from a frame that has moved."""
    cos, sin = np.cos(moved.place[:, 2]), np.sin(moved.place[:, 2])
    seen = states.copy()
    away = np.pad(states[:, :2] - moved.place[:, :2], ((0, 0), (0, 1)))
    seen[:, :2] = turned(away, cos, -sin)[:, :2]
    seen[:, 2:4] = turned_direction(states[:, 2:4], -moved.place[:, 2])
    return seen
