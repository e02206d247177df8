"""Gaps between the robot and obstacles, their axes and contact points, against the Minkowski difference by Qhull."""

import numba
import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linprog
from scipy.spatial import ConvexHull

import caster_gym.engines.native.compiler
import caster_gym.engines.tensor.model  # noqa: F401  teaches the choices and roots of tensors
from caster_gym.arena import read_arena
from caster_gym.arena.packing import hull_from, pack
from caster_gym.arrays import Array
from caster_gym.mechanics.separation import (
    TOUCH,
    Hull,
    Obstacles,
    clearance,
    contact_points,
    separation,
)
from caster_gym.outlines import Outline, convex

ROUNDING = 1e-12  # m, some hundred times the rounding of numbers of a few metres
KINDS = ("half_planes", "thin walls", "walls", "pillars", "polygons")
HULLS = {
    "disc": hull_from(Outline((), ((0.0, 0.0),), 0.2)),
    "polygon": hull_from(convex(((0.3, -0.2), (0.35, 0.1), (0.1, 0.3), (-0.25, 0.2), (-0.3, -0.15)))),
    "rounded": hull_from(convex(((0.2, -0.2), (0.2, 0.2), (-0.3, 0.0)))._replace(radius=0.1)),
}


def random_polygon(rng, count=None):
    """Corners (M, 2) of a convex polygon, counter-clockwise: points on a turned ellipse."""
    count = count or int(rng.integers(3, 8))
    angles = 2.0 * np.pi * (np.arange(count) + rng.uniform(-0.3, 0.3, count)) / count
    points = rng.uniform(0.1, 0.6) * np.cos(angles) + 1j * rng.uniform(0.1, 0.6) * np.sin(angles)
    points = points * np.exp(1j * rng.uniform(0.0, 6.3)) + complex(*rng.uniform(-0.5, 0.5, 2))
    return np.stack([points.real, points.imag], -1)


def random_arena(seed, kind):
    """An arena of one obstacle near the origin."""
    rng = np.random.default_rng(seed)
    start, end = rng.uniform(-0.7, 0.7, (2, 2)).tolist()
    parts = {
        "half_planes": {"half_planes": [{"point": start, "normal": end}]},
        "thin walls": {"walls": [{"start": start, "end": end}]},
        "walls": {"walls": [{"start": start, "end": end, "thickness": rng.uniform(0.02, 0.3)}]},
        "pillars": {"pillars": [{"centre": start, "radius": rng.uniform(0.05, 0.3)}]},
        "polygons": {"polygons": [{"corners": random_polygon(rng).tolist()}]},
    }
    return read_arena(parts[kind])


def random_poses(seed, count):
    """x, y [m] and the heading as a unit vector (count,), near the origin."""
    rng = np.random.default_rng((seed, 1))
    x, y, beta = rng.uniform(-1.2, 1.2, count), rng.uniform(-1.2, 1.2, count), rng.uniform(-np.pi, np.pi, count)
    return (x, y), (np.cos(beta), np.sin(beta))


def everything():
    """One table of four obstacles of each kind."""
    return pack([random_arena(seed, kind) for kind in KINDS for seed in range(4)])[0]


def corners_in_world(x, y, c, s, hull):
    return np.array([[x, y]]) + hull.corners @ np.array([[c, s], [-s, c]])


def to_segment(a, b):
    """Distance of the origin from the segment from a to b."""
    way = b - a
    share = np.clip(-(a @ way) / max(way @ way, 1e-300), 0.0, 1.0)
    return np.linalg.norm(a + share * way)


def from_minkowski(robot, obstacle):
    """Greatest separation along a face normal, and Euclidean distance (0 if they overlap), of two sets of corners.

    Two convex sets are as far apart as the origin is from the set of all differences of their points.
    """
    differences = (robot[:, None] - obstacle[None]).reshape(-1, 2)
    if np.linalg.matrix_rank(differences - differences[0], tol=1e-9) < 2:
        distance = min(to_segment(a, b) for a in differences for b in differences)
        return 0.0, distance
    outline = ConvexHull(differences)
    widest = outline.equations[:, 2].max()
    ring = differences[outline.vertices]
    nearest = min(to_segment(a, b) for a, b in zip(ring, np.roll(ring, -1, axis=0), strict=True))
    return widest, 0.0 if widest <= 0.0 else nearest


