"""Gains that weigh predictions and measurements: the Kalman filter of a disturbed double integrator. docs/control.md.

x       error of an estimate along one axis: place, speed, acceleration of a disturbance that stays
T       control period                                                                              [s]
L_k     gains (3, 2) of control period k, from place and speed measured to x
"""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array

SETTLED = 1e-9  # relative change of the gains from which on they stay
MOST_PERIODS = 3000


class Axis(NamedTuple):
    """What is uncertain along one axis, as standard deviations."""

    place: float  # [m] or [rad] measured
    speed: float  # [m/s] or [rad/s] measured
    unmodelled: float  # [m/s²] or [rad/s²] anew in every control period
    drift: float  # [m/s²/√s] or [rad/s²/√s] of the disturbance that stays
    disturbance: float  # [m/s²] or [rad/s²] of it at the start of an episode


class Gains(NamedTuple):
    """Gains of the control periods 0, 1, … of an episode, the last of which stay, and how sure the speed then is."""

    weights: Array  # (periods, 3, 2)
    speed: float  # standard deviation of the estimated speed in the end


def gains_of(axis: Axis, period: float) -> Gains:
    """Gains by the covariance's recursion from the first measurement on, until they no longer change."""
    t = period
    moves = np.array([[1.0, t, 0.5 * t**2], [0.0, 1.0, t], [0.0, 0.0, 1.0]])
    pushed = np.array([0.5 * t**2, t, 0.0])
    added = axis.unmodelled**2 * np.outer(pushed, pushed)  # (X3)
    added[2, 2] = axis.drift**2 * t
    measured = np.diag([axis.place**2, axis.speed**2])
    certain = np.diag([axis.place**2, axis.speed**2, axis.disturbance**2])
    weights = [np.eye(3, 2)]  # the first estimate is the first measurement
    while len(weights) < MOST_PERIODS:
        before = moves @ certain @ moves.T + added  # (X4)
        weight = np.linalg.solve(before[:2, :2] + measured, before[:2]).T  # (X5)
        kept = np.eye(3)
        kept[:, :2] -= weight
        certain = kept @ before @ kept.T + weight @ measured @ weight.T  # Joseph's form of (X6): it stays symmetric
        weights.append(weight)
        if np.abs(weight - weights[-2]).max() <= SETTLED * np.abs(weight).max():
            break
    return Gains(np.array(weights), float(np.sqrt(certain[1, 1])))


def steady_share(noise: float, walk: float) -> float:
    """Gain of a measured angle with that noise [rad], whose prediction errs by `walk` [rad] more every period."""
    ratio = (walk / noise) ** 2
    return float(0.5 * (np.sqrt(ratio**2 + 4.0 * ratio) - ratio))  # (X7)
