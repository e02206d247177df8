"""caster_gym.wrappers.failures: motors that give no torque from some instant on."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym import load_robot
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import MotorFailure, wrap

COUNT, STEPS, PERIOD = 300, 60, 0.02
ROBOT = load_robot("chung2008")


def torques(*features, **options):
    """Torques (steps, robots, joints) of robots that are asked for a fifth of them."""
    path = {"shape": "lemniscate", "duration": 40.0}
    env = wrap(CasterTrackVectorEnv(COUNT, path=path, corridor=100.0, **options), *features)
    env.reset(seed=4)
    action = np.full((COUNT, 6), 0.2, dtype=np.float32)
    return np.array([env.step(action)[4]["torque"] for _ in range(STEPS)])


def test_named_motors_fail_at_their_time_and_no_others():
    failing = torques(MotorFailure(motors=("roll_1", "steer_3"), after=0.4))
    whole = torques()
    dead = [ROBOT.joints.index(joint) for joint in ("roll_1", "steer_3")]
    alive = np.setdiff1d(np.arange(6), dead)
    first = round(0.4 / PERIOD)
    assert (whole > 0.0).all()
    assert_array_equal(failing[:first], whole[:first])
    assert_array_equal(failing[first:, :, dead], 0.0)
    assert_array_equal(failing[first:, :, alive], whole[first:, :, alive])


def test_else_one_motor_fails_and_each_of_them_in_its_turn():
    dead = torques(MotorFailure(after=(0.2, 0.8))) == 0.0
    assert (dead[-1].sum(axis=1) == 1).all()
    assert (dead.any(axis=0).sum(axis=1) == 1).all()  # the same one all the time
    share = dead[-1].mean(axis=0)
    assert (abs(share - 1.0 / 6.0) < 5.0 * np.sqrt(5.0 / 36.0 / COUNT)).all()
    begun = PERIOD * (STEPS - dead.any(axis=2).sum(axis=0))
    assert begun.min() >= 0.2 - PERIOD and begun.max() <= 0.8 + PERIOD
    assert abs(begun.mean() - 0.5) < 5.0 * 0.6 / np.sqrt(12.0 * COUNT)


def test_motors_that_are_not_there_are_told():
    with pytest.raises(ValueError, match="unknown joint 'roll_4'"):
        torques(MotorFailure(motors=("roll_4",)))
    with pytest.raises(
        ValueError, match="joint 'roll_2' of robot 'chung2008' has no motor that could fail; driven are"
    ):
        torques(MotorFailure(motors=("roll_2",)), actuation=("roll_1", "steer_1", "steer_2", "roll_3", "steer_3"))
