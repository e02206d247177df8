"""Converts the table of a recording to measured quantities in SI units at evenly spaced times."""

from dataclasses import replace
from pathlib import Path

import numpy as np

from caster_gym.arrays import Array
from caster_gym.bounded_files import expanded
from caster_gym.configuration import did_you_mean
from caster_gym.identification.recording import FEWEST_ROWS, TWIST, Recording
from caster_gym.mechanics.motors import joint_torques
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import each, flatten, pairs
from caster_gym.paths.angles import degrees_by_mistake
from caster_gym.paths.files import HEADING, POINT, QUATERNION, TIME, planar_heading
from caster_gym.robot import Robot
from caster_gym.table_files import read_table
from caster_gym.tables import Quantity, Table, note, note_left_out
from caster_gym.units import unlikely_radians

MOST_JITTER = 0.5  # [-] of the time step, by which two samples may come too near or too far, and are made even
_EVEN = 0.01  # [-] of the time step, by which they may without being changed

_TWIST = {
    "vx": Quantity("velocity", ("vx", "v_x", "vel_x", "velocity_x", "linear_x")),
    "vy": Quantity("velocity", ("vy", "v_y", "vel_y", "velocity_y", "linear_y")),
    "yaw_rate": Quantity("rate", ("yaw_rate", "yawrate", "omega", "omega_z", "wz", "angular_z", "angular_velocity_z")),
}


def quantities_of(robot: Robot) -> dict[str, Quantity]:
    """The columns that a recording of a robot may have, ours first among their names."""
    casters = range(1, robot.caster_count + 1)
    steering = {
        f"steering_{i}": Quantity("angle", (f"steering_{i}", f"steering_angle_{i}", f"delta_{i}")) for i in casters
    }
    rolling = {f"rolling_{i}": Quantity("angle", (f"rolling_{i}", f"rolling_angle_{i}")) for i in casters}
    torques = {
        f"{at}_{joint}": Quantity("torque", (f"{at}_{joint}", other.format(joint)))
        for at, other in (("torque", "tau_{}"), ("motor", "motor_torque_{}"))
        for joint in robot.joints
    }
    return {"time": TIME, **POINT, "heading": HEADING, **_TWIST, **steering, **rolling, **torques, **QUATERNION}


def read_recording(path: str | Path, robot: Robot) -> Recording:
    """A recording of a robot from a file. Raises ValueError that names column, line and value of what is wrong."""
    path = expanded(path)
    table = read_table(path).matched(quantities_of(robot))
    steering = [f"steering_{i}" for i in range(1, robot.caster_count + 1)]
    at = "torque" if all(f"torque_{joint}" in table.found for joint in robot.joints) else "motor"
    if at == "motor" and not any(f"motor_{joint}" in table.found for joint in robot.joints):
        at = "torque"
    torques = [f"{at}_{joint}" for joint in robot.joints]
    twist = list(TWIST) if set(table.found) & set(TWIST) else []
    rolling = [f"rolling_{i}" for i in range(1, robot.caster_count + 1)]
    rolled = rolling if set(table.found) & set(rolling) else []
    turned = [] if "heading" in table.found or not {"qz", "qw"} <= set(table.found) else list(QUATERNION)
    needed = ["time", "x", "y", *([] if turned else ["heading"]), *twist, *steering, *rolled, *torques]
    _refuse_missing(table, robot, needed)
    if len(table.rows) < FEWEST_ROWS:
        raise ValueError(f"{path} has {len(table.rows)} samples; a recording needs at least {FEWEST_ROWS}")
    note_left_out(table.source, table.left_out([*needed, *turned]))
    heading = planar_heading(table) if turned else table.numbers(["heading"])[:, 0]
    for name in [*([] if turned else ["heading"]), *steering]:
        _refuse_degrees(table, name)
    given = table.numbers(torques)
    if at == "motor":
        casters = robot_parameters(robot).casters
        given = np.stack(flatten(each(joint_torques, (), pairs(tuple(given.T)), casters)), axis=1)
    pose = np.column_stack([table.numbers(["x", "y"]), heading])
    optional = [table.numbers(names) if names else None for names in (twist, rolled)]
    return _made_even(table, table.times()[0], Recording(0.0, pose, table.numbers(steering), given, *optional))


