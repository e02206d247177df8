"""identification.recording_check: mistakes in recordings are named, their mend helps, and noise is no mistake."""

import math
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from caster_gym.identification.recording import Noise, record
from caster_gym.identification.recording_check import ContradictionError, check_recording, contradiction
from caster_gym.identification.unknowns import robot_with
from caster_gym.robot import load_robot
from tests.random_robots import random_robot

ROBOTS = {"chung2008": load_robot("chung2008"), "tidybot2": load_robot("tidybot2"), "random": random_robot(3, 2)}
USUAL = Noise(position=1e-3, heading=1e-3, velocity=1e-2, yaw_rate=1e-2, steering=1e-3, rolling=1e-3)
DEGREE = math.pi / 180.0


@pytest.fixture(scope="module")
def drives():
    return {name: record(robot, 10.0, 0.02, seed=1, with_rolling=True) for name, robot in ROBOTS.items()}


def posed(recording, change):
    return replace(recording, pose=np.column_stack(change(*recording.pose.T)))


def flipped(recording, name, column):
    array = getattr(recording, name).copy()
    array[:, column] *= -1.0
    return replace(recording, **{name: array})


def swapped(recording, name):
    order = [1, 0, *range(2, recording.steering.shape[1])]
    return replace(recording, **{name: getattr(recording, name)[:, order]})


def rotated(recording):
    """Casters that are counted from another one, in all of their columns."""
    return replace(
        recording, **{name: np.roll(getattr(recording, name), 1, axis=1) for name in ("steering", "rolling")}
    )


def in_the_world(recording):
    c, s = np.cos(recording.pose[:, 2]), np.sin(recording.pose[:, 2])
    vx, vy, omega = recording.twist.T
    return replace(recording, twist=np.column_stack([c * vx - s * vy, s * vx + c * vy, omega]))


