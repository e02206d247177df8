"""caster_gym.paths.course: courses of all shapes, driven in time, and what is refused."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.paths.course import COURSE_COLUMNS, Course, build_courses
from caster_gym.paths.feasibility import motor_use
from tests.motion_laws import derivative_error

ROBOT = load_robot("chung2008")
SHAPES = ("circle", "ellipse", "lemniscate", "rounded_square")
RANDOM = {"shape": "random_paths", "reversing": 0.0, "min_radius": 0.15}


@pytest.mark.parametrize("shape", SHAPES)
def test_a_course_rests_at_both_ends_and_moves_in_between(shape):
    (course,) = build_courses(shape, ROBOT, 1.0)
    square = course.samples[:, -1]
    assert square[0] == square[-1] == 0.0
    assert square[1:-1].min() > 0.0 and square.max() <= 1.0
    assert course.samples.shape == (round(course.length / 0.02) + 1, len(COURSE_COLUMNS))


def test_the_duration_is_the_length_over_the_mean_speed():
    """Of a law of constant acceleration to 1 m/s over 1 m and back: twice 2 s."""
    samples = np.zeros((101, 10))
    samples[:, 0], samples[:, 2], samples[:, 5] = np.linspace(0.0, 2.0, 101), 1.0, 1.0
    samples[:, -1] = 1.0 - abs(samples[:, 0] - 1.0)
    assert Course("line", 0.02, samples).duration == pytest.approx(4.0, rel=1e-12)


@pytest.mark.parametrize("shape", ["ellipse", "rounded_square"])
def test_the_timed_course_is_a_motion(shape):
    """Velocity is the derivative of position, and acceleration that of velocity but where s̈ jumps.

    So the mean of the difference tells: it falls with the time step, while a wrong column would leave it.
    """
    (course,) = build_courses(shape, ROBOT, 1.0)
    timed = course.trajectory(0.002)
    samples = timed.samples
    velocity = np.diff(samples[:, 0:2], axis=0) / 0.002
    assert_allclose(velocity, 0.5 * (samples[1:, 4:6] + samples[:-1, 4:6]), atol=2e-3)
    acceleration = np.diff(samples[:, 4:7], axis=0) / 0.002
    error = abs(acceleration - 0.5 * (samples[1:, 7:10] + samples[:-1, 7:10]))
    assert np.median(error) < 0.02 and error.mean() < 0.1  # of about 3 m/s² and 10 rad/s²
    assert derivative_error((timed,)) > 0.0


def test_the_timed_course_starts_and_ends_as_the_course_does():
    (course,) = build_courses("ellipse", ROBOT, 1.0)
    timed = course.trajectory(0.02)
    assert 0.0 <= timed.duration - course.duration < 0.02
    assert_allclose(timed.samples[[0, -1]][:, [0, 1, 2, 3]], course.samples[[0, -1]][:, [0, 1, 5, 6]], atol=1e-12)
    assert_allclose(timed.samples[[0, -1], 4:7], 0.0, atol=0.0)
    assert_allclose(timed.samples[-1, 7:], 0.0, atol=0.0)


@pytest.mark.slow
def test_random_paths_that_do_not_reverse_always_make_courses():
    courses = build_courses({**RANDOM, "count": 200, "seed": 7}, ROBOT, 1.0)
    assert len(courses) == 200 and len({course.name for course in courses}) == 200
    for course in courses:
        assert abs(course.samples[:, 4]).max() <= 1.001 / 0.15  # samples lie beside the peak that min_radius bounds
        assert abs(course.samples[:, 7]).max() <= 1.001 / 0.15
        assert course.length > 0.3 and course.duration < 20.0


def test_a_course_does_not_depend_on_those_built_with_it():
    mixed = build_courses([{**RANDOM, "count": 20}, "circle"], ROBOT, 1.0)
    alone = build_courses("circle", ROBOT, 1.0)[0]
    assert_allclose(mixed[-1].samples, alone.samples, rtol=1e-12, atol=1e-15)
    few = build_courses({**RANDOM, "count": 3}, ROBOT, 1.0)
    assert_allclose(few[2].samples, mixed[2].samples, rtol=1e-9, atol=1e-12)


def test_a_free_heading_does_not_turn():
    (course,) = build_courses("lemniscate", ROBOT, 1.0, free_heading=True)
    assert_array_equal(np.ptp(course.samples[:, 5:9], axis=0), 0.0)
    assert motor_use([course.trajectory(0.005)], ROBOT).use[0] < 0.85


def test_courses_of_one_name_are_told_apart():
    assert [course.name for course in build_courses(["circle", "circle"], ROBOT, 1.0)] == ["circle", "circle (2)"]


def test_samples_are_read_only():
    (course,) = build_courses("circle", ROBOT, 1.0)
    with pytest.raises(ValueError, match="read-only"):
        course.samples[0, 0] = 1.0


def test_a_path_that_makes_no_course_is_named():
    with pytest.raises(ValueError, match=r"path 'random_paths \d+' makes no course: it turns back on the spot at s ="):
        build_courses({"shape": "random_paths", "count": 20}, ROBOT, 1.0)
    with pytest.raises(ValueError, match=r"path 'circle' makes no course: it is 0\.00314 m long"):
        build_courses({"shape": "circle", "radius": 5e-4}, ROBOT, 1.0)


@pytest.mark.parametrize("radius", [0.002, 0.01, 0.03])
def test_rows_are_finer_where_a_path_turns_sharply(radius):
    """At most 0.5 rad within a row; the curvature is that of the circle."""
    (course,) = build_courses({"shape": "circle", "radius": radius}, ROBOT, 1.0)
    assert course.spacing <= 0.5 * radius * (1.0 + 1e-6)
    assert course.length == pytest.approx(2.0 * np.pi * radius, rel=1e-6)
    assert_allclose(course.samples[:, 4], 1.0 / radius, rtol=1e-5)


def test_a_corner_of_waypoints_makes_a_course():
    """Points 10 cm apart around a corner, as people type them."""
    points = [(0.1 * i, 0.0) for i in range(11)] + [(1.0, 0.1 * i) for i in range(1, 11)]
    (course,) = build_courses({"shape": "spline", "waypoints": points}, ROBOT, 1.0)
    assert 0.01 < course.spacing < 0.02
    assert course.length == pytest.approx(2.0, abs=0.02)


def test_paths_that_do_not_turn_sharply_keep_their_rows_beside_one_that_does():
    tight, _ = build_courses(["lemniscate", {"shape": "circle", "radius": 0.01}], ROBOT, 1.0)
    (alone,) = build_courses("lemniscate", ROBOT, 1.0)
    assert tight.spacing == alone.spacing
    assert_array_equal(tight.samples[:, :9], alone.samples[:, :9])


@pytest.mark.parametrize("decimals", [2, 3, 4])
def test_a_recorded_path_is_driven_as_fast_as_the_curve_that_was_recorded(decimals):
    """400 points on an ellipse of 6 m, rounded, against 40 exact ones."""

    def duration(count, digits):
        t = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False)
        points = np.column_stack([1.2 * np.cos(t), 0.7 * np.sin(t)]).round(digits)
        (course,) = build_courses({"shape": "spline", "waypoints": points.tolist(), "closed": True}, ROBOT, 1.0)
        return course.duration

    assert duration(400, decimals) == pytest.approx(duration(40, 15), rel=0.03)


def test_a_free_heading_passes_turns_on_the_spot():
    turning = {"shape": "spline", "waypoints": [(0, 0, 0.3), (1, 0, 0.3), (1, 0, 2.0), (1, 1, 2.0)]}
    (course,) = build_courses(turning, ROBOT, 1.0, free_heading=True)
    assert_allclose(course.samples[:, 5:7], [[np.cos(0.3), np.sin(0.3)]] * len(course.samples), atol=1e-12)


def test_the_description_of_a_path_comes_with_its_course():
    t = np.linspace(0.0, 2.0, 60)
    path = {"shape": "spline", "waypoints": np.column_stack([t, np.sin(t)]).round(3).tolist()}
    (course,) = build_courses(path, ROBOT, 1.0)
    assert "rounded to 0.001 m" in course.description


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"speed_limit": 0.0}, "speed_limit must be positive, got 0 m/s"),
        ({"speed_limit": float("nan")}, "speed_limit must be positive, got nan m/s"),
        ({"spacing": -0.02}, "spacing must be positive, got -0.02 m"),
        ({"margin": 1.5}, "margin must be above 0 and at most 1, got 1.5"),
    ],
)
def test_numbers_out_of_range_are_refused(wrong, message):
    with pytest.raises(ValueError, match=re.escape(message)):
        build_courses("circle", ROBOT, **{"speed_limit": 1.0, **wrong})


def test_a_table_of_another_shape_and_one_with_holes_are_refused():
    with pytest.raises(ValueError, match=r"must have shape \(K \+ 1, 10\), got \(5, 9\)"):
        Course("short", 0.02, np.zeros((5, 9)))
    samples = np.zeros((5, 10))
    samples[3, 4] = np.inf
    with pytest.raises(ValueError, match="curvature of course 'holed' is inf in row 3"):
        Course("holed", 0.02, samples)


def test_a_course_of_too_many_time_steps_is_refused():
    (course,) = build_courses("circle", ROBOT, 1.0)
    with pytest.raises(ValueError, match="over 400000 steps of 1e-06 s"):
        course.trajectory(1e-6)