def _refuse_missing(table: Table, robot: Robot, needed: list[str]) -> None:
    missing = [name for name in needed if name not in table.found]
    if not missing:
        return
    others = table.left_out(needed)
    hint = ""
    if others:
        close = did_you_mean(missing[0], others)
        hint = f"; {close.replace('did you mean', 'is it called')}" if close.startswith("did") else ""
    if "heading" in missing and "psi" in [name.casefold() for name in others]:
        hint = "; 'psi' is counted from the x-axis by some and from north by others: call it 'heading' if it is from x"
    raise ValueError(
        f"{table.source}: the columns {', '.join(map(repr, missing))} are missing, for robot {robot.name!r} of "
        f"{robot.caster_count} casters; the header names {table.header}{hint}"
    )


def _refuse_degrees(table: Table, name: str) -> None:
    """Refuse angles that can hardly be in radians where the header does not say that they are."""
    unlikely = None if table.found[name].declared else unlikely_radians(table.numbers([name]))
    if unlikely is not None:
        written = table.columns[table.found[name].place].name
        said = degrees_by_mistake(unlikely).split(": write")[0]
        raise ValueError(
            f"{table.source}: column {written!r}: an angle {said}; call the column '{written} [deg]' if it is in "
            f"degrees, or '{written} [rad]'"
        )


def _made_even(table: Table, times: Array, measured: Recording) -> Recording:
    """The same at even times: as it is, or resampled if times jitter by less than MOST_JITTER of their step.

    Torques are held from sample to sample: their means over the new steps keep their impulse.
    """
    steps = np.diff(times)
    usual = float(np.median(steps))
    off = steps / usual - 1.0
    if (np.abs(off) > MOST_JITTER).any():
        row = int((np.abs(off) > MOST_JITTER).argmax()) + 1
        lost = round(float(steps[row - 1]) / usual) - 1
        what = f"{lost} {'sample is' if lost == 1 else 'samples are'} missing before it" if lost > 0 else "too early"
        raise ValueError(
            f"{table.source}, line {table.lines[row]}: this sample comes {steps[row - 1]:.4g} s after the one before, "
            f"where {usual:.4g} s are usual: {what}; up to {MOST_JITTER:.0%} of the step would be made even. "
            f"Cut the recording there, or resample it"
        )
    step = float(times[-1]) / (len(times) - 1)
    even = step * np.arange(len(times))
    if np.abs(off).max() <= _EVEN or np.abs(times - even).max() <= 0.5 * _EVEN * step:
        return replace(measured, time_step=step)
    note(
        f"{table.source}: the times between samples differ by up to {np.abs(off).max():.0%} from {usual:.4g} s; "
        f"the recording is resampled to even steps of {step:.4g} s"
    )
    from scipy.interpolate import CubicSpline  # takes a while to import

    def moved(values: Array) -> Array:
        return np.asarray(CubicSpline(times, values)(even), dtype=np.float64)

    pushed = np.concatenate(
        [np.zeros((1, measured.torque.shape[1])), np.cumsum(measured.torque[:-1] * steps[:, None], axis=0)]
    )
    held = np.stack([np.diff(np.interp(even, times, column)) / step for column in pushed.T], axis=1)
    return Recording(
        step,
        moved(np.column_stack([measured.pose[:, :2], np.unwrap(measured.pose[:, 2])])),
        moved(np.unwrap(measured.steering, axis=0)),
        np.concatenate([held, measured.torque[-1:]]),
        None if measured.twist is None else moved(measured.twist),
        None if measured.rolling is None else moved(measured.rolling),
    )
