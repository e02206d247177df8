"""Where a robot is hit alike from all sides, and where most unevenly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.impulse_circles import circle_curves, circles, greatest_elongation
from papers.analysis.impulse_shape import elongation, extremes
from tests.random_robots import random_robot

CHUNG = load_robot("chung2008")
MODEL = Model(CHUNG)
STEERS = ("steer_1", "steer_2", "steer_3")


@pytest.fixture(scope="module")
def curves():
    return circle_curves(MODEL, np.zeros(3), STEERS)


def with_steering_armatures(armature):
    casters = tuple(
        caster.model_copy(update={"steer": caster.steer.model_copy(update={"armature": armature})})
        for caster in CHUNG.casters
    )
    return CHUNG.model_copy(update={"casters": casters})


def distance(steering, others, period):
    """Between points on the torus of a period."""
    apart = (others - steering + 0.5 * period) % period - 0.5 * period
    return np.linalg.norm(apart, axis=-1)


def test_every_point_of_a_curve_is_a_circle(curves):
    """(U5) by the extremes themselves: nothing is greater than the least but for rounding."""
    for curve in curves:
        assert_allclose(extremes(MODEL, curve.steering).ratio, 1.0, atol=1e-12)


def test_curves_are_closed_and_without_gaps(curves):
    """Neighbours lie a stride of 0.05 rad apart, the last as near to the first; chords are a little shorter."""
    for curve in curves:
        gaps = [distance(a, b, np.pi) for a, b in zip(curve.steering, np.roll(curve.steering, -1, 0), strict=True)]
        assert max(gaps) < 0.051
        whole = curve.steering[-1] - curve.steering[0]
        assert_allclose(np.round(whole / np.pi), curve.windings)


def test_robot_of_the_paper_has_two_curves_and_a_finer_search_no_more(curves):
    """Each meets each plane of constant φ_3 once, up to half turns; the finer search finds points of these two."""
    finer = circle_curves(MODEL, np.zeros(3), STEERS, slices=24, cells=128)
    assert len(curves) == len(finer) == 2
    assert all(any(curve.holds(steering) for curve in curves) for other in finer for steering in other.steering)
    assert [abs(turns) for curve in curves for turns in curve.windings] == [1] * 6
    assert [curve.copies for curve in curves] == [4, 4]


def test_counting_whole_turns_finds_as_many_curves_as_copies(curves):
    """A plane of constant φ_3 meets each of them once a turn; a curve that goes round twice, twice."""
    grid = 2.0 * np.pi * (np.arange(200) + 0.37) / 200
    plane = np.stack(np.broadcast_arrays(grid[:, None], grid[None, :], 0.3), -1)
    phase = np.angle(elongation(MODEL, plane))
    up, across = np.roll(phase, -1, 0) - phase, np.roll(phase, -1, 1) - phase
    up, across = np.angle(np.exp(1j * up)), np.angle(np.exp(1j * across))
    turns = np.rint((up + np.roll(across, -1, 0) - np.roll(up, -1, 1) - across) / (2.0 * np.pi))
    # each copy of a curve goes round twice as far as a half turn: once round the whole, one point in the plane
    assert np.abs(turns).sum() == sum(curve.copies for curve in curves) == 8
    assert turns.sum() == 0  # as on every torus


def test_symmetric_configurations_lie_on_a_curve_and_figure_18_among_them(curves):
    """(U7), as near as the pivots, rounded by a thousandth, form a regular triangle."""
    angles = np.array([np.arctan2(c.y, c.x) for c in CHUNG.casters])
    for turn in (0.0, 0.5 * np.pi, 1.0):
        assert sum(curve.holds(angles + turn) for curve in curves) == 1
    assert any(curve.holds(np.pi - np.radians([240.0, 120.0, 0.0])) for curve in curves)
    assert not any(curve.holds(np.pi - np.radians([120.0, 240.0, 0.0])) for curve in curves)


def test_mirror_of_the_robot_keeps_each_curve(curves):
    """x → −x exchanges casters 1 and 2 and turns δ into π − δ."""
    for curve in curves:
        assert all(curve.holds(np.pi - steering[[1, 0, 2]]) for steering in curve.steering)


@pytest.mark.parametrize("caster_count", [2, 3, 4])
def test_roots_in_a_plane_are_circles_and_come_in_pairs(caster_count):
    """ε turns as often one way as the other over the whole torus, so simple roots are even in number."""
    robot = random_robot(2, caster_count)
    model = Model(robot.model_copy(update={"platform": robot.platform.model_copy(update={"com": (0.0, 0.0)})}))
    fixed = np.linspace(0.3, 1.1, caster_count)
    found = circles(model, fixed, ("steer_2", "steer_1"))
    assert len(found) % 2 == 0
    assert all(distance(a, found[:i], 2.0 * np.pi).min(initial=9.0) > 1e-6 for i, a in enumerate(found))
    assert_allclose(found[:, 2:], np.tile(fixed[2:], (len(found), 1)))
    assert_allclose(np.abs(elongation(model, found)), 0.0, atol=1e-12)  # where Newton's method stops


def test_circles_exist_in_every_plane_of_the_paper_s_robot():
    """Two up to half turns, whatever the third angle: the symmetric one and the balanced one."""
    radii = np.radians([210.0, 330.0, 90.0])  # of a regular triangle
    for third in (0.0, 0.4, 1.1, 2.9):
        found = circles(MODEL, [0.0, 0.0, third], STEERS[:2])
        assert len(found) == 2
        # pivots that are rounded by a thousandth move the circle off the exact symmetry in second order
        assert distance(radii - radii[2] + third, found, np.pi).min() < 1e-6


def test_steering_armatures_make_whole_turns_count():
    """g_δ keeps its part of the yaw when a caster turns by half: the circles are found over whole turns."""
    model = Model(with_steering_armatures(1e-5))
    found = circles(model, np.zeros(3), STEERS[:2])
    assert len(found) == 8  # a small armature moves each of the eight circles a little
    assert_allclose(np.abs(elongation(model, found)), 0.0, atol=1e-12)
    assert np.abs(elongation(model, found + np.array([np.pi, 0.0, 0.0]))).max() > 1e-6


def test_circles_at_a_point_beside_the_centre():
    """The same search at a point of the rim, where other angles make the curve a circle, if any."""
    point = (0.01, 0.0)
    found = circles(MODEL, np.zeros(3), STEERS[:2], point)
    assert len(found) > 0
    assert_allclose(np.abs(elongation(MODEL, found, point)), 0.0, atol=1e-12)


def test_nothing_is_more_elongated_than_parallel_wheels():
    """Figs. 16 and 17; a random search stays below, and the greatest is attained."""
    size, steering = greatest_elongation(MODEL)
    assert size == pytest.approx(abs(complex(elongation(MODEL, steering))), rel=1e-12)
    assert size == pytest.approx(abs(complex(elongation(MODEL, np.zeros(3)))), abs=1e-8)  # flat: the gradient's root
    others = np.random.default_rng(8).uniform(-np.pi, np.pi, (20000, 3))
    assert np.abs(elongation(MODEL, others)).max() <= size


def test_close_roots_are_found_apart():
    """A robot two of whose circles lie in neighbouring cells, found among forty: each is told apart."""
    found = circles(Model(random_robot(19, 2)), np.zeros(2), STEERS[:2])
    assert len(found) > 0
    assert len(found) % 2 == 0
    assert all(distance(a, found[:i], 2.0 * np.pi).min(initial=9.0) > 1e-6 for i, a in enumerate(found))


def test_curves_that_all_but_meet_are_refused():
    """Of four equal casters on a square: where both gradients of ε are all but parallel, no curve can be followed."""
    with pytest.raises(RuntimeError, match="curves of circles all but meet near the steering angles"):
        circle_curves(Model(load_robot("xr4000")), [0.0, 0.0, 0.0, 0.7], STEERS)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: circles(MODEL, np.zeros(3), ("steer_1", "steer_9")), "unknown joint 'steer_9'"),
        (lambda: circles(MODEL, np.zeros(3), ("steer_1", "roll_2")), "joints must name 2 steering joints .*roll_2"),
        (lambda: circle_curves(MODEL, np.zeros(3), STEERS[:2]), "joints must name 3 steering joints"),
        (lambda: circles(MODEL, np.zeros(2), STEERS[:2]), "steering must be 3 finite angles"),
        (lambda: circles(MODEL, [0.0, 0.0, np.nan], STEERS[:2]), "steering must be 3 finite angles .*nan"),
        (lambda: circles(MODEL, np.zeros(3), STEERS[:2], cells=2), "cells must be 8 or more .*got 2"),
        (lambda: circle_curves(MODEL, np.zeros(3), STEERS, slices=0), "slices must be 1 or more, got 0"),
        (lambda: circles(Model(CHUNG.without_wheels()), np.zeros(3), STEERS[:2]), "'chung2008' is hit alike"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()
