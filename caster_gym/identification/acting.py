"""Corrects a recording's torques and angles: motor strengths, delay, lag, zeros and biases."""

from collections.abc import Mapping

import numpy as np

from caster_gym.arrays import Array
from caster_gym.identification.recording import Recording
from caster_gym.identification.unknowns import ACTING, SHOWN, kind_of, of_caster
from caster_gym.robot import Robot


def acting_torque(recording: Recording, robot: Robot, values: Mapping[str, float], substeps: int) -> Array:
    """Torques (K · substeps, 2 N) that act at the joints over each substep, on average. [N m]

    They are held from row to row of the recording, come torque_delay later, are followed with motor_lag by motors of
    some strengths. Before the first row, and after the last, torques are those of these rows.
    """
    said = recording.torque @ _strengths(robot, values).T
    step = recording.time_step / substeps
    steps = np.arange(len(said) * substeps + 1) - values.get("torque_delay", 0.0) / step
    late = np.repeat(said, substeps, axis=0)
    if values.get("torque_delay", 0.0) != 0.0:
        impulse = np.concatenate([np.zeros_like(said[:1]), np.cumsum(late, axis=0)])
        inside = np.clip(steps, 0.0, len(late))
        knots = np.arange(len(impulse))
        ends = np.stack([np.interp(inside, knots, column) for column in impulse.T], axis=1)
        ends += np.minimum(steps, 0.0)[:, None] * said[0] + np.maximum(steps - len(late), 0.0)[:, None] * said[-1]
        late = np.diff(ends, axis=0)
    lag = values.get("motor_lag", 0.0)
    return late if lag <= 0.0 else _followed(late, lag / step)


def _followed(wanted: Array, lag: float) -> Array:
    """Means over each step of what follows (k, n) held values with a lag, in steps; it starts with the first."""
    from scipy.signal import lfilter

    kept = np.exp(-1.0 / lag)
    start = wanted[:1] * kept
    ends = lfilter([1.0 - kept], [1.0, -kept], wanted, axis=0, zi=start)[0]
    before = np.concatenate([wanted[:1], ends[:-1]])
    means: Array = wanted + (before - wanted) * lag * (1.0 - kept)
    return means


def _strengths(robot: Robot, values: Mapping[str, float]) -> Array:
    """Acting torques of the joints from recorded ones (2 N, 2 N): the motors have strengths, gears couple joints."""
    matrix = np.zeros((2 * robot.caster_count,) * 2)
    for i, caster in enumerate(robot.casters):
        own, gear = of_caster(values, i), np.array(caster.gear)
        strengths = np.diag([float(own.get("roll_strength", 1.0)), float(own.get("steer_strength", 1.0))])
        place = slice(2 * i, 2 * i + 2)
        matrix[place, place] = gear.T @ strengths @ np.linalg.inv(gear.T)
    return matrix


def acts(names: Mapping[str, float]) -> bool:
    """Whether any of the names stands between recorded and acting torques."""
    return any(kind_of(name) in ACTING for name in names)


def shown_errors(robot: Robot, values: Mapping[str, float], width: int) -> Array:
    """What sensors show minus what is true, for each component (width,) of x, y, β, vx, vy, ω, δ_1, …, θ_1, …"""
    errors = np.zeros(width)
    for name, place in SHOWN.items():
        errors[place] = values.get(name, 0.0)
    for i in range(robot.caster_count):
        errors[6 + i] = of_caster(values, i).get("steering_zero", 0.0)
    return errors
