"""caster_gym.identification.shooting: windows of a recording, their prediction, and its derivatives."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.identification.recording import record
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.unknowns import UNITS, robot_with, value_of
from caster_gym.robot import load_robot
from tests.random_robots import random_robot

STEP = 1e-6  # of central differences: truncation of about 1e-12 times third derivatives, rounding of about 1e-9


@pytest.mark.parametrize(
    ("robot", "seconds"),
    [(random_robot(1, 2), 0.2), pytest.param(load_robot("tidybot2"), 0.1, marks=pytest.mark.slow)],
    ids=["random", "tidybot2"],
)
def test_the_derivatives_are_those_of_central_differences(robot, seconds):
    names = tuple(UNITS)
    recording = record(robot, 0.6, 0.02, seed=1, with_rolling=True)
    shooting = Shooting(robot, recording, names, {}, seconds)
    values = np.array([value_of(robot, name) for name in names])
    values[:4] = 1.0, 0.05, -0.02, 0.03
    values[names.index("torque_delay")], values[names.index("motor_lag")] = 0.0037, 0.03  # away from kinks
    starts = shooting.first_guess(values)
    by_start, by_value = shooting.derivatives(shooting.predict(starts, values), values)

    def difference(d_starts, d_values):
        ahead = shooting.predict(starts + d_starts, values + d_values)
        behind = shooting.predict(starts - d_starts, values - d_values)
        later, earlier = (
            shooting.at_samples(*one) for one in ((ahead, values + d_values), (behind, values - d_values))
        )
        return (later - earlier) / (2.0 * STEP)

    def check(found, expected, atol):
        size = np.abs(expected).max()
        state = 6 + robot.caster_count
        assert_allclose(found[..., :state], expected[..., :state], rtol=1e-5, atol=atol * size)
        # the wheels' angles are integrals by Hermite's rule, their derivatives by the trapezoidal rule
        assert_allclose(found[..., state:], expected[..., state:], rtol=0.0, atol=0.02 * size)

    for k, direction in enumerate(np.eye(starts.shape[1])):
        check(by_start[..., k], difference(STEP * direction, 0.0), 1e-6)
    for k, direction in enumerate(np.eye(len(names))):
        check(by_value[..., k], difference(0.0, STEP * direction), 1e-5)


def test_windows_hold_every_sample_once_and_leave_fewer_than_there_are_windows():
    robot = random_robot(0, 2)
    recording = record(robot, 1.0, 0.02, seed=0)
    for seconds in (0.1, 0.17, 0.4, 5.0):
        shooting = Shooting(robot, recording, (), {}, seconds)
        rows = shooting.measured.reshape(-1, shooting.measured.shape[-1])
        assert_allclose(rows, recording.measured[: len(rows)], rtol=0.0)
        assert len(recording.pose) - len(rows) < shooting.count
        assert shooting.length >= min(round(seconds / 0.02) + 1, 51)


def test_the_robot_of_a_recording_predicts_it_and_turns_do_not_count():
    robot = robot_with(load_robot("chung2008"), {"payload_mass": 1.0, "payload_x": 0.02})
    recording = record(robot, 1.0, 0.02, seed=2)
    recording.pose[30:, 2] += 2.0 * np.pi
    recording.steering[20:, 1] -= 4.0 * np.pi
    shooting = Shooting(load_robot("chung2008"), recording, ("payload_mass",), {"payload_x": 0.02}, 0.3)
    values = np.array([1.0])
    path = shooting.predict(shooting.first_guess(values), values)
    errors = shooting.errors(path, values)
    *_, drift = shooting.derivatives_and_drift(path, values, shooting.step_errors(path, values))
    assert np.abs(errors).max() > 1e-4  # of steps that are coarser than those of the recording
    assert_allclose(errors + drift, 0.0, atol=1e-2 * np.abs(errors).max())  # their squares are left out


def test_velocities_are_first_guessed_from_poses():
    robot = load_robot("chung2008")
    recording = record(robot, 1.0, 0.01, seed=2)
    guess = Shooting(robot, replace(recording, twist=None), (), {}, 0.1).first_guess(np.array([]))[1:-1]
    truth = Shooting(robot, recording, (), {}, 0.1).first_guess(np.array([]))[1:-1]
    # a parabola over 7 samples misses h² v''/6 · 7; accelerations change within 0.1 s
    assert_allclose(guess[:, 3:6], truth[:, 3:6], atol=0.05 * np.abs(truth[:, 3:6]).max())
