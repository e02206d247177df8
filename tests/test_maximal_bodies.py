"""scripts.maximal_bodies: bodies held together by multipliers move as Kane's equations say, and friction as its law."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.robot import load_robot
from scripts.maximal_bodies import FrictionLaw, MaximalBodies
from tests.kane import Kane
from tests.random_robots import random_robot


@pytest.mark.parametrize("robot", [load_robot("chung2008"), load_robot("tidybot2"), *map(random_robot, (0, 1), (2, 3))])
def test_accelerations_are_those_of_kanes_equations(robot):
    rng, bodies, kane = np.random.default_rng(0), MaximalBodies(robot), Kane(robot)
    steering = rng.uniform(-np.pi, np.pi, (4, robot.caster_count))
    twist, torque = rng.normal(size=(4, 3)), rng.normal(size=(4, 2 * robot.caster_count))
    found, _ = bodies.accelerations(twist, steering, torque)
    truth = [kane.forward_dynamics(*motion, np.zeros(3)) for motion in zip(steering, twist, torque, strict=True)]
    assert_allclose(found, truth, rtol=1e-10, atol=1e-10)  # rounding, magnified by the condition of 50 equations


def test_a_step_is_of_the_fourth_order():
    bodies, rng = MaximalBodies(load_robot("chung2008")), np.random.default_rng(1)
    start = bodies.at_rest(rng.uniform(-np.pi, np.pi, (5, 3)))
    torque = rng.normal(scale=0.03, size=(5, 6))
    coarse, middle, fine = (bodies.simulate(start, torque, 0.2, steps) for steps in (20, 40, 160))
    errors = [np.abs(one.rolling - fine.rolling).max() for one in (coarse, middle)]
    assert errors[0] / errors[1] == pytest.approx(16.0, rel=0.3)  # 2⁴, and terms of higher order


def test_friction_laws_by_hand():
    rates = np.array([-30.0, -0.05, 0.0, 0.05, 30.0])
    own = FrictionLaw().torque(rates, np.array(2e-4), np.array(4e-3))
    assert_allclose(
        own[3:], [2e-4 * 0.05 + 4e-3 * 0.05 / np.hypot(0.05, 0.1), 2e-4 * 30.0 + 4e-3 * 30.0 / np.hypot(30, 0.1)]
    )
    assert_allclose(own, -own[::-1])
    sharp = FrictionLaw(speed=0.01, sharp=True).torque(rates, np.array(0.0), np.array(4e-3))
    assert_allclose(sharp, 4e-3 * np.array([-1.0, -1.0, 0.0, 1.0, 1.0]), rtol=1e-4)  # tanh 5
    stuck = FrictionLaw(breakaway=0.5).torque(np.array([0.3, 20.0]), np.array(0.0), np.array(4e-3))
    assert_allclose(stuck, [4e-3 * 0.3 / np.hypot(0.3, 0.1) * (1.0 + 0.5 * np.exp(-0.09)), 4e-3], rtol=2e-5)
    bent = FrictionLaw(bend=0.2).torque(np.array([20.0]), np.array(2e-4), np.array(0.0))
    assert_allclose(bent, 1.2 * 2e-4 * 20.0)
