"""caster_gym.identification.recording: files of recordings, and recordings from the simulator."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.engines.numpy_model import Model
from caster_gym.identification.recording import KINDS, Noise, record, write_recording
from caster_gym.identification.recording_table import read_recording
from caster_gym.robot import load_robot
from tests.random_robots import random_robot

ROBOT = load_robot("chung2008")
GEARED = load_robot("tidybot2")


@pytest.fixture(scope="module")
def shaken():
    return record(ROBOT, 0.5, 0.02, seed=1)


def reread(folder, lines, robot=ROBOT):
    (folder / "changed.csv").write_text("\n".join(lines) + "\n")
    return read_recording(folder / "changed.csv", robot)


@pytest.mark.parametrize("with_twist", [True, False])
def test_a_recording_comes_back_from_its_file(shaken, tmp_path, with_twist):
    recording = shaken if with_twist else replace(shaken, twist=None)
    write_recording(tmp_path / "run.csv", recording)
    back = read_recording(tmp_path / "run.csv", ROBOT)
    assert back.time_step == pytest.approx(0.02, rel=1e-9)
    for name in ("pose", "steering", "torque", "twist"):
        if getattr(recording, name) is None:
            assert getattr(back, name) is None
        else:
            assert_allclose(getattr(back, name), getattr(recording, name), rtol=1e-9, atol=1e-12)  # ten digits written


def test_each_sample_follows_from_the_one_before_under_its_torque(shaken):
    states = np.concatenate([shaken.pose, shaken.twist, shaken.steering], axis=1)
    after = Model(ROBOT).simulate(states[:-1], shaken.torque[:-1], 0.005, 4)[-1]
    # the recording was made with steps twice as long: RK4's error there, of motions of about 1 m/s and 10 rad/s
    assert_allclose(after, states[1:], atol=1e-4)


def test_only_driven_joints_push_and_none_beyond_its_limit():
    joints = ("roll_1", "steer_1", "roll_2", "steer_2")
    torque = record(ROBOT.with_actuation(joints), 1.0, 0.02, seed=2, share=2.0).torque
    assert_array_equal(torque[:, 4:], 0.0)
    limits = np.array([0.2, 0.1, 0.2, 0.1])
    assert (np.abs(torque[:, :4]) <= limits).all()
    assert (np.abs(torque[:, :4]).max(axis=0) == limits).all()  # with twice the force that there is, each reaches it


@pytest.mark.slow
def test_noise_has_the_size_that_was_asked_for_in_each_kind():
    recording = record(ROBOT, 10.0, 0.02, seed=0, with_rolling=True)
    sizes = {"position": 0.1, "heading": 0.2, "velocity": 0.3, "yaw_rate": 0.4, "steering": 0.5, "rolling": 0.6}
    errors = recording.noisy(Noise(**sizes), np.random.default_rng(0)).measured - recording.measured
    expected = [sizes[recording.kinds[i]] for i in recording.observed]
    assert_allclose(errors.std(axis=0), expected, rtol=0.15)  # 501 samples: four standard deviations are 13 %
    assert_array_equal(recording.noisy(Noise(), np.random.default_rng(0)).measured, recording.measured)
    assert set(recording.kinds) == set(KINDS)


def test_motor_torques_reach_the_joints_through_the_gear_with_the_same_power(tmp_path):
    """Power is the same on both sides: torque at the joints times their rates, at the motors times gear · rates."""
    recording = record(GEARED, 0.3, 0.02, seed=1)
    write_recording(tmp_path / "run.csv", recording)
    lines = (tmp_path / "run.csv").read_text().replace("torque_", "motor_").splitlines()
    at_joints = reread(tmp_path, lines, GEARED).torque
    rates = np.random.default_rng(0).normal(size=at_joints.shape)
    gear = np.kron(np.eye(4), np.array(GEARED.casters[0].gear))
    assert_allclose((at_joints * rates).sum(axis=1), (recording.torque * (rates @ gear.T)).sum(axis=1), rtol=1e-8)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file .*none\.csv"):
        read_recording(tmp_path / "none.csv", ROBOT)


def test_a_recording_too_short_is_refused():
    with pytest.raises(ValueError, match=r"needs 10 steps or more, got 0\.1 s in steps of 0\.02 s"):
        record(random_robot(0, 2), 0.1, 0.02)
