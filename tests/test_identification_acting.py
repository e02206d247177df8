"""identification.acting: torques that come late, lag, or are of another strength; angles that are shown askew."""

import numpy as np
from numpy.testing import assert_allclose

from caster_gym.identification.acting import acting_torque, shown_errors
from caster_gym.identification.recording import Recording
from caster_gym.robot import load_robot

ROBOT = load_robot("chung2008")
COUNT, STEP = 12, 0.02
SAID = np.random.default_rng(0).standard_normal((COUNT, 6))
RECORDING = Recording(STEP, np.zeros((COUNT, 3)), np.zeros((COUNT, 3)), SAID)


def test_without_anything_between_torques_are_held():
    assert_allclose(acting_torque(RECORDING, ROBOT, {}, 4), np.repeat(SAID, 4, axis=0), rtol=0.0)


def test_a_delay_of_rows_shifts_and_one_between_mixes_neighbours():
    two = acting_torque(RECORDING, ROBOT, {"torque_delay": 2.0 * STEP}, 1)
    assert_allclose(two, SAID[[0, 0, *range(COUNT - 2)]], atol=1e-12)  # rounding of sums
    early = acting_torque(RECORDING, ROBOT, {"torque_delay": -STEP}, 1)
    assert_allclose(early, SAID[[*range(1, COUNT), COUNT - 1]], atol=1e-12)
    quarter = acting_torque(RECORDING, ROBOT, {"torque_delay": 0.25 * STEP}, 1)
    assert_allclose(quarter[1:], 0.75 * SAID[1:] + 0.25 * SAID[:-1], atol=1e-12)


def test_a_lag_is_the_solution_of_its_differential_equation():
    lag, fine = 0.03, 2000
    h = STEP / fine
    followed = SAID[0].copy()
    means = np.zeros_like(SAID)
    for k in range(COUNT * fine):  # midpoint rule
        wanted = SAID[k // fine]
        half = followed + 0.5 * h * (wanted - followed) / lag
        followed = followed + h * (wanted - half) / lag
        means[k // fine] += half / fine
    assert_allclose(acting_torque(RECORDING, ROBOT, {"motor_lag": lag}, 1), means, atol=1e-6)  # h²/lag²


def test_a_weaker_motor_gives_less_behind_a_gear_too():
    gear = ((1.0, 0.0), (0.5, 2.0))
    casters = tuple(caster.model_copy(update={"gear": gear}) for caster in ROBOT.casters)
    robot = ROBOT.model_copy(update={"casters": casters})
    motors = np.array([1.0, 2.0])
    joints = np.array(gear).T @ motors
    recording = Recording(STEP, np.zeros((1, 3)), np.zeros((1, 3)), np.tile(joints, 3)[None])
    acting = acting_torque(recording, robot, {"roll_strength": 0.5, "steer_strength_2": 3.0}, 1)[0]
    assert_allclose(acting[:2], np.array(gear).T @ (motors * [0.5, 1.0]), rtol=1e-12)
    assert_allclose(acting[2:4], np.array(gear).T @ (motors * [0.5, 3.0]), rtol=1e-12)


def test_what_sensors_show_is_counted_by_component():
    values = {"heading_zero": 0.1, "vy_bias": 0.2, "steering_zero": 0.3, "steering_zero_2": 0.4}
    assert_allclose(shown_errors(ROBOT, values, 9), [0, 0, 0.1, 0, 0.2, 0, 0.3, 0.4, 0.3], rtol=0.0)
