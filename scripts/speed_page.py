"""The page of `scripts.measure_speed`, with the goals that are reached and missed."""

import os
import platform
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import versions_in_words
from caster_gym.report.tables import markdown_table
from scripts.mujoco_robot import DURATION, STRONG
from scripts.speed_accuracy import Accuracy
from scripts.speed_growth import growth_table
from scripts.speed_limits import limits_text
from scripts.speed_peers import MUJOCO_STEP
from scripts.speed_robots import COARSE_STEP, PERIOD, RK4_STEP, SUBSTEPS
from scripts.speed_timing import Goal, Ratio, Row, Values, at_least, at_most, middle, shown, spread

LIBRARIES = ("caster_gym", "gymnasium", "mujoco", "numba", "numpy", "stable_baselines3", "torch")
DEMANDED_ACCURACY = 1000.0  # MuJoCo's error over ours
MICROMETRE = 1e-6  # [m]

RATIOS = (
    Ratio(
        "bare RK4 at 5 ms over MuJoCo at 2 ms: simulated time, 1 core",
        "bare",
        "mujoco",
        RK4_STEP / MUJOCO_STEP,
        at_least(100.0),
    ),
    Ratio("bare RK4 at 10 ms over MuJoCo at 2 ms: simulated time, 1 core", "bare", "mujoco", COARSE_STEP / MUJOCO_STEP),
    Ratio(
        "whole environment over bare MuJoCo: simulated time, 1 core",
        "env",
        "mujoco",
        PERIOD / MUJOCO_STEP,
        at_least(25.0),
    ),
    Ratio(
        "whole environment over MuJoCo's `rollout`: simulated time, two cores",
        "env_cores",
        "mujoco_threads",
        PERIOD / MUJOCO_STEP,
        at_least(25.0),
    ),
    Ratio(
        "RK4 steps of the environment over bare ones, batch of 4,096, two cores",
        "env_cores",
        "bare_cores",
        SUBSTEPS,
        at_least(0.6),
    ),
    Ratio("the same with 2 substeps per period", "env_fewer", "bare_cores", 2.0, at_least(0.6)),
    Ratio("one environment over Pendulum-v1: time of a step", "one", "pendulum", 1.0, at_most(1.0)),
    Ratio("one environment over CartPole-v1: time of a step", "one", "cartpole"),
    Ratio("HalfCheetah-v5 over one environment: time of a step", "cheetah", "one"),
    Ratio("one environment over the same without Gymnasium's wrappers: time", "one", "one_beneath"),
    Ratio("native batch over SyncVectorEnv of the same: steps", "env_small", "sync_ours"),
    Ratio("native batch over DummyVecEnv of the same, both in SB3: steps", "sb3_small", "dummy_ours"),
    Ratio("two cores over one, bare", "bare_cores", "bare"),
    Ratio("two cores over one, environment", "env_cores", "env"),
    Ratio("derivatives over the step alone, one robot, a call each: time", "jacobian", "bare_call"),
    Ratio("derivatives of one robot over those of a robot in a batch: time", "jacobian", "jacobian_batch"),
    Ratio("MuJoCo's `rollout` over `mj_step`", "mujoco_threads", "mujoco"),
    Ratio("bare among 8 obstacles over none", "bare_among", "bare", 1.0, at_least(0.5)),
    Ratio("following among 6 obstacles over none", "follow_among", "follow"),
    Ratio("environment over its engine, two cores", "env_cores", "engine_cores"),
    Ratio("Torch over Numba, bare, 1 core", "torch", "bare"),
    Ratio("Torch over Numba, environment, 1 core", "torch_env_core", "env"),
    Ratio("Torch over Numba, environment, two cores", "torch_env", "env_cores"),
    Ratio("GPU over Numba on two cores, bare", "cuda", "bare_cores"),
    Ratio("GPU over Numba on two cores, environment", "cuda_env", "env_cores"),
)


class Occasion(NamedTuple):
    """Where and how it was measured."""

    command: str
    turns: int
    seconds: float  # of a row in a turn
    cores: int
    loads: tuple[float, float]  # of the machine at the start and at the end
    quick: bool


def page(
    sections: Sequence[tuple[str, str, Sequence[Row]]],
    measured: Values,
    accuracy: Accuracy,
    robot: str,
    operations: int,
    folder: str,
    occasion: Occasion,
) -> str:
    """All results as Markdown; sections: title, remark and rows; figures lie in a folder beside the page."""
    parts = [
        "# Speed",
        paragraph(
            f"""This page says how fast caster_gym runs, beside MuJoCo, Gymnasium's own environments, and loops over
            environments. All rows were measured in one run, in {occasion.turns} short turns. Each turn measures the
            rows in a new random order, so that a busy moment of the machine affects all of them alike. Ratios are
            computed turn by turn. Each number is the median over the turns; the "middle half" is the range between the
            quartiles. A "step" is an RK4 step of {1e3 * RK4_STEP:g} ms for the bare equations, a control period of
            {1e3 * PERIOD:g} ms for an environment, and a step of {1e3 * MUJOCO_STEP:g} ms for MuJoCo."""
        ),
        "## Goals",
        goals_table([row for _, _, rows in sections for row in rows], measured, accuracy),
    ]
    for title, remark, rows in sections:
        if rows:
            parts += [f"## {title}", paragraph(remark), rows_table(rows, measured)]
    parts += [
        "## Ratios",
        ratios_table(measured),
        "## Errors at these steps",
        accuracy_text(accuracy, robot),
        "## Growth",
        f"![Speed over the number of robots, casters and obstacles]({folder}/growth.png)",
        paragraph(
            """*Left: steps per second of whole batches. A batch of a few robots costs as much as a block of 32. Middle
            and right: time of one robot's step on one core, over the number of its casters and over the number of
            pillars. Bars: the middle half of the turns.*"""
        ),
        growth_table(measured),
        "## What limits each engine",
        limits_text(measured, accuracy, operations),
        "## How it was measured",
        origin(occasion, folder),
    ]
    return join_parts(parts)


