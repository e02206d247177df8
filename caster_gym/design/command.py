"""The command `design`: the radius and trail that suit a target best, and the motors that it needs."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pydantic import field_validator

from caster_gym.configuration import ConfigurationError, parse, read_yaml
from caster_gym.design.figures import write_design_figure
from caster_gym.design.region import DesignTarget, check_designable
from caster_gym.design.search import Design, optimise
from caster_gym.design.sizing import MotorRequirement, Requirement, require
from caster_gym.design.target import driven_as
from caster_gym.durable_files import write_file
from caster_gym.file_names import NameOrFile, from_working_folder, with_files_beside
from caster_gym.report.pages import join_parts
from caster_gym.report.provenance import write_provenance
from caster_gym.report.robot_files import robot_yaml
from caster_gym.report.run_folder import staged
from caster_gym.report.tables import markdown_table, write_csv
from caster_gym.robot import Robot, load_robot
from caster_gym.shipped_files import find

FILES = ("design.md", "motors.csv", "design.png", "robot.yaml", "run.yaml")
COLUMNS: dict[str, Callable[[MotorRequirement, MotorRequirement], object]] = {  # of a motor after and before
    "joint": lambda after, _: after.joint,
    "torque_Nm": lambda after, _: after.torque,
    "speed_rad_s": lambda after, _: after.speed,
    "power_W": lambda after, _: after.power,
    "smallest_motor_torque_Nm": lambda after, _: after.standstill_torque,
    "smallest_motor_speed_rad_s": lambda after, _: after.top_speed,
    "file_torque_Nm": lambda after, _: after.has_torque,
    "file_speed_rad_s": lambda after, _: after.has_speed,
    "file_power_W": lambda after, _: after.has_power,
    "use": lambda after, _: after.use,
    "enough": lambda after, _: after.enough,
    "use_before": lambda _, before: before.use,
}
MOTOR_HEADS = (
    "motor",
    "torque [N m]",
    "speed [rad/s]",
    "power [W]",
    "smallest motor",
    "in the file",
    "before",
    "use",
    "enough",
)
OBJECTIVES = {
    "isotropy": "global isotropy (1 is best)",
    "torque": "largest motor torque, as a share of that in the file",
    "use": "largest share of the torque that a motor has at its speed (1 is the limit)",
}
MEANINGS = {
    "isotropy": (
        "Isotropy is the mean over the steering angles of σ_min/σ_max of the driven joints' rates, as shares of the "
        "top speeds of their motors in the file, against velocities, as shares of the speed and yaw rate asked for."
    ),
    "torque": (
        "The torque of each motor counts as a share of its `max_torque` in the robot file, so that unlike motors can "
        "be compared; the margin is included. How fast the motors turn is not weighed: `objective: use` does."
    ),
    "use": "The margin is included; what a motor has is taken from the robot file.",
}


class DesignSettings(DesignTarget):
    """A target, and the robot that is to meet it."""

    robot: NameOrFile = "chung2008"  # name, or path of a YAML file

    _files_beside = field_validator("paths", mode="before")(with_files_beside)


@dataclass(frozen=True)
class DesignReport:
    """A design, and what the target asks of the motors before and after."""

    settings: DesignSettings
    original: Robot  # with the joints driven that the target names
    design: Design
    before: Requirement
    after: Requirement


def read_design(
    target: str | Path, robot: str | None = None, changes: Mapping[str, Any] | None = None
) -> DesignSettings:
    """Settings from a name in configs/designs or a YAML file, with some of them changed.

    Raises ValueError for settings that are wrong by themselves, and for those with which the robot cannot be designed.
    """
    path = find("designs", target)
    given = {**(changes or {}), **({} if robot is None else {"robot": robot})}
    source = f"{path}, as changed" if given else str(path)
    settings = parse(DesignSettings, {**read_yaml(path), **from_working_folder(given)}, source, path.parent)
    try:
        check_designable(load_robot(settings.robot), settings)
    except ValueError as error:
        raise ConfigurationError(f"{source}: {error}") from error
    return settings


def design(settings: DesignSettings, out: Path, overwrite: bool, report: Callable[[float], None]) -> str:
    """What the command does: all results in the folder `out`, or, if anything goes wrong, none; returns them in words.

    report is told the share of the work that is done.
    """
    with staged(out, overwrite, FILES, kept=(Path(settings.robot),)) as folder:
        made = make_design(settings, report)
        write_design(made, folder)
    return in_words(made)


def make_design(settings: DesignSettings, report: Callable[[float], None] = lambda share: None) -> DesignReport:
    """The best design and the requirements; report is told the share of the work that is done."""
    original = driven_as(load_robot(settings.robot), settings)
    design = optimise(original, settings, report)
    before = require(original, settings, design.motions)
    return DesignReport(settings, original, design, before, require(design.robot, settings, design.motions))


def write_design(report: DesignReport, folder: Path) -> str:
    """design.md, motors.csv, design.png, robot.yaml and run.yaml in a folder; returns the page."""
    text = page(report)
    folder.mkdir(parents=True, exist_ok=True)
    write_design_figure(folder / "design.png", report.settings, report.design, report.after)
    motors = list(zip(report.after.motors, report.before.motors, strict=True))
    write_csv(folder / "motors.csv", COLUMNS, ([value(*motor) for value in COLUMNS.values()] for motor in motors))
    remark = (
        f"{report.original.name} with wheels of {1e3 * report.design.radius:.1f} mm radius and "
        f"{1e3 * report.design.trail:.1f} mm trail, by `caster-gym design`; its motors are those of the original."
    )
    write_file(folder / "robot.yaml", robot_yaml(report.design.robot, remark))
    write_provenance(folder, settings=report.settings.model_dump(mode="json"))
    write_file(folder / "design.md", text)
    return text


def in_words(report: DesignReport) -> str:
    """The result in a sentence or two."""
    best, (radius, trail, value) = report.design, report.design.own
    lacking = [motor.joint for motor in report.after.motors if not motor.enough]
    return (
        f"Wheels of {1e3 * best.radius:.1f} mm radius instead of {1e3 * radius:.1f} mm, with a trail of "
        f"{1e3 * best.trail:.1f} mm instead of {1e3 * trail:.1f} mm: {OBJECTIVES[report.settings.objective]} "
        f"{_use_words(best.value, 3)} instead of {_use_words(value, 3)}. "
        + (f"Its motors are too weak at {', '.join(lacking)}." if lacking else "Its motors are strong enough.")
    )


def page(report: DesignReport) -> str:
    """The results in Markdown."""
    settings, design = report.settings, report.design
    sizes = [("as it was", *design.own), ("**best**", design.radius, design.trail, design.value), *design.nearby]
    parts = [
        f"# A design for {report.original.name}",
        f"Asked for: {settings.speed:g} m/s in every direction with {settings.yaw_rate:g} rad/s; accelerations of "
        f"{settings.acceleration:g} m/s² and {settings.yaw_acceleration:g} rad/s² up to "
        f"{100 * settings.accelerating_up_to:g} % of these speeds; starts from rest with the casters at any angle"
        f"{_payload_words(settings)}{_path_words(settings)}. Driven: {', '.join(report.original.driven)}. "
        f"Margin on torque and speed: {settings.margin:g}.",
        markdown_table(
            ("", "radius [mm]", "trail [mm]", OBJECTIVES[settings.objective]),
            [(words, f"{1e3 * r:.1f}", f"{1e3 * d:.1f}", _use_words(value, 3)) for words, r, d, value in sizes],
        ),
        f"{MEANINGS[settings.objective]} {_bound_words(design)}{_speed_words(report)}",
        "![objective over radius and trail; motors asked for and there](design.png)",
        "## Motors",
        "Maximum torque, speed and power of each motor, as the robot file counts them, with the margin. The smallest "
        "motor has the least product of standstill torque and top speed among those whose line, from that torque at "
        "rest to zero at that speed, lies above everything that is needed. Use is the needed torque over what the "
        "file's motor can give at that speed; 1 is the limit.",
        markdown_table(MOTOR_HEADS, map(_motor_row, report.after.motors, report.before.motors)),
        f"{report.after.factor:.2f} times all torques of the file, with the top speeds of the smallest motors, would "
        "suffice. The motors share the work with the least sum of squared shares, as paths are checked by; so, without "
        f"margin, the one that works hardest gives {100 * report.after.share:.0f} % of its standstill torque in the "
        f"envelope. No way of sharing needs less than {100 * report.after.least_share:.0f} %.",
        "`robot.yaml` is the robot with the best radius and trail, and with the motors of the original.",
    ]
    return join_parts(parts)


def _bound_words(design: Design) -> str:
    if not design.bounds:
        return "The best design lies inside the bounds."
    return f"The best design lies at {' and at '.join(design.bounds)}: beyond it there may be better ones."


def _speed_words(report: DesignReport) -> str:
    """What the least torque costs in speed."""
    if report.settings.objective != "torque":
        return ""
    fastest, earlier = (
        max(requirement.motors, key=lambda motor: motor.speed / motor.has_speed)
        for requirement in (report.after, report.before)
    )
    return (
        f" Less torque has its price in speed: with the margin, the motor of {fastest.joint} turns at up to "
        f"{fastest.speed:.3g} rad/s, {100 * fastest.speed / fastest.has_speed:.0f} % of its top speed in the file; as "
        f"the robot was, the fastest by that measure turns at {earlier.speed:.3g} rad/s, "
        f"{100 * earlier.speed / earlier.has_speed:.0f} %."
    )


def _payload_words(settings: DesignSettings) -> str:
    load = settings.payload
    return f"; a payload of {load.mass:g} kg at ({load.com[0]:g}, {load.com[1]:g}) m" if load else ""


def _path_words(settings: DesignSettings) -> str:
    return f"; the paths {', '.join(path.shape for path in settings.paths)}" if settings.paths else ""


def _motor_row(motor: MotorRequirement, earlier: MotorRequirement) -> tuple[str, ...]:
    return (
        motor.joint,
        f"{motor.torque:.3g}",
        f"{motor.speed:.3g}",
        f"{motor.power:.3g}",
        f"{motor.standstill_torque:.3g} N m, {motor.top_speed:.3g} rad/s",
        f"{motor.has_torque:.3g} N m, {motor.has_speed:.3g} rad/s",
        _use_words(earlier.use),
        _use_words(motor.use),
        "yes" if motor.enough else "**no**",
    )


def _use_words(use: float, digits: int = 2) -> str:
    return "too fast" if use == float("inf") else f"{use:.{digits}f}"
