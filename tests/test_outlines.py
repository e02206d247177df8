"""caster_gym.outlines: faces of convex polygons, and how far they reach."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.outlines import Outline, convex


def test_faces_of_an_outline_pass_through_its_corners_and_have_all_others_behind():
    angles = np.sort(np.random.default_rng(2).uniform(0.0, 2.0 * np.pi, 7))
    corners = np.stack([2.0 * np.cos(angles) + 1.0, np.sin(angles)], -1)
    faces = np.array(convex(tuple(map(tuple, corners))).faces)
    assert_allclose(np.hypot(*faces[:, :2].T), 1.0, rtol=1e-14)
    behind = faces[:, 2] - corners @ faces[:, :2].T  # (corner, face)
    on_face = np.eye(7, dtype=bool) | np.roll(np.eye(7, dtype=bool), 1, axis=0)
    assert_allclose(behind[on_face], 0.0, atol=1e-14)  # rounding of numbers of order 1
    assert (behind[~on_face] > 0.0).all()


def test_an_outline_reaches_as_far_as_its_farthest_corner_and_the_radius_around_it():
    assert Outline((), ((3.0, 4.0), (1.0, 0.0)), 0.5).reach == pytest.approx(5.5, rel=1e-15)
