"""scripts.model_limits: what the model leaves out, in numbers."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from scripts import model_limits
from scripts.model_limits import Row, at_full_torque, creep, lifting_acceleration, off_without, page, rows, step_error

CHUNG = load_robot("chung2008")


def standing(robot, height):
    return robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": height})})


def test_a_wheel_lifts_where_the_tipping_moment_is_that_of_the_weight():
    """A robot whose casters weigh nothing: a · z = g · b, b from the mass centre to the middle of two wheels."""
    bare = standing(CHUNG.without_wheels(), 0.2)
    # the triangle of pivots has its sides 0.05 m from C, and wheels lie 0.025 m behind: a robot that brakes towards a
    # side has 0.025 m to it
    shortest = 0.05 - 0.025
    assert_allclose(lifting_acceleration(bare), 9.81 * shortest / 0.2, rtol=0.02)  # 64 directions are tried


def test_loads_at_rest_are_those_of_a_robot_without_height():
    low = at_full_torque(standing(CHUNG.without_wheels(), 0.0))
    assert_allclose(low[0], low[1], rtol=1e-9)  # the damping of the sharing
    high = at_full_torque(standing(CHUNG, 0.1))
    assert high[0] > 1.05 * high[1]


def test_terms_that_a_robot_lacks_are_not_missed():
    assert off_without(CHUNG, "cross_armature") == (0.0, 0.0)
    median, greatest = off_without(CHUNG, "off_axis")
    assert 1.0 < median < greatest
    assert creep(CHUNG) == 0.0
    assert_allclose(creep(load_robot("xr4000")), 1e3 * 0.055 * 0.1 / np.sqrt(3.0), rtol=1e-12)


def test_the_page_has_a_line_for_each_row_and_a_column_for_each_robot(monkeypatch):
    monkeypatch.setattr(model_limits, "DRAWS", 20)
    monkeypatch.setattr(model_limits, "SECONDS", 0.1)
    found = rows([CHUNG])
    text = page(found, [CHUNG], "python -m scripts.model_limits")
    assert all(isinstance(one, Row) and f"| {one.what} | {one.sizes[0]} | {one.option} |" in text for one in found)
    assert 0.0 <= step_error(CHUNG) < 1.0  # µm


@pytest.mark.parametrize(
    "name", ["chung2008", *(pytest.param(one, marks=pytest.mark.slow) for one in model_limits.ROBOTS[1:])]
)
def test_every_size_is_a_number(name, monkeypatch):
    monkeypatch.setattr(model_limits, "DRAWS", 20)
    monkeypatch.setattr(model_limits, "SECONDS", 0.1)
    for one in rows([load_robot(name)]):
        assert "nan" not in one.sizes[0]
