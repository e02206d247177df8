"""How cost grows: with robots, with casters, with obstacles."""

import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from caster_gym import Robot
from caster_gym.arena import Arena
from caster_gym.arena.arena import Pillar
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.report.tables import markdown_table
from scripts.speed_robots import COURSES, FOLLOW, bare_equations, batch, on
from scripts.speed_timing import RATE, Row, Values, middle

ROBOTS = (1, 4, 16, 64, 256, 1024, 4096, 16384, 65536)
CASTERS = (2, 3, 4, 5, 6, 7, 8)
OBSTACLES = (0, 1, 2, 4, 8, 16, 32, 64)
SIDE = 8  # pillars along each side of a square field
APART = 1.0  # [m] between neighbouring pillars
PILLAR = 0.1  # [m] radius
BESIDE = {"walls": 0, "gap": [0.05, 2.0], "pillar_radius": [0.03, 0.05]}  # room for 64 beside each path
MOTION_STEPS = 40 * 65536  # RK4 steps times robots in a call, that the greatest batches do not take seconds


def with_casters(robot: Robot, count: int) -> Robot:
    """The robot with so many of its first caster, all around on a circle."""
    first = robot.casters[0]
    radius = math.hypot(first.x, first.y)
    angles = [2.0 * math.pi * i / count for i in range(count)]
    casters = [first.model_copy(update={"x": radius * math.cos(a), "y": radius * math.sin(a)}) for a in angles]
    return robot.model_copy(update={"casters": tuple(casters)})


def field(count: int) -> Arena | None:
    """So many pillars in a field, which is always of the same size."""
    places = [APART * (i - 0.5 * (SIDE - 1)) for i in range(SIDE)]
    every = np.random.default_rng(0).permutation([(x, y) for x in places for y in places])[:count]
    return Arena(pillars=tuple(Pillar(centre=tuple(centre), radius=PILLAR) for centre in every)) if count else None


def growth_rows(robot: Robot, name: str, cores: int, seconds: float, quick: bool) -> list[Row]:
    """A row for each point of the figure; only the outermost and a middle one of each line if it is to be quick."""

    def some(values: Sequence[int]) -> Sequence[int]:
        return (values[0], values[len(values) // 2], values[-1]) if quick else values

    half = 0.5 * APART * SIDE
    rows: list[Row] = []
    for count in some(ROBOTS):
        steps = max(1, min(400, MOTION_STEPS // count))
        rows += [_row("robots", "bare", count, on(cores, bare_equations(robot, count, steps=steps), seconds))]
        rows += [_row("robots", "env", count, on(cores, batch(name, count), seconds))]
    for count in some(CASTERS):
        work = bare_equations(with_casters(robot, count), 4096)
        rows += [_row("casters", "bare", count, on(1, work, seconds))]
    for count in some(OBSTACLES):
        work = bare_equations(robot, 4096, field(count), half)
        rows += [_row("obstacles", "bare", count, on(1, work, seconds))]
        arena = {"beside": {**BESIDE, "pillars": count}} if count else None
        among = batch(name, 1024, FOLLOW, path=COURSES, arena=arena)
        rows += [_row("obstacles", "env", count, on(1, among, seconds))]
    return rows


def _row(what: str, kind: str, count: int, measure: Callable[[], float]) -> Row:
    return Row(f"{what}_{kind}_{count}", f"{what} {count}, {kind}", RATE, measure)


def line(measured: Values, what: str, kind: str) -> dict[int, list[float]]:
    """Steps per second in every turn, by the number of what grows."""
    start = f"{what}_{kind}_"
    return {int(key.removeprefix(start)): list(values) for key, values in measured.items() if key.startswith(start)}


def draw_growth(file: Path, measured: Values, cores: int) -> None:
    """Steps per second over robots; time of a robot's step over casters and obstacles. Bars: the middle half."""
    figure = new_figure(1, 3, (4.2, 3.6))
    kinds = {
        "env": (COLOURS[3], "s", "environment: a control period"),
        "bare": (COLOURS[0], "o", "bare: an RK4 step"),
    }
    titles = {
        "robots": ("robots in the batch", f"batches, {cores} cores"),
        "casters": ("casters of each robot", "batch of 4,096, 1 core"),
        "obstacles": ("obstacles", "batches of 4,096 (bare) and 1,024, 1 core"),
    }
    for axis, (what, (label, title)) in zip(figure.axes, titles.items(), strict=True):
        for kind, (colour, marker, name) in kinds.items():
            points = line(measured, what, kind)
            if not points:
                continue
            values = np.array([np.quantile(rates, (0.25, 0.5, 0.75)) for rates in points.values()])
            shown = values if what == "robots" else 1e9 / values[:, ::-1]
            low, centre, high = shown.T
            bars = (centre - low, high - centre)
            axis.errorbar(list(points), centre, bars, color=colour, marker=marker, markersize=4, capsize=2, label=name)
        axis.set_xlabel(label)
        axis.set_title(title, fontsize=10)
        axis.set_yscale("log")
    robots, casters, obstacles = figure.axes
    robots.set_xscale("log", base=2)
    robots.set_xticks(ROBOTS, [f"{count:,}" for count in ROBOTS], rotation=45)
    robots.set_ylabel("steps per second, all robots")
    robots.legend(frameon=False, fontsize=9)
    casters.set_xscale("log")
    casters.set_xticks(CASTERS, [str(count) for count in CASTERS])
    casters.minorticks_off()
    obstacles.set_xscale("symlog", base=2, linthresh=1)
    obstacles.set_xticks(OBSTACLES, [str(count) for count in OBSTACLES])
    obstacles.set_xlim(-0.3, 90.0)
    casters.sharey(obstacles)
    casters.autoscale_view()
    for axis in (casters, obstacles):
        axis.set_ylabel("time of a robot's step on a core [ns]")
    figure.savefig(file)


def growth_table(measured: Values) -> str:
    """Medians as Markdown, a line for each number of what grows."""
    rows = []
    for what in ("robots", "casters", "obstacles"):
        bare, env = line(measured, what, "bare"), line(measured, what, "env")
        for count, rates in bare.items():
            whole = f"{middle(env[count]):,.3g}" if count in env else ""
            rows.append((what, f"{count:,}", f"{middle(rates):,.3g}", whole))
    return markdown_table(("what grows", "number", "bare RK4, steps/s", "environment, steps/s"), rows)
