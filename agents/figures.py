"""Pictures of a comparison: paths driven, errors over time, torques, and how the policies learned."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from .evaluation import Episodes
from .training import Validation

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Array = NDArray[np.float64]
# Okabe and Ito's colours, distinguishable with colour-blind eyes
COLOURS = ("#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#F0E442", "#000000")
MOST_PATHS = 6


def write_figures(
    folder: Path, episodes: Mapping[str, Episodes], histories: Mapping[str, Sequence[Validation]]
) -> list[Path]:
    """paths.png, errors.png, torques.png, learning.png (if anything learned) and overview.png; returns their paths."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    colours = dict(zip(episodes, COLOURS * (1 + len(episodes) // len(COLOURS)), strict=False))
    chosen = _telling_episodes(next(iter(episodes.values())).names)
    figures: dict[str, Any] = {}

    figure, axes = plt.subplots(2, 3, figsize=(12, 8), layout="constrained")
    for axis, index in zip(axes.flat, chosen, strict=False):
        draw_path(axis, episodes, index, colours)
    for axis in axes.flat[len(chosen) :]:
        axis.set_visible(False)
    figure.legend(*axes.flat[0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    figures["paths"] = figure

    figure, (above, below) = plt.subplots(2, 1, figsize=(9, 7), sharex=True, layout="constrained")
    draw_errors(above, episodes, "position_error", 1e3, "position error [mm]", colours)
    draw_errors(below, episodes, "heading_error", 1e3, "heading error [mrad]", colours)
    below.set_xlabel("time [s]")
    above.legend(fontsize="small")
    figures["errors"] = figure

    figure, axes = plt.subplots(
        len(episodes), 1, figsize=(9, 2.2 * len(episodes)), squeeze=False, sharex=True, layout="constrained"
    )
    for axis, (agent, series) in zip(axes[:, 0], episodes.items(), strict=True):
        draw_torques(axis, series, chosen[-1])
        axis.set_title(f"{agent}, {series.names[chosen[-1]]}", fontsize="medium")
    axes[-1, 0].set_xlabel("time [s]")
    axes[0, 0].legend(fontsize="x-small", ncols=3)
    figures["torques"] = figure

    if histories:
        figure, axis = plt.subplots(figsize=(7, 4.5), layout="constrained")
        draw_learning(axis, histories)
        figures["learning"] = figure

    figure, axes = plt.subplots(1, 3 if histories else 2, figsize=(16 if histories else 11, 4.6), layout="constrained")
    draw_path(axes[0], episodes, chosen[-1], colours)
    draw_errors(axes[1], episodes, "position_error", 1e3, "position error [mm]", colours)
    axes[1].set_xlabel("time [s]")
    axes[1].legend(fontsize="small")
    axes[1].set_title("all test episodes: median, 10 to 90 %", fontsize="medium")
    if histories:
        draw_learning(axes[2], histories)
    figures["overview"] = figure

    written = []
    for name, figure in figures.items():
        path = folder / f"{name}.png"
        figure.savefig(path, dpi=110)
        plt.close(figure)
        written.append(path)
    return written


def draw_path(axis: "Axes", episodes: Mapping[str, Episodes], index: int, colours: Mapping[str, str]) -> None:
    """What each agent drove in one episode, over its reference; the error is drawn twenty times as large."""
    first = next(iter(episodes.values()))
    reference = first.reference[:, index]
    axis.plot(reference[:, 0], reference[:, 1], color="0.6", linewidth=4, label="reference", solid_capstyle="round")
    for agent, series in episodes.items():
        pose, asked = series.pose[:, index], series.reference[:, index]
        shown = asked[:, :2] + 20.0 * (pose[:, :2] - asked[:, :2])
        settled = slice(round(2.0 / series.period), None)
        axis.plot(shown[settled, 0], shown[settled, 1], color=colours[agent], linewidth=1.2, label=agent)
    axis.plot(*reference[0, :2], "o", color="black", markersize=5)
    low, high = np.nanmin(reference[:, :2], axis=0), np.nanmax(reference[:, :2], axis=0)
    centre, reach = 0.5 * (low + high), 0.15 + 0.6 * float((high - low).max())
    axis.set_xlim(centre[0] - reach, centre[0] + reach)
    axis.set_ylim(centre[1] - reach, centre[1] + reach)
    axis.set_aspect("equal")
    axis.set_title(f"{first.names[index]}, errors × 20 after 2 s", fontsize="medium")
    axis.set_xlabel("x [m]")
    axis.set_ylabel("y [m]")


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
    axis.set_yscale("log")
    axis.set_ylabel(label)
    axis.grid(alpha=0.3)


def draw_torques(axis: "Axes", series: Episodes, index: int) -> None:
    """Torques of all motors in one episode, as shares of their limits."""
    share = series.share[:, index]
    time = series.period * np.arange(1, len(share) + 1)
    for motor in range(share.shape[1]):
        kind = "roll" if motor % 2 == 0 else "steer"
        colour, style = COLOURS[motor // 2 % len(COLOURS)], "-" if motor % 2 == 0 else ":"
        axis.plot(time, share[:, motor], style, color=colour, linewidth=1.0, label=f"{kind}_{motor // 2 + 1}")
    axis.set_ylabel("torque / limit")
    axis.grid(alpha=0.3)


def draw_learning(axis: "Axes", histories: Mapping[str, Sequence[Validation]]) -> None:
    """Error on validation paths over training time, a line for each seed."""
    for i, (name, history) in enumerate(histories.items()):
        seconds = [one.seconds for one in history]
        axis.plot(
            seconds, [1e3 * one.position_rmse for one in history], ".-", color=COLOURS[i % len(COLOURS)], label=name
        )
    axis.set_yscale("log")
    axis.set_xlabel("training time [s], one core for each seed")
    axis.set_ylabel("validation position RMSE [mm]")
    axis.grid(alpha=0.3)
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
