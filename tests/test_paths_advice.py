"""caster_gym.paths.advice: whatever a message about a path advises is done here, and the path is then accepted."""

import re

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.paths import build_trajectories, read_paths
from caster_gym.paths.course import build_courses
from caster_gym.paths.splines import Spline

ROBOT = load_robot("chung2008")
PERIOD = 0.02  # [s] of the environments


def spline(*waypoints, **fields):
    return {"shape": "spline", "waypoints": waypoints, "duration": 20.0, **fields}


def turning(turns):
    return {"shape": "circle", "heading": {"kind": "spinning", "turns": turns}}


def changed(path, advice):
    """A path with all values of an advice in it."""
    result = dict(path)
    for name, value in re.findall(r"(duration|tolerance|min_radius) of (?:at least )?([\d.e+-]+)", advice):
        result[name] = float(value)
    for name, value in re.findall(r"(radius|width|side|rounding|max_\w+) ([\d.e-]+) (?:m|rad)", advice):
        result[name] = float(value)
    for name, values in re.findall(r"(semi_axes) \((.*?)\) m", advice):
        result[name] = [float(value) for value in values.split(",")]
    if "reversing 0" in advice:
        result["reversing"] = 0.0
    if "fixed heading" in advice:
        result["heading"] = "fixed"
    assert result != path, advice
    return result


TOO_FAST = [
    {"shape": "circle", "duration": 0.001},
    {"shape": "circle", "duration": 1.0},
    {"shape": "circle", "laps": 100},
    {"shape": "ellipse", "semi_axes": [1.5, 1e-4]},
    {"shape": "rounded_square", "rounding": 1e-6},
    turning(30),
    turning(300),
    spline((0, 0), (1, 0), (0, 0)),
    spline((0, 0, 0), (1, 0, 300), unit="rad"),
    spline((0, 0, 0), (0, 0, 1), duration=0.1),
    spline((0, 0, 0), (1, 0, 0), (1, 0, 1), (2, 0, 1), duration=0.5),
    {"shape": "random_paths", "count": 20, "duration": 5.0, "max_speed": 5.0, "max_acceleration": 20.0},
]


@pytest.mark.parametrize("path", TOO_FAST, ids=str)
def test_a_trajectory_is_accepted_once_its_message_is_followed(path):
    with pytest.raises(ValueError, match=r"would suffice$") as error:
        build_trajectories(path, ROBOT, PERIOD)
    assert build_trajectories(changed(path, str(error.value).rsplit(";", 1)[1]), ROBOT, PERIOD)


def test_a_path_of_too_many_steps_is_accepted_once_it_is_as_short_as_its_message_says():
    step = 0.0012345678
    with pytest.raises(ValueError, match="at most") as error:
        read_paths({"shape": "circle", "duration": 1e5})[0].trajectories(step)
    longest = float(re.findall(r"at most ([\d.]+) s would suffice", str(error.value))[0])
    assert read_paths({"shape": "circle", "duration": longest})[0].trajectories(step)


NOISY = [(x + 0.008 * np.sin(700.0 * x), np.sin(x) + 0.016 * np.cos(900.0 * x)) for x in np.linspace(0.0, 2.0, 300)]

NO_COURSE = [
    {"shape": "circle", "radius": 1e-9},
    {"shape": "circle", "radius": 1e-5},
    {"shape": "circle", "radius": 1e-3},
    {"shape": "ellipse", "semi_axes": [1.5, 0.01]},
    pytest.param({"shape": "ellipse", "semi_axes": [1.5, 0.05]}, marks=pytest.mark.slow),
    {"shape": "lemniscate", "width": 1e-3},
    pytest.param({"shape": "rounded_square", "rounding": 1e-3}, marks=pytest.mark.slow),
    {"shape": "rounded_square", "side": 1e-3, "rounding": 1e-4},
    {"shape": "random_paths", "count": 20},
    {"shape": "random_paths", "count": 3, "extent": 1e-3},
    turning(600),
    spline((1, 1)),
    spline((0, 0, 0), (0, 0, 1)),
    spline((0, 0), (1, 0), (0, 0)),
    spline((0, 0), (1, 0), (0, 0), heading="fixed"),
    spline((0, 0, 0), (1, 0, 0), (1, 0, 1), (2, 0, 1)),
    spline((0, 0, 0), (1, 0, 0), (1, 0, 1), (2, 0, 1), duration=0.5),
    spline(*NOISY),
    spline((0, 0), (1e-3, 0), (1e-3, 1e-3)),
]


