"""The command `identify`: payload, friction, wheels, motors and sensor zeros from a recording, with intervals.

The file is read and checked before anything heavy is imported, so that a refusal comes at once.
"""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import numpy as np
import yaml
from pydantic import Field

from caster_gym.configuration import Frozen, Positive, parse
from caster_gym.durable_files import write_file
from caster_gym.identification.recording import KIND_UNITS, Noise, record, write_recording
from caster_gym.identification.recording_check import ContradictionError, check_recording
from caster_gym.identification.recording_table import read_recording
from caster_gym.identification.unknowns import (
    CONFIDENCE,
    UNITS,
    WINDOW,
    check_alike,
    each_named,
    kind_of,
    robot_with,
    unknowns,
)
from caster_gym.mechanics.parameters import Dynamics
from caster_gym.report.pages import join_parts
from caster_gym.report.provenance import write_provenance
from caster_gym.report.robot_files import robot_yaml
from caster_gym.report.run_folder import check_file, check_free, staged
from caster_gym.report.tables import markdown_table, write_csv
from caster_gym.robot import load_robot

if TYPE_CHECKING:
    from caster_gym.identification.fit import Identification

FILES = ("identified.md", "identified.csv", "identified.png", "robot.yaml", "features.yaml", "run.yaml")
PAYLOAD = ("payload_mass", "payload_x", "payload_y")
EXAMPLE_NOISE = Noise(position=1e-3, heading=2e-3, velocity=1e-2, yaw_rate=1e-2, steering=2e-3, rolling=2e-3)
EXAMPLE_SECONDS, EXAMPLE_STEP = 10.0, 0.02
_FIGURES = 6  # of numbers in the tables of results
_SMALL = -3  # power of ten below which numbers are written with it


class IdentifySettings(Frozen):
    """What is looked for in a recording."""

    robot: str = "chung2008"  # name, or path of a YAML file: the robot as it is thought to be
    unknowns: tuple[str, ...] = PAYLOAD
    # values that differ from the robot file's, also of a payload that is known
    start: dict[str, float] = Field(default_factory=dict)
    bounds: dict[str, tuple[float, float]] = Field(default_factory=dict)  # that differ from ours
    noise: Noise = Noise()  # standard deviations that are known; the others are estimated
    window: Positive = WINDOW  # [s] over which motions are predicted
    confidence: Annotated[float, Field(gt=0.0, lt=1.0)] = CONFIDENCE
    dynamics: Dynamics = "exact"
    check: bool = True  # whether columns that contradict each other are refused before anything is fitted


def read_identify(
    robot: str, unknowns: Sequence[str] = PAYLOAD, changes: Mapping[str, Any] | None = None
) -> IdentifySettings:
    """Checked settings."""
    return parse(IdentifySettings, {"robot": robot, "unknowns": list(unknowns), **(changes or {})}, "identify")


def identify_file(
    recording: Path, settings: IdentifySettings, out: Path, overwrite: bool, report: Callable[[], None] = lambda: None
) -> str:
    """What the command does: all results in the folder `out`, or, if anything goes wrong, none; returns the table.

    report is called before each step of the fit.
    """
    kept = (recording, Path(settings.robot))
    check_free(out, overwrite, FILES, kept)
    robot = load_robot(settings.robot)
    unknowns(robot, settings.unknowns, settings.start, settings.bounds)
    check_alike(robot, [*settings.unknowns, *settings.start])
    recorded = read_recording(recording, robot)
    if settings.check:
        try:
            check_recording(recorded, robot, each_named(robot, settings.unknowns), settings.start)
        except ContradictionError as error:
            raise ContradictionError(f"{recording}: {error}") from None
    with staged(out, overwrite, FILES, kept) as folder:
        from caster_gym.engines.tensor.threads import DEFAULT, limit_threads
        from caster_gym.identification.fit import identify  # late: Torch takes seconds

        with limit_threads(DEFAULT):
            found = identify(
                robot,
                recorded,
                settings.unknowns,
                settings.start,
                settings.bounds,
                settings.noise,
                settings.window,
                settings.confidence,
                settings.dynamics,
                report,
                settings.check,
            )
        write_identification(found, recording, settings, folder)
    return in_words(found)


