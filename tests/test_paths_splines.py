"""caster_gym.paths.splines: curves through waypoints."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from caster_gym.paths.headings import Fixed, Profile, Spinning
from caster_gym.paths.splines import Spline
from tests.motion_laws import derivative_error

TRIANGLE = ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))
ROUND = ((0.0, 0.0, 3.0), (1.0, 0.0, -3.0), (1.0, 1.0, -2.0), (0.0, 1.0, 1.0))


def samples(spline, time_step=0.02):
    (trajectory,) = spline.trajectories(time_step)
    return trajectory.samples


@pytest.mark.parametrize("spline", [Spline(waypoints=TRIANGLE), Spline(waypoints=ROUND, closed=True, laps=2)])
def test_every_column_is_the_derivative_of_the_one_before(spline):
    """The fifth derivative jumps at waypoints, so that the fourth-order error falls at least as a third-order one."""
    coarse, fine = (derivative_error(spline.trajectories(h)) for h in (0.02, 0.01))
    assert coarse / fine > 6.0
    assert fine < 1e-3


def test_curve_passes_the_waypoints_in_order_from_the_first_to_the_last():
    spline = Spline(waypoints=((0.0, 0.0), (2.0, 0.0), (2.0, 1.0), (5.0, 5.0)))
    p = spline.curve(np.array([0.0, 2.0, 3.0, 8.0]) / 8.0)[0]  # chords of 2, 1 and 5 m
    assert_allclose(p, [0, 2, 2 + 1j, 5 + 5j], atol=1e-12)
    table = samples(spline)
    assert_allclose(table[[0, -1], 0:2], [[0.0, 0.0], [5.0, 5.0]], atol=1e-12)
    assert_allclose(table[[0, -1], 4:], 0.0, atol=1e-12)


def test_two_waypoints_make_a_straight_line():
    table = samples(Spline(waypoints=((0.0, 0.0), (3.0, 4.0))))
    assert_allclose(table[:, 0] * 4.0, table[:, 1] * 3.0, atol=1e-14)
    assert_allclose(table[:, 2:4], [[0.6, 0.8]] * len(table), atol=1e-14)


def test_closed_spline_returns_to_its_first_waypoint():
    table = samples(Spline(waypoints=TRIANGLE, closed=True))
    assert_allclose(table[0, :4], table[-1, :4], atol=1e-12)
    assert np.hypot(*(table[:, 0:2] - [1.0, 1.0]).T).min() < 0.02  # the third waypoint, one sample away at most


@pytest.mark.parametrize("closed", [False, True])
def test_headings_of_the_waypoints_are_met_over_the_shorter_turn(closed):
    """From 3.0 to −3.0 rad it is 0.28 rad across ±π, not 6 rad back."""
    spline = Spline(waypoints=ROUND, closed=closed)
    length = 4.0 if closed else 3.0
    stations = np.arange(4) / length
    angle, *_ = spline.turn(stations, spline.curve(stations))
    assert_allclose(np.exp(1j * angle), np.exp(1j * np.array([3.0, -3.0, -2.0, 1.0])), atol=1e-12)
    assert angle[1] - angle[0] == pytest.approx(2.0 * np.pi - 6.0)


def test_headings_do_not_jump_between_laps():
    table = samples(Spline(waypoints=ROUND, closed=True, laps=3, duration=30.0))
    heading = table[:, 2] + 1j * table[:, 3]
    most = abs(table[:, 6]).max() * 0.02
    assert abs(np.angle(heading[1:] / heading[:-1])).max() <= 1.01 * most  # 1.01: the rate peaks between samples


def test_a_path_that_turns_back_on_the_spot_has_no_tangent_to_follow():
    there_and_back = ((0.0, 0.0), (1.0, 0.0), (0.0, 0.0))
    with pytest.raises(ValueError, match=r"of path 'spline' (turns by|is (nan|inf))"):
        samples(Spline(waypoints=there_and_back))
    assert samples(Spline(waypoints=there_and_back, heading=Fixed()))[:, 0].max() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"waypoints": []}, "at least 1 item"),
        ({"waypoints": [[0, 0], [1, 0]], "closed": True}, "at least 3 waypoints at different places, got 2"),
        ({"waypoints": [[0, 0], [1, 0], [0, 0]], "closed": True}, "at least 3 waypoints at different places, got 2"),
        ({"waypoints": [[0, 0], [1, 0]], "laps": 2}, "open spline has one lap, got laps 2(?!;)"),
        ({"waypoints": [[0, 0], [1, 0], [1, 1]], "laps": 2}, "got laps 2; set 'closed' for a round course"),
        ({"waypoints": [[0, 0], [1, 0, 2]]}, "either every waypoint has a heading or none"),
        ({"waypoints": [[0, 0, 1], [1, 0, 2]], "heading": "fixed"}, "the waypoints have headings already"),
        ({"waypoints": [[0, 0], [1, float("nan")]]}, "finite"),
        ({"waypoints": [[0, 0], [1, 0]], "file": "a.csv"}, "either 'waypoints' or a 'file'"),
        ({"waypoints": [[0, 0], [1, 0]], "tolerance": -0.1}, "greater than or equal to 0"),
        ({"waypoints": [[0, 0], [1, 0]], "turns": "some"}, "turns"),
        ({}, "waypoints"),
    ],
)
def test_waypoints_that_contradict_themselves_are_refused(content, message):
    with pytest.raises(ValidationError, match=message):
        Spline(**content)


def test_a_tolerance_beyond_a_tenth_of_the_extent_is_refused_and_the_offered_one_does():
    waypoints = ((0.0, 0.0), (1.23, 0.0), (1.23, 0.7), (0.0, 0.7))
    with pytest.raises(ValidationError, match=r"tolerance of 2 m is more than a tenth of the 1\.23 m") as error:
        Spline(waypoints=waypoints, closed=True, tolerance=2.0)
    offered = float(re.findall(r"at most ([\d.]+) m would suffice", str(error.value))[0])
    assert len(samples(Spline(waypoints=waypoints, closed=True, tolerance=offered))) == 501


def test_file_gives_the_same_path_as_its_numbers(tmp_path):
    file = tmp_path / "course.csv"
    file.write_text("\ufeffx, y, heading\n0,0,3.0\n1,0,-3.0\n\n1,1,-2\n0,1,1e0\n", encoding="utf-8")
    spline = Spline.model_validate({"file": str(file), "closed": True})
    assert spline.waypoints == ROUND
    assert_allclose(samples(spline), samples(Spline(waypoints=ROUND, closed=True)), atol=0.0)


def test_a_dumped_spline_keeps_its_waypoints_and_needs_its_file_no_more(tmp_path):
    file = tmp_path / "course.csv"
    file.write_text("x,y\n0,0\n1,0\n1,1\n", encoding="utf-8")
    dumped = Spline.model_validate({"file": str(file)}).model_dump()
    file.unlink()
    assert Spline(**dumped).waypoints == TRIANGLE


# ---- Turning on the spot, and standing still


def turned(table):
    """Heading from the start, counted over full turns. [rad]"""
    angle = np.unwrap(np.arctan2(table[:, 3], table[:, 2]))
    return angle - angle[0]


def test_two_headings_at_one_place_are_a_turn_on_the_spot_by_the_quintic():
    """chung2008 (61), for the heading alone: half the turn at half the time, the greatest rate 15/8 of the mean."""
    table = samples(Spline(waypoints=((0.5, 1.0, 0.0), (0.5, 1.0, 1.5)), duration=3.0))
    assert_allclose(table[:, [0, 1, 4, 5, 7, 8]], [[0.5, 1.0, 0.0, 0.0, 0.0, 0.0]] * 151, atol=0.0)
    assert_allclose(turned(table)[[75, 150]], [0.75, 1.5], atol=1e-12)
    assert table[:, 6].max() == pytest.approx(15.0 / 8.0 * 0.5, rel=1e-12)


@pytest.mark.parametrize("waypoints", [((1.0, 2.0),), ((1.0, 2.0, 0.5),), ((1.0, 2.0),) * 4, ((1.0, 2.0, 0.5),) * 4])
@pytest.mark.parametrize("laps", [1, 2])
def test_one_place_is_kept_for_the_duration(waypoints, laps):
    table = samples(Spline(waypoints=waypoints, duration=5.0, laps=laps, closed=laps > 1))
    angle = 0.5 if len(waypoints[0]) == 3 else 0.0
    assert_allclose(table, [[1.0, 2.0, np.cos(angle), np.sin(angle), 0, 0, 0, 0, 0, 0]] * 251, atol=1e-15)


def test_a_kept_place_may_be_turned_at_by_a_heading_of_its_own():
    table = samples(Spline(waypoints=((1.0, 2.0),), heading=Spinning(turns=2)))
    assert turned(table)[-1] == pytest.approx(4.0 * np.pi)


SQUARE_TURNS = ((0, 0, 0), (1, 0, 0), (1, 0, 1.6), (1, 1, 1.6), (1, 1, 0.2), (0, 2, 0.0))


def test_a_place_with_two_headings_is_turned_at_in_between_at_rest():
    table = samples(Spline(waypoints=SQUARE_TURNS, duration=20.0))
    still = np.hypot(table[:, 4], table[:, 5]) == 0.0
    at_corner = np.hypot(table[:, 0] - 1.0, table[:, 1]) < 1e-12
    # the first and last samples of a turn, at times of their own: 10 (h / T)³ of it for T of 2 s
    assert turned(table)[at_corner & still].min() == pytest.approx(0.0, abs=5e-5)
    assert turned(table)[at_corner & still].max() == pytest.approx(1.6, abs=5e-5)
    assert (np.abs(table[still][:, 6]) > 0.1).any()
    assert_allclose(table[[0, -1], :2], [[0.0, 0.0], [0.0, 2.0]], atol=1e-12)
    assert_allclose(turned(table)[-1], 0.0, atol=1e-12)
    assert_allclose(np.diff(table[:, :2], axis=0), 0.01 * (table[1:, 4:6] + table[:-1, 4:6]), atol=2e-5)  # h³/12 · jerk


def test_every_leg_starts_and_ends_at_rest_and_takes_time_by_the_root_of_its_way():
    """Ways of 1 m and 4 m need the same greatest acceleration in times of 1 to 2."""
    waypoints = ((0, 0, 0), (1, 0, 0), (1, 0, 1), (5, 0, 1))
    table = samples(Spline(waypoints=waypoints, duration=60.0), 0.01)
    on_way = np.flatnonzero(np.hypot(table[:, 4], table[:, 5]) > 0.0)
    first, second = on_way[table[on_way, 0] < 1.0], on_way[table[on_way, 0] > 1.0]
    assert len(second) / len(first) == pytest.approx(2.0, rel=0.01)  # of whole time steps
    most = [np.abs(table[part, 7]).max() for part in (first, second)]
    assert most[0] == pytest.approx(most[1], rel=0.02)


def test_a_closed_path_with_a_turn_on_the_spot_returns_on_every_lap():
    closed = ((0, 0, 0), (1, 0, 0), (1, 0, 1.6), (1, 1, 1.6))
    table = samples(Spline(waypoints=closed, closed=True, laps=2, duration=60.0))
    assert_allclose(table[[0, 1500, -1], :4], [[0.0, 0.0, 1.0, 0.0]] * 3, atol=1e-9)


def test_too_short_a_duration_for_all_legs_is_refused():
    with pytest.raises(ValueError, match=r"0\.5 s is too short for 5 legs from rest to rest"):
        samples(Spline(waypoints=SQUARE_TURNS, duration=0.5))


def test_a_turn_on_the_spot_that_was_recorded_is_one():
    """A log at 50 Hz, rounded to mm and mrad: at rest, 2 m ahead, a quarter turn, 1 m on, at rest."""
    t = np.linspace(0.0, 1.0, 101)[:, None]
    parts = [0.0 * t + [0, 0, 0], t * [2, 0, 0], [2, 0, 0] + t * [0, 0, np.pi / 2], [2, 0, np.pi / 2] + t * [0, 1, 0]]
    log = np.vstack([*parts, parts[-1][-1:].repeat(50, axis=0)]).round(3)
    spline = Spline(waypoints=log.tolist(), duration=30.0)
    assert "turns on the spot once" in spline.description
    table = samples(spline)
    still = np.hypot(table[:, 4], table[:, 5]) == 0.0
    turning = table[still & (table[:, 6] != 0.0)]
    assert len(turning) > 100
    assert np.abs(turning[:, :2] - [2.0, 0.0]).max() < 2e-3  # of the rows that fall together there
    assert turned(table)[-1] == pytest.approx(np.pi / 2, abs=1e-3)
    assert np.abs(table[:, 7:9]).max() < 0.1  # of 6 · way / T² and a turn: the rounding would make it 50


# ---- Headings of more than half a turn


@pytest.mark.parametrize(
    ("headings", "turns", "whole"),
    [
        ((0.0, 3.2), "auto", 3.2),
        ((0.0, 2.0 * np.pi), "auto", 2.0 * np.pi),
        ((0.0, -7.0, 1.0), "auto", 1.0),
        ((0.0, 3.2), "nearest", 3.2 - 2.0 * np.pi),
        ((3.0, -3.0), "auto", 2.0 * np.pi - 6.0),
        ((3.0, -3.0), "as_written", -6.0),
        ((6.0, 6.2, 0.1, 0.3), "auto", 2.0 * np.pi - 5.7),  # goes on as before, past a full turn
        ((6.0, 6.2, 0.1, 0.3), "as_written", -5.7),
        ((0.3, 0.1, 6.2, 6.0), "auto", 5.7 - 2.0 * np.pi),
        ((0.0, 0.2, 6.28, 6.48), "auto", 6.48),  # more than a full turn cannot be a wrapped heading
    ],
)
def test_headings_turn_as_they_are_written_or_the_nearest_way(headings, turns, whole):
    waypoints = tuple((float(i), 0.0, heading) for i, heading in enumerate(headings))
    spline = Spline(waypoints=waypoints, turns=turns, duration=60.0)
    assert turned(samples(spline))[-1] == pytest.approx(whole, abs=1e-9)


def test_a_profile_and_waypoints_of_the_same_headings_turn_alike():
    at, headings = (0.0, 1.0, 2.0, 3.0), (0.0, 4.0, 9.0, 2.0)
    turning = tuple((x, 0.0, h) for x, h in zip(at, headings, strict=True))
    own = samples(Spline(waypoints=turning, duration=40.0))
    given = samples(Spline(waypoints=tuple((x, 0.0) for x in at), heading=Profile(angles=headings), duration=40.0))
    assert_allclose(own, given, atol=1e-9)


def test_a_closed_path_turns_by_what_its_repeated_first_waypoint_says():
    ring = tuple((np.cos(a), np.sin(a), -2.0 * a) for a in np.linspace(0.0, 2.0 * np.pi, 17))
    spline = Spline(waypoints=ring, closed=True, laps=3, duration=60.0)
    assert turned(samples(spline))[-1] == pytest.approx(-12.0 * np.pi, abs=1e-9)