def goals_table(rows: Sequence[Row], measured: Values, accuracy: Accuracy) -> str:
    """Whatever has a goal, and whether it is reached by the median."""
    entries: list[tuple[str, Goal, Sequence[float], str]] = [
        (row.name, row.goal, measured[row.key], row.unit) for row in rows if row.goal and measured.get(row.key)
    ]
    entries += [(ratio.name, ratio.goal, ratio.values(measured), "") for ratio in RATIOS if ratio.goal]
    coarse = list(1e6 * accuracy.ours[COARSE_STEP])
    entries += [
        ("error of MuJoCo at 2 ms over ours at 5 ms", at_least(DEMANDED_ACCURACY), list(accuracy.over), ""),
        ("error of ours at 10 ms", at_most(1e6 * MICROMETRE), coarse, "µm"),
    ]
    lines = [
        (
            name,
            f"{goal} {unit}".strip(),
            f"{shown(middle(values))} {unit}".strip(),
            spread(values),
            verdict(goal, middle(values)),
        )
        for name, goal, values, unit in entries
        if values
    ]
    return markdown_table(("what", "goal", "median", "middle half", ""), lines)


def verdict(goal: Goal, value: float) -> str:
    """Reached or missed, the latter to be seen."""
    return "reached" if goal.reached(value) else "**missed**"


def rows_table(rows: Sequence[Row], measured: Values) -> str:
    """One line a row."""
    lines = [
        (row.name, f"{shown(middle(values))} {row.unit}", spread(values))
        for row in rows
        if (values := measured.get(row.key))
    ]
    return markdown_table(("what", "median", "middle half"), lines)


def ratios_table(measured: Values) -> str:
    """One line a ratio of rows that were measured."""
    lines = [
        (ratio.name, shown(middle(values)), spread(values)) for ratio in RATIOS if (values := ratio.values(measured))
    ]
    return markdown_table(("what", "median", "middle half"), lines)


def accuracy_text(accuracy: Accuracy, robot: str) -> str:
    """How far off both are, and by how much ours is better."""
    sides = {f"ours, RK4 at {1e3 * step:g} ms": errors for step, errors in accuracy.ours.items()}
    sides[f"MuJoCo at {1e3 * MUJOCO_STEP:g} ms"] = accuracy.mujoco
    lines = [
        (name, f"{shown(1e6 * middle(errors))} µm", spread(1e6 * errors), f"{shown(1e6 * float(errors.max()))} µm")
        for name, errors in sides.items()
    ]
    over, slips = accuracy.over, 100.0 * middle(accuracy.slips)
    text = f"""{robot} is driven from rest for {DURATION:g} s, {len(over)} times. Each joint pushes the floor with up to
        {100.0 * STRONG:.0f} % of the weight on its wheel. The error is the distance from the end that RK4 reaches with
        a tiny step. MuJoCo's error is {shown(middle(over))} times ours at {1e3 * RK4_STEP:g} ms (median over the
        drives), and at least {shown(float(over.min()))} times; its wheels slip by {slips:.2f} % of the distance that
        they roll. As its step goes to zero, its result converges to ours ([mujoco.md](truth/mujoco.md))."""
    heads = ("position after the drive", "median error", "middle half", "greatest")
    return f"{paragraph(text)}\n\n{markdown_table(heads, lines)}"


def origin(occasion: Occasion, folder: str) -> str:
    """Command, machine and versions."""
    return "\n".join(
        [
            f"- Command: `{occasion.command}`",
            *(["- A quick measurement, without Torch, memory and compiling from scratch"] if occasion.quick else []),
            f"- {occasion.turns} turns of {occasion.seconds:g} s per row, at least one call; all values: "
            f"[turns.csv]({folder}/turns.csv)",
            f"- Machine: {processor()}, {os.cpu_count()} cores, of which {occasion.cores} are used",
            f"- Load of the machine: {occasion.loads[0]:.1f} at the start, {occasion.loads[1]:.1f} at the end "
            "(0 at the start if nothing else runs; the load at the end comes from the measurement)",
            f"- Versions: {versions_in_words(*LIBRARIES)}",
        ]
    )


def processor() -> str:
    """What the system calls its processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()
