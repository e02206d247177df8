"""caster_gym.arena.beside: obstacles near a path, drawn at random."""

import re

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.arena import read_arena
from caster_gym.arena.beside import draw_beside
from caster_gym.arena.checks import check_free
from caster_gym.arena.clearance import ROUNDING, separations
from caster_gym.arena.packing import hull_of, pack
from caster_gym.paths import build_trajectories

HULLS = {name: hull_of(load_robot(name)) for name in ("chung2008", "tidybot2")}  # a disc and a rectangle
PATHS = [
    one.samples[:, :4]
    for one in build_trajectories(["lemniscate", {"shape": "random_paths", "count": 8}], load_robot("chung2008"), 0.02)
]
LEAST, GREATEST = 0.05, 0.12  # m
BESIDE = read_arena({"beside": {"pillars": 3, "walls": 2, "gap": [LEAST, GREATEST]}})


def drawn(hull, arena=BESIDE, start_margin=0.0):
    return [draw_beside(arena, hull, poses, k, f"path {k}", start_margin) for k, poses in enumerate(PATHS)]


@pytest.mark.parametrize("hull", HULLS.values(), ids=HULLS)
def test_every_obstacle_is_as_near_to_the_whole_path_as_asked(hull):
    """Its least gap to the robot anywhere on the path, other branches included."""
    for arena, poses in zip(drawn(hull), PATHS, strict=True):
        assert (len(arena.pillars), len(arena.walls), arena.beside) == (3, 2, None)
        gaps, _ = separations(hull, pack([arena])[0], poses)
        assert (gaps.min(0) >= LEAST - ROUNDING).all()
        assert (gaps.min(0) <= GREATEST + ROUNDING).all()
        check_free(arena, hull, poses, "path")


@pytest.mark.parametrize("hull", HULLS.values(), ids=HULLS)
def test_gaps_fill_the_range(hull):
    """45 gaps, uniform: all of them leave out the upper or the lower third once in 1e7 draws."""
    everyone = zip(drawn(hull), PATHS, strict=True)
    gaps = np.concatenate([separations(hull, pack([arena])[0], poses)[0].min(0) for arena, poses in everyone])
    third = (GREATEST - LEAST) / 3.0
    assert gaps.min() < LEAST + third
    assert gaps.max() > GREATEST - third


def test_a_seed_and_an_index_always_give_the_same_obstacles():
    hull, poses = HULLS["tidybot2"], PATHS[0]
    once = draw_beside(BESIDE, hull, poses, 4)
    assert once == draw_beside(BESIDE, hull, poses, 4)
    assert once != draw_beside(BESIDE, hull, poses, 5)
    other = read_arena({"beside": {"pillars": 3, "walls": 2, "gap": [LEAST, GREATEST], "seed": 1}})
    assert once != draw_beside(other, hull, poses, 4)


def test_obstacles_lie_on_both_sides():
    sides = []
    for arena, poses in zip(drawn(HULLS["chung2008"]), PATHS, strict=True):
        position = poses[:, 0] + 1j * poses[:, 1]
        for pillar in arena.pillars:
            away = complex(*pillar.centre) - position
            k = min(int(np.abs(away).argmin()), len(position) - 2)
            sides.append(np.sign((np.conj(position[k + 1] - position[k]) * away[k]).imag))
    assert {-1.0, 1.0} <= set(sides)


def test_sizes_and_directions_keep_to_their_ranges():
    arena = read_arena(
        {
            "beside": {
                "pillars": 2,
                "walls": 3,
                "pillar_radius": [0.06, 0.07],
                "wall_length": [0.3, 0.4],
                "wall_thickness": [0.01, 0.02],
                "wall_turn": 0.0,
            }
        }
    )
    straight = np.stack([np.linspace(0.0, 5.0, 501), np.zeros(501), np.ones(501), np.zeros(501)], -1)
    one = draw_beside(arena, HULLS["tidybot2"], straight, 0)
    assert all(0.06 <= pillar.radius <= 0.07 for pillar in one.pillars)
    assert all(0.01 <= wall.thickness <= 0.02 for wall in one.walls)
    ways = [complex(*wall.end) - complex(*wall.start) for wall in one.walls]
    assert all(0.3 <= abs(way) <= 0.4 for way in ways)
    assert np.abs(np.imag(ways)).max() < ROUNDING  # parallel to the path


