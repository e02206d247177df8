"""Pictures of the natural orthogonal complement: near its singularities, and along a path."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.report.figures import COLOURS, new_figure
from papers.analysis.coordinate_switching import singular_steering
from papers.analysis.orthogonal_complement import OrthogonalComplement
from papers.chung2008.complement_runs import Approach
from papers.line_drawing import LEGEND, draw_lines
from papers.notation import in_letters
from papers.page import Picture

if TYPE_CHECKING:
    from matplotlib.axes import Axes


BAD, BETTER, GOOD, PLAIN = COLOURS[3], COLOURS[2], COLOURS[0], COLOURS[4]
LEAST, GREATEST = 1e-17, 1e17  # what is drawn of numbers beyond: errors of zero, condition numbers without bound
VIEW = 0.28  # [m] around C
EXAMPLE = (0.6, 2.4, 0.0)  # [rad] steering angles next to which three lines meet


def picture_of_singularity(complement: OrthogonalComplement, distances: Array, near: Approach) -> Picture:
    """Where three lines meet, and how condition number and error grow on the way there."""
    figure = new_figure(1, 3, size=(4.4, 3.7))
    floor, number, error = figure.axes
    steering = singular_steering(complement, np.array(EXAMPLE))
    if steering is not None:
        draw_lines(floor, complement.robot, steering, complement.independent, VIEW)
    floor.set(title=f"{in_letters(complement.independent)} singular", xlabel="x [m]", ylabel="y [m]")
    _band(number, distances, near.condition_numbers, BAD, "J_p of the singular set")
    _band(number, distances, near.inertia_numbers, PLAIN, "operational-space model: its inertia")
    number.set(title="Condition number", xlabel="distance from the singularity [rad]", ylabel="condition number [-]")
    _band(error, distances, near.printed_errors, BAD, "complement, as printed")
    _band(error, distances, near.errors, BETTER, "complement, vector by vector")
    _band(error, distances, near.best_errors, GOOD, "the same, with the best set")
    error.set(
        title="Error of the twist rate", xlabel="distance from the singularity [rad]", ylabel="relative error [-]"
    )
    for axis in (number, error):
        axis.set_xscale("log")
        axis.set_yscale("log")
        axis.invert_xaxis()
        axis.legend(loc="upper left" if axis is number else "center right", fontsize=8)
    caption = (
        f"Left: a configuration at which {in_letters(complement.independent)} is singular: the lines of the three "
        f"joints meet in a point, about which the robot can turn while all three rest. {LEGEND} Middle and right: on "
        f"the way to {len(near.errors)} singular configurations of all sets of three joints, median and range. Errors "
        f"are relative to the operational-space model, which needs no set; they end at 1, where no digit is right."
    )
    return Picture("complement_singularity", "Condition and error near singularities", caption, figure)


def picture_of_path(
    times: Array,
    numbers: Array,
    paper: int,
    chosen: NDArray[np.int64],
    limit: float,
    errors: Sequence[Array],
    gaps: Sequence[Array],
) -> Picture:
    """Condition numbers, errors, and where a simulation goes, over time."""
    figure = new_figure(3, 1, size=(8.5, 2.5), sharex=True)
    number, error, gap = figure.axes
    number.semilogy(times, numbers, color="0.8", linewidth=0.8)
    number.semilogy(times, numbers[:, paper], color=BAD, label="(θ_1, θ_2, φ_3) alone")
    number.semilogy(times, numbers[np.arange(len(times)), chosen], color=GOOD, label="changing sets")
    number.axhline(limit, color="black", linewidth=0.8, linestyle="--", label="limit")
    number.set(ylabel="condition number\nof J_p [-]")
    for values, colour, label in zip(errors, (BAD, GOOD), ("(θ_1, θ_2, φ_3) alone", "changing sets"), strict=True):
        error.semilogy(times, np.maximum(values, LEAST), color=colour, label=label)
    error.set(ylabel="relative error of\nthe twist rate [-]")
    for values, colour in zip(gaps, (BAD, GOOD), strict=True):
        gap.semilogy(times, np.clip(values[1:], 1e-12, 1.0), color=colour)
    gap.set(ylabel="error of the\nsimulated place [m]", xlabel="time [s]")
    for axis in figure.axes:
        for change in times[1:][np.diff(chosen) != 0]:
            axis.axvline(change, color=GOOD, linewidth=0.8, linestyle=":")
    number.legend(loc="upper right", fontsize=8, ncols=3)
    caption = (
        f"A drive through singular configurations. Top: condition numbers of all {numbers.shape[1]} sets (grey), of "
        f"the paper's set, and of the sets in use when they are changed at the limit (dotted lines). Middle: error of "
        f"the twist rate at the configurations of the path. Bottom: distance between the places simulated in "
        f"independent joint rates and in the operational space, under the same torques: the paper's set loses its way "
        f"at a singularity and never finds it again."
    )
    return Picture("complement_path", "Condition and error along a drive", caption, figure)


def _band(axis: "Axes", x: Array, values: Array, colour: str, label: str) -> None:
    drawn = np.clip(values, LEAST, GREATEST)
    axis.fill_between(x, drawn.min(axis=0), drawn.max(axis=0), color=colour, alpha=0.2, linewidth=0.0)
    axis.plot(x, np.median(drawn, axis=0), color=colour, label=label)
