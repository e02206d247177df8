"""caster_gym.engines.native.driven: what a controller foresees is what the simulator does."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.engines.native.driven import DrivenRobots
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import load_robot

ROBOT = load_robot("chung2008")
PERIOD = 0.02
COUNT = 20  # more than one call moves together


@pytest.fixture(scope="module")
def driven():
    return DrivenRobots(ROBOT, robot_parameters(ROBOT), PERIOD)


def states(rng):
    """Slow robots, whose motors give what they are asked for."""
    angles = rng.uniform(-np.pi, np.pi, (COUNT, 4))
    pairs = np.stack([np.cos(angles), np.sin(angles)], axis=2)
    parts = rng.uniform(-1.0, 1.0, (COUNT, 2)), pairs[:, 0], rng.uniform(-0.1, 0.1, (COUNT, 3))
    return np.concatenate([*parts, pairs[:, 1:].reshape(COUNT, -1)], axis=1)


def test_robots_move_as_a_fleet_does_under_the_same_torques(driven):
    """To the last bit: with shares of the greatest torque small enough for the motors' speeds."""
    rng = np.random.default_rng(0)
    start, shares = states(rng), rng.uniform(-0.3, 0.3, (COUNT, 6))
    fleet = Fleet(ROBOT, COUNT)
    fleet.state = start
    fleet.step(shares * ROBOT.max_torques, PERIOD / 4, 4)  # steps of at most 5 ms
    after = driven.after(start, shares, np.zeros((COUNT, 3)))
    assert_array_equal(after, fleet.state)
    alone = [
        driven.after(one[None], share[None], np.zeros((1, 3)))[0] for one, share in zip(start, shares, strict=True)
    ]
    assert_array_equal(alone, after)


def test_wrenches_push_as_the_model_says(driven):
    """(D4): a short time after rest the twist has grown by M⁻¹ w t, here within 1 %, as casters turn meanwhile."""
    rng = np.random.default_rng(1)
    start, wrench = states(rng), rng.uniform(-1.0, 1.0, (COUNT, 3)) * [1.0, 1.0, 0.1]
    start[:, 4:7] = 0.0
    period = 1e-4
    after = DrivenRobots(ROBOT, robot_parameters(ROBOT), period).after(start, np.zeros((COUNT, 6)), wrench)
    steering = np.arctan2(start[:, 8::2], start[:, 7::2])
    rate = Model(ROBOT).forward_dynamics(steering, np.zeros((COUNT, 3)), np.zeros((COUNT, 6)), wrench)
    assert_allclose(after[:, 4:7] / period, rate, rtol=0.01, atol=1e-3 * np.abs(rate).max())


def test_what_does_not_fit_is_refused(driven):
    with pytest.raises(ValueError, match=r"shapes \(2, 13\), \(2, 6\) and \(2, 3\), got \(2, 13\), \(2, 5\) and"):
        driven.after(np.zeros((2, 13)), np.zeros((2, 5)), np.zeros((2, 3)))
    with pytest.raises(ValueError, match=r"period must be positive, got 0\.0"):
        DrivenRobots(ROBOT, robot_parameters(ROBOT), 0.0)
