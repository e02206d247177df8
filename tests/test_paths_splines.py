"""caster_gym.paths.splines: curves through waypoints, and CSV files of them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from pydantic import ValidationError

from caster_gym.paths.splines import Spline, read_waypoints
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
    assert samples(Spline(waypoints=there_and_back, heading="fixed"))[:, 0].max() == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"waypoints": [[0, 0]]}, "at least 2 items"),
        ({"waypoints": [[0, 0], [1, 0]], "closed": True}, "closed spline needs at least 3 waypoints, got 2"),
        ({"waypoints": [[0, 0], [1, 0], [1, 0]]}, "waypoints 2 and 3 are the same point"),
        ({"waypoints": [[0, 0], [1, 0], [1, 1], [0, 0]], "closed": True}, "waypoints 4 and 1 .* returns to its first"),
        ({"waypoints": [[0, 0], [1, 0]], "laps": 2}, "open spline has one lap, got laps 2"),
        ({"waypoints": [[0, 0], [1, 0, 2]]}, "either every waypoint has a heading or none"),
        ({"waypoints": [[0, 0, 1], [1, 0, 2]], "heading": "fixed"}, "the waypoints have headings already"),
        ({"waypoints": [[0, 0], [1, float("nan")]]}, "finite"),
        ({"waypoints": [[0, 0], [1, 0]], "file": "a.csv"}, "either 'waypoints' or a 'file'"),
        ({}, "waypoints"),
    ],
)
def test_waypoints_that_contradict_themselves_are_refused(content, message):
    with pytest.raises(ValidationError, match=message):
        Spline(**content)


def test_file_gives_the_same_path_as_its_numbers(tmp_path):
    file = tmp_path / "course.csv"
    file.write_text("\ufeffx, y, heading\n0,0,3.0\n1,0,-3.0\n\n1,1,-2\n0,1,1e0\n", encoding="utf-8")
    spline = Spline(file=str(file), closed=True)
    assert spline.waypoints == ROUND
    assert_allclose(samples(spline), samples(Spline(waypoints=ROUND, closed=True)), atol=0.0)


def test_a_dumped_spline_keeps_its_waypoints_and_needs_its_file_no_more(tmp_path):
    file = tmp_path / "course.csv"
    file.write_text("x,y\n0,0\n1,0\n1,1\n", encoding="utf-8")
    dumped = Spline(file=str(file)).model_dump()
    file.unlink()
    assert Spline(**dumped).waypoints == TRIANGLE


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x,y\n0,0\n1,a\n", "line 3: 'a' is not a number"),
        ("x,y\n0,0\n\n1,inf\n", "line 4: a coordinate must be finite, got 'inf'"),
        ("x,y\n0,0\n1,2,3\n", "line 3: expected 2 values, got 3: '1,2,3'"),
        ("x,z\n0,0\n", "line 1: the header must be x,y or x,y,heading, got 'x,z'"),
        ("0,0\n1,1\n", "line 1: the header must be x,y or x,y,heading, got '0,0'"),
        ("", "line 1: the header must be x,y or x,y,heading, got ''"),
    ],
)
def test_bad_csv_is_refused_with_file_line_and_value(tmp_path, text, message):
    file = tmp_path / "course.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(ValueError, match=message) as error:
        read_waypoints(file)
    assert str(file) in str(error.value)


def test_a_missing_or_unreadable_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file .*nowhere\.csv"):
        read_waypoints(tmp_path / "nowhere.csv")
    (tmp_path / "binary.csv").write_bytes(b"x,y\n\xff\xfe\n")
    with pytest.raises(ValueError, match=r"binary\.csv cannot be read as CSV"):
        read_waypoints(tmp_path / "binary.csv")
