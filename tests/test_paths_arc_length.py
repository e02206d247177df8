"""caster_gym.paths.arc_length: lines against shapes known in closed form, and what makes no line."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.paths import read_paths
from caster_gym.paths.arc_length import LINE_COLUMNS, NoLineError, between, hermite, line_along
from caster_gym.paths.trajectory import Trajectory

SPACING = 0.02


def lines(path, samples=2000, free_heading=False, spacing=SPACING):
    return [
        line_along(trajectory, spacing, free_heading)
        for one in read_paths(path)
        for trajectory in one.trajectories(one.duration / samples)
    ]


def columns(line, *names):
    return [line.rows[:, LINE_COLUMNS.index(name)] for name in names]


def along(line):
    return np.arange(len(line.rows)) * line.spacing


@pytest.mark.parametrize("radius", [0.15, 1.0, 2.5])
def test_a_circle_has_its_length_curvature_and_points(radius):
    """The arc length is the integral of a polynomial of degree 4, its end corrections leave 1e-12 of it."""
    (line,) = lines({"shape": "circle", "radius": radius})
    s = along(line)
    assert s[-1] == pytest.approx(2.0 * np.pi * radius, rel=1e-9)
    x, y, tx, ty, curvature, cos, sin, bend, bend_slope = line.rows.T
    turned = s / radius
    assert_allclose(x + 1j * y, radius * np.exp(1j * turned), atol=1e-6)
    assert_allclose(tx + 1j * ty, 1j * np.exp(1j * turned), atol=1e-6 / radius)
    assert_allclose(curvature, 1.0 / radius, rtol=1e-6)
    assert_allclose(cos + 1j * sin, tx + 1j * ty, atol=1e-9)
    assert_allclose(bend, 1.0 / radius, rtol=1e-6)
    assert_allclose(bend_slope, 0.0, atol=1e-5 / radius**2)


def test_the_spacing_divides_the_length_and_is_the_one_asked_for_but_for_half_a_row():
    (line,) = lines("ellipse")
    count = len(line.rows) - 1
    assert abs(count * line.spacing / SPACING - count) <= 0.5


def test_points_are_where_the_arc_length_of_an_ellipse_says():
    """Its length by SciPy's elliptic integral."""
    from scipy.special import ellipe

    (line,) = lines("ellipse")
    assert along(line)[-1] == pytest.approx(4.0 * 1.5 * ellipe(1.0 - (0.5 / 1.5) ** 2), abs=1e-7)
    x, y = columns(line, "x", "y")
    assert_allclose((x / 1.5) ** 2 + (y / 0.5) ** 2, 1.0, atol=2e-6 / 0.5)  # 1 µm off the ellipse


@pytest.mark.parametrize(
    "path", ["ellipse", "lemniscate", "rounded_square", {"shape": "circle", "heading": "spinning"}]
)
def test_each_column_is_the_slope_of_the_one_before(path):
    """Central differences on rows of 1 mm: their error is h²/6 times a third derivative of less than 1000.

    The slope of the bend has kinks at the corners of the rounded square: h times a jump of less than 100 1/m³ there.
    """
    (line,) = lines(path, 20_000, spacing=0.001)
    x, y, tx, ty, curvature, cos, sin, bend, bend_slope = line.rows.T

    def slope(column):
        return (column[2:] - column[:-2]) / (2.0 * line.spacing)

    tangent, heading = tx + 1j * ty, cos + 1j * sin
    assert_allclose(abs(tangent), 1.0, atol=1e-12)
    assert_allclose(slope(x + 1j * y), tangent[1:-1], atol=1e-3)
    assert_allclose(slope(tangent), (1j * curvature * tangent)[1:-1], atol=1e-3)
    assert_allclose(slope(heading), (1j * bend * heading)[1:-1], atol=1e-3)
    assert_allclose(slope(bend), bend_slope[1:-1], atol=0.1)  # of up to 30


def test_ends_have_the_limits_of_what_lies_inside():
    """There the speed is zero. Curvature of an ellipse at its end is a/b², the lemniscate's at its crossing is zero.

    The limits are lines through samples 20 µm away: off by their square times a second derivative of 600 1/m³. The
    slope of the bend, zero by symmetry, is that of a parabola through three rows: off by a part of its 11 1/m² a row.
    """
    (ellipse,), (eight,) = lines("ellipse"), lines("lemniscate")
    for end in (0, -1):
        assert_allclose(ellipse.rows[end, [4, 7]], 1.5 / 0.5**2, atol=1e-6)
        assert_allclose(ellipse.rows[end, 8], 0.0, atol=1.0)
        assert_allclose(ellipse.rows[end, 2:4], [0.0, 1.0], atol=1e-9)
        assert_allclose(eight.rows[end, [4, 7]], 0.0, atol=1e-6)


def test_the_slope_of_the_bend_stays_bounded_where_a_random_path_rests():
    """There its speed waves in time, which grows as the cube root of the way: the slope itself has no limit."""
    for line in lines({"shape": "random_paths", "count": 40, "reversing": 0.0}):
        change = abs(np.diff(line.rows[:, 7]))
        for end, inside in ((0, change[:2]), (-1, change[-2:])):
            assert abs(line.rows[end, 8]) * line.spacing <= 2.0 * inside.max() + 1e-9


