"""Faults of whole columns in logs of robots: repeated old values, torques that were not measured."""

import math
from dataclasses import replace

import numpy as np

from caster_gym.arrays import Array
from caster_gym.identification.contradictions import Finding, columns_of
from caster_gym.identification.kinematic_laws import white_noise
from caster_gym.identification.mends import Mend, listed
from caster_gym.identification.recording import Recording
from caster_gym.robot import Robot

_FEWEST_CHANGES = 5
_HELD = 0.8  # [-] of a column's changes that come at one and the same interval
_WINDOWS_OF_SPEED = 50
_MOSTLY = 0.9  # [-] quantile of torques that stands for the greatest, without outliers
_BEYOND_LIMITS = 5.0  # times the greatest torque of a motor
_SURE = 10.0  # standard deviations of noise that a speed must gain

# Suppressions below: mypy follows neither the fields that `replace` is given by name nor defaults of lambdas.


def held_columns(recording: Recording) -> Finding | None:
    """Columns that are written less often than the rows come."""
    groups = {
        "x, y and heading": "pose",
        "vx, vy and yaw_rate": "twist",
        listed(columns_of("steering", recording)): "steering",
    }
    if recording.rolling is not None:
        groups[listed(columns_of("rolling", recording))] = "rolling"
    rates = {columns: _interval(getattr(recording, name)) for columns, name in groups.items()}
    slow = max(rates, key=lambda columns: rates[columns])
    if rates[slow] < 2 or min(rates.values()) >= rates[slow]:
        return None
    name = groups[slow]
    return Finding(
        f"{slow} change only in every {_ordinal(rates[slow])} row, all together, while others change more often: "
        "they are old values that are written again. To mend it, interpolate them between the rows in which they "
        "change.",
        Mend(
            f"{slow} are held",
            "interpolate them between the rows in which they change",
            lambda r: replace(r, **{name: _interpolated(getattr(r, name))}),  # type: ignore[arg-type]
            name,
        ),
    )


def _interval(columns: Array | None) -> int:
    """Rows from one change of columns (K, n) to the next, if it is nearly always the same; else 1."""
    if columns is None:
        return 1
    changed = np.diff(columns, axis=0) != 0.0
    changed = changed[:, changed.any(axis=0)]
    rows = np.flatnonzero(changed.any(axis=1))
    if len(rows) < _FEWEST_CHANGES or not changed[rows].all(axis=1).mean() >= _HELD:
        return 1
    steps = np.diff(rows)
    usual = int(np.median(steps))
    return usual if (steps == usual).mean() >= _HELD else 1


def _interpolated(columns: Array) -> Array:
    """Straight lines between the rows in which columns (K, n) change. The last value is held."""
    rows = np.concatenate([[0], 1 + np.flatnonzero((np.diff(columns, axis=0) != 0.0).any(axis=1))])
    everywhere = np.arange(len(columns))
    return np.stack([np.interp(everywhere, rows, column[rows]) for column in columns.T], axis=1)


def torques_missing(recording: Recording) -> Finding | None:
    """A robot that speeds up without a torque: a log of drives that tell no effort."""
    if recording.torque.any():
        return None
    width = max(len(recording.pose) // _WINDOWS_OF_SPEED, 1)
    steps = np.diff(recording.pose[::width, :2], axis=0)
    speeds = np.hypot(*steps.T) / (width * recording.time_step)
    gained = speeds - np.minimum.accumulate(speeds)
    last = int(gained.argmax())
    noise = math.sqrt(2.0) * white_noise(recording.pose[:, :2]) / (width * recording.time_step)
    if gained[last] <= max(0.5 * speeds.max(), _SURE * noise):
        return None
    return Finding(
        f"All torques are zero, though the robot speeds up from {speeds[: last + 1].min():.3g} to {speeds[last]:.3g} "
        "m/s: whatever wrote the recording did not know them. Write the torques of the motors, such as their currents "
        "times their torque constants.",
        None,
    )


def torques_too_large(recording: Recording, robot: Robot) -> Finding | None:
    """Torques far beyond what motors give: a log in another unit, or of currents."""
    limits, names = robot.max_torques, [f"torque_{joint}" for joint in robot.joints]
    shares = np.quantile(np.abs(recording.torque), _MOSTLY, axis=0) / limits  # (2 N,)
    if shares.max() <= _BEYOND_LIMITS:
        return None
    worst = int(shares.argmax())
    large = listed(f"{name} [mN m]" for name, share in zip(names, shares, strict=True) if share > _BEYOND_LIMITS)
    return Finding(
        f"{names[worst]} reaches {shares[worst] * limits[worst]:.3g} N m, where its motor has {limits[worst]:g} N m at "
        f"most. If it is in mN m, write {large} into the header; if it is a current, multiply it by the torque "
        "constant; if the motor is stronger, say so in the robot's file.",
        None,
    )


def _ordinal(number: int) -> str:
    return f"{number}{ {2: 'nd', 3: 'rd'}.get(number, 'th') }"
