"""caster_gym.engines.free_wheels: time steps that follow wheels without grip."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.engines.free_wheels import check_free_wheels, free_rates
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.shipped_files import names_of
from tests.random_robots import random_robot


def rows(*robots):
    return np.array([pack_parameters(robot_parameters(robot)) for robot in robots])


def with_wheels(robot, inertia):
    casters = tuple(
        caster.model_copy(update={"wheel": caster.wheel.model_copy(update={"spin_inertia": inertia})})
        for caster in robot.casters
    )
    return robot.model_copy(update={"casters": casters})


def test_the_rate_of_a_wheel_on_its_own_axle_is_that_of_a_hand_calculation():
    """chung2008, whose motors turn one joint each: torque over inertia and top speed, of its rolling joint."""
    robot = load_robot("chung2008")
    caster = robot.casters[0]
    rate = caster.roll.max_torque / (caster.roll.max_speed * (caster.wheel.spin_inertia + caster.roll.rotor))
    assert_allclose(free_rates(rows(robot)), rate, rtol=1e-12)


def test_rates_are_those_of_the_eigenvalues():
    """Of coupled joints, against NumPy's, of matrices put together from the robot's own file."""
    for robot in [load_robot("tidybot2"), load_robot("xr4000"), *(random_robot(seed, 3) for seed in range(20))]:
        for i, caster in enumerate(robot.casters):
            wheel, link, gear = caster.wheel, caster.link, np.array(caster.gear)
            yaw = wheel.yaw_inertia + wheel.mass * (caster.trail**2 + caster.offset**2)
            yaw += link.inertia + link.mass * (link.com[0] ** 2 + link.com[1] ** 2)
            inertia = np.diag([wheel.spin_inertia + caster.roll.armature, yaw + caster.steer.armature])
            inertia = inertia + gear.T @ np.diag([caster.roll.rotor, caster.steer.rotor]) @ gear
            names = f"roll_{i + 1}", f"steer_{i + 1}"
            slopes = [
                motor.max_torque / motor.max_speed * (name in robot.driven)
                for motor, name in zip((caster.roll, caster.steer), names, strict=True)
            ]
            rates = np.linalg.eigvals(np.linalg.solve(inertia, gear.T @ np.diag(slopes) @ gear)).real
            assert_allclose(free_rates(rows(robot))[0, i], max(rates), rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("name", names_of("robots"))
def test_the_tasks_steps_follow_the_robots_that_come_with_the_package(name):
    check_free_wheels(name, rows(load_robot(name)), 0.01, 2)


def test_a_step_that_throws_light_wheels_beyond_their_top_speed_is_refused_with_one_that_does_not():
    light = rows(load_robot("chung2008"), with_wheels(load_robot("chung2008"), 1e-6))
    with pytest.raises(
        ValueError, match=r"caster 1 to its top speed in 0.0005 s.*'substeps' of 80 would suffice"
    ) as told:
        check_free_wheels("these", light, 0.005, 4)
    assert "at most 0.00025 s" in str(told.value)
    check_free_wheels("these", light, 0.02 / 80, 80)
    lightest = rows(with_wheels(load_robot("chung2008"), 1e-9))
    with pytest.raises(ValueError, match="more than a task may have; give the wheels more inertia, or let the floor"):
        check_free_wheels("these", lightest, 0.005, 4)