def test_how_long_a_path_takes_does_not_matter():
    quick, slow = (lines({"shape": "lemniscate", "duration": d})[0] for d in (1.0, 100.0))
    assert_allclose(quick.rows, slow.rows, atol=1e-8)


def test_a_free_heading_stays_what_it_is_at_the_start():
    (line,) = lines("circle", free_heading=True)
    cos, sin, bend, bend_slope = columns(line, "cos", "sin", "bend", "bend_slope")
    assert_allclose(cos, 0.0, atol=1e-9)  # the circle starts upwards
    assert_allclose(sin, 1.0, atol=1e-9)
    assert not bend.any() and not bend_slope.any()


def test_a_spinning_heading_turns_in_proportion_to_the_way_round_a_circle():
    (line,) = lines({"shape": "circle", "heading": {"kind": "spinning", "turns": -2.0, "angle": 0.3}})
    cos, sin = columns(line, "cos", "sin")
    assert_allclose(cos + 1j * sin, np.exp(1j * (0.3 - 2.0 * along(line))), atol=1e-6)


def test_between_rows_of_a_circle_the_cubic_errs_by_a_known_amount():
    """Hermite's cubic errs by at most spacing⁴/384 times the fourth derivative 1/R³: 0.12 µm at R = 15 cm."""
    radius = 0.15
    (line,) = lines({"shape": "circle", "radius": radius})
    middle = between(line.rows, line.spacing, 0.5, slice(0, -1))
    error = abs(np.hypot(middle[:, 0], middle[:, 1]) - radius)
    assert error.max() < 1.1 * SPACING**4 / 384.0 / radius**3
    assert_allclose(np.hypot(middle[:, 2], middle[:, 3]), 1.0, atol=1e-12)
    angle = (along(line)[:-1] + 0.5 * line.spacing) / radius
    assert_allclose(middle[:, 2] + 1j * middle[:, 3], 1j * np.exp(1j * angle), atol=1e-6)  # symmetric about the middle


def test_between_at_single_rows_is_between_at_all_of_them():
    (line,) = lines("ellipse")
    everywhere = between(line.rows, line.spacing, 0.3, slice(0, -1))
    assert_allclose(between(line.rows, line.spacing, np.full(2, 0.3), np.array([4, 7])), everywhere[[4, 7]], rtol=1e-14)


def test_hermite_is_exact_for_cubics():
    at = np.array([0.0, 0.3, 1.0])
    s = np.linspace(0.0, 1.0, 11)
    p = np.polynomial.Polynomial([1.0, -2.0j, 0.5, 3.0 + 1.0j])
    assert_allclose(hermite(at, p(at), p.deriv()(at), s), p(s), atol=1e-14)


@pytest.mark.parametrize(
    ("waypoints", "what"),
    [
        ([(0, 0), (1, 0), (0, 0)], r"turns back on the spot at s = 1 m, \(x, y\) = \(1, 0\) m"),
        ([(0, 0, 0), (1, 0, 0), (1, 0, 2), (2, 0, 2)], r"turns on the spot at s = 1 m, \(x, y\) = \(1, 0\) m"),
        ([(1, 1, 0), (1, 1, 2)], "turns on the spot and leads nowhere"),
        ([(1, 1)], "stands still and leads nowhere"),
        ([(0, 0), (1e9, 0)], r"1e\+09 m long, over 500000 rows of 0.02 m; its unit must be metres"),
    ],
)
def test_a_path_that_rests_on_its_way_is_refused_with_the_place(waypoints, what):
    heading = {} if len(waypoints[0]) == 3 else {"heading": "fixed"}
    with pytest.raises(NoLineError, match=what):
        lines({"shape": "spline", "waypoints": waypoints, **heading})


def test_a_random_path_that_reverses_is_refused():
    with pytest.raises(NoLineError, match=r"turns back on the spot at s ="):
        lines({"shape": "random_paths", "reversing": 1.0, "count": 20})


def test_a_turn_within_a_row_is_refused_and_the_spacing_offered_does():
    sharp = {"shape": "circle", "radius": 0.03}
    with pytest.raises(
        ValueError, match=r"tangent turns by 0\.7 rad within 0\.02\d* m at s = .*more than 0\.5"
    ) as error:
        lines(sharp)
    offered = float(str(error.value).split("a spacing of ")[1].split()[0])
    assert lines(sharp, spacing=offered)


def test_a_heading_that_turns_within_a_row_is_refused_unless_it_is_free():
    dizzy = {"shape": "circle", "heading": {"kind": "spinning", "turns": 30}}
    with pytest.raises(ValueError, match=r"its heading turns by .* a spacing of 0\.01\d? m would suffice"):
        lines(dizzy)
    assert lines(dizzy, free_heading=True)


@pytest.mark.parametrize("radius", [1e-5, 0.01])
def test_a_path_shorter_than_some_rows_is_refused(radius):
    with pytest.raises(ValueError, match="m long"):
        lines({"shape": "circle", "radius": radius})


def test_a_path_that_stops_on_its_way_is_refused():
    (circle,) = read_paths("circle")
    samples = np.array(circle.trajectories(0.01)[0].samples)
    samples[500, 4:6] = 0.0
    with pytest.raises(ValueError, match="on the spot"):
        line_along(Trajectory("stopping", 0.01, samples), SPACING, False)
