"""Recordings of a robot that moves under known torques: CSV files, and examples from the simulator.

A file has one row a sample, at a constant time step, and a header that names each column with its unit. In any order:

    time [s]                           of the sample
    x [m], y [m], heading [rad]        pose of C in the world; the heading may wrap or not
    vx [m/s], vy [m/s], yaw_rate [rad/s]      twist at C, in B; all three or none
    steering_1 [rad] … steering_N [rad]       angle of each rolling direction in B, as encoders show it
    rolling_1 [rad] … rolling_N [rad]         angle each wheel has rolled, forward positive, never wrapped; all or none
    torque_roll_1 [N m], torque_steer_1 [N m], …      at the joints, held from this sample to the next
    motor_roll_1 [N m], motor_steer_1 [N m], …        instead of these: at the motors, which `gear` couples

Lengths may be in m, cm or mm, angles in rad or deg, times in s or ms, torques in N m or mN m. Columns without a unit
are in the first one given here.
"""

import csv
import math
import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from pydantic import NonNegativeFloat

from caster_gym.analysis.rolling import rolled_along
from caster_gym.configuration import Frozen, did_you_mean
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import Dynamics, robot_parameters
from caster_gym.mechanics.scalars import each, flatten, pairs
from caster_gym.robot import Robot

Array = NDArray[np.float64]

FEWEST_ROWS = 10
POSE = ("x", "y", "heading")
TWIST = ("vx", "vy", "yaw_rate")
_EVEN = 0.01  # [-] of the time step by which a sample may come too early or too late
_UNITS = {
    "time": {"s": 1.0, "ms": 1e-3},
    "length": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "angle": {"rad": 1.0, "deg": math.pi / 180.0},
    "velocity": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3},
    "rate": {"rad/s": 1.0, "deg/s": math.pi / 180.0},
    "torque": {"N m": 1.0, "mN m": 1e-3},
}
_QUANTITIES = {
    "time": "time", "x": "length", "y": "length", "heading": "angle", "vx": "velocity", "vy": "velocity",
    "yaw_rate": "rate", "steering": "angle", "rolling": "angle", "torque": "torque", "motor": "torque",
}  # fmt: skip


class Noise(Frozen):
    """Standard deviations of independent normal errors of each sample, by kind of quantity."""

    position: NonNegativeFloat | None = None  # [m]
    heading: NonNegativeFloat | None = None  # [rad]
    velocity: NonNegativeFloat | None = None  # [m/s]
    yaw_rate: NonNegativeFloat | None = None  # [rad/s]
    steering: NonNegativeFloat | None = None  # [rad]
    rolling: NonNegativeFloat | None = None  # [rad]


KINDS = tuple(Noise.model_fields)
KIND_UNITS = dict(zip(KINDS, ("m", "rad", "m/s", "rad/s", "rad", "rad"), strict=True))
_KIND_OF_BODY: tuple[str, ...] = ("position", "position", "heading", "velocity", "velocity", "yaw_rate")


@dataclass(frozen=True)
class Recording:
    """K samples of a robot of N casters."""

    time_step: float  # [s]
    pose: Array  # (K, 3) x, y [m], heading [rad]
    steering: Array  # (K, N) [rad]
    torque: Array  # (K, 2 N) at the joints roll_1, steer_1, …, held until the next sample [N m]
    twist: Array | None = None  # (K, 3) in B [m/s, m/s, rad/s]
    rolling: Array | None = None  # (K, N) angles that the wheels have rolled [rad]

    @property
    def kinds(self) -> tuple[str, ...]:
        """Kind of each component of a state x, y, β, vx, vy, ω, δ_1, …, and of θ_1, … if those were measured."""
        n = self.steering.shape[1]
        return (*_KIND_OF_BODY, *["steering"] * n, *["rolling"] * (0 if self.rolling is None else n))

    @property
    def observed(self) -> list[int]:
        """Components of the state that were measured."""
        twist = [] if self.twist is None else [3, 4, 5]
        return [0, 1, 2, *twist, *range(6, len(self.kinds))]

    @property
    def measured(self) -> Array:
        """The measured components (K, observed)."""
        parts = [self.pose, self.twist, self.steering, self.rolling]
        return np.concatenate([part for part in parts if part is not None], axis=1)

    def without_twist(self) -> "Recording":
        """The same recording as a robot makes it that measures no velocities."""
        return replace(self, twist=None)

    def noisy(self, noise: Noise, rng: np.random.Generator) -> "Recording":
        """The same recording with errors added to all that is measured; torques stay."""
        levels = np.array([getattr(noise, kind) or 0.0 for kind in self.kinds])
        errors = levels * rng.standard_normal((len(self.pose), len(levels)))
        pose, twist, steering, rolling = np.split(errors, [3, 6, 6 + self.steering.shape[1]], axis=1)
        return replace(
            self,
            pose=self.pose + pose,
            steering=self.steering + steering,
            twist=None if self.twist is None else self.twist + twist,
            rolling=None if self.rolling is None else self.rolling + rolling,
        )


