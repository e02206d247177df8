"""The picture of an identification: what was measured, what the model predicts before and after, and the errors."""

from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from caster_gym.analysis.frames import wrap_angle
from caster_gym.arrays import Array
from caster_gym.identification.fit import Identification
from caster_gym.identification.recording import KIND_UNITS
from caster_gym.report.figures import COLOURS, legend_below, new_figure, save_figure

if TYPE_CHECKING:
    from matplotlib.axes import Axes


_NAMES = {
    "position": "x",
    "heading": "heading",
    "velocity": "vx",
    "yaw_rate": "yaw rate",
    "steering": "steering 1",
    "rolling": "rolling 1",
}
_FEWEST_SHOWN = 3.0  # times the greatest error left that an axis of errors shows at least


def write_identify_figure(path: Path, found: Identification) -> None:
    """One row a kind of quantity: a measured component with its predictions, and the errors of these, as PNG."""
    shooting = found.shooting
    components = shooting.recording.kinds
    kinds = [components[i] for i in shooting.observed]
    firsts = {kind: kinds.index(kind) for kind in dict.fromkeys(kinds)}
    figure = new_figure(len(firsts), 2, (6.2, 1.9), sharex=True)
    time = shooting.recording.time_step * np.arange(shooting.count * shooting.length, dtype=np.float64)
    for row, (kind, place) in enumerate(firsts.items()):
        left, right = figure.axes[2 * row], figure.axes[2 * row + 1]
        measured = shooting.measured[..., place]
        errors, shown = [path[..., place] - measured for path in (found.before, found.after)], measured
        if kind in ("heading", "steering"):
            errors, shown = [*map(wrap_angle, errors)], np.unwrap(measured.ravel()).reshape(measured.shape)
        left.plot(time, shown.ravel(), ".", color="0.72", markersize=6.0, label="measured")
        for error, colour, label in zip(errors, (COLOURS[2], COLOURS[0]), _LABELS, strict=True):
            draw_windows(left, time, shown + error, colour, label)
            draw_windows(right, time, error, colour, label)
        left.set_ylabel(f"{_NAMES[kind]} [{KIND_UNITS[kind]}]")
        right.set_ylabel(f"error [{KIND_UNITS[kind]}]")
        limit = max(_FEWEST_SHOWN * float(np.abs(errors[1]).max()), float(np.quantile(np.abs(errors[0]), 0.98)))
        right.set_ylim(-limit or -1.0, limit or 1.0)
        low, high = float(shown.min()), float(shown.max())
        left.set_ylim(low - 0.25 * (high - low or 1.0), high + 0.25 * (high - low or 1.0))
    for axis in figure.axes[-2:]:
        axis.set_xlabel("time [s]")
    figure.axes[0].set_title("measured and predicted", fontsize="medium")
    figure.axes[1].set_title("predicted minus measured", fontsize="medium")
    legend_below(figure, figure.axes[0], 3)
    save_figure(figure, path)


_LABELS = ("predicted with the starting values", "predicted with the estimates")


def draw_windows(axis: "Axes", time: NDArray[np.floating], values: Array, colour: str, label: str) -> None:
    """A line through the samples of each window, broken between windows."""
    apart = np.concatenate([values, np.full((len(values), 1), np.nan)], axis=1)
    times = time.reshape(values.shape)
    axis.plot(np.concatenate([times, times[:, -1:]], axis=1).ravel(), apart.ravel(), color=colour, lw=1.2, label=label)
