"""caster_gym.render.view: metres and pixels."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.render.view import Area, View, extent, fit_view, grid, round_length, view_around
from tests.scenes import CIRCLE, obstacles, scene

AREA = Area(40.0, 10.0, 300.0, 200.0)


def test_y_points_up():
    view = View(AREA, x=1.0, y=2.0, scale=50.0)
    assert_allclose(view.pixels([1.0, 2.0]), AREA.centre, rtol=0, atol=0)
    assert_allclose(view.pixels([2.0, 3.0]), np.add(AREA.centre, (50.0, -50.0)), rtol=0, atol=1e-12)


def test_metres_undo_pixels():
    view = View(AREA, x=-3.0, y=0.4, scale=123.0)
    points = np.random.default_rng(0).normal(size=(20, 2))
    assert_allclose(view.metres(view.pixels(points)), points, rtol=0, atol=1e-14)  # a few roundings of numbers near 1


@pytest.mark.parametrize(("low", "high"), [((0, 0), (6, 1)), ((-1, -5), (0, 5)), ((2, 2), (2, 2))])
def test_what_is_fitted_lies_in_the_area_and_touches_its_edge(low, high):
    corners = fit_view(low, high, AREA).pixels([low, high])
    assert (corners.min(axis=0) >= np.array([AREA.left, AREA.top]) - 1e-9).all()
    assert (corners.max(axis=0) <= np.array([AREA.left + AREA.width, AREA.top + AREA.height]) + 1e-9).all()
    share = np.ptp(corners, axis=0) / (AREA.width, AREA.height)
    assert max(share) == pytest.approx(1.0) or low == high


def test_a_view_around_a_point_shows_so_many_metres_of_the_shorter_side():
    view = view_around((4.0, 4.0), 0.5, AREA)
    top, bottom = view.metres([(190.0, 10.0), (190.0, 210.0)])
    assert top[1] - bottom[1] == pytest.approx(0.5)
    assert_allclose(view.pixels((4.0, 4.0)), AREA.centre)


def test_the_extent_holds_path_corridor_and_all_obstacles_that_end():
    low, high = extent(scene(obstacles=obstacles(pillars=[(5.0, 0.0, 0.25)], half_planes=[(0.0, 1.0, -40.0)])))
    assert (low <= CIRCLE.min(axis=0) - 0.5).all()
    assert high[1] >= CIRCLE[:, 1].max() + 0.5
    assert high[0] == 5.25
    assert low[1] > -2.0  # the half-plane 40 m away is not shown


@pytest.mark.parametrize("normal", [(0.0, 1.0), (-1.0, 0.0), (0.6, -0.8)])
def test_the_edge_of_a_near_half_plane_is_shown(normal):
    """A point of its edge lies inside, and so does a strip behind it."""
    low, high = extent(scene(obstacles=obstacles(half_planes=[(*normal, -1.9)])))
    corner = np.where(np.array(normal) > 0.0, low, high)
    assert corner @ normal < -1.9 - 0.02 * (high - low).max()
    assert (high - low).max() < 5.0


def test_a_wide_corridor_does_not_make_the_path_small():
    low, high = extent(scene(corridor=1000.0))
    assert (high - low).max() < 2.0 * np.ptp(CIRCLE, axis=0).max()


@pytest.mark.parametrize("count", [1, 2, 3, 5, 7, 9, 12, 16])
def test_cells_of_a_grid_are_equal_and_do_not_overlap(count):
    cells = grid(count, AREA)
    assert len(cells) == count
    assert len({(cell.width, cell.height) for cell in cells}) == 1
    inside = [(x + 0.5, y + 0.5) for x in range(40, 340) for y in range(10, 210)]
    owners = [
        sum(c.left <= x < c.left + c.width and c.top <= y < c.top + c.height for c in cells) for x, y in inside[::37]
    ]
    assert max(owners) == 1
    assert [(cell.top, cell.left) for cell in cells] == sorted((cell.top, cell.left) for cell in cells)


def test_a_grid_wastes_no_row():
    assert len({cell.top for cell in grid(9, Area(0.0, 0.0, 960.0, 640.0))}) == 3
    assert len({cell.top for cell in grid(2, Area(0.0, 0.0, 960.0, 640.0))}) == 1


@pytest.mark.parametrize(("longest", "length"), [(0.99, 0.5), (1.0, 1.0), (4.9, 2.0), (0.0499, 0.02), (730.0, 500.0)])
def test_round_lengths(longest, length):
    assert round_length(longest) == pytest.approx(length)
