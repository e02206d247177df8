"""Pictures of a comparison: paths driven, errors over time, speeds, torques, and how the policies learned."""

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.agents.comparison.validation import Validation
from caster_gym.envs.plan import Plan
from caster_gym.report.figures import COLOURS, legend_below, new_figure, save_figure
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import Printed, shown
from caster_gym.tasks.task import Pictures

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

OBSTACLE = "0.75"
MOST_PATHS = 6
TRANSIENT = 2.0  # [s] from which on errors are drawn larger


def write_figures(
    folder: Path,
    episodes: Mapping[str, Episodes],
    histories: Mapping[str, Sequence[Validation]],
    plan: Plan,
    pictures: Pictures,
) -> list[Path]:
    """Pictures of the episodes of a plan, by agent, and of what was learned, if anything; returns their paths.

    paths.png, errors.png, torques.png, learning.png and overview.png; speeds.png where the task shows speeds.
    """
    colours = dict(zip(episodes, COLOURS * (1 + len(episodes) // len(COLOURS)), strict=False))
    chosen = _telling_episodes(next(iter(episodes.values())).names)
    curves = learning_curves(histories)
    figures: dict[str, Figure] = {}

    drawn: dict[str, Callable[..., None]] = {"paths": partial(draw_path, pictures=pictures)}
    if pictures.speeds:
        drawn["speeds"] = draw_speeds
    for kind, draw in drawn.items():
        figure = figures[kind] = new_figure(2, 3, (4.0, 4.0))
        for axis, index in zip(figure.axes, chosen, strict=False):
            draw(axis, episodes, index, colours, plan)
        for axis in figure.axes[len(chosen) :]:
            axis.set_visible(False)
        legend_below(figure, figure.axes[0], 3)

    figure = figures["errors"] = new_figure(2, 1, (9.0, 3.5), sharex=True)
    above, below = figure.axes
    draw_errors(above, episodes, "position_error", 1e3, "position error [mm]", colours)
    draw_errors(below, episodes, "heading_error", 1e3, "heading error [mrad]", colours)
    below.set_xlabel("time [s]")
    above.legend(fontsize="small")

    figure = figures["torques"] = new_figure(len(episodes), 1, (9.0, 2.2), sharex=True)
    for axis, (agent, series) in zip(figure.axes, episodes.items(), strict=True):
        draw_torques(axis, series, chosen[-1])
        axis.set_title(f"{agent}, {series.names[chosen[-1]]}", fontsize="medium")
    figure.axes[-1].set_xlabel("time [s]")
    figure.axes[0].legend(fontsize="x-small", ncols=3)

    if curves:
        figure = figures["learning"] = new_figure(1, len(curves), (7.0, 4.5))
        for axis, (name, how) in zip(figure.axes, curves.items(), strict=True):
            draw_learning(axis, histories, name, how)

    figure = figures["overview"] = new_figure(1, 3 if curves else 2, (5.4, 4.6))
    left, middle, *right = figure.axes
    draw_path(left, episodes, chosen[-1], colours, plan, pictures)
    if pictures.speeds:
        draw_speeds(middle, episodes, chosen[-1], colours, plan)
    else:
        draw_errors(middle, episodes, "position_error", 1e3, "position error [mm]", colours)
        middle.set_xlabel("time [s]")
        middle.set_title("all test episodes: median, 10 to 90 %", fontsize="medium")
    middle.legend(fontsize="small")
    for axis, (name, how) in zip(right, list(curves.items())[-1:], strict=True):
        draw_learning(axis, histories, name, how)

    written = [folder / f"{name}.png" for name in figures]
    for path, figure in zip(written, figures.values(), strict=True):
        save_figure(figure, path)
    return written


def draw_path(
    axis: "Axes",
    episodes: Mapping[str, Episodes],
    index: int,
    colours: Mapping[str, str],
    plan: Plan,
    pictures: Pictures,
) -> None:
    """What each agent drove in one episode, over its path and among its obstacles, with errors as large as asked."""
    first = next(iter(episodes.values()))
    path = index % len(plan.names)
    table = plan.tables[path]
    larger = pictures.magnified
    draw_obstacles(axis, plan, path)
    axis.plot(table[:, 0], table[:, 1], color="0.6", linewidth=4, label=pictures.path, solid_capstyle="round")
    for agent, series in episodes.items():
        driven, asked = series.pose[:, index, :2], series.reference[:, index, :2]
        if larger != 1.0:
            driven = (asked + larger * (driven - asked))[round(TRANSIENT / series.period) :]
        axis.plot(driven[:, 0], driven[:, 1], color=colours[agent], linewidth=1.2, label=agent)
    axis.plot(*table[0, :2], "o", color="black", markersize=5)
    low, high = table[:, :2].min(axis=0), table[:, :2].max(axis=0)
    centre, reach = 0.5 * (low + high), pictures.around + 0.6 * float((high - low).max())
    axis.set(aspect="equal", xlabel="x [m]", ylabel="y [m]")
    axis.set(xlim=(centre[0] - reach, centre[0] + reach), ylim=(centre[1] - reach, centre[1] + reach))
    remark = "" if larger == 1.0 else f", errors × {larger:g} after {TRANSIENT:g} s"
    axis.set_title(f"{first.names[index]}{remark}", fontsize="medium")


def draw_obstacles(axis: "Axes", plan: Plan, path: int) -> None:
    """The obstacles beside one path."""
    from matplotlib.patches import Circle, Polygon

    obstacles = plan.around.obstacles
    for k in range(*plan.arenas[path]):
        first_face, _, first, end = obstacles.spans[k]
        corners = obstacles.corners[first:end]
        if len(corners) == 1:
            axis.add_patch(Circle((corners[0, 0], corners[0, 1]), obstacles.radii[k], color=OBSTACLE, linewidth=0))
        elif len(corners):
            axis.add_patch(Polygon(corners, facecolor=OBSTACLE, edgecolor=OBSTACLE, linewidth=1.5))
        else:
            x, y, offset = obstacles.faces[first_face]
            axis.axline((offset * x, offset * y), (offset * x - y, offset * y + x), color=OBSTACLE, linewidth=3)


def draw_speeds(
    axis: "Axes", episodes: Mapping[str, Episodes], index: int, colours: Mapping[str, str], plan: Plan
) -> None:
    """Speed along the path in one episode over the way, beside that of the time law."""
    path = index % len(plan.names)
    square = plan.tables[path][:, -1]
    way = plan.source.spacings[path] * np.arange(len(square))
    axis.plot(way, np.sqrt(square), color="0.6", linewidth=4, label="time law")
    for agent, series in episodes.items():
        progress = series.progress[:, index]
        axis.plot(progress[1:], np.diff(progress) / series.period, color=colours[agent], linewidth=1.2, label=agent)
    axis.set_title(next(iter(episodes.values())).names[index], fontsize="medium")
    axis.set(xlabel="progress [m]", ylabel="speed along the path [m/s]")


def draw_errors(
    axis: "Axes", episodes: Mapping[str, Episodes], field: str, factor: float, label: str, colours: Mapping[str, str]
) -> None:
    """Median and 10 to 90 % of an error over all episodes that still run."""
    for agent, series in episodes.items():
        size = np.abs(getattr(series, field)) * factor
        size = size[np.isfinite(size).sum(axis=1) * 2 > size.shape[1]]
        time = series.period * np.arange(1, len(size) + 1)
        low, middle, high = np.nanquantile(size, [0.1, 0.5, 0.9], axis=1)
        axis.fill_between(time, low, high, color=colours[agent], alpha=0.2, linewidth=0)
        axis.plot(time, middle, color=colours[agent], label=agent)
    axis.set(yscale="log", ylabel=label)


def draw_torques(axis: "Axes", series: Episodes, index: int) -> None:
    """Torques of all motors in one episode, as shares of their limits."""
    share = series.share[:, index]
    time = series.period * np.arange(1, len(share) + 1)
    for motor in range(share.shape[1]):
        kind = "roll" if motor % 2 == 0 else "steer"
        colour, style = COLOURS[motor // 2 % len(COLOURS)], "-" if motor % 2 == 0 else ":"
        axis.plot(time, share[:, motor], style, color=colour, linewidth=1.0, label=f"{kind}_{motor // 2 + 1}")
    axis.set_ylabel("torque / limit")


def learning_curves(histories: Mapping[str, Sequence[Validation]]) -> dict[str, Printed]:
    """The numbers of the verdicts that are to be seen, with how; none if nothing learned."""
    verdicts = {type(one.verdict) for history in histories.values() for one in history}
    return {name: how for kind in verdicts for name, how in shown(kind) if isinstance(how, Printed)}


def draw_learning(axis: "Axes", histories: Mapping[str, Sequence[Validation]], name: str, how: Printed) -> None:
    """One number of the verdicts on validation paths over training time, a line for each seed."""
    for i, (run, history) in enumerate(histories.items()):
        seconds = [one.seconds for one in history]
        values = how.factor * np.array([getattr(one.verdict, name) for one in history])
        values = np.where(np.isfinite(values), values, np.nan)
        axis.plot(seconds, values, ".-", color=COLOURS[i % len(COLOURS)], label=run)
    label = f"validation {how.label}"
    axis.set(yscale=how.scale, xlabel="training time [s], one core for each seed", ylabel=label)
    axis.legend(fontsize="small")


def _telling_episodes(names: Sequence[str]) -> list[int]:
    """Some episodes worth drawing: random paths first, then those with a shape of their own."""
    seen: set[str] = set()
    shapes: list[int] = []
    wandering: list[int] = []
    for i, name in enumerate(names):
        if name not in seen:
            (wandering if name.startswith("random_paths") else shapes).append(i)
        seen.add(name)
    kept = shapes[:MOST_PATHS]
    return [*wandering[: max(MOST_PATHS - len(kept), 0)], *kept]
