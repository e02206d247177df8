"""The inner loop that tracks twist commands.

    v        twist (vx, vy, ω) in B, v at the start of a control period T, v′ wanted at its end
    c        commanded twist in B
    σ        how fast (vx, vy) of the command turns in B, of −ω: 0 stays in B, 1 points in a direction of W
    E        exp(−bandwidth T), what is left of an error after a period

    v′ = R(−σ ω̄ T) (c + E (v − c)), R turning (vx, vy), ω̄ the mean yaw rate of the period

The wrench is that of the rate (v′ − v) / T in the middle of the period, for casters that trail until then. Where the
motors cannot hold the command, c is the greatest multiple of it that they can hold; where they cannot reach v′ at once,
the wrench is that of the greatest part of the way towards it.
"""

from typing import TYPE_CHECKING

import numpy as np
from gymnasium.spaces import Box

from caster_gym.arrays import Array
from caster_gym.control.torque_distribution import distribute
from caster_gym.control.wrench_limits import reach_of
from caster_gym.mechanics.motors import torque_range
from caster_gym.paths.trailing import steer
from caster_gym.wrappers.feature import Actions, Place, Quantities
from caster_gym.wrappers.inner_loop import InnerLoop

if TYPE_CHECKING:
    from caster_gym.wrappers.commands import TwistCommands

_HALVINGS = 12  # of the interval in which the multiple of a command lies that the motors can hold: 0.02 %
_HELD = 0.98  # [-] of the torques that holding a twist may take; the rest corrects errors
_STUCK = 0.02  # [-] of the way, below which the motors do what they can, in whatever ratio, to get on
_LEAST_TURN = 1e-6  # [rad] in a period, below which it does not matter how a command turns


