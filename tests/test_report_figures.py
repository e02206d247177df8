"""caster_gym.report.figures: size, resolution, and the legend of a whole figure."""

from matplotlib.image import imread

from caster_gym.report.figures import COLOURS, DOTS_PER_INCH, legend_below, new_figure


def test_a_file_has_the_size_that_was_asked_for(tmp_path):
    new_figure(2, 3, (1.5, 1.0)).savefig(tmp_path / "a.png")
    rows, columns, _ = imread(tmp_path / "a.png").shape
    assert (rows, columns) == (2.0 * DOTS_PER_INCH, 4.5 * DOTS_PER_INCH)


def test_a_figure_needs_no_pyplot_and_leaves_nothing_open():
    from matplotlib import pyplot as plt

    before = plt.get_fignums()
    new_figure()
    assert plt.get_fignums() == before


def test_one_legend_names_the_lines_of_the_axes():
    figure = new_figure(1, 2)
    for label, colour in zip(("ours", "theirs"), COLOURS, strict=False):
        figure.axes[0].plot([0.0, 1.0], color=colour, label=label)
    legend_below(figure, figure.axes[0], 2)
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["ours", "theirs"]
    figure.canvas.draw()
    below = legend.get_window_extent().y1
    assert below <= min(axis.get_window_extent().y0 for axis in figure.axes)
