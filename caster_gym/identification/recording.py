"""Recordings of a robot that moves under known torques: CSV files, and examples from the simulator.

A file has one row a sample and a header that names each column with its unit. In any order:

    time [s]                           of the sample
    x [m], y [m], heading [rad]        pose of C in the world; the heading may wrap or not
    vx [m/s], vy [m/s], yaw_rate [rad/s]      twist at C, in B; all three or none
    steering_1 [rad] … steering_N [rad]       angle of each rolling direction in B, as encoders show it
    rolling_1 [rad] … rolling_N [rad]         angle each wheel has rolled, forward positive, never wrapped; all or none
    torque_roll_1 [N m], torque_steer_1 [N m], …      at the joints, held from this sample to the next
    motor_roll_1 [N m], motor_steer_1 [N m], …        instead of these: at the motors, which `gear` couples

Columns without a unit are in the one given here. docs/files.md tells which other units, names and separators are read.
Other columns are left out, and times that jitter are made even; a TableNote tells of both.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from pydantic import NonNegativeFloat

from caster_gym.arrays import Array
from caster_gym.configuration import Frozen
from caster_gym.engines.numpy_model import Model
from caster_gym.engines.time_step import longest_time_step, substeps_for
from caster_gym.identification.rolling import rolled_along
from caster_gym.mechanics.parameters import Dynamics
from caster_gym.report.tables import write_csv
from caster_gym.robot import Robot

FEWEST_ROWS = 10
POSE, TWIST = ("x", "y", "heading"), ("vx", "vy", "yaw_rate")


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

    def change_columns(self, change: Callable[[str, Array], Array]) -> "Recording":
        """The same recording with other columns: change gives new ones for each field's name and columns (K, n)."""
        fields = {name: getattr(self, name) for name in ("pose", "steering", "torque", "twist", "rolling")}
        given = {name: change(name, columns) for name, columns in fields.items() if columns is not None}
        return replace(self, **given)  # type: ignore[arg-type]  # mypy does not follow names in a dict

    def noisy(self, noise: Noise, rng: np.random.Generator) -> "Recording":
        """The same recording with errors added to all that is measured; torques stay."""
        levels = np.array([getattr(noise, kind) or 0.0 for kind in self.kinds])
        errors = levels * rng.standard_normal((len(self.pose), len(levels)))
        parts = np.split(errors, [3, 6, 6 + self.steering.shape[1]], axis=1)
        added = dict(zip(("pose", "twist", "steering", "rolling"), parts, strict=True))
        return self.change_columns(lambda name, columns: columns + added[name] if name in added else columns)


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
    driven = robot.driven_indices
    limits = robot.max_torques[driven]
    lengths = np.array([1.0, 1.0, model.characteristic_length])
    force = share * sum(caster.roll.max_torque / caster.radius for caster in robot.casters) * lengths
    drag = force * lengths / (_CRUISE * robot.top_speed)
    phases = rng.uniform(-np.pi, np.pi, (len(_FREQUENCIES), 3))
    frequencies = _FREQUENCIES[:, None] * rng.uniform(0.8, 1.25, phases.shape)
    count, substeps = round(seconds / time_step) + 1, FINER * substeps_of(robot, time_step)
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


FINER = 4  # times more steps than follow a robot, which pass over the rates at which dry friction changes its sign


def substeps_of(robot: Robot, time_step: float) -> int:
    """RK4 steps in a time step [s], as few as follow the robot."""
    return substeps_for(time_step, longest_time_step(robot))


_UNITS = {
    "time": "s", "x": "m", "y": "m", "heading": "rad", "vx": "m/s", "vy": "m/s", "yaw_rate": "rad/s",
    "steering": "rad", "rolling": "rad", "torque": "N m",
}  # fmt: skip


def _unit(name: str) -> str:
    return _UNITS.get(name) or _UNITS[name.split("_")[0]]


def write_recording(path: str | Path, recording: Recording) -> None:
    """A CSV file as `read_recording` reads it, with ten significant digits."""
    casters = range(1, recording.steering.shape[1] + 1)
    names = ["time", *POSE, *(TWIST if recording.twist is not None else ())]
    names += [f"steering_{i}" for i in casters]
    names += [f"rolling_{i}" for i in casters] if recording.rolling is not None else []
    names += [f"torque_{kind}_{i}" for i in casters for kind in ("roll", "steer")]
    time = recording.time_step * np.arange(len(recording.pose))
    rows = np.column_stack([time, recording.measured, recording.torque])
    heads = [f"{name} [{_unit(name)}]" for name in names]
    write_csv(Path(path).expanduser(), heads, ([f"{number:.10g}" for number in row] for row in rows))
