"""caster_gym.analysis.recording: files of recordings, and recordings from the simulator."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.analysis.recording import FEWEST_ROWS, KINDS, Noise, read_recording, record, write_recording
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import load_robot
from tests.random_robots import random_robot

ROBOT = load_robot("chung2008")
GEARED = load_robot("tidybot2")


@pytest.fixture(scope="module")
def shaken():
    return record(ROBOT, 0.5, 0.02, seed=1)


@pytest.fixture
def lines(shaken, tmp_path):
    write_recording(tmp_path / "run.csv", shaken)
    return (tmp_path / "run.csv").read_text().splitlines()


def reread(folder, lines, robot=ROBOT):
    (folder / "changed.csv").write_text("\n".join(lines) + "\n")
    return read_recording(folder / "changed.csv", robot)


@pytest.mark.parametrize("with_twist", [True, False])
def test_a_recording_comes_back_from_its_file(shaken, tmp_path, with_twist):
    recording = shaken if with_twist else shaken.without_twist()
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


def test_noise_has_the_size_that_was_asked_for_in_each_kind():
    recording = record(ROBOT, 10.0, 0.02, seed=0, with_rolling=True)
    sizes = {"position": 0.1, "heading": 0.2, "velocity": 0.3, "yaw_rate": 0.4, "steering": 0.5, "rolling": 0.6}
    errors = recording.noisy(Noise(**sizes), np.random.default_rng(0)).measured - recording.measured
    expected = [sizes[recording.kinds[i]] for i in recording.observed]
    assert_allclose(errors.std(axis=0), expected, rtol=0.15)  # 501 samples: four standard deviations are 13 %
    assert_array_equal(recording.noisy(Noise(), np.random.default_rng(0)).measured, recording.measured)
    assert set(recording.kinds) == set(KINDS)


def test_other_units_of_a_file_mean_the_same(shaken, lines, tmp_path):
    header, *rows = (line.split(",") for line in lines)
    other = {"[s]": ("[ms]", 1e3), "[m]": ("[mm]", 1e3), "[rad]": ("[deg]", np.degrees(1.0)), "[m/s]": ("[cm/s]", 1e2),
             "[rad/s]": ("[deg/s]", np.degrees(1.0)), "[N m]": ("[mN m]", 1e3)}  # fmt: skip
    units = [name[name.index("[") :] for name in header]
    changed = [name.replace(unit, other[unit][0]) for name, unit in zip(header, units, strict=True)]
    numbers = [[f"{float(c) * other[u][1]:.15g}" for c, u in zip(row, units, strict=True)] for row in rows]
    back = reread(tmp_path, [",".join(row) for row in (changed, *numbers)])
    assert_allclose(back.measured, shaken.measured, rtol=1e-9, atol=1e-12)
    assert_allclose(back.torque, shaken.torque, rtol=1e-9, atol=1e-12)
    assert back.time_step == pytest.approx(0.02, rel=1e-9)


def test_the_order_of_columns_does_not_matter(shaken, lines, tmp_path):
    back = reread(tmp_path, [",".join(reversed(line.split(","))) for line in lines])
    assert_allclose(back.measured, shaken.measured, rtol=1e-9, atol=1e-12)


def test_motor_torques_reach_the_joints_through_the_gear_with_the_same_power(tmp_path):
    """Power is the same on both sides: torque at the joints times their rates, at the motors times gear · rates."""
    recording = record(GEARED, 0.3, 0.02, seed=1)
    write_recording(tmp_path / "run.csv", recording)
    lines = (tmp_path / "run.csv").read_text().replace("torque_", "motor_").splitlines()
    at_joints = reread(tmp_path, lines, GEARED).torque
    rates = np.random.default_rng(0).normal(size=at_joints.shape)
    gear = np.kron(np.eye(4), np.array(GEARED.casters[0].gear))
    assert_allclose((at_joints * rates).sum(axis=1), (recording.torque * (rates @ gear.T)).sum(axis=1), rtol=1e-8)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda rows: [r[:3] + r[4:] for r in rows], "'heading' are missing"),
        (lambda rows: [r[:5] + r[6:] for r in rows], "'vy' are missing"),
        (lambda rows: [r[:9] + r[10:] for r in rows], "'steering_3' are missing, for robot 'chung2008' of 3 casters"),
        (lambda rows: [[*rows[0], "stering_4 [rad]"], *([*r, "0"] for r in rows[1:])], "unknown column 'stering_4'"),
        (lambda rows: [[*rows[0], "x [m]"], *([*r, "0"] for r in rows[1:])], "'x' stands twice"),
        (lambda rows: [["time [h]", *rows[0][1:]], *rows[1:]], r"'time' must be in s or ms, got \[h\]"),
        (lambda rows: [["the time", *rows[0][1:]], *rows[1:]], "called as in 'x"),
        (lambda rows: [*rows[:4], [*rows[4][:2], "nan", *rows[4][3:]], *rows[5:]], "line 5: 'y' must be .* got 'nan'"),
        (lambda rows: [*rows[:4], [*rows[4][:2], "", *rows[4][3:]], *rows[5:]], "line 5: 'y' must be .* got ''"),
        (lambda rows: [*rows[:6], rows[6][:-1], *rows[7:]], "line 7: the header names 16 columns, got 15 cells"),
        (
            lambda rows: [*rows[:8], ["0.135", *rows[8][1:]], *rows[9:]],
            "line 9: samples must come evenly, every 0.02 s",
        ),
        (lambda rows: [rows[0], *reversed(rows[1:])], "'time' must grow"),
        (lambda rows: rows[:FEWEST_ROWS], f"has {FEWEST_ROWS - 1} samples; a recording needs at least {FEWEST_ROWS}"),
        (lambda rows: [], "are missing"),
    ],
)
def test_a_wrong_file_is_refused_by_a_sentence_that_names_the_place(lines, tmp_path, change, words):
    rows = [line.split(",") for line in lines]
    with pytest.raises(ValueError, match=words):
        reread(tmp_path, [",".join(row) for row in change(rows)])


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file .*none\.csv"):
        read_recording(tmp_path / "none.csv", ROBOT)


def test_a_recording_too_short_is_refused():
    with pytest.raises(ValueError, match=r"needs 10 steps or more, got 0\.1 s in steps of 0\.02 s"):
        record(random_robot(0, 2), 0.1, 0.02)
