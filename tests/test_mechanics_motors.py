"""(M1) to (M4): motors and the gear between them and the joints."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.arrays import Array
from caster_gym.mechanics.integration import rk4_step
from caster_gym.mechanics.motors import joint_torques, motor_ranges, motor_speeds, motor_torques, torque_range
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.plant import driven_step
from caster_gym.shipped_files import names_of
from tests.random_robots import random_robot
from tests.walks import floats, state_of, steering_of


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


@pytest.mark.parametrize("name", names_of("robots"))
def test_power_is_the_mean_of_torque_times_speed(name):
    """(M2): against eighty fine steps under the same torques; off by the second order of the time step."""
    robot = load_robot(name)
    parameters, model, rng = robot_parameters(robot), Model(robot), np.random.default_rng(5)
    gears = np.array([caster.gear for caster in robot.casters])

    def speeds(state):
        _, rolling, steering = model.rates(steering_of(state), np.array(state.twist))
        return np.einsum("nij,nj->ni", gears, np.stack((rolling, steering), -1))

    errors, sizes = [], []
    for _ in range(10):
        angles = rng.uniform(-np.pi, np.pi, robot.caster_count)
        state = floats(state_of(0.0, 0.0, 0.0, rng.uniform(-0.7, 0.7, 2), rng.uniform(-1.0, 1.0), angles))
        commands = tuple(map(tuple, rng.uniform(-1.0, 1.0, (robot.caster_count, 2)).tolist()))
        for h in (4e-3, 2e-3):
            _, drive = driven_step(state, commands, (0.0, 0.0, 0.0), h, parameters)
            torques: Array = np.array(drive.torques)
            now, powers = state, []
            at_joints = tuple(map(tuple, np.einsum("nij,ni->nj", gears, torques).tolist()))
            for _ in range(40):
                middle = rk4_step(now, at_joints, (0.0, 0.0, 0.0), h / 80, parameters)
                powers.append((torques * speeds(middle)).sum())
                now = rk4_step(middle, at_joints, (0.0, 0.0, 0.0), h / 80, parameters)
            errors.append(drive.power - np.mean(powers))
            sizes.append(np.abs(torques * speeds(state)).sum())
    coarse, fine = np.abs(errors[::2]), np.abs(errors[1::2])
    assert (coarse < 0.01 * np.array(sizes[::2])).all()
    assert np.median(coarse / fine) == pytest.approx(4.0, rel=0.1)  # a half step leaves a quarter, to leading order