def held(recording, name, rows):
    array = getattr(recording, name)
    return replace(recording, **{name: array[np.arange(len(array)) // rows * rows]})


def late(recording, name, rows):
    """Some columns that hold what was true some rows before."""
    arrays = {key: getattr(recording, key) for key in ("pose", "steering", "torque", "twist", "rolling")}
    return replace(recording, **{key: a[:-rows] if key == name else a[rows:] for key, a in arrays.items()})


def zeros(recording, angle):
    return replace(recording, steering=recording.steering + angle)


MISTAKES = {
    "steering_1 and steering_2 are columns of other casters": lambda r: swapped(r, "steering"),
    "steering_1 has the other sign": lambda r: flipped(r, "steering", 0),
    "steering_1, .* have the other sign|steering_1 and steering_2 have": lambda r: replace(r, steering=-r.steering),
    "steering_2 are in degrees|steering_[34] are in degrees": lambda r: replace(r, steering=r.steering / DEGREE),
    "are in radians, not in degrees": lambda r: replace(r, steering=r.steering * DEGREE),
    "heading has the other sign": lambda r: posed(r, lambda x, y, b: (x, y, -b)),
    "heading is in degrees": lambda r: posed(r, lambda x, y, b: (x, y, b / DEGREE)),
    "clockwise from the y-axis": lambda r: posed(r, lambda x, y, b: (x, y, 0.5 * np.pi - b)),
    "heading is 90° ahead": lambda r: posed(r, lambda x, y, b: (x, y, b + 0.5 * np.pi)),
    "x and y are in mm": lambda r: posed(r, lambda x, y, b: (1e3 * x, 1e3 * y, b)),
    "x and y are in feet": lambda r: posed(r, lambda x, y, b: (x / 0.3048, y / 0.3048, b)),
    "x and y are swapped": lambda r: posed(r, lambda x, y, b: (y, x, b)),
    "y has the other sign": lambda r: posed(r, lambda x, y, b: (x, -y, b)),
    "vx and vy are in the world's frame": in_the_world,
    "vy has the other sign": lambda r: flipped(r, "twist", 1),
    "yaw_rate is in deg/s": lambda r: replace(r, twist=r.twist / [1.0, 1.0, DEGREE]),
    "vx and vy are in mm/s": lambda r: replace(r, twist=r.twist * [1e3, 1e3, 1.0]),
    "vx and vy are in km/h": lambda r: replace(r, twist=r.twist * [3.6, 3.6, 1.0]),
    "time is in ms": lambda r: replace(r, time_step=1e3 * r.time_step),
    "time is in ns": lambda r: replace(r, time_step=1e9 * r.time_step),
    "time is in minutes": lambda r: replace(r, time_step=r.time_step / 60.0),
    "rolling_2 has the other sign": lambda r: flipped(r, "rolling", 1),
    "rolling_1 and rolling_2 are columns of other casters": lambda r: swapped(r, "rolling"),
    "steering_1, steering_2.*rolling_1, rolling_2.*are columns of other casters": rotated,
    "rolling_1, .* start again after each turn": lambda r: replace(r, rolling=np.mod(r.rolling, 2.0 * np.pi)),
    "rolling_1, .* are 65[123].* times the wheels' angles": lambda r: replace(r, rolling=651.9 * r.rolling),
    "rolling_1, .* are -4[78].* times the wheels' angles": lambda r: replace(r, rolling=-48.0 * r.rolling),
    "rolling_2 is 4[78].* times the wheels' angles": lambda r: replace(
        r, rolling=r.rolling * np.where(np.arange(r.rolling.shape[1]) == 1, 48.0, 1.0)
    ),
    "are in turns": lambda r: replace(r, rolling=r.rolling / (2.0 * np.pi)),
    "rolling.* are in degrees": lambda r: replace(r, rolling=r.rolling / DEGREE),
    "are rates in rad/s": lambda r: replace(r, rolling=np.gradient(r.rolling, r.time_step, axis=0)),
    "a zero of 1.57.* rad": lambda r: zeros(r, 0.5 * np.pi),
    "a zero of 0.7.*1.4.* rad": lambda r: zeros(r, 0.7 * np.arange(1, 1 + r.steering.shape[1])),
    "steering.* come 4 rows late": lambda r: late(r, "steering", 4),
    "vx, vy and yaw_rate come 3 rows late": lambda r: late(r, "twist", 3),
    "rolling.* come 3 rows late": lambda r: late(r, "rolling", 3),
    "x, y and heading change only in every 4th row": lambda r: held(r, "pose", 4),
    "steering.* change only in every 3rd row": lambda r: held(r, "steering", 3),
}


@pytest.mark.parametrize(
    ("name", "with_noise"), [("chung2008", True), pytest.param("tidybot2", False, marks=pytest.mark.slow)]
)
@pytest.mark.parametrize("words", MISTAKES)
def test_a_mistake_is_named_and_its_mend_is_accepted(drives, name, words, with_noise):
    robot, recording = ROBOTS[name], drives[name]
    if with_noise:
        recording = recording.noisy(USUAL, np.random.default_rng(0))
    wrong = MISTAKES[words](recording)
    found = contradiction(wrong, robot)
    assert found is not None and found.mend is not None
    assert re.search(words, found.words)
    assert found.mend.advice in found.words
    check_recording(found.mend.mended(wrong), robot)


@pytest.mark.parametrize("name", ROBOTS)
def test_ways_of_wheels_are_told_from_angles(drives, name):
    robot, recording = ROBOTS[name], drives[name]
    ways = recording.rolling * [caster.radius for caster in robot.casters]
    with pytest.raises(ContradictionError, match="are ways in metres"):
        check_recording(replace(recording, rolling=ways), robot)


@pytest.mark.parametrize("name", ROBOTS)
def test_recordings_at_usual_noise_raise_no_alarm(drives, name):
    robot = ROBOTS[name]
    for seed in range(10):
        noisy = drives[name].noisy(USUAL, np.random.default_rng(seed))
        assert check_recording(noisy, robot) == ()
        assert check_recording(replace(noisy, twist=None, rolling=None), robot) == ()
        wrapped = np.mod(noisy.steering, 2.0 * np.pi)
        assert check_recording(replace(noisy, steering=wrapped), robot) == ()


def test_a_robot_that_stands_still_contradicts_nothing(drives):
    still = drives["chung2008"]
    still = replace(
        still, pose=0.0 * still.pose, steering=0.0 * still.steering + 0.3, twist=0.0 * still.twist, rolling=None
    )
    assert check_recording(still, ROBOTS["chung2008"]) == ()
    for seed in range(5):
        assert check_recording(still.noisy(USUAL, np.random.default_rng(seed)), ROBOTS["chung2008"]) == ()


@pytest.mark.slow
def test_wrong_sizes_are_named_unless_they_are_asked_for_or_given(drives):
    truth = {"radius": 0.0265, "trail": 0.0235}
    robot = ROBOTS["chung2008"]
    recording = record(robot_with(robot, truth), 10.0, 0.02, seed=1, with_rolling=True)
    with pytest.raises(
        ContradictionError, match=r"trail is 0\.0235\d* .*radius is 0\.0265.*--unknown trail --unknown radius"
    ):
        check_recording(recording, robot)
    with pytest.raises(ContradictionError, match="radius is") as refused:
        check_recording(recording, robot, ("trail",))
    assert "trail is" not in str(refused.value)
    assert check_recording(recording, robot, ("trail", "radius")) == ()
    assert check_recording(recording, robot, (), truth) == ()
    noisy = record(robot_with(robot, {"radius": 0.02501}), 10.0, 0.02, seed=1, with_rolling=True)
    assert check_recording(noisy.noisy(USUAL, np.random.default_rng(0)), robot) == ()  # 0.04 % are below the noise


def test_a_steering_zero_is_named_with_its_size_and_can_be_given(drives):
    robot, angle = ROBOTS["chung2008"], 0.8 * DEGREE
    askew = zeros(drives["chung2008"], [0.0, angle, 0.0])
    with pytest.raises(ContradictionError, match=r"steering_zero_2 is 0\.01") as refused:
        check_recording(askew, robot)
    assert float(str(refused.value).split("steering_zero_2 is ")[1].split()[0]) == pytest.approx(angle, abs=2e-4)
    assert check_recording(askew, robot, ("steering_zero_2",)) == ()
    assert check_recording(askew, robot, (), {"steering_zero_2": angle}) == ()
    small = check_recording(zeros(drives["chung2008"], [0.0, 0.3 * DEGREE, 0.0]), robot)
    assert len(small) == 1
    assert "steering_zero_2 by +0.0052 rad" in small[0]


def test_a_twist_that_is_too_fast_is_mended_by_the_factor_that_is_told(drives):
    robot, recording = ROBOTS["chung2008"], drives["chung2008"]
    with pytest.raises(ContradictionError, match=r"vx and vy are 1\.05 times .*: multiply by 0\.95") as refused:
        check_recording(replace(recording, twist=recording.twist * [1.05, 1.05, 1.0]), robot)
    factor = float(str(refused.value).split("multiply by ")[1].split(".")[1][:4]) / 1e4
    assert check_recording(replace(recording, twist=recording.twist * [1.05 * factor, 1.05 * factor, 1.0]), robot) == ()


def test_what_no_single_mistake_explains_is_refused_all_the_same(drives):
    robot, recording = ROBOTS["chung2008"], drives["chung2008"]
    with pytest.raises(ContradictionError, match=r"explains it\. steering_1, steering_2 and steering_3 never change"):
        check_recording(replace(recording, steering=0.0 * recording.steering), robot)


def test_torques_in_another_unit_are_named_unless_strengths_are_asked_for(drives):
    robot, recording = ROBOTS["chung2008"], drives["chung2008"]
    wrong = replace(recording, torque=recording.torque * 1e3)
    with pytest.raises(ContradictionError, match=r"write torque_roll_1 \[mN m\], .* into the header"):
        check_recording(wrong, robot)
    assert check_recording(wrong, robot, ("roll_strength",)) == ()
    for name in ROBOTS:
        assert check_recording(replace(drives[name], torque=2.0 * drives[name].torque), ROBOTS[name]) == ()


def test_the_check_needs_neither_torch_nor_scipy():
    code = (
        "import sys, caster_gym.identification.command, caster_gym.identification.recording_check\n"
        "print([name for name in ('torch', 'scipy', 'matplotlib', 'numba') if name in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