def test_the_start_keeps_its_room():
    hull = HULLS["chung2008"]
    for arena, poses in zip(drawn(hull, start_margin=0.3), PATHS, strict=True):
        check_free(arena, hull, poses, "path", 0.3)


def test_what_was_there_stays_and_is_not_overlapped():
    """Pillars that are apart from each other, from the room and from the pillar of the user, by plain geometry."""
    pillar = {"centre": [0.0, 0.6], "radius": 0.05}
    arena = read_arena({"room": [[-2, -1], [2, 1]], "pillars": [pillar], "beside": {"pillars": 5, "walls": 0}})
    result = draw_beside(arena, HULLS["chung2008"], PATHS[0], 0)
    assert (result.room, result.pillars[0]) == (arena.room, arena.pillars[0])
    centres, radii = np.array([one.centre for one in result.pillars]), np.array([one.radius for one in result.pillars])
    assert (np.abs(centres) + radii[:, None] < [2.0, 1.0]).all()
    apart = np.linalg.norm(centres[:, None] - centres, axis=-1) - radii[:, None] - radii
    assert (apart[~np.eye(6, dtype=bool)] > 0.0).all()


def test_an_arena_with_nothing_to_draw_stays_as_it_is():
    arena = read_arena({"pillars": [{"centre": [9, 9]}]})
    assert draw_beside(arena, HULLS["chung2008"], PATHS[0], 0) is arena


def test_a_pose_that_is_held_gets_its_obstacles_too():
    """A path of one pose has no direction but that of the robot."""
    pose = np.array([[1.0, -2.0, 0.6, 0.8]])
    one_each = read_arena({"beside": {"pillars": 1, "walls": 1, "gap": [LEAST, GREATEST]}})
    arena = draw_beside(one_each, HULLS["tidybot2"], pose, 0)
    gaps, _ = separations(HULLS["tidybot2"], pack([arena])[0], pose)
    assert gaps.shape == (1, 2)
    assert (gaps >= LEAST - ROUNDING).all() and (gaps <= GREATEST + ROUNDING).all()


def test_a_robot_that_only_turns_gets_its_obstacles_too():
    angles = np.linspace(0.0, np.pi, 100)
    spot = np.stack([np.ones(100), np.ones(100), np.cos(angles), np.sin(angles)], -1)
    arena = draw_beside(BESIDE, HULLS["tidybot2"], spot, 0)
    gaps, _ = separations(HULLS["tidybot2"], pack([arena])[0], spot)
    assert ((gaps.min(0) >= LEAST - ROUNDING) & (gaps.min(0) <= GREATEST + ROUNDING)).all()


@pytest.mark.slow
@pytest.mark.parametrize(
    "asked", [{"pillars": 90, "walls": 2}, {"pillars": 1, "walls": 30}, {"pillars": 12, "gap": [1, 2]}], ids=str
)
def test_where_there_is_no_room_the_path_is_named_and_so_many_as_are_told_fit(asked):
    """A room that fits the path closely has little left."""
    low, high = PATHS[0][:, :2].min(0) - 0.3, PATHS[0][:, :2].max(0) + 0.3
    crowded = {"room": [low.tolist(), high.tolist()], "beside": asked}
    with pytest.raises(
        ValueError, match=r"pillars and \d+ walls do not fit beside path 'eight'; .* would suffice"
    ) as error:
        draw_beside(read_arena(crowded), HULLS["chung2008"], PATHS[0], 0, "eight")
    pillars, walls = map(int, re.findall(r"'pillars' of (\d+) and 'walls' of (\d+)", str(error.value))[0])
    fewer = read_arena({**crowded, "beside": {**asked, "pillars": pillars, "walls": walls}})
    drawn = draw_beside(fewer, HULLS["chung2008"], PATHS[0], 0, "eight")
    assert (len(drawn.pillars), len(drawn.walls)) == (pillars, walls)
