"""kim2001, Figs. 5 and 6, and what section V says in a sentence about six joints."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from caster_gym.arrays import Array
from caster_gym.report.figures import COLOURS, new_figure
from papers.analysis.isotropy import isotropy
from papers.kim2001.isotropy_search import RATIOS, ROBOT, SIX, indices
from papers.notation import KIM2001

if TYPE_CHECKING:
    from matplotlib.figure import Figure

TWIST = (2.0, 2.0, 1.0)
FIGURES = "r = d = 0.1a, φ̇_max/θ̇_max = 1, ω_max/v_max = 0.5/a"  # Figs. 5 and 6
ANGLES = np.linspace(0.0, 2.0 * np.pi, 145)  # φ_1 and φ_2
THIRD = np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False)  # φ_3, over which Fig. 5 averages
LONG_TRAILS = (1.0, 2.0, 5.0, 10.0)  # [a]


def local_indices(joints: Sequence[str]) -> Array:
    """(φ_1, φ_2, φ_3) index for r = d = 0.1a and the demand of Figs. 5 and 6."""
    phi = np.stack(np.meshgrid(ANGLES, ANGLES, THIRD, indexing="ij"), axis=-1)
    return isotropy(ROBOT, KIM2001.steering(phi), joints, TWIST, np.ones(len(joints)))


def contours(joints: Sequence[str], step: float) -> "Figure":
    """The index over φ_1 and φ_2, averaged over φ_3, with a line at every multiple of a step; each second is named."""
    figure = new_figure(size=(5.8, 4.6))
    axis = figure.axes[0]
    values, degrees = local_indices(joints).mean(axis=2).T, np.degrees(ANGLES)
    levels = step * np.arange(np.floor(values.min() / step), np.ceil(values.max() / step) + 1.0)
    filled = axis.contourf(degrees, degrees, values, levels=levels, cmap="cividis")
    lines = axis.contour(degrees, degrees, values, levels=levels, colors="white", linewidths=0.6)
    axis.clabel(lines, levels[::2], fontsize=7, fmt="%.2f")
    figure.colorbar(filled, ax=axis, label=r"isotropy index $\sigma_{\min}/\sigma_{\max}$", ticks=levels[::2])
    ticks = np.arange(0.0, 361.0, 60.0)
    axis.set(xlabel=r"$\varphi_1$ [°]", ylabel=r"$\varphi_2$ [°]", xticks=ticks, yticks=ticks)
    axis.set_box_aspect(1.0)
    axis.grid(False)
    return figure


def best_quotient() -> "Figure":
    """σ_GI of all six joints against r/d, for short and for long steering links."""
    figure = new_figure(1, 2, size=(4.8, 3.6))
    short, long = figure.axes
    quotient = np.geomspace(0.25, 4.0, 65)
    interval = np.radians(10.0)
    for colour, ratio in zip(COLOURS, RATIOS, strict=False):
        mean = indices(SIX, 0.1 * quotient, 0.1, 1.0, ratio, interval)
        style = "--" if ratio == RATIOS[-1] else "-"  # the last two can hardly be told apart
        short.plot(quotient, mean / mean.max(), style, color=colour, label=f"{ratio:g}/a, {mean.max():.3f}")
    for colour, trail in zip(COLOURS, LONG_TRAILS, strict=False):
        mean = indices(SIX, trail * quotient, trail, 1.0, RATIOS[0], interval)
        long.plot(quotient, mean, color=colour, label=f"{trail:g}a")
        long.plot(quotient[mean.argmax()], mean.max(), "o", color=colour, markersize=5)
    short.set(ylabel=r"$\sigma_{GI}$ / its maximum", title="$d = 0.1a$")
    short.legend(title=r"$\omega_{\max}/v_{\max}$, maximum", fontsize=8, title_fontsize=8)
    long.set(ylabel=r"$\sigma_{GI}$", title=rf"$\omega_{{\max}}/v_{{\max}} = {RATIOS[0]:g}/a$")
    long.legend(title="$d$", fontsize=8, title_fontsize=8)
    for axis in (short, long):
        axis.set_xscale("log")
        axis.axvline(1.0, color="#707C8B", linewidth=1.0, linestyle=":")
        ticks = [0.25, 0.5, 1.0, 2.0, 4.0]
        axis.set_xticks(ticks, [f"{tick:g}" for tick in ticks])
        axis.minorticks_off()
        axis.set_xlabel(r"$r/d$  (where $\dot\varphi_{\max} = \dot\theta_{\max}$)")
    return figure
