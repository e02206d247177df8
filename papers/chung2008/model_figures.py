"""The picture of computed torque with incomplete models: error over speed."""

from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.report.figures import COLOURS, new_figure
from papers.chung2008.model_trials import BARE, EXACT, FREQUENCIES, MODELS, PATHS, PRINTED, SOFT, STIFF, Study
from papers.page import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


def picture(studies: list[Study]) -> Picture:
    """Position error of every model over speed, a row for each robot, a column for each path; crosses for the law."""
    return Picture("incomplete_models", "Tracking error by model and speed", _caption(), _figure(studies))


def _caption() -> str:
    return (
        "Position RMSE of computed torque over the mean speed of the motion, by what the controller knows of the "
        f"robot. Solid: feedback of {FREQUENCIES[SOFT]:g} rad/s, dashed: of {FREQUENCIES[STIFF]:g} rad/s. Crosses: "
        "what the law predicts of the lack in the model alone. Incomplete models lose with v², the exact one, by "
        "holding its torques, with v³ where there is no dry friction; feedback lowers all of them."
    )


def _figure(studies: list[Study]) -> "Figure":
    figure = new_figure(len(studies), len(PATHS), sharex="all", sharey="row")
    for panel, (s, p) in zip(figure.axes, product(studies, range(len(PATHS))), strict=True):
        _draw(panel, s, p)
        panel.label_outer()
    for panel in figure.axes[:: len(PATHS)]:
        panel.set_ylabel("position RMSE [mm]")
    handles, labels = figure.axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels), frameon=False)
    return figure


def _draw(panel: "Axes", s: Study, p: int) -> None:
    from matplotlib.ticker import LogLocator, NullFormatter, ScalarFormatter

    colours = (COLOURS[0], COLOURS[2], COLOURS[3])
    v = s.speeds[p]
    for (m, model), (q, f) in product(enumerate(MODELS), enumerate(FREQUENCIES)):
        label = f"{model}, {f:g} rad/s"
        panel.plot(v, 1e3 * s.position[m, q, p], "-" if q == SOFT else "--", color=colours[m], label=label)
    for q in range(len(FREQUENCIES)):
        label = "" if q else "law"
        panel.plot(v, 1e3 * s.predicted[PRINTED, q, p], "x", color="black", markersize=5, zorder=3, label=label)
        panel.plot(v, 1e3 * s.predicted[BARE, q, p], "x", color="black", markersize=5, zorder=3)
    guide, lowest = np.array([1.0, 2.0]), 1e3 * s.position[EXACT, STIFF].min()
    for power, sign in ((2, "v²"), (3, "v³")):
        panel.plot(0.4 * guide, lowest * guide**power, color="0.5", linewidth=1.0)
        panel.annotate(sign, (0.82, lowest * guide[1] ** power), color="0.35", fontsize=8, va="center")
    panel.set_xscale("log")
    panel.set_yscale("log")
    panel.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
    panel.xaxis.set_major_formatter(ScalarFormatter())
    panel.xaxis.set_minor_formatter(NullFormatter())
    panel.set_xlabel("mean speed [m/s]")
    panel.set_title(f"{s.robot}, {list(PATHS)[p]}")