def record(
    robot: Robot,
    seconds: float = 10.0,
    time_step: float = 0.01,
    seed: int = 0,
    share: float = 0.5,
    dynamics: Dynamics = "exact",
    with_rolling: bool = False,
) -> Recording:
    """A recording, without noise, of a robot that its driven joints push along all its three degrees of freedom.

    Each component of the force at C is a sum of sines of random phases less a drag on the twist, which keeps the robot
    slow; the joints share it with the least sum of squared shares of their greatest torques, within these.
    share [-]: of the greatest force that all rolling motors have together. with_rolling: the wheels' angles too.
    """
    if not 0.0 < time_step <= seconds / FEWEST_ROWS:
        raise ValueError(
            f"a recording needs {FEWEST_ROWS} steps or more, got {seconds:g} s in steps of {time_step:g} s"
        )
    rng, model = np.random.default_rng(seed), Model(robot, dynamics)
    driven = [robot.joints.index(joint) for joint in robot.driven]
    limits = np.array([motor.max_torque for caster in robot.casters for motor in (caster.roll, caster.steer)])[driven]
    lengths = np.array([1.0, 1.0, model.characteristic_length])
    force = share * sum(caster.roll.max_torque / caster.radius for caster in robot.casters) * lengths
    drag = force * lengths / (_CRUISE * robot.top_speed)
    phases = rng.uniform(-np.pi, np.pi, (len(_FREQUENCIES), 3))
    frequencies = _FREQUENCIES[:, None] * rng.uniform(0.8, 1.25, phases.shape)
    count, substeps = round(seconds / time_step) + 1, substeps_of(robot, time_step)
    state = np.concatenate([np.zeros(6), rng.uniform(-np.pi, np.pi, robot.caster_count)])
    states, torques, rolled = [], [], [np.zeros(robot.caster_count)]
    for k in range(count):
        waves = np.sin(2.0 * np.pi * frequencies * k * time_step + phases).sum(axis=0) / len(_FREQUENCIES) ** 0.5
        wrenches = limits[:, None] * model.jacobian(state[6:], robot.driven)
        shares = np.linalg.lstsq(wrenches.T, force * waves - drag * state[3:6], rcond=1e-3)[0]
        torque = np.zeros(len(robot.joints))
        torque[driven] = limits * np.clip(shares, -1.0, 1.0)
        states.append(state)
        torques.append(torque)
        path = model.simulate(state, torque, time_step / substeps, substeps)
        rolled.append(rolled[-1] + rolled_along(model, path, torque, time_step / substeps)[-1])
        state = path[-1]
    moved = np.array(states)
    rolling = np.array(rolled[:count]) if with_rolling else None
    return Recording(time_step, moved[:, :3], moved[:, 6:], np.array(torques), moved[:, 3:6], rolling)


_FREQUENCIES = np.array([0.2, 0.5, 1.1, 2.3])  # [Hz]
_CRUISE = 0.25  # [-] of the top speed at which the drag equals the amplitude of each sine


def substeps_of(robot: Robot, time_step: float) -> int:
    """RK4 steps in a time step [s], as few as `Robot.check_time_step` lets pass."""
    longest = min(caster.trail for caster in robot.casters) / robot.top_speed
    return math.ceil(time_step / longest * (1.0 - 1e-9))


def write_recording(path: Path, recording: Recording) -> None:
    """A CSV file as `read_recording` reads it, with ten significant digits."""
    casters = range(1, recording.steering.shape[1] + 1)
    names = ["time", *POSE, *(TWIST if recording.twist is not None else ())]
    names += [f"steering_{i}" for i in casters]
    names += [f"rolling_{i}" for i in casters] if recording.rolling is not None else []
    names += [f"torque_{kind}_{i}" for i in casters for kind in ("roll", "steer")]
    time = recording.time_step * np.arange(len(recording.pose))
    rows = np.column_stack([time, recording.measured, recording.torque])
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow([f"{name} [{next(iter(_units(name)))}]" for name in names])
        writer.writerows([[f"{number:.10g}" for number in row] for row in rows])


