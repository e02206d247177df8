"""Robots that lift wheels as they drive off."""

import re
import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.analysis.tipping import LiftWarning, least_load, warn_if_lifting
from caster_gym.shipped_files import names_of
from caster_gym.tasks.track.environment import CasterTrackEnv


def standing(name, height):
    robot = load_robot(name)
    return robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": height})})


def test_the_least_load_is_that_of_full_torque_in_the_worst_direction():
    robot = standing("xr4000", 0.12)
    load, wheel, acceleration, direction, *_ = least_load(robot)
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
        for name in names_of("robots"):
            warn_if_lifting(load_robot(name))


@pytest.mark.parametrize(("name", "height"), [("chung2008", 0.12), ("chung2008", 0.3), ("xr4000", 0.35)])
def test_what_the_warning_says_lifts_that_wheel(name, height):
    """Casters as it says, and all rolling motors forwards or backwards: that wheel loses its load, at that rate."""
    robot = standing(name, height)
    robot = robot.model_copy(update={"floor_friction": 5.0})  # holds all that the motors give
    with pytest.warns(LiftWarning) as caught:
        warn_if_lifting(robot)
    told = str(caught[0].message)
    found = re.search(
        r"lifts wheel (\d) when it (drives off|brakes while driving) along (-?\d+)° .* by (\S+) m/s²", told
    )
    assert found is not None, told
    model, n = Model(robot), robot.caster_count
    torque = np.zeros(2 * n)
    for i, caster in enumerate(robot.casters):
        pull = caster.roll.max_torque * (1.0 if found[2] == "drives off" else -1.0)
        torque[2 * i : 2 * i + 2] = pull * np.array(caster.gear[0])  # a motor's torque on the joints that it turns
    steering = np.full(n, np.radians(float(found[3])))
    assert (
        model.wheel_loads(steering, np.zeros(3), torque)[int(found[1]) - 1] < 0.02 * model.wheel_loads(steering).sum()
    )
    rate = model.forward_dynamics(steering, np.zeros(3), torque)
    assert_allclose(np.hypot(rate[0], rate[1]), float(found[4]), rtol=0.06)  # two digits


@pytest.mark.parametrize("friction", [0.1, None])
def test_a_rough_patch_lets_a_robot_lift(friction):
    """A floor as smooth as ice with a rough patch: the robot lifts a wheel there."""
    robot = standing("chung2008", 0.12).model_copy(update={"floor_friction": 0.1})
    smooth = {"friction": friction, "patches": [{"x": 0.0, "y": 0.0, "radius": 50.0, "friction": 0.05}]}
    with warnings.catch_warnings():
        warnings.simplefilter("error", LiftWarning)
        CasterTrackEnv(robot, floor=smooth)
    rough = {**smooth, "patches": [*smooth["patches"], {"x": 0.0, "y": 0.0, "radius": 50.0, "friction": 2.0}]}
    with pytest.warns(LiftWarning, match="lifts wheel"):
        CasterTrackEnv(robot, floor=rough)