def expected_gap(robot, robot_radius, obstacles, k):
    """Gap [m] and Euclidean distance [m] of the robot's corners in W from obstacle k, by the other derivation."""
    first, _, first_corner, end_corner = obstacles.spans[k]
    radius = robot_radius + obstacles.radii[k]
    if end_corner == first_corner:
        nx, ny, offset = obstacles.faces[first]
        gap = (robot @ [nx, ny]).min() - offset - radius
        return gap, max(gap, 0.0)
    widest, distance = from_minkowski(robot, obstacles.corners[first_corner:end_corner])
    rounded = distance if widest > 0.0 or distance > 0.0 else widest
    gap = (rounded if radius > 0.0 else widest) - radius
    return gap, max(distance - radius, 0.0)


@pytest.mark.parametrize("hull", HULLS.values(), ids=HULLS)
@pytest.mark.parametrize("kind", KINDS)
def test_gap_is_what_the_minkowski_difference_says(hull, kind):
    """(O1), (O2), (O3): the distance where one is round, else the widest face normal; the depth where they overlap."""
    apart = overlapping = 0
    for seed in range(8):
        obstacles, _ = pack([random_arena(seed, kind)])
        (x, y), (c, s) = random_poses(seed, 40)
        gap = separation((x, y), (c, s), hull, obstacles, 0).gap
        for i in range(40):
            robot = corners_in_world(x[i], y[i], c[i], s[i], hull)
            # Qhull's own rounding is some 1e-15 of the size of the shapes
            assert_allclose(gap[i], expected_gap(robot, hull.radius, obstacles, 0)[0], rtol=0.0, atol=ROUNDING)
        apart, overlapping = apart + (gap > 0.0).sum(), overlapping + (gap < 0.0).sum()
    assert apart > 20
    assert overlapping > 20


@pytest.mark.parametrize("kind", ["thin walls", "walls", "polygons"])
def test_gap_of_two_polygons_never_exceeds_their_distance(kind):
    """Corner before corner it is less than the Euclidean distance, but positive exactly where they are apart."""
    less = 0
    for seed in range(8):
        obstacles, _ = pack([random_arena(seed, kind)])
        (x, y), (c, s) = random_poses(seed, 40)
        gap = separation((x, y), (c, s), HULLS["polygon"], obstacles, 0).gap
        for i in range(40):
            robot = corners_in_world(x[i], y[i], c[i], s[i], HULLS["polygon"])
            _, distance = expected_gap(robot, 0.0, obstacles, 0)
            assert gap[i] <= distance + ROUNDING
            assert (gap[i] > 0.0) == (distance > 0.0)
            less += gap[i] < distance - 1e-3
    assert less > 20


@pytest.mark.parametrize("kind", ["thin walls", "walls", "polygons"])
def test_gap_is_negative_where_a_point_lies_in_both(kind):
    """By linear programming: shares of the corners of both that make the same point."""
    obstacles, _ = pack([random_arena(3, kind)])
    (x, y), (c, s) = random_poses(3, 60)
    gap = separation((x, y), (c, s), HULLS["polygon"], obstacles, 0).gap
    met = []
    for i in range(60):
        robot, other = corners_in_world(x[i], y[i], c[i], s[i], HULLS["polygon"]), obstacles.corners
        ours, theirs = np.ones((1, len(robot))), np.ones((1, len(other)))
        shares = np.block([[robot.T, -other.T], [ours, 0.0 * theirs], [0.0 * ours, theirs]])
        met.append(linprog(np.zeros(shares.shape[1]), A_eq=shares, b_eq=[0.0, 0.0, 1.0, 1.0]).success)
    assert_array_equal(gap < 0.0, met)
    assert 0 < sum(met) < 60


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(KINDS), name=st.sampled_from(sorted(HULLS)))
def test_axis_points_from_the_obstacle_to_the_robot(seed, kind, name):
    """It is a unit vector along which every step of the robot opens the gap by its length."""
    obstacles, _ = pack([random_arena(seed, kind)])
    (x, y), heading = random_poses(seed, 50)
    gap, nx, ny = separation((x, y), heading, HULLS[name], obstacles, 0)
    assert_allclose(np.hypot(nx, ny), 1.0, rtol=0.0, atol=ROUNDING)
    for way in (1e-3, 0.1, 2.0):
        further = separation((x + way * nx, y + way * ny), heading, HULLS[name], obstacles, 0).gap
        assert_allclose(further, gap + way, rtol=0.0, atol=ROUNDING)


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), kind=st.sampled_from(KINDS), name=st.sampled_from(sorted(HULLS)))
def test_a_gap_is_not_used_up_by_less_motion(seed, kind, name):
    """A search for the first contact relies on it: a robot whose points move less than the gap stays free.

    Where one is round, or behind a half-plane, the gap itself changes by no more than the way. That of two polygons,
    corner before corner, changes faster as the robot turns, but without a contact.
    """
    hull = HULLS[name]
    obstacles, _ = pack([random_arena(seed, kind)])
    (x, y), (c, s) = random_poses(seed, 50)
    before = separation((x, y), (c, s), hull, obstacles, 0).gap
    rng = np.random.default_rng((seed, 2))
    for size in (1e-4, 0.05, 1.0):
        dx, dy, turn = size * rng.uniform(-1.0, 1.0, (3, 50))
        heading = (c * np.cos(turn) - s * np.sin(turn), s * np.cos(turn) + c * np.sin(turn))
        after = separation((x + dx, y + dy), heading, hull, obstacles, 0).gap
        way = np.hypot(dx, dy) + hull.reach * abs(turn) + ROUNDING
        assert (after > 0.0)[before > way].all()
        assert (after >= before - way)[before <= way].all()
        if kind == "half_planes" or hull.radius + obstacles.radii[0] > 0.0:
            assert (abs(after - before) <= way).all()


