"""caster_gym.tasks.follow.course: places and motion between two rows of a course."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.envs.tracking import Reference
from caster_gym.paths.course import COURSE_COLUMNS
from caster_gym.tasks.follow import course
from caster_gym.tasks.follow.parameters import FollowParameters

EXACT = 1e-12  # rounding of a few dozen operations on numbers of order 1
RADIUS, SPACING = 0.5, 0.02  # [m] of a circle, and between two rows of it
TURN, FIRST, LAST = 0.7, 0.36, 0.4  # [-] rad of heading per rad of the circle; [m²/s²] ṡ² of both rows


def row(s, square):
    """A circle about the origin, at an arc length; its heading turns in proportion, a little faster and faster."""
    angle, bend_slope = s / RADIUS, 0.3
    bend = TURN / RADIUS + bend_slope * s
    psi = TURN * angle + 0.5 * bend_slope * s**2
    place = (RADIUS * np.cos(angle), RADIUS * np.sin(angle), -np.sin(angle), np.cos(angle))
    return course.Row(*place, 1.0 / RADIUS, np.cos(psi), np.sin(psi), bend, bend_slope, square)


def random_rows(rng):
    """Two rows that a cubic joins, as far apart as their tangents say."""
    a, b = rng.normal(size=10), rng.normal(size=10)
    a[2:4] /= np.hypot(*a[2:4])
    b[2:4] /= np.hypot(*b[2:4])
    return course.Row(*a), course.Row(*b)


ROWS = row(0.0, FIRST), row(SPACING, LAST)


def test_rows_are_those_of_a_course():
    assert course.Row._fields == COURSE_COLUMNS


def test_points_between_rows_start_and_end_at_them_along_their_tangents():
    rng = np.random.default_rng(0)
    for _ in range(50):
        (a, b), spacing = random_rows(rng), rng.uniform(0.01, 2.0)
        for share, end in ((0.0, a), (1.0, b)):
            assert_allclose(course.point_between(a, b, share, spacing), end[:2], rtol=0.0, atol=EXACT)
            slope = np.array(course.slope_between(a, b, share, spacing))
            assert_allclose(slope, spacing * np.array(end[2:4]), rtol=0.0, atol=EXACT)


def test_points_between_rows_lie_on_one_cubic():
    """The fourth differences of a cubic vanish, and its slope is the derivative."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        (a, b), spacing = random_rows(rng), rng.uniform(0.01, 2.0)
        points = np.array([course.point_between(a, b, share, spacing) for share in np.linspace(0.0, 1.0, 6)])
        assert_allclose(np.diff(points, 4, axis=0), 0.0, atol=1e-11)  # rounding, times binomials of up to 6
        share, h = rng.uniform(0.1, 0.9), 1e-4
        ends = [np.array(course.point_between(a, b, share + side * h, spacing)) for side in (-1.0, 1.0)]
        slope = course.slope_between(a, b, share, spacing)
        # p‴ h²/6, p‴ up to 12 |b − a| of the cubic
        assert_allclose((ends[1] - ends[0]) / (2.0 * h), slope, rtol=0.0, atol=1e-6)


def test_the_nearest_share_is_that_of_a_dense_search():
    """From the foot on the chord, for points up to half of the radius away from the curve, on either side."""
    rng = np.random.default_rng(2)
    shares = np.linspace(0.0, 1.0, 20001)
    a, b = row(0.0, FIRST), row(0.1, FIRST)  # five times as far apart as rows are, so that chord and curve differ
    curve = np.array(course.point_between(a, b, shares, 0.1)).T
    chord = curve[-1] - curve[0]
    for _ in range(100):
        angle, distance = rng.uniform(-0.02, 0.22), rng.uniform(0.5, 1.5) * RADIUS
        point = distance * np.array([np.cos(angle), np.sin(angle)])
        guess = np.clip((point - curve[0]) @ chord / (chord @ chord), 0.0, 1.0)
        found = course.nearest_share(a, b, guess, 0.1, *point)
        expected = shares[np.hypot(*(curve - point).T).argmin()]
        assert_allclose(found, expected, rtol=0.0, atol=5e-5)  # the search's own step


