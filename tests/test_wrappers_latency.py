"""caster_gym.wrappers.latency: late actions, and motors that follow slowly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.configuration import ConfigurationError
from caster_gym.envs.caster_track import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import ActionDelay, MotorLag, read_features, wrap

PATH = {"shape": "circle", "radius": 0.5}
PERIOD = 0.02  # [s] of the environment's control


def batch(*features, count=200):
    return wrap(CasterTrackVectorEnv(count, path=PATH, corridor=100.0), *features)


def sent(env, actions):
    """What the environment inside is told, step by step."""
    told, step = [], env.env.step

    def spy(given):
        told.append(given.copy())
        return step(given)

    env.env.step = spy
    for action in actions:
        env.step(action)
    env.env.step = step
    return np.array(told)


def noise(steps, shape, seed=0):
    return np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, *shape)).astype(np.float32)


@pytest.mark.parametrize("periods", [0, 1, 4])
def test_a_delay_is_the_same_actions_shifted(periods):
    late, prompt = wrap(CasterTrackEnv(path=PATH), ActionDelay(periods=periods)), CasterTrackEnv(path=PATH)
    late.reset(seed=3)
    prompt.reset(seed=3)
    actions = 0.3 * noise(30, (6,))
    shifted = np.concatenate([np.zeros((periods, 6), np.float32), actions])
    for given, due in zip(actions, shifted, strict=False):
        assert_array_equal(late.step(given)[0], prompt.step(due)[0])


def test_each_robot_draws_a_delay_of_its_own():
    """All delays of the range come up equally often, and each shifts the actions."""
    env = batch(ActionDelay(periods=(1, 4)), count=2000)
    env.reset(seed=0)
    actions = noise(12, (2000, 6))
    told = sent(env, actions)
    shifts = np.array([(told[k:] == actions[: 12 - k]).all(axis=(0, 2)) for k in range(6)])
    assert_array_equal(shifts.sum(axis=0), 1)
    frequency = shifts.mean(axis=1)
    assert_array_equal(frequency[[0, 5]], 0.0)
    assert_allclose(frequency[1:5], 0.25, atol=5.0 * np.sqrt(0.25 * 0.75 / 2000))  # five standard deviations


@pytest.mark.parametrize("time_constant", [0.005, 0.02, 0.3])
def test_step_response_of_a_lag(time_constant):
    """1 − exp(−t/τ) at the end of every control period."""
    env = batch(MotorLag(time_constant=time_constant), count=2)
    env.reset(seed=0)
    told = sent(env, np.full((40, 2, 6), 0.5, np.float32))
    times = PERIOD * np.arange(1, 41)
    expected = 0.5 * (1.0 - np.exp(-times / time_constant))
    assert_allclose(told, np.broadcast_to(expected[:, None, None], told.shape), atol=1e-7)  # float32


def test_no_time_constant_is_no_lag():
    env = batch(MotorLag(time_constant=0.0), ActionDelay(periods=0), count=2)
    env.reset(seed=0)
    actions = noise(5, (2, 6))
    assert_array_equal(sent(env, actions), actions)


def test_each_robot_draws_a_time_constant_of_its_own():
    env = batch(MotorLag(time_constant=(0.01, 0.05)), count=2000)
    env.reset(seed=0)
    told = sent(env, np.ones((1, 2000, 6), np.float32))[0, :, 0].astype(np.float64)
    drawn = -PERIOD / np.log(1.0 - told)
    assert drawn.min() >= 0.01 - 1e-6  # float32
    assert drawn.max() <= 0.05 + 1e-6
    assert abs(drawn.mean() - 0.03) < 5.0 * 0.04 / np.sqrt(12.0 * 2000)  # five standard deviations of the mean


def test_an_episode_remembers_nothing_of_the_one_before():
    env = batch(ActionDelay(periods=2), MotorLag(time_constant=0.1), count=3)
    env.reset(seed=0)
    first = sent(env, noise(6, (3, 6)))
    env.reset(seed=1)
    assert_array_equal(sent(env, noise(6, (3, 6))), first)
    env.reset(seed=2)
    assert_array_equal(sent(env, np.zeros((6, 3, 6), np.float32)), 0.0)


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ({"kind": "action_delay", "periods": -1}, "'periods' should be greater than or equal to 0"),
        ({"kind": "action_delay", "periods": [3, 1]}, "'periods' must rise from its first to its second number"),
        ({"kind": "action_delay", "periods": 1.5}, "'periods' should be a whole number"),
        ({"kind": "motor_lag", "time_constant": -0.1}, "'time_constant' must not be negative, got -0.1"),
        ({"kind": "motor_lag", "time_constant": [0.2, 0.1]}, "'time_constant' must rise"),
        ({"kind": "motor_lag", "time_constant": "fast"}, "'time_constant' should be a number"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])
