"""caster_gym.envs.following: places and motion between two rows of a course, and what following is worth."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.envs import following
from caster_gym.envs.follow_task import FollowTask
from caster_gym.envs.following import FollowTerms, FollowWeights
from caster_gym.envs.tracking import Errors, Record, Reference

EXACT = 1e-12  # rounding of a few dozen operations on numbers of order 1
RADIUS, SPACING = 0.5, 0.02  # [m] of a circle, and between two rows of it
TURN, FIRST, LAST = 0.7, 0.36, 0.4  # [-] rad of heading per rad of the circle; [m²/s²] ṡ² of both rows
NO_ERROR = Errors(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def row(s, square):
    """A circle about the origin, at an arc length; its heading turns in proportion, a little faster and faster."""
    angle, bend_slope = s / RADIUS, 0.3
    bend = TURN / RADIUS + bend_slope * s
    psi = TURN * angle + 0.5 * bend_slope * s**2
    place = (RADIUS * np.cos(angle), RADIUS * np.sin(angle), -np.sin(angle), np.cos(angle))
    return (*place, 1.0 / RADIUS, np.cos(psi), np.sin(psi), bend, bend_slope, square)


def random_rows(rng):
    """Two rows that a cubic joins, as far apart as their tangents say."""
    a, b = rng.normal(size=10), rng.normal(size=10)
    a[2:4] /= np.hypot(*a[2:4])
    b[2:4] /= np.hypot(*b[2:4])
    return tuple(a), tuple(b)


ROWS = row(0.0, FIRST), row(SPACING, LAST)


def test_points_between_rows_start_and_end_at_them_along_their_tangents():
    rng = np.random.default_rng(0)
    for _ in range(50):
        (a, b), spacing = random_rows(rng), rng.uniform(0.01, 2.0)
        for share, end in ((0.0, a), (1.0, b)):
            assert_allclose(following.point_between(a, b, share, spacing), end[:2], rtol=0.0, atol=EXACT)
            slope = np.array(following.slope_between(a, b, share, spacing))
            assert_allclose(slope, spacing * np.array(end[2:4]), rtol=0.0, atol=EXACT)


def test_points_between_rows_lie_on_one_cubic():
    """The fourth differences of a cubic vanish, and its slope is the derivative."""
    rng = np.random.default_rng(1)
    for _ in range(50):
        (a, b), spacing = random_rows(rng), rng.uniform(0.01, 2.0)
        points = np.array([following.point_between(a, b, share, spacing) for share in np.linspace(0.0, 1.0, 6)])
        assert_allclose(np.diff(points, 4, axis=0), 0.0, atol=1e-11)  # rounding, times binomials of up to 6
        share, h = rng.uniform(0.1, 0.9), 1e-4
        ends = [np.array(following.point_between(a, b, share + side * h, spacing)) for side in (-1.0, 1.0)]
        slope = following.slope_between(a, b, share, spacing)
        # p‴ h²/6, p‴ up to 12 |b − a| of the cubic
        assert_allclose((ends[1] - ends[0]) / (2.0 * h), slope, rtol=0.0, atol=1e-6)


def test_the_nearest_share_is_that_of_a_dense_search():
    """From the foot on the chord, for points up to half of the radius away from the curve, on either side."""
    rng = np.random.default_rng(2)
    shares = np.linspace(0.0, 1.0, 20001)
    a, b = row(0.0, FIRST), row(0.1, FIRST)  # five times as far apart as rows are, so that chord and curve differ
    curve = np.array(following.point_between(a, b, shares, 0.1)).T
    chord = curve[-1] - curve[0]
    for _ in range(100):
        angle, distance = rng.uniform(-0.02, 0.22), rng.uniform(0.5, 1.5) * RADIUS
        point = distance * np.array([np.cos(angle), np.sin(angle)])
        guess = np.clip((point - curve[0]) @ chord / (chord @ chord), 0.0, 1.0)
        found = following.nearest_share(a, b, guess, 0.1, *point)
        expected = shares[np.hypot(*(curve - point).T).argmin()]
        assert_allclose(found, expected, rtol=0.0, atol=5e-5)  # the search's own step


@pytest.mark.parametrize(("ahead", "share"), [(-0.3, 0.0), (0.5, 1.0)])
def test_beyond_both_rows_the_nearest_share_is_an_end(ahead, share):
    a, b = ROWS
    assert following.nearest_share(a, b, 0.5, SPACING, a[0] + ahead * a[2], a[1] + ahead * a[3]) == share


def test_a_reference_moves_along_the_path_at_the_speed_of_the_law():
    """On a circle: velocity along the tangent, ω = ψ′ ṡ."""
    for share in (0.0, 0.3, 1.0):
        r = following.course_reference(*ROWS, share, SPACING)
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
    before, now, after = (following.course_reference(*ROWS, share + d, SPACING) for d in (-h, 0.0, h))
    speed = np.hypot(now.vx, now.vy)
    time = 2.0 * h * SPACING / speed
    rates = [(getattr(after, v) - getattr(before, v)) / time for v in ("vx", "vy", "omega")]
    # the cubic's own curvature differs from κ by κ φ²/12 = 1.3e-4 of κ ṡ² = 0.75; halves of differences of 1e-4
    assert_allclose(rates, [now.ax, now.ay, now.alpha], rtol=0.0, atol=3e-4)
    along = now.ax * now.vx / speed + now.ay * now.vy / speed
    assert along == pytest.approx(0.5 * (LAST - FIRST) / SPACING, rel=1e-12)


def test_a_law_that_rounding_made_negative_stands_still():
    assert following.law_speed(-1e-18) == 0.0
    assert following.law_speed(0.25) == 0.5


def test_at_rest_only_the_place_is_left():
    moving = Reference(*np.arange(1.0, 11.0))
    assert following.at_rest(moving) == Reference(1.0, 2.0, 3.0, 4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


WEIGHTS = FollowTask().weights()


def follow_terms(errors=NO_ERROR, share=1.0, effort=0.0, pressing=0.0, failed=0.0):
    record = Record(*(0.0,) * len(Record._fields))._replace(pressing=pressing)
    return following.follow_terms(errors, share, effort, record, failed, WEIGHTS)


def random_cases(count):
    """Errors from 1e-4 of their usual scale to a hundred times it; any progress, effort and normal impulse."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        size = 10.0 ** rng.uniform(-4.0, 2.0, 5) * rng.choice((-1.0, 1.0), 5)
        turn = rng.uniform(-np.pi, np.pi) * 10.0 ** rng.uniform(-4.0, 0.0)
        errors = Errors(size[0], size[1], np.cos(turn), np.sin(turn), *size[2:])
        share, effort = (rng.choice([0.0, rng.uniform(), 1.0]) for _ in range(2))
        yield errors, share, effort, rng.choice([0.0, 10.0 ** rng.uniform(-4.0, 6.0)])