@pytest.mark.parametrize(("ahead", "share"), [(-0.3, 0.0), (0.5, 1.0)])
def test_beyond_both_rows_the_nearest_share_is_an_end(ahead, share):
    a, b = ROWS
    assert course.nearest_share(a, b, 0.5, SPACING, a[0] + ahead * a[2], a[1] + ahead * a[3]) == share


def test_a_reference_moves_along_the_path_at_the_speed_of_the_law():
    """On a circle: velocity along the tangent, ω = ψ′ ṡ."""
    for share in (0.0, 0.3, 1.0):
        r = course.course_reference(*ROWS, share, SPACING)
        angle, speed = share * SPACING / RADIUS, np.sqrt(FIRST + share * (LAST - FIRST))
        bend = TURN / RADIUS + 0.3 * share * SPACING
        psi = TURN * angle + 0.15 * (share * SPACING) ** 2
        # a cubic over an angle φ = 0.04 errs by R φ⁴/384 = 3e-9 m in the point and by φ³/125 = 5e-7 in the tangent; a
        # heading whose slope changes by 0.006, linear between rows, by 0.006 · 0.02/8 = 1.5e-5
        assert_allclose([r.x, r.y], RADIUS * np.array([np.cos(angle), np.sin(angle)]), rtol=0.0, atol=1e-8)
        assert_allclose([r.vx, r.vy], speed * np.array([-np.sin(angle), np.cos(angle)]), rtol=0.0, atol=5e-7)
        assert_allclose([r.cos, r.sin], [np.cos(psi), np.sin(psi)], rtol=0.0, atol=1.6e-5)
        assert np.hypot(r.cos, r.sin) == pytest.approx(1.0, abs=1e-15)
        assert_allclose(r.omega, bend * speed, rtol=1e-12)


def test_a_references_acceleration_is_the_derivative_of_its_velocity():
    """Along the path s̈, across it κ ṡ², and the rate of the yaw rate; by differences over ±1e-4 of the spacing."""
    share, h = 0.4, 1e-4
    before, now, after = (course.course_reference(*ROWS, share + d, SPACING) for d in (-h, 0.0, h))
    speed = np.hypot(now.vx, now.vy)
    time = 2.0 * h * SPACING / speed
    rates = [(getattr(after, v) - getattr(before, v)) / time for v in ("vx", "vy", "omega")]
    # the cubic's own curvature differs from κ by κ φ²/12 = 1.3e-4 of κ ṡ² = 0.75; halves of differences of 1e-4
    assert_allclose(rates, [now.ax, now.ay, now.alpha], rtol=0.0, atol=3e-4)
    along = now.ax * now.vx / speed + now.ay * now.vy / speed
    assert along == pytest.approx(0.5 * (LAST - FIRST) / SPACING, rel=1e-12)


def test_a_law_that_rounding_made_negative_stands_still():
    assert course.law_speed(-1e-18) == 0.0
    assert course.law_speed(0.25) == 0.5


def test_at_rest_only_the_place_is_left():
    moving = Reference(*np.arange(1.0, 11.0))
    assert course.at_rest(moving) == Reference(1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def test_arriving_counts_as_progress_on_the_last_point():
    """A rational kernel of the distance."""
    last = course.Row(3.0, -1.0, *(0.0,) * 8)
    assert course.arrived_share(3.0, -1.0, last, 0.02) == 1.0
    assert course.arrived_share(3.012, -1.016, last, 0.02) == pytest.approx(0.5, abs=1e-12)  # rounding of 3 m
    assert course.arrived_share(5.0, -1.0, last, 0.02) < 1e-3


def test_a_stride_is_the_way_at_the_speed_limit():
    assert FollowParameters(speed_limit=0.5, control_period=0.04).stride == pytest.approx(0.02, abs=1e-15)


def test_the_nearest_point_of_a_chord_is_nearer_than_all_others():
    """Against a thousand points of it; distances agree with that of the point."""
    rng = np.random.default_rng(6)
    for a, b, place in rng.normal(0.0, 1.0, (50, 3, 2)):
        share, square = course.chord_share(tuple(a), tuple(b), *place)
        assert 0.0 <= share <= 1.0
        assert square == pytest.approx(((a + share * (b - a) - place) ** 2).sum(), rel=1e-12, abs=1e-15)  # rounding
        others = a + np.linspace(0.0, 1.0, 1001)[:, None] * (b - a)
        assert square <= ((others - place) ** 2).sum(axis=1).min() + 1e-15
