"""caster_gym.wrappers.latency: late actions, and motors that follow slowly."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp

from caster_gym import Model
from caster_gym.configuration import ConfigurationError
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
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
def test_a_lag_holds_the_mean_over_each_period_of_its_differential_equation(time_constant):
    """Against the midpoint rule on y' = (u − y) / T with 4000 steps a period: (h / T)² / 24 is 4e-8 at most."""
    env = batch(MotorLag(time_constant=time_constant), count=2)
    env.reset(seed=0)
    actions = noise(12, (2, 6))
    told = sent(env, actions)
    steps, y = 4000, np.zeros((2, 6))
    h = PERIOD / steps
    for action, given in zip(actions.astype(np.float64), told, strict=True):
        impulse = np.zeros_like(y)
        for _ in range(steps):
            after = y + h * (action - y) / time_constant * (1.0 - 0.5 * h / time_constant)
            impulse += 0.5 * h * (y + after)
            y = after
        assert_allclose(given, impulse / PERIOD, atol=2e-7)  # float32


def lagging_plant(robot, actions, period, time_constant):
    """Twist and steering at the end of actions (k, motors) that lag, all integrated together by SciPy, from rest."""
    model = Model(robot)
    size = np.array([motor.max_torque for caster in robot.casters for motor in (caster.roll, caster.steer)])
    casters = robot.caster_count

    def slope(_, state, action):
        steering, twist, y = state[:casters], state[casters : casters + 3], state[casters + 3 :]
        rate = model.forward_dynamics(steering, twist, size * y)
        return np.concatenate([model.rates(steering, twist)[2], rate, (action - y) / time_constant])

    state = np.zeros(casters + 3 + len(size))
    for action in actions.astype(np.float64):
        state = solve_ivp(slope, (0.0, period), state, "DOP853", args=(action,), rtol=1e-10, atol=1e-12).y[:, -1]
    return state[: casters + 3]


def test_a_robot_moves_as_one_whose_motors_follow_at_every_moment():
    """Over 0.4 s of small random torques; what is held errs by the square of the period, and so falls by four.

    The value at a period's end would err in proportion to the period.
    """
    lag, errors, distance = 0.03, [], []
    coarse = 0.3 * noise(20, (6,), seed=4)
    for parts in (1, 2):
        period = PERIOD / parts
        env = CasterTrackVectorEnv(
            1, path=PATH, corridor=100.0, control_period=period, substeps=8, start_offset=0.0, start_turn=0.0
        )
        wrapped = wrap(env, MotorLag(time_constant=lag))
        wrapped.reset(seed=0, options={"steering": [0.0, 0.0, 0.0], "twist": [0.0, 0.0, 0.0]})
        actions = np.repeat(coarse, parts, axis=0)
        for action in actions:
            wrapped.step(action[None])
        (state,) = env.engine.states
        found = np.concatenate([np.arctan2(state[8::2], state[7::2]), state[4:7]])
        expected = lagging_plant(env.robot, actions, period, lag)
        errors.append(np.abs(np.sin(found[:3] - expected[:3])).max() + np.abs(found[3:] - expected[3:]).max())
        distance.append(np.abs(expected[3:]).max())
    assert distance[0] > 0.1  # m/s or rad/s: it does move
    assert errors[0] < 0.01 * distance[0]
    assert errors[0] / errors[1] > 3.0


def test_no_time_constant_is_no_lag():
    env = batch(MotorLag(time_constant=0.0), ActionDelay(periods=0), count=2)
    env.reset(seed=0)
    actions = noise(5, (2, 6))
    assert_array_equal(sent(env, actions), actions)


def test_each_robot_draws_a_time_constant_of_its_own():
    env = batch(MotorLag(time_constant=(0.01, 0.05)), count=2000)
    env.reset(seed=0)
    told = sent(env, np.ones((1, 2000, 6), np.float32))[0, :, 0].astype(np.float64)
    ratio = np.linspace(0.3, 3.0, 10_000)  # period over time constant: the mean grows with it
    drawn = PERIOD / np.interp(told, 1.0 - (1.0 - np.exp(-ratio)) / ratio, ratio)
    assert drawn.min() >= 0.01 - 1e-6  # float32, and interpolation
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
