"""caster_gym.arena.packing and .clearance: the tables that the mechanics reads, and gaps at whole arrays of poses."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.arena import distances, read_arena
from caster_gym.arena.packing import hull_of, pack, surroundings
from caster_gym.mechanics.impulse import LAWS
from caster_gym.robot import Footprint

ROBOT = load_robot("chung2008")
RADIUS = ROBOT.platform.footprint.disc or 0.0
PILLARS = read_arena({"pillars": [{"centre": [1, 2], "radius": 0.3}, {"centre": [-1, 0]}]})
MIXED = read_arena(
    {
        "room": [[-3, -3], [3, 3]],
        "walls": [{"start": [0, 0], "end": [1, 0]}, {"start": [0, 1], "end": [1, 1], "thickness": 0.1}],
        "polygons": [{"corners": [[0, 2], [1, 2], [1, 2.5]]}],
    }
)


def with_footprint(**footprint):
    platform = ROBOT.platform.model_copy(update={"footprint": Footprint(**footprint)})
    return ROBOT.model_copy(update={"platform": platform})


def test_a_disc_is_one_corner_with_a_radius():
    hull = hull_of(with_footprint(disc=0.2))
    assert (hull.faces.shape, hull.corners.tolist(), hull.radius, hull.reach) == ((0, 3), [[0.0, 0.0]], 0.2, 0.2)


def test_a_polygon_reaches_as_far_as_its_farthest_corner():
    hull = hull_of(with_footprint(polygon=((0.3, -0.4), (0.1, 0.2), (-0.2, 0.1))))
    assert (hull.faces.shape, hull.corners.shape, hull.radius) == ((3, 3), (3, 2), 0.0)
    assert_allclose(hull.reach, 0.5, rtol=1e-15)


@pytest.mark.parametrize("arenas", [[read_arena(None)], [PILLARS], [MIXED, read_arena(None), PILLARS]])
def test_tables_are_contiguous_and_of_the_types_that_compiled_code_knows(arenas):
    obstacles, parts = pack(arenas)
    count = sum(len(arena.obstacles) for arena in arenas)
    shapes = (obstacles.faces.shape[1:], obstacles.corners.shape[1:], obstacles.radii.shape, obstacles.spans.shape)
    assert shapes == ((3,), (2,), (count,), (count, 4))
    assert [table.dtype for table in (*obstacles[:4], parts)] == [np.float64] * 3 + [np.int64] * 2
    assert all(table.flags.c_contiguous for table in (*obstacles[:4], parts))
    assert (obstacles.restitution, obstacles.friction, obstacles.law) == (0.5, 0.2, LAWS["stronge"])


def test_the_law_of_impacts_is_that_of_the_arenas():
    other = read_arena({"impact_law": "chatterjee_ruina"})
    assert pack([other])[0].law == LAWS["chatterjee_ruina"] != LAWS["stronge"]


def test_each_arena_keeps_its_obstacles_in_a_common_table():
    together, parts = pack([MIXED, read_arena(None), PILLARS])
    assert parts.tolist() == [[0, 7], [7, 7], [7, 9]]
    for arena, (first, end) in zip((MIXED, PILLARS), parts[[0, 2]], strict=True):
        alone, _ = pack([arena])
        for k in range(end - first):
            ours, theirs = together.spans[first + k], alone.spans[k]
            assert_array_equal(together.faces[ours[0] : ours[1]], alone.faces[theirs[0] : theirs[1]])
            assert_array_equal(together.corners[ours[2] : ours[3]], alone.corners[theirs[2] : theirs[3]])
            assert together.radii[first + k] == alone.radii[k]


def test_obstacles_have_the_faces_and_corners_of_their_kind():
    spans = pack([MIXED])[0].spans
    assert (spans[:, 1] - spans[:, 0]).tolist() == [1, 1, 1, 1, 2, 4, 3]
    assert (spans[:, 3] - spans[:, 2]).tolist() == [0, 0, 0, 0, 2, 4, 3]


def test_surroundings_are_the_outline_and_the_obstacles_of_one_arena():
    around = surroundings(ROBOT, MIXED)
    for ours, theirs in zip((*around.hull, *around.obstacles), (*hull_of(ROBOT), *pack([MIXED])[0]), strict=True):
        assert_array_equal(ours, theirs)


@pytest.mark.parametrize(
    ("arenas", "message"),
    [
        ([], "at least one arena is needed, got none"),
        ([read_arena({"beside": {}})], "obstacles beside a path have no place before they are drawn"),
        (
            [read_arena({}), read_arena({"friction": 0.5})],
            r"must share restitution and friction, got \[\(0\.5, 0\.2\), \(0\.5, 0\.5\)\]",
        ),
        (
            [read_arena({}), read_arena({"impact_law": "chatterjee_ruina"})],
            "must share impact_law, got chatterjee_ruina, stronge",
        ),
    ],
)
def test_arenas_that_make_no_table_are_refused(arenas, message):
    with pytest.raises(ValueError, match=message):
        pack(arenas)


def test_distances_to_pillars_are_those_of_centres_less_both_radii():
    poses = np.random.default_rng(3).uniform(-2.0, 2.0, (4, 5, 3))
    gaps, normals = distances(PILLARS, ROBOT, poses)
    apart = poses[..., None, :2] - [[1.0, 2.0], [-1.0, 0.0]]
    lengths = np.hypot(apart[..., 0], apart[..., 1])
    both = np.array([0.3 + RADIUS, 0.1 + RADIUS])
    assert_allclose(gaps, lengths - both, rtol=0.0, atol=1e-14)  # rounding of a few metres
    assert_allclose(normals, apart / lengths[..., None], rtol=0.0, atol=1e-13)  # the same, at a length above 0.1 m


def test_distances_of_a_polygon_depend_on_its_heading():
    """A bar, 1 m by 0.2 m, before a wall."""
    bar = with_footprint(polygon=((0.5, -0.1), (0.5, 0.1), (-0.5, 0.1), (-0.5, -0.1)))
    arena = read_arena({"half_planes": [{"point": [0, 0], "normal": [0, 2]}]})
    gaps, normals = distances(arena, bar, [[7.0, 1.0, 0.0], [7.0, 1.0, np.pi / 2], [7.0, 0.05, np.pi]])
    assert_allclose(gaps[:, 0], [0.9, 0.5, -0.05], rtol=0.0, atol=1e-15)
    assert_allclose(normals[:, 0], [[0.0, 1.0]] * 3, atol=1e-15)


@pytest.mark.parametrize("shape", [(3,), (0, 3), (6, 3), (2, 0, 3)])
@pytest.mark.parametrize("arena", [read_arena(None), PILLARS])
def test_distances_have_the_shape_of_the_poses_and_obstacles(shape, arena):
    gaps, normals = distances(arena, ROBOT, np.zeros(shape))
    count = len(arena.obstacles)
    assert (gaps.shape, normals.shape) == ((*shape[:-1], count), (*shape[:-1], count, 2))


@pytest.mark.parametrize(
    ("pose", "message"),
    [
        (np.zeros(4), r"pose must have shape \(\.\.\., 3\), got \(4,\)"),
        (0.0, r"got \(\)"),
        ([0.0, np.nan, 0.0], "pose must be finite, got nan"),
    ],
)
def test_poses_that_are_none_are_refused(pose, message):
    with pytest.raises(ValueError, match=message):
        distances(PILLARS, ROBOT, pose)
