"""(M1) to (M3): motors and the gear between them and the joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.mechanics.motors import joint_torques, motor_ranges, motor_speeds, motor_torques, torque_range
from caster_gym.mechanics.parameters import robot_parameters
from tests.random_robots import random_robot


@pytest.fixture
def caster():
    return robot_parameters(random_robot(81, 3)).casters[0]


def test_gear_conserves_power(caster):
    """(M1), (M2): motor torque times motor speed is joint torque times joint rate."""
    rng = np.random.default_rng(82)
    rates, torques = tuple(rng.normal(size=(2, 50))), tuple(rng.normal(size=(2, 50)))
    at_motors = sum(np.multiply(motor_speeds(rates, caster), torques))
    at_joints = sum(np.multiply(joint_torques(torques, caster), rates))
    assert_allclose(at_motors, at_joints, rtol=0.0, atol=1e-12 * np.abs(at_motors).max())  # rounding


def test_gear_turns_motors_by_its_matrix(caster):
    """(M1): motor speeds = gear · joint rates, as the robot file states."""
    gear = np.array(random_robot(81, 3).casters[0].gear)
    assert_allclose(motor_speeds((2.0, -3.0), caster), gear @ [2.0, -3.0], rtol=1e-14)
    assert_allclose(joint_torques((2.0, -3.0), caster), gear.T @ [2.0, -3.0], rtol=1e-14)


def test_torque_falls_to_zero_at_top_speed_and_stays_whole_when_braking():
    """(M3)."""
    assert torque_range(0.0, 2.0, 10.0) == (-2.0, 2.0)
    assert torque_range(5.0, 2.0, 10.0) == (-2.0, 1.0)
    assert torque_range(10.0, 2.0, 10.0) == (-2.0, 0.0)
    assert torque_range(25.0, 2.0, 10.0) == (-2.0, 0.0)
    assert torque_range(-5.0, 2.0, 10.0) == (-1.0, 2.0)
    assert torque_range(-25.0, 2.0, 10.0) == (0.0, 2.0)


def test_a_motor_never_drives_beyond_its_top_speed(caster):
    """(M3): the power that a motor gives is bounded by a quarter of greatest torque times top speed."""
    speeds = np.linspace(-3.0, 3.0, 601) * caster.roll_max_speed
    command = np.sign(speeds)
    roll, _ = motor_torques((command, 0.0 * command), (speeds, 0.0 * speeds), caster)
    power = roll * speeds
    assert (power[np.abs(speeds) >= caster.roll_max_speed] <= 0.0).all()
    assert_allclose(power.max(), 0.25 * caster.roll_max_torque * caster.roll_max_speed, rtol=1e-12)


def test_commands_are_shares_of_the_greatest_torque(caster):
    """Half a command gives half the torque, and one beyond 1 no more than all of it."""
    assert_allclose(
        motor_torques((0.5, -0.5), (0.0, 0.0), caster),
        (0.5 * caster.roll_max_torque, -0.5 * caster.steer_max_torque),
        rtol=1e-15,
    )
    assert motor_torques((7.0, -7.0), (0.0, 0.0), caster) == (caster.roll_max_torque, -caster.steer_max_torque)


def test_rotors_have_the_energy_of_their_motors_speeds():
    """(M4): ½ R Ω² of each motor beside ½ J ϑ̇² of what turns with a joint."""
    made = random_robot(81, 2).casters[0]
    for rates in ((2.0, 0.0), (0.0, -3.0), (1.3, 2.1)):
        numbers = robot_parameters(random_robot(81, 2)).casters[0]
        ours = numbers.roll_armature * rates[0] ** 2 + numbers.steer_armature * rates[1] ** 2
        ours += 2.0 * numbers.cross_armature * rates[0] * rates[1]
        theirs = made.roll.armature * rates[0] ** 2 + made.steer.armature * rates[1] ** 2
        for motor, ratios in zip((made.roll, made.steer), made.gear, strict=True):
            theirs += motor.rotor * (ratios[0] * rates[0] + ratios[1] * rates[1]) ** 2
        assert_allclose(ours, theirs, rtol=1e-13)  # rounding


@pytest.mark.parametrize("driven", ["roll_1", "steer_1"])
def test_passive_motors_give_no_torque(driven):
    robot = random_robot(83, 2).with_actuation((driven,))
    for i, caster in enumerate(robot_parameters(robot).casters, start=1):
        roll, steer = motor_torques((1.0, -1.0), (3.0, -4.0), caster)
        assert (roll != 0.0) == (driven == f"roll_{i}")
        assert (steer != 0.0) == (driven == f"steer_{i}")
        for (low, high), torque in zip(motor_ranges((3.0, -4.0), caster), (roll, steer), strict=True):
            assert low <= torque <= high