@pytest.mark.parametrize("path", NO_COURSE, ids=lambda path: str(path)[:90])
def test_a_course_is_made_once_its_message_is_followed(path):
    """Each way out that a message names by itself: in following, and in tracking."""
    with pytest.raises(ValueError, match="makes no course: ") as error:
        build_courses(path, ROBOT, 1.0)
    reason, *advice = str(error.value).split("; ")
    assert advice, reason
    for sentence in advice:
        if sentence.startswith("CasterTrack"):
            as_it_is = sentence == "CasterTrack drives it as it is, in the time of its 'duration'"
            assert build_trajectories(path if as_it_is else changed(path, sentence), ROBOT, PERIOD)
            continue
        assert sentence.endswith(" would suffice")
        for way in sentence.removesuffix(" would suffice").split(" or "):
            free = way == "a free heading"
            assert build_courses(path if free else changed(path, way), ROBOT, 1.0, free_heading=free)


@pytest.mark.parametrize(
    "path", [{"shape": "circle", "radius": 0.03}, {"shape": "circle", "radius": 0.01}, turning(30)]
)
def test_a_spacing_that_was_asked_for_is_replaced_by_one_that_does(path):
    with pytest.raises(ValueError, match=r"a spacing of .* would suffice$") as error:
        build_courses(path, ROBOT, 1.0, spacing=0.02)
    spacing = float(re.findall(r"a spacing of ([\d.e-]+) m", str(error.value))[0])
    assert build_courses(path, ROBOT, 1.0, spacing=spacing)


@pytest.mark.parametrize(
    ("path", "pattern", "field"),
    [
        (spline((0, 0), (1.2345678, 0), tolerance=1.0), r"at most ([\d.]+) m would suffice", "tolerance"),
        ({"shape": "rounded_square", "side": 1.23456789, "rounding": 1.0}, r"half the side, ([\d.]+) m", "rounding"),
        ({"shape": "random_paths", "min_radius": 0.1}, r"needs reversing ([\d.]+),", "reversing"),
    ],
)
def test_a_value_that_a_check_names_passes_the_check(path, pattern, field):
    with pytest.raises(ConfigurationError) as error:
        read_paths(path)
    assert read_paths({**path, field: float(re.findall(pattern, str(error.value))[0])})


def test_a_round_course_may_have_laps_as_its_message_says():
    open_one = spline((0, 0), (1, 0), (1, 1), laps=2)
    with pytest.raises(ConfigurationError, match="set 'closed' for a round course"):
        read_paths(open_one)
    assert read_paths({**open_one, "closed": True})


def test_a_heading_given_twice_may_be_left_out_in_either_place():
    twice = spline((0, 0, 1), (1, 0, 2), heading="fixed")
    with pytest.raises(ConfigurationError, match="leave 'heading' out, or their third numbers"):
        read_paths(twice)
    assert read_paths({key: value for key, value in twice.items() if key != "heading"})
    assert read_paths({**twice, "waypoints": [one[:2] for one in twice["waypoints"]]})


def test_waypoints_that_zigzag_are_told_of_with_a_tolerance_that_smooths_them():
    t = np.linspace(0.0, 2.0, 300)
    points = np.column_stack([t, np.sin(t)]) + np.random.default_rng(8).normal(0.0, 0.0005, (300, 2))
    (noisy,) = read_paths(spline(*map(tuple, points.tolist())))
    assert isinstance(noisy, Spline)
    told = re.findall(r"zigzag by about ([\d.]+) m: a tolerance of that", noisy.description)[0]
    slow, fast = (
        build_courses(one, ROBOT, 1.0)[0].duration
        for one in (noisy, noisy.model_copy(update={"tolerance": float(told)}))
    )
    assert fast < 0.5 * slow