def write_example(path: Path, robot: str, seed: int, overwrite: bool) -> str:
    """A recording of a robot that carries a payload which its file does not know, with noise; says what it carries."""
    check_file(path, overwrite, "--example")
    bare = load_robot(robot)
    reach = bare.pivot_reach
    load = {"payload_mass": 0.2 * bare.platform.mass, "payload_x": 0.4 * reach, "payload_y": -0.2 * reach}
    shaken = record(robot_with(bare, load), EXAMPLE_SECONDS, EXAMPLE_STEP, seed, with_rolling=True)
    write_recording(path, shaken.noisy(EXAMPLE_NOISE, np.random.default_rng((seed, 1))))
    words = ", ".join(f"{name} {value:.4g} {UNITS[name]}" for name, value in load.items())
    return f"{path} is a recording of {bare.name} with a payload that its file does not know: {words}."


def write_identification(found: "Identification", recording: Path, settings: IdentifySettings, folder: Path) -> None:
    """identified.md, identified.csv, identified.png, robot.yaml, features.yaml and run.yaml in a folder."""
    from caster_gym.identification.figures import write_identify_figure  # late: matplotlib takes seconds

    folder.mkdir(parents=True, exist_ok=True)
    write_identify_figure(folder / "identified.png", found)
    rows = []
    for k, one in enumerate(found.unknowns):
        value, half, told = found.estimates[k], found.half_widths[k], bool(found.is_told[k])
        spread = (found.deviations[k], value - half, value + half) if told else ("", "", "")
        rows.append((one.name, one.unit, told, one.start, value, *spread))
    heads = ("name", "unit", "determined", "start", "estimate", "standard_deviation", "low", "high")
    write_csv(folder / "identified.csv", heads, rows)
    names = ", ".join(one.name for one, told in zip(found.unknowns, found.is_told, strict=True) if told) or "nothing"
    remark = f"{found.robot.name} as identified from {recording.name} by `caster-gym identify`: {names}."
    text = robot_yaml(found.robot, remark, "A payload is part of the platform.")
    write_file(folder / "robot.yaml", text)
    write_file(folder / "features.yaml", features_yaml(found, recording))
    write_provenance(folder, recording=str(recording), settings=settings.model_dump(mode="json"))
    write_file(folder / "identified.md", page(found, recording))


def features_yaml(found: "Identification", recording: Path) -> str:
    """What wrappers make of the estimates that a robot file has no place for: zeros, biases, delay and lag.

    A list, which may be empty, for `caster_gym.wrappers.read_features`; what no wrapper has is a comment.
    """
    told = zip(found.unknowns, found.estimates, found.is_told, strict=True)
    values = {one.name: float(value) for one, value, is_told in told if is_told}
    count = found.robot.caster_count
    features: list[dict[str, Any]] = []
    if any(kind_of(name) == "steering_zero" for name in values):
        shared = values.get("steering_zero", 0.0)
        zeros = [values.get(f"steering_zero_{i}", shared) for i in range(1, count + 1)]
        features.append({"kind": "steering_offset", "angle": 0.0, "zeros": zeros})
    lags = values.get("motor_lag", 0.0) > 0.0
    if lags:
        features.append({"kind": "motor_lag", "time_constant": values["motor_lag"]})
    none = {} if lags else {"motor_lag": "motors that follow at once need no wrapper"}
    rest = {
        **none,
        "torque_delay": "an action_delay of as many control periods comes nearest",
        "heading_zero": "subtract it from what the heading's sensor shows",
        **dict.fromkeys(("vx_bias", "vy_bias", "yaw_rate_bias"), "subtract it from what the sensor shows"),
    }
    notes = [f"# {name}: {values[name]:.6g} {UNITS[name]}; {words}\n" for name, words in rest.items() if name in values]
    header = (
        f"# Sensors and drives of {found.robot.name} as identified from {recording.name}: for caster_gym.wrappers.\n"
    )
    return header + "".join(notes) + yaml.safe_dump(features, sort_keys=False, default_flow_style=None, width=110)