class TwistLoop(InnerLoop):
    """Torques for twist commands."""

    constants = InnerLoop.constants | {"_engine"}

    def __init__(self, settings: "TwistCommands", place: Place) -> None:
        super().__init__(place, settings.bandwidth)
        self._engine, self._period = place.engine, place.period
        self._world = settings.frame == "world"
        self._greatest = np.array([settings.max_speed, settings.max_speed, settings.max_yaw_rate])
        self._left = np.exp(-settings.bandwidth * place.period)
        self._before = np.zeros((place.count, 3))  # command, and yaw rate, at the action before
        casters = place.engine.robot.casters
        self._pivots = np.array([[caster.x for caster in casters], [caster.y for caster in casters]])
        self._trails = np.array([caster.trail for caster in casters])
        self.action_space = Box(-1.0, 1.0, (3,), np.float32)

    def begin(self, robots: np.ndarray, quantities: Quantities) -> None:
        self._before[robots] = 0.0

    def act(self, actions: Actions) -> Actions:
        wanted = np.clip(actions.astype(np.float64), -1.0, 1.0) * self._greatest
        if self._world:
            cos, sin = self._engine.states[:, 2:4].T
            wanted = _turned(wanted, np.arctan2(-sin, cos))
            turning = np.ones(len(wanted))
        else:
            turning = self._turning(wanted)
        wanted = self._holdable(wanted, turning)
        mean_rate = self._twist[:, 2] + 0.5 * (1.0 - self._left) * (wanted[:, 2] - self._twist[:, 2])
        turn = -turning * mean_rate * self._period
        coming = _turned(wanted + self._left * (self._twist - wanted), turn)
        steering = self._steering_after(0.5 * self._period, 0.5 * (self._twist + coming))
        b = self._pushes(steering)
        force = self._wrench(steering, 0.5 * (self._twist + coming), (coming - self._twist) / self._period)
        low, high = torque_range(self._speeds, np.ones_like(self._speeds), self._max_speed)
        shares = distribute(b, force, low, high)
        limited = ((shares <= low) | (shares >= high)).any(axis=1)
        if limited.any():
            kept = _turned(self._twist, turn)
            start = self._wrench(steering, 0.5 * (self._twist + kept), (kept - self._twist) / self._period)[limited]
            way = force[limited] - start
            part = reach_of(b[limited]).greatest_share(start, way, low[limited], high[limited])
            part = np.where(part < _STUCK, 1.0, part)
            shares[limited] = distribute(b[limited], start + part[:, None] * way, low[limited], high[limited])
        return shares.astype(np.float32)

    def _turning(self, wanted: Array) -> Array:
        """σ (robots,) from the commands of this action and the one before."""
        x, y, last_x, last_y = *wanted[:, :2].T, *self._before[:, :2].T
        angle = np.arctan2(last_x * y - last_y * x, last_x * x + last_y * y)
        robot = -0.5 * self._period * (self._before[:, 2] + self._twist[:, 2])
        turns = np.abs(robot) > _LEAST_TURN
        self._before[:, :2], self._before[:, 2] = wanted[:, :2], self._twist[:, 2]
        return np.where(turns, np.clip(angle / np.where(turns, robot, 1.0), 0.0, 1.0), 0.0)

    def _steering_after(self, time: float, twist: Array) -> Array:
        """Steering angles (robots, N) after a time [s] in which the twist changes evenly to this one (robots, 3)."""
        turn = 0.5 * time * (self._twist[:, 2] + twist[:, 2])[:, None]
        cos, sin = np.cos(turn), np.sin(turn)
        (x, y), (later_x, later_y) = self._pivot_velocities(self._twist), self._pivot_velocities(twist)
        end_x, end_y = cos * later_x - sin * later_y, sin * later_x + cos * later_y  # in the axes of B at the start
        way, change = (0.5 * time * (x + end_x), 0.5 * time * (y + end_y)), (time * (end_x - x), time * (end_y - y))
        c, s = steer((np.cos(self._steering), np.sin(self._steering)), way, change, self._trails)
        return np.arctan2(s, c) - turn

    def _pivot_velocities(self, twist: Array) -> tuple[Array, Array]:
        """Velocities of the steering axes (robots, N) along the axes of B. [m/s]"""
        vx, vy, omega = (column[:, None] for column in twist.T)
        return vx - omega * self._pivots[1], vy + omega * self._pivots[0]

    def _pushes(self, steering: Array) -> Array:
        """B (robots, 3, motors)."""
        b = self._model.motor_wrenches(steering)
        b[:, 2] /= self._model.characteristic_length
        return b

    def _wrench(self, steering: Array, twist: Array, rate: Array) -> Array:
        """Force (robots, 3) at C for a twist and its rate, its moment divided by the characteristic length."""
        force = self._model.inverse_dynamics(steering, twist, rate)
        force[:, 2] /= self._model.characteristic_length
        return force

    def _holdable(self, wanted: Array, turning: Array) -> Array:
        """The greatest multiples, up to 1, of twists (robots, 3) that the motors can hold at the present steering."""
        b = self._pushes(self._steering)

        def held(multiple: Array) -> tuple[Array, Array, Array]:
            twist = multiple[:, None] * wanted
            rate = (_turned(twist, -turning * twist[:, 2] * self._period) - twist) / self._period
            x, y, z = twist[:, 0], twist[:, 1], self._model.characteristic_length * twist[:, 2]
            along = b[:, 0] * x[:, None] + b[:, 1] * y[:, None] + b[:, 2] * z[:, None]
            low, high = torque_range(along / self._max_torque, np.ones_like(along), self._max_speed)
            return self._wrench(self._steering, twist, rate), _HELD * low, _HELD * high

        wrench, low, high = held(np.ones(len(wanted)))
        shares = distribute(b, wrench, low, high)
        limited = ((shares <= low) | (shares >= high)).any(axis=1)
        if not limited.any():
            return wanted
        reach = reach_of(b)
        limited &= reach.lack(wrench, low, high) > 0.0
        below, above = np.zeros(len(wanted)), np.ones(len(wanted))
        for _ in range(_HALVINGS if limited.any() else 0):
            middle = 0.5 * (below + above)
            fits = reach.lack(*held(middle)) <= 0.0
            below, above = np.where(fits, middle, below), np.where(fits, above, middle)
        return np.where(limited, below, 1.0)[:, None] * wanted


def _turned(twist: Array, angle: Array) -> Array:
    """Twists (robots, 3) with (vx, vy) turned by angles (robots,). [rad]"""
    cos, sin = np.cos(angle), np.sin(angle)
    x, y, omega = twist.T
    return np.stack([cos * x - sin * y, sin * x + cos * y, omega], axis=1)