@pytest.mark.parametrize("hull", HULLS.values(), ids=HULLS)
def test_gap_does_not_depend_on_where_the_world_has_its_origin(hull):
    """Robot and obstacles moved and turned together keep their gaps; the axes turn with them."""
    obstacles = everything()
    shift, angle = np.array([3.0, -2.0]), 1.1
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    faces = obstacles.faces.copy()
    faces[:, :2] = faces[:, :2] @ turn.T
    faces[:, 2] += faces[:, :2] @ shift
    moved = obstacles._replace(faces=faces, corners=obstacles.corners @ turn.T + shift)
    (x, y), (c, s) = random_poses(5, 50)
    there = turn @ np.stack([x, y]) + shift[:, None]
    heading = turn @ np.stack([c, s])
    for k in range(len(obstacles.spans)):
        here = separation((x, y), (c, s), hull, obstacles, k)
        apart = separation(tuple(there), tuple(heading), hull, moved, k)
        assert_allclose(apart.gap, here.gap, rtol=0.0, atol=ROUNDING)
        assert_allclose(
            [apart.nx, apart.ny], turn @ [here.nx, here.ny], rtol=0.0, atol=1e-9
        )  # a gap of rounding's size


def solid(corners, radius):
    """An obstacle of these corners and rounding."""
    spans = np.array([[0, 0, 0, len(corners)]])
    return Obstacles(np.zeros((0, 3)), corners, np.array([radius]), spans, 0.0, 0.0)


@pytest.mark.parametrize("hull", HULLS.values(), ids=HULLS)
@pytest.mark.parametrize("kind", KINDS)
def test_contact_points_of_a_touching_robot_lie_on_both_surfaces(hull, kind):
    touched = 0
    for seed in range(8):
        obstacles, _ = pack([random_arena(seed, kind)])
        (x, y), (c, s) = random_poses(seed, 40)
        gap, nx, ny = separation((x, y), (c, s), hull, obstacles, 0)
        x, y = x - gap * nx, y - gap * ny
        apart = separation((x, y), (c, s), hull, obstacles, 0)
        ends = contact_points((x, y), (c, s), apart, hull, obstacles, 0)
        for px, py in ends:
            points = np.stack([x + c * px - s * py, y + s * px + c * py], -1)
            for i in np.flatnonzero(abs(apart.gap) < ROUNDING):
                theirs, _ = expected_gap(points[i][None], 0.0, obstacles, 0)
                robot = solid(corners_in_world(x[i], y[i], c[i], s[i], hull), hull.radius)
                ours, _ = expected_gap(points[i][None], 0.0, robot, 0)
                # corners nearer than TOUCH to the common line count as touching
                assert_allclose([theirs, ours], 0.0, rtol=0.0, atol=TOUCH)
                touched += 1
    assert touched > 200


RECTANGLE = hull_from(convex(((0.2, -0.1), (0.2, 0.1), (-0.2, 0.1), (-0.2, -0.1))))