def in_words(found: "Identification") -> str:
    """The estimates, the unknowns that are not determined, warnings and notes."""
    lines = [
        f"{one.name} {number_words(found.estimates[k], found.half_widths[k])} {one.unit}"
        for k, one in enumerate(found.unknowns)
        if found.is_told[k]
    ]
    return "\n".join([*lines, *found.untold, *found.warnings, *found.notes])


def number_words(value: float, half: float) -> str:
    """A number and the half width of its interval, down to two digits of this."""
    if half <= 0.0 or not np.isfinite(half):
        return f"{value:.{_FIGURES}g}"
    power = int(np.floor(np.log10(max(abs(value), half))))
    power = power if power < _SMALL else 0
    digits = min(max(0, 1 - int(np.floor(np.log10(half))) + power), 12)
    words = f"{value / 10.0**power:.{digits}f} ± {half / 10.0**power:.{digits}f}"
    return f"({words}) × 10^{power}" if power else words


def page(found: "Identification", recording: Path) -> str:
    """The results in Markdown."""
    shooting = found.shooting
    seconds = (shooting.length - 1) * shooting.recording.time_step
    percent = f"{100 * found.confidence:g} %"
    parts = [
        f"# What {recording.name} says about {found.robot.name}",
        f"{shooting.count} windows of {seconds:.3g} s, each predicted by the simulator from an initial state of its "
        f"own; maximum-likelihood estimates with {percent} intervals, after {found.steps} steps. Torques are assumed "
        "to be exact. Friction may deviate from the model's law as far as the recording requires.",
        markdown_table(("", "start", f"estimate, {percent}", "unit"), _estimate_rows(found)),
        *(f"**{sentence}**" for sentence in (*found.untold, *found.warnings)),
        *found.notes,
        "## Errors",
        "The errors that the model leaves, beside the noise. Noise is as given, or as it shows from one sample to the "
        "next. If the model were wrong, errors would vary slowly and exceed the noise.",
        markdown_table(("", "unit", "error at the start", "error left", "noise", "explained"), _error_rows(found)),
        "![measured and predicted, with the starting values and with the estimates](identified.png)",
        "Initial states are those of the estimates in both cases.",
        *_correlation_parts(found),
        "`robot.yaml` is the robot file with the estimates in it. A payload is part of the platform, negative friction "
        "is zero, and the motors' maximum torques are multiplied by their strengths. Steering zeros, biases, delay "
        "and lag have no place in it; where they were estimated, they are in `features.yaml`.",
    ]
    return join_parts(parts)


def _estimate_rows(found: "Identification") -> list[tuple[str, ...]]:
    rows: list[tuple[str, ...]] = []
    for k, one in enumerate(found.unknowns):
        words = number_words(found.estimates[k], found.half_widths[k]) if found.is_told[k] else "not determined"
        rows.append((one.name, f"{one.start:.{_FIGURES}g}", words, one.unit))
    return rows


def _error_rows(found: "Identification") -> list[tuple[str, ...]]:
    return [
        (
            one.kind,
            KIND_UNITS[one.kind],
            f"{one.before:.3g}",
            f"{one.left:.3g}",
            f"{one.noise:.3g}" + (", as given" if one.given else ""),
            "yes" if one.explained else "**no**",
        )
        for one in found.agreements
    ]


def _correlation_parts(found: "Identification") -> list[str]:
    names = [one.name for one in found.unknowns]
    if len(names) < 2:
        return []
    rows = [
        (name, *("" if np.isnan(value) else f"{value:+.2f}" for value in row))
        for name, row in zip(names, found.correlations, strict=True)
    ]
    return ["## Correlations", markdown_table(("", *names), rows)]
