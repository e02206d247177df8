"""The style of all figures: size, resolution, grid, colours of lines, and a legend for the whole figure."""

import io
from pathlib import Path
from typing import TYPE_CHECKING, Any

from caster_gym.durable_files import write_file

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

# Colours of lines, by Okabe and Ito; colour-blind eyes can tell them apart
COLOURS = ("#0072B2", "#56B4E9", "#E69F00", "#D55E00", "#009E73", "#CC79A7", "#F0E442", "#000000")
DOTS_PER_INCH = 110


def new_figure(rows: int = 1, columns: int = 1, size: tuple[float, float] = (4.6, 3.4), **options: Any) -> "Figure":
    """A figure with rows and columns of axes, each of a size [in]; options as for matplotlib's `subplots`."""
    figure = empty_figure((columns * size[0], rows * size[1]))
    figure.subplots(rows, columns, squeeze=False, **options)
    for axis in figure.axes:
        axis.grid(alpha=0.3)
    return figure


def empty_figure(size: tuple[float, float]) -> "Figure":
    """A figure of a size [in] without axes, for `save_figure`. It needs no display and need not be closed."""
    from matplotlib.figure import Figure

    return Figure(figsize=size, dpi=DOTS_PER_INCH, layout="constrained")


def save_figure(figure: "Figure", path: Path) -> None:
    """Write a figure as a PNG file."""
    picture = io.BytesIO()
    figure.savefig(picture, format="png")
    write_file(path, picture.getvalue())


def legend_below(figure: Any, axis: "Axes", columns: int, **options: Any) -> None:
    """One legend below a whole figure or subfigure, with the labels of one of its axes."""
    figure.legend(*axis.get_legend_handles_labels(), loc="outside lower center", ncols=columns, **options)
