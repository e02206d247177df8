"""Section 4 and Figs. 16 to 19 of chung2008, as the page shows them."""

import numpy as np
import pytest

from caster_gym import Model, load_robot
from papers.analysis.impulse_shape import extremes
from papers.chung2008 import circles, impulse
from papers.chung2008.impulse_checks import printed_impulse, steering_of
from papers.page import unexplained

MODEL = Model(load_robot("chung2008"))


@pytest.fixture(scope="module")
def sections():
    return impulse.section(), circles.section()


def test_every_check_agrees_or_names_its_erratum(sections):
    checks = [check for section in sections for check in section.checks]
    assert len(checks) > 10
    assert unexplained(sections) == ()
    doubted = {check.remark.split(":")[0] for check in checks if not check.agrees}
    assert doubted <= {difference.tag for section in sections for difference in section.differences}


@pytest.mark.parametrize(
    ("figure", "least", "greatest", "axis"),
    [
        # by hand: all wheels parallel, 1.8 · (5 + 3 · 0.1403) across and 1.8 · (5 + 3 · 0.85) along them
        ("Fig. 16", 9.758, 13.590, 0.0),
        ("Fig. 17", 9.758, 13.590, 135.0),
        ("Fig. 18 mirrored", 11.162, 11.674, 90.0),
    ],
)
def test_impulses_of_the_figures(figure, least, greatest, axis):
    shape = extremes(MODEL, steering_of(figure))
    assert 1.8 * shape.least == pytest.approx(least, abs=5e-4)
    assert 1.8 * shape.greatest == pytest.approx(greatest, abs=5e-4)
    assert np.degrees(shape.along_greatest) == pytest.approx(axis, abs=1e-9)  # symmetry


def test_figure_18_is_uniform_but_for_the_rounding_of_the_pivots():
    """1.2e-8: the coupling is of first order in 0.0866025 − 0.0865, its effect of second."""
    assert 1e-9 < extremes(MODEL, steering_of("Fig. 18")).ratio - 1.0 < 2e-8


def test_printed_formula_gives_the_impulse_at_the_centre_alone():
    normal, twist, steering = np.array([0.6, 0.8]), np.array([-0.9, -0.4, 1.3]), np.array([0.2, -1.0, 2.5])
    at_centre, _ = MODEL.collide(steering, twist, [0.0, 0.0], normal, 0.8)
    beside, _ = MODEL.collide(steering, twist, [0.1, 0.0], normal, 0.8)
    printed = printed_impulse(MODEL, steering, twist, normal, 0.8)
    assert printed == pytest.approx(at_centre[0], rel=1e-12)  # the same division, another solver
    assert abs(printed - beside[0]) > 1.0  # [N s]


def test_pictures_and_tables_show_all_figures_robots_and_curves(sections):
    figures, circles = sections
    assert [row[0] for row in figures.tables[0].rows] == [f"Fig. {n}" for n in (16, 17, 18, 19)] + ["Fig. 18 mirrored"]
    assert {row[0] for row in circles.tables[0].rows} == {"symmetric", "balanced"}
    assert [row[0] for row in circles.tables[1].rows] == ["chung2008", "xr4000", "tidybot2"]
    for section in sections:
        for picture in section.pictures:
            assert all(axis.has_data() for axis in picture.figure.axes)
            assert all(axis.get_xlabel() for axis in picture.figure.axes if axis.get_label() != "<colorbar>")


def test_real_robots_are_heavier_across_their_wheels(sections):
    """Short trails and geared steering turn round what the paper finds for its own robot."""
    along, across = np.array([[float(row[2]), float(row[3])] for row in sections[1].tables[1].rows]).T
    assert (along > across).tolist() == [True, False, False]
