"""Robots that lift wheels as they drive off."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.analysis.tipping import LiftWarning, least_load, warn_if_lifting
from caster_gym.envs.caster_track import CasterTrackEnv


def standing(name, height):
    robot = load_robot(name)
    return robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": height})})


def test_the_least_load_is_that_of_full_torque_in_the_worst_direction():
    robot = standing("xr4000", 0.12)
    load, wheel, acceleration, direction = least_load(robot)
    model = Model(robot)
    torque = np.zeros((144, 8))
    torque[:, ::2] = 4.27  # N m of every rolling motor, which the gear also turns by half against the steering
    torque[:, 1::2] = -0.5 * 4.27
    torque[72:] *= -1.0  # braking
    angles = np.tile(np.linspace(0.0, 2.0 * np.pi, 72, endpoint=False), 2)
    loads = model.wheel_loads(np.tile(angles[:, None], 4), np.zeros((144, 3)), torque)
    assert_allclose(load, loads.min(), rtol=0.05)  # other directions are tried
    rates = model.forward_dynamics(np.tile(angles[:, None], 4), np.zeros((144, 3)), torque)
    assert_allclose(np.hypot(rates[:, 0], rates[:, 1]).max(), acceleration, rtol=1e-3)  # alike in all directions
    k = loads.min(axis=1).argmin()
    turn = direction - np.arctan2(rates[k, 1], rates[k, 0])
    assert np.cos(4.0 * turn) > 0.9  # the robot looks the same after every quarter turn
    assert 1 <= wheel <= 4


def test_a_floor_that_holds_less_lets_a_robot_lift_less():
    robot = standing("xr4000", 0.35)
    slippery = robot.model_copy(update={"floor_friction": 0.2})
    assert least_load(robot)[0] <= 0.0 < least_load(slippery)[0]
    assert_allclose(least_load(slippery)[2], 0.2 * 9.81, rtol=1e-9)


def test_a_robot_that_lifts_is_warned_of_and_shipped_ones_are_not():
    with pytest.warns(LiftWarning, match=r"'xr4000', .* 0.35 m above the floor, lifts wheel \d .*wheels_lifted"):
        CasterTrackEnv(standing("xr4000", 0.35))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for name in ("chung2008", "tidybot2", "xr4000"):
            warn_if_lifting(load_robot(name))
