"""(I3) to (I5): slopes of friction and of motors, how fast casters turn; against differences and by hand."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.motors import joint_torques, motor_ranges, motor_speeds
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.stability import (
    UNBOUNDED,
    caster_damping,
    caster_falloff,
    caster_top_speed,
    caster_turning,
    geared_speed,
)
from tests.random_robots import random_robot

SMALL = 1e-5  # of a twist, for differences; dry friction bends within 0.1 rad/s


def matrix(packed):
    xx, xy, xz, yy, yz, zz = packed
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


@pytest.mark.parametrize("seed", range(3))
def test_damping_is_the_slope_of_friction_at_rest(seed):
    """(I3)"""
    robot = random_robot(seed, 3)
    angles = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    ours = sum(
        matrix(caster_damping(robot.coulomb_speed, (np.cos(a), np.sin(a)), caster))
        for a, caster in zip(angles, robot_parameters(robot).casters, strict=True)
    )
    model = Model(robot)
    slopes = [model.friction(angles, SMALL * axis) / SMALL for axis in np.eye(3)]
    # rates of 1e-5 / trail bend the law by (rate / 0.1)² / 2, under 1e-5 here
    assert_allclose(ours, np.array(slopes).T, rtol=1e-5, atol=1e-5 * np.abs(ours).max())


@pytest.mark.parametrize("seed", range(3))
def test_falloff_is_the_slope_of_full_torque(seed):
    """(I4): what full commands give at the joints, from rest to a small twist."""
    robot = random_robot(seed, 3)
    angles = np.random.default_rng(seed).uniform(-3.0, 3.0, 3)
    casters = robot_parameters(robot).casters
    ours = sum(
        matrix(caster_falloff((np.cos(a), np.sin(a)), caster)) for a, caster in zip(angles, casters, strict=True)
    )
    model = Model(robot)
    rows = model.jacobian(angles)

    def lost(twist):
        _, rolling, turning = model.rates(angles, twist)
        torques: list[float] = []
        for i, caster in enumerate(casters):
            speeds = motor_speeds((rolling[i], turning[i]), caster)
            chosen = [r[1] if s >= 0.0 else r[0] for r, s in zip(motor_ranges(speeds, caster), speeds, strict=True)]
            greatest = caster.roll_max_torque, caster.steer_max_torque
            full = [t if s >= 0.0 else -t for t, s in zip(greatest, speeds, strict=True)]
            torques += joint_torques((full[0] - chosen[0], full[1] - chosen[1]), caster)
        return rows.T @ np.array(torques)

    slopes = [lost(SMALL * axis) / SMALL for axis in np.eye(3)]
    assert_allclose(ours, np.array(slopes).T, rtol=1e-8, atol=1e-8 * np.abs(ours).max())  # linear but for rounding


def test_motors_that_are_not_driven_have_no_falloff():
    robot = load_robot("chung2008").with_actuation(["roll_1"])
    driven, idle, _ = robot_parameters(robot).casters
    assert np.linalg.matrix_rank(matrix(caster_falloff((0.6, 0.8), driven))) == 1
    assert not matrix(caster_falloff((0.6, 0.8), idle)).any()


def test_gears_divide_the_speed_of_wheels():
    """(I5)"""
    robot = random_robot(4, 3)
    for caster, numbers in zip(robot.casters, robot_parameters(robot).casters, strict=True):
        (rr, _), (sr, ss) = caster.gear
        slower = min(caster.roll.max_speed / rr, caster.steer.max_speed / abs(sr))
        assert caster.top_speed == pytest.approx(caster.radius * slower, rel=1e-12)
        assert caster_top_speed(numbers) == pytest.approx(caster.top_speed, rel=1e-12)
        by_motor = caster.steer.max_speed / ss
        assert caster_turning(0.0, numbers) == pytest.approx(by_motor, rel=1e-12)
        assert caster_turning(1e3, numbers) == pytest.approx(1e3 / caster.trail, rel=1e-12)
        idle = numbers._replace(steer_active=0.0)
        assert caster_turning(0.5, idle) == pytest.approx(0.5 / caster.trail, rel=1e-12)
    assert geared_speed(3.0, 0.0) == UNBOUNDED