def test_terms_stay_in_their_ranges():
    for errors, share, effort, pressing in random_cases(2000):
        terms = follow_terms(errors, share, effort, pressing)
        assert 0.0 <= terms.progress <= 0.2
        assert 0.0 <= terms.cross_track <= 0.4
        assert 0.0 <= terms.heading <= 0.4
        assert -0.02 <= terms.effort <= 0.0
        assert -0.5 <= terms.impact <= 0.0
        assert terms.alive == 0.52


def test_terms_are_what_the_documentation_says():
    def k(e, scale):
        return 0.5 / (1.0 + (e / scale) ** 2) + 0.5 / (1.0 + (e / (10.0 * scale)) ** 2)

    for errors, share, effort, pressing in random_cases(500):
        expected = {
            "progress": 0.2 * share,
            "cross_track": 0.4 * share * k(np.hypot(errors.ahead, errors.left), 0.01),
            "heading": 0.4 * share * k(2.0 * np.sin(0.5 * np.arctan2(errors.sin, errors.cos)), 0.15),
            "effort": -0.02 * effort,
            "impact": -0.5 * pressing / (pressing + 0.5),
            "alive": 0.52,
        }
        terms = follow_terms(errors, share, effort, pressing)._asdict()
        for name, value in expected.items():
            # 1 − cos of a small heading error loses 1e-16, in units of the scale's square 2.5e-3
            assert_allclose(terms[name], value, rtol=0.0, atol=1e-12, err_msg=name)


