"""caster_gym.arena.checks: an arena in the way of a path is refused, with a sentence that says where."""

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.arena import read_arena
from caster_gym.arena.checks import check_free
from caster_gym.arena.packing import hull_of

HULL = hull_of(load_robot("chung2008"))  # a disc of 0.15 m
STRAIGHT = np.stack([np.linspace(0.0, 2.0, 201), np.zeros(201), np.ones(201), np.zeros(201)], -1)


def check(arena, start_margin=0.0):
    check_free(read_arena(arena), HULL, STRAIGHT, "straight", start_margin, lambda k: f"after {0.01 * k:.2f} m")


@pytest.mark.parametrize(
    "arena",
    [
        None,
        {"room": [[-0.15, -0.15], [2.15, 0.15]]},  # touches all along
        {"pillars": [{"centre": [1.0, 0.26], "radius": 0.1}]},
        {"walls": [{"start": [-1.0, -0.16], "end": [3.0, -0.16]}]},
    ],
)
def test_a_path_that_overlaps_nothing_is_free(arena):
    check(arena)


@pytest.mark.parametrize(
    ("arena", "message"),
    [
        (
            {"pillars": [{"centre": [1.0, 5.0]}, {"centre": [1.5, 0.2]}]},
            r"path 'straight' runs into pillar 2 at \(1\.5, 0\.2\) m: after 1\.50 m, at \(1\.500, 0\.000\) m, "
            r"the robot overlaps it by 0\.05 m",
        ),
        (
            {"room": [[-1.0, -1.0], [1.9, 1.0]]},
            r"leaves the arena through the room's side x_max: after 2\.00 m, .* by 0\.25 m",
        ),
        (
            {"half_planes": [{"point": [0.0, -0.1], "normal": [0.0, 1.0]}]},
            r"leaves the arena through half-plane 1 through \(0, -0\.1\) m: .* by 0\.05 m",
        ),
        ({"walls": [{"start": [1.0, -1.0], "end": [1.0, 1.0]}]}, r"runs into wall 1 .*: after 1\.00 m"),
        ({"polygons": [{"corners": [[0.4, 0], [0.5, 0.1], [0.4, 0.1]]}]}, "runs into polygon 1 with its first corner"),
    ],
)
def test_an_obstacle_in_the_way_is_named_with_place_and_depth(arena, message):
    with pytest.raises(ValueError, match=message):
        check(arena)


def test_the_start_needs_room_for_its_displacements():
    """A gap of 0.08 m at the start, and less of it later on, which matters to nobody."""
    arena = {"pillars": [{"centre": [-0.33, 0.0], "radius": 0.1}, {"centre": [1.0, 0.26], "radius": 0.1}]}
    check(arena, 0.079)
    with pytest.raises(
        ValueError, match=r"'straight' starts too near to pillar 1 .*: the gap is 0\.08 m, and 0\.081 m"
    ):
        check(arena, 0.081)


def test_the_first_obstacle_is_not_the_worst():
    """The one that is overlapped most is reported: the others may vanish with it."""
    arena = {"pillars": [{"centre": [0.5, 0.2]}, {"centre": [1.5, 0.1]}]}
    with pytest.raises(ValueError, match=r"pillar 2 .* by 0\.15 m"):
        check(arena)