def read_recording(path: Path, robot: Robot) -> Recording:
    """A recording of a robot from a CSV file. Raises ValueError that names column, line and value of what is wrong."""
    try:
        with path.open(encoding="utf-8-sig", newline="") as file:
            header, *rows = list(csv.reader(file)) or [[]]
    except FileNotFoundError:
        raise ValueError(f"there is no file {str(path)!r}") from None
    except (UnicodeDecodeError, csv.Error) as error:
        raise ValueError(f"{path} cannot be read as CSV: {error}") from error
    while rows and not any(cell.strip() for cell in rows[-1]):
        rows.pop()
    table = _Table(path, [_column(path, cell) for cell in header], rows)
    n = robot.caster_count
    steering = [f"steering_{i}" for i in range(1, n + 1)]
    names = {column.name for column in table.columns}
    at = "motor" if any(name.startswith("motor_") for name in names) else "torque"
    torques = [f"{at}_{joint}" for joint in robot.joints]
    twist = list(TWIST) if names & set(TWIST) else []
    rolling = [f"rolling_{i}" for i in range(1, n + 1)]
    rolled = rolling if any(name.startswith("rolling_") for name in names) else []
    _check_columns(table, robot, ["time", *POSE, *twist, *steering, *rolled, *torques], [*TWIST, *rolling])
    if len(rows) < FEWEST_ROWS:
        raise ValueError(f"{path} has {len(rows)} samples; a recording needs at least {FEWEST_ROWS}")
    given = table.numbers(torques)
    if at == "motor":
        casters = robot_parameters(robot).casters
        given = np.stack(flatten(each(joint_torques, (), pairs(tuple(given.T)), casters)), axis=1)
    return Recording(
        time_step=_time_step(path, table.numbers(["time"])[:, 0]),
        pose=table.numbers(POSE),
        steering=table.numbers(steering),
        torque=given,
        twist=table.numbers(twist) if twist else None,
        rolling=table.numbers(rolling) if rolled else None,
    )


class _Column(NamedTuple):
    name: str
    factor: float  # SI units in one of the file's


class _Table(NamedTuple):
    path: Path
    columns: list[_Column]
    rows: list[list[str]]

    def numbers(self, names: list[str] | tuple[str, ...]) -> Array:
        """Columns (rows, names) in SI units."""
        places = {column.name: (place, column.factor) for place, column in enumerate(self.columns)}
        return np.array([[self._number(line, name, *places[name]) for name in names] for line in range(len(self.rows))])

    def _number(self, line: int, name: str, place: int, factor: float) -> float:
        cells = self.rows[line]
        if len(cells) != len(self.columns):
            raise ValueError(
                f"{self.path}, line {line + 2}: the header names {len(self.columns)} columns, got {len(cells)} cells"
            )
        try:
            number = float(cells[place])
        except ValueError:
            number = math.nan
        if not math.isfinite(number):
            raise ValueError(
                f"{self.path}, line {line + 2}: {name!r} must be a finite number, got {cells[place].strip()!r}"
            )
        return factor * number


def _column(path: Path, cell: str) -> _Column:
    match = re.fullmatch(r"\s*(\w+)\s*(?:\[\s*(.*?)\s*\])?\s*", cell)
    if match is None:
        raise ValueError(f"{path}: a column must be called as in 'x [m]', got {cell!r}")
    name, unit = match[1], match[2]
    units = _units(name)
    if unit is not None and units and unit not in units:
        raise ValueError(f"{path}: column {name!r} must be in {' or '.join(units)}, got [{unit}]")
    return _Column(name, units.get(unit, 1.0) if unit is not None else 1.0)


def _units(name: str) -> dict[str, float]:
    """Units that a column may have; none for an unknown one."""
    quantity = _QUANTITIES.get(name) or _QUANTITIES.get(name.split("_")[0])
    return {} if quantity is None else _UNITS[quantity]


def _check_columns(table: _Table, robot: Robot, needed: list[str], optional: list[str]) -> None:
    names = [column.name for column in table.columns]
    for name in names:
        if names.count(name) > 1:
            raise ValueError(f"{table.path}: the column {name!r} stands twice")
    known = {*needed, *optional}
    of_robot = f"robot {robot.name!r} of {robot.caster_count} casters"
    missing = [name for name in needed if name not in names]
    if missing:
        raise ValueError(f"{table.path}: the columns {', '.join(map(repr, missing))} are missing, for {of_robot}")
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(
            f"{table.path}: unknown column {unknown[0]!r}, for {of_robot}; {did_you_mean(unknown[0], known)}"
        )


def _time_step(path: Path, times: Array) -> float:
    step = float(times[-1] - times[0]) / (len(times) - 1)
    if step <= 0.0:
        raise ValueError(f"{path}: 'time' must grow, got {times[0]:g} s at first and {times[-1]:g} s at last")
    early = np.abs(np.diff(times) - step) > _EVEN * step
    if early.any():
        row = int(early.argmax())
        raise ValueError(
            f"{path}, line {row + 3}: samples must come evenly, every {step:g} s; this one comes "
            f"{times[row + 1] - times[row]:g} s after that before"
        )
    return step
