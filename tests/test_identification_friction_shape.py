"""identification.friction_shape: shapes are what (H1) says, and factors are believed as far as data ask for it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.integrate import quad

from caster_gym.engines.numpy_model import Model
from caster_gym.identification.friction_shape import Shapes, likeliest_deviations
from caster_gym.identification.recording import record
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.unknowns import robot_with
from caster_gym.robot import load_robot

ROBOT = robot_with(load_robot("chung2008"), {"roll_coulomb": 4e-3})


def test_slow_shapes_fade_out_and_fast_ones_begin_late():
    shapes = Shapes(ROBOT)
    own = np.eye(len(shapes.units))
    for factor, group in zip(own, shapes.groups, strict=True):
        joint, fast = divmod(int(group), 2)
        early, late = np.abs(shapes.torque(joint, np.array([0.05, 60.0]), factor)) / (shapes.units @ factor)
        # slow shapes end below 3.2 rad/s, fast ones begin beyond it: 0.05 / 10 and (3.2 / 60)² / 2 are left
        assert (early < 6e-3) if fast else (late < 2e-3)


def test_means_over_a_step_are_those_of_an_integral():
    """(H3)"""
    shapes = Shapes(ROBOT)
    factors = np.random.default_rng(0).normal(size=len(shapes.units))
    half = len(factors) // 2
    for before, after in ((-0.4, 0.7), (2.0, 2.0), (0.0, 30.0)):
        mean = shapes._means(np.array(before), np.array(after)) @ (shapes.units * factors)[:half]
        expected = shapes.torque(0, np.array(before), factors)
        if after > before:
            integral = quad(lambda rate: shapes.torque(0, np.array(rate), factors), before, after, points=[0.0])[0]
            expected = integral / (after - before)
        assert_allclose(mean, expected, rtol=1e-6)  # of the quadrature


def test_all_slow_shapes_together_push_as_dry_friction_that_is_sharper():
    """Neighbours cancel in their sum: what is left is friction of the sharpest rate less that of the bluntest."""
    robot = ROBOT.model_copy(update={"coulomb_speed": 0.1})
    recording = record(robot, 0.6, 0.02, seed=1)
    shooting = Shooting(robot, recording, ("payload_mass",), {}, 0.3)
    values = np.array([0.5])
    path = shooting.predict(shooting.first_guess(values), values)
    shapes = Shapes(robot)
    pushes = shapes.pushes(shooting, path, values)
    sum_of_slow = np.flatnonzero(shapes.groups == 0)
    torque = pushes[..., sum_of_slow].sum(axis=-1)[..., ::2]
    rates = Model(robot).rates(path[..., 6:], path[..., 3:6])[1]
    middle = 0.5 * (rates[:, 1:] + rates[:, :-1])
    sharp, blunt = (middle / np.hypot(middle, speed) for speed in (0.01, 10.0**0.5))
    # rates hardly change within a step but where they pass through zero
    even = np.abs(np.diff(rates, axis=1)) < 0.2 * np.abs(middle)
    assert even.mean() > 0.5
    assert_allclose(torque[even], -shapes.units[0] * (sharp - blunt)[even], rtol=0.02, atol=1e-4 * shapes.units[0])


@pytest.mark.parametrize(("true", "gains"), [((0.0, 0.0, 0.0, 0.0), False), ((0.3, 0.0, 0.0, 0.02), True)])
def test_deviations_are_those_that_data_were_drawn_with(true, gains):
    """(H2): factors drawn from a normal distribution, measured with noise of one, are found within their scatter."""
    rng, groups = np.random.default_rng(3), np.repeat(np.arange(4), 40)
    columns = rng.normal(size=(4000, len(groups))) * 3.0
    factors = rng.normal(size=len(groups)) * np.array(true)[groups]
    information = columns.T @ columns
    pull = columns.T @ (columns @ factors + rng.normal(size=4000))
    found = likeliest_deviations(information, pull, groups, np.zeros(4))
    for group, deviation in enumerate(true):
        own = found.deviations[groups == group][0]
        # a geometric grid of ratio 1.8, and 40 draws tell their scatter to 11 %
        assert own == pytest.approx(deviation, rel=0.6, abs=0.005)
        assert (found.gains[group] > 3.0) == (deviation > 0.0)
    assert (found.gains > 3.0).any() == gains


def test_the_least_deviations_are_kept():
    least = np.array([0.1, 0.0, 0.2, 0.0])
    found = likeliest_deviations(np.eye(4), np.zeros(4), np.arange(4), least)
    assert_allclose(found.deviations, least)
    assert_allclose(found.gains, 0.0)


def test_slow_shapes_are_as_unsure_as_dry_friction_is_large():
    shooting = Shooting(ROBOT, record(ROBOT, 0.6, 0.02, seed=1), ("steer_coulomb",), {}, 0.3)
    shapes = Shapes(ROBOT)
    roll, _, steer, _ = shapes.least(shooting, np.array([1e-3]))
    # half of the dry friction, in units of a tenth of the motors' torques of 0.2 and 0.1 N m
    assert_allclose((roll, steer), (0.5 * 4e-3 / 0.02, 0.5 * 1e-3 / 0.01))
    assert_allclose(shapes.least(shooting, np.array([-1e-3]))[2], 0.0)