def test_full_progress_on_the_path_without_effort_is_worth_most():
    assert sum(follow_terms()) == pytest.approx(1.52, abs=1e-15)


def test_resting_anywhere_earns_only_alive():
    """Without progress quality is worth nothing, so that the path's start is no better than any other place."""
    for errors, *_ in random_cases(200):
        assert sum(follow_terms(errors, share=0.0)) == 0.52


def test_surviving_always_beats_dying():
    """The worst step in the task is worth no less than nothing, a failing one is worth 0."""
    for errors, share, effort, pressing in random_cases(2000):
        assert sum(follow_terms(errors, share, effort, pressing)) >= 0.0
        assert follow_terms(errors, share, effort, pressing, failed=1.0) == (0.0,) * len(FollowTerms._fields)


def test_failing_is_worth_nothing_even_where_the_errors_are_no_numbers():
    """A state that is not finite is a failure, too."""
    nowhere = Errors(*[np.nan] * 7)
    assert follow_terms(nowhere, np.nan, np.nan, np.nan, failed=1.0) == (0.0,) * len(FollowTerms._fields)


@pytest.mark.parametrize("name", ["ahead", "left", "turn"])
def test_each_error_alone_lowers_the_reward(name):
    def reward(size):
        change = {"cos": np.cos(size), "sin": np.sin(size)} if name == "turn" else {name: size}
        return sum(follow_terms(NO_ERROR._replace(**change)))

    sizes = np.linspace(0.0, np.pi, 300)
    for side in (sizes, -sizes):
        assert (np.diff([reward(size) for size in side]) < 0.0).all()


def test_errors_of_speed_cost_nothing():
    """Nobody has to keep to the law's speed."""
    assert follow_terms(NO_ERROR._replace(vx=3.0, vy=-2.0, omega=1.0)) == follow_terms()


def test_progress_effort_and_impacts_each_count():
    shares = np.linspace(0.0, 1.0, 11)
    assert (np.diff([sum(follow_terms(share=share)) for share in shares]) > 0.0).all()
    assert (np.diff([sum(follow_terms(effort=share)) for share in shares]) < 0.0).all()
    assert (np.diff([sum(follow_terms(pressing=10.0 * share)) for share in shares]) < 0.0).all()


def test_arriving_counts_as_progress_on_the_last_point():
    """A rational kernel of the distance."""
    last = (3.0, -1.0) + (0.0,) * 8
    assert following.arrived_share(3.0, -1.0, last, 0.02) == 1.0
    assert following.arrived_share(3.012, -1.016, last, 0.02) == pytest.approx(0.5, abs=1e-12)  # rounding of 3 m
    assert following.arrived_share(5.0, -1.0, last, 0.02) < 1e-3


def test_weights_carry_every_number_of_the_task():
    """Each into the field that means it."""
    fields = [name for name in FollowWeights._fields if name not in ("coarse", "corridor", "touching_ends")]
    named = {f"{name}_weight" if f"{name}_weight" in FollowTask.model_fields else name: name for name in fields}
    for i, (field, weight) in enumerate(named.items()):
        value = 0.111 * (i + 1)
        assert getattr(FollowTask(**{field: value}).weights(), weight) == value
    weights = FollowTask(coarse=7.0, corridor=0.9).weights()
    assert (weights.coarse, weights.corridor, weights.touching_ends) == (7.0, 0.9, 0.0)
    assert FollowTask(touching="ends").weights().touching_ends == 1.0


def test_a_stride_is_the_way_at_the_speed_limit():
    assert FollowTask(speed_limit=0.5, control_period=0.04).stride == pytest.approx(0.02, abs=1e-15)