@pytest.mark.parametrize(
    ("arena", "ends"),
    [
        ({"half_planes": [{"point": [0.0, 0.0], "normal": [0.0, 1.0]}]}, (-0.2, 0.2)),
        ({"walls": [{"start": [-5.0, 0.0], "end": [5.0, 0.0]}]}, (-0.2, 0.2)),
        ({"walls": [{"start": [0.05, 0.0], "end": [5.0, 0.0]}]}, (0.05, 0.2)),
        ({"walls": [{"start": [-0.1, -0.1], "end": [0.15, -0.1], "thickness": 0.2}]}, (-0.1, 0.15)),
        ({"polygons": [{"corners": [[-1.0, -1.0], [-0.03, -1.0], [-0.03, 0.0], [-1.0, 0.0]]}]}, (-0.2, -0.03)),
        ({"polygons": [{"corners": [[0.0, -1.0], [0.07, 0.0], [-0.2, -0.5]]}]}, (0.07, 0.07)),
        ({"pillars": [{"centre": [0.1, -0.3], "radius": 0.3}]}, (0.1, 0.1)),
    ],
)
def test_flush_edges_touch_along_the_line_that_they_share(arena, ends):
    """A rectangle that stands with its lower edge on the x-axis."""
    obstacles, _ = pack([read_arena(arena)])
    pose = ((0.0, 0.1), (1.0, 0.0))
    apart = separation(*pose, RECTANGLE, obstacles, 0)
    assert_allclose(apart, (0.0, 0.0, 1.0), rtol=0.0, atol=ROUNDING)
    points: Array = np.array(contact_points(*pose, apart, RECTANGLE, obstacles, 0))
    assert_allclose(np.sort(points, axis=0), [[ends[0], -0.1], [ends[1], -0.1]], rtol=0.0, atol=ROUNDING)


@pytest.mark.parametrize("gap", [-0.02, 0.0, 0.04])
@pytest.mark.parametrize("hull", [RECTANGLE, hull_from(Outline((), ((0.0, 0.0),), 0.1))], ids=["rectangle", "disc"])
def test_contact_points_lie_halfway_between_the_surfaces(hull, gap):
    """(O4): of a robot whose lowest points are 0.1 m below C, above a pillar, sunk into it, or before touching it."""
    obstacles, _ = pack([read_arena({"pillars": [{"centre": [0.0, -0.3], "radius": 0.3}]})])
    pose = ((0.0, 0.1 + gap), (1.0, 0.0))
    apart = separation(*pose, hull, obstacles, 0)
    points = contact_points(*pose, apart, hull, obstacles, 0)
    assert_allclose(points, [[0.0, -0.1 - 0.5 * gap]] * 2, rtol=0.0, atol=ROUNDING)


def measured(position, heading, hull, obstacles, k):
    """All numbers of a pose and an obstacle."""
    apart = separation(position, heading, hull, obstacles, k)
    (ax, ay), (bx, by) = contact_points(position, heading, apart, hull, obstacles, k)
    return apart.gap, apart.nx, apart.ny, ax, ay, bx, by


compiled_measured = numba.njit(error_model="numpy")(measured)


@pytest.mark.parametrize("hull", [HULLS["disc"], HULLS["polygon"]], ids=["disc", "polygon"])
def test_numbers_arrays_tensors_and_compiled_code_agree(hull):
    """The same source in strict arithmetic; compilers may round a root's argument otherwise, once."""
    obstacles = everything()
    listed = Obstacles(*(part.tolist() for part in obstacles[:4]), *obstacles[4:])
    plain = Hull(hull.faces.tolist(), hull.corners.tolist(), hull.radius, hull.reach)
    (x, y), (c, s) = random_poses(6, 30)
    tensors = tuple(torch.tensor(part) for part in (x, y, c, s))
    for k in range(len(obstacles.spans)):
        arrays = np.stack(measured((x, y), (c, s), hull, obstacles, k), -1)
        of_tensors = torch.stack(measured(tensors[:2], tensors[2:], plain, listed, k), -1)
        assert_allclose(of_tensors, arrays, rtol=0.0, atol=1e-14)  # some roundings of numbers of order 1
        for i in range(30):
            pose = (float(x[i]), float(y[i])), (float(c[i]), float(s[i]))
            assert measured(*pose, plain, listed, k) == tuple(arrays[i])
            assert_allclose(compiled_measured(*pose, hull, obstacles, k), arrays[i], rtol=0.0, atol=1e-14)


def test_clearance_is_the_least_gap_of_a_span():
    obstacles, hull = everything(), HULLS["polygon"]
    position, heading = random_poses(7, 30)
    gaps = np.stack([separation(position, heading, hull, obstacles, k).gap for k in range(len(obstacles.spans))])
    assert_array_equal(clearance(position, heading, hull, obstacles, 3, 11), gaps[3:11].min(0))


def test_nothing_is_near_where_there_is_nothing():
    nothing, _ = pack([read_arena(None)])
    position, heading = random_poses(8, 5)
    assert (clearance(position, heading, HULLS["disc"], nothing, 0, 0) > 1e8).all()
