"""paths.points: of a long list, the first item that is no point is told."""

import pytest

from caster_gym.configuration import ConfigurationError
from caster_gym.paths import read_paths
from caster_gym.paths.points import FEW, check_long


def test_long_lists_of_points_and_numbers_pass():
    check_long([[0.0, 1]] * FEW + [[0, 1, 2.0]], "waypoint", (2, 3))
    check_long([0.5] * (FEW + 1), "angle")
    check_long(None, "angle")


@pytest.mark.parametrize(
    ("points", "sizes", "said"),
    [
        ([[0, 1]] * FEW + [[0]], (2, 3), "waypoint 31 should be 2 or 3 numbers, got \\[0\\]"),
        ([[0, 1]] * FEW + ["ab"], (2, 3), "waypoint 31 should be 2 or 3 numbers, got 'ab'"),
        ([[0, True]] + [[0, 1]] * FEW, (2, 3), "waypoint 1 should be 2 or 3 numbers"),
        ([0.0] * FEW + [None], (), "waypoint 31 should be a number, got None"),
    ],
)
def test_the_first_that_is_none_is_told(points, sizes, said):
    with pytest.raises(ValueError, match=said):
        check_long(points, "waypoint", sizes)


def test_of_a_short_list_the_types_tell():
    check_long(["a"], "waypoint", (2,))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"shape": "spline", "waypoints": [["a", 1]] * (FEW + 1)}, "waypoint 1 should be 2 or 3 numbers"),
        ({"shape": "timed", "poses": [[0, 1]] * (FEW + 1)}, "pose 1 should be 3 or 4 numbers"),
        (
            {"shape": "circle", "heading": {"kind": "profile", "angles": ["a"] * (FEW + 1)}},
            "angle 1 should be a number",
        ),
    ],
)
def test_paths_say_so(content, said):
    with pytest.raises(ConfigurationError, match=said):
        read_paths(content)
