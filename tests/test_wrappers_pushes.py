"""caster_gym.wrappers.pushes: forces from outside, at random times."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model
from caster_gym.configuration import ConfigurationError
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import Pushes, read_features, wrap

PATH = {"shape": "circle", "radius": 0.5}
PERIOD = 0.02  # [s] of the environment's control


def batch(*features, count=400):
    return wrap(CasterTrackVectorEnv(count, path=PATH, corridor=1e3), *features)


def wrenches(env, steps):
    """What acts during each control period (steps, robots, 3)."""
    still = np.zeros(env.action_space.shape, np.float32)
    seen = []
    for _ in range(steps):
        env.step(still)
        seen.append(env.unwrapped.engine.wrenches)
    return np.array(seen)


def test_pushes_come_at_their_rate():
    """Beginnings per second are Poisson's, but for more than one in a period; five standard deviations."""
    env = batch(Pushes(rate=2.0, force=(1.0, 2.0), duration=PERIOD))
    env.reset(seed=0)
    pushed = (wrenches(env, 200) != 0.0).any(axis=2)
    chance = 1.0 - np.exp(-2.0 * PERIOD)
    assert abs(pushed.mean() - chance) < 5.0 * np.sqrt(chance * (1.0 - chance) / pushed.size)
    follows = pushed[1:][pushed[:-1]]
    assert abs(follows.mean() - chance) < 5.0 * np.sqrt(chance * (1.0 - chance) / follows.size)  # no memory


def test_pushes_have_their_sizes_and_all_directions():
    env = batch(Pushes(rate=5.0, force=(2.0, 6.0), moment=(-0.3, 0.1), duration=PERIOD))
    env.reset(seed=0)
    seen = wrenches(env, 100)
    seen = seen[(seen != 0.0).any(axis=2)]
    force, count = np.hypot(seen[:, 0], seen[:, 1]), len(seen)
    assert force.min() >= 2.0 - 1e-12
    assert force.max() <= 6.0 + 1e-12
    assert abs(force.mean() - 4.0) < 5.0 * 4.0 / np.sqrt(12.0 * count)
    assert np.abs((seen[:, :2] / force[:, None]).mean(axis=0)).max() < 5.0 / np.sqrt(2.0 * count)
    assert seen[:, 2].min() >= -0.3
    assert seen[:, 2].max() <= 0.1
    assert abs(seen[:, 2].mean() + 0.1) < 5.0 * 0.4 / np.sqrt(12.0 * count)


def test_a_push_lasts_as_long_as_it_should():
    env = batch(Pushes(rate=0.2, force=3.0, duration=5 * PERIOD), count=200)
    env.reset(seed=0)
    seen = wrenches(env, 150)
    pushed = (seen != 0.0).any(axis=2)
    begins = np.diff(pushed.astype(int), axis=0) == 1
    alone = 0
    for step, robot in np.argwhere(begins[:-12]):
        window = seen[step + 1 : step + 12, robot]
        if len(np.unique(window[(window != 0.0).any(axis=1)], axis=0)) == 1:  # no other push follows
            assert (window[:5] == window[0]).all()
            assert not window[5:].any()
            alone += 1
    assert alone > 50


def test_a_push_moves_the_robot_by_its_impulse():
    """M Δν = F Δt for a robot at rest whose motors are off, up to the turning of its casters meanwhile."""
    env = batch(Pushes(rate=1e9, force=1e-3, moment=1e-4, duration=PERIOD), count=30)
    observations, _ = env.reset(seed=0)
    part = env.unwrapped.engine.layout.physical(observations, "directions")
    steering = np.arctan2(part[:, 1::2], part[:, ::2])
    (wrench,) = wrenches(env, 1)
    model = Model(env.unwrapped.robot)
    expected = np.linalg.solve(model.inertia(steering), PERIOD * wrench[..., None])[..., 0]
    twist = env.unwrapped.engine.states[:, 4:7]
    # 4e-6 m/s over a trail of 0.025 m turns casters by 3e-6 in a period
    assert_allclose(twist, expected, rtol=0.0, atol=1e-4 * np.abs(expected).max())


def test_an_episode_begins_unpushed():
    """A push of the episode before does not go on, and seeds reproduce pushes."""
    env = batch(Pushes(rate=1.0, force=3.0, duration=1.0), count=100)
    env.reset(seed=0)
    first = wrenches(env, 40)
    assert first[-1].any()
    env.reset(seed=0)
    assert_array_equal(wrenches(env, 40), first)


def test_pushes_of_two_features_add_up_and_differ():
    one, two = (batch(*[Pushes(rate=1e9, force=1.0, duration=PERIOD)] * n, count=500) for n in (1, 2))
    for env in (one, two):
        env.reset(seed=0)
    (first,), (both,) = wrenches(one, 1), wrenches(two, 1)
    second = np.hypot(*(both - first)[:, :2].T)
    assert_allclose(second, 1.0, rtol=1e-12)
    cosine = ((both - first) * first).sum(axis=1)
    assert abs(cosine.mean()) < 5.0 / np.sqrt(2.0 * 500)  # directions of their own


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ({"kind": "pushes", "rate": -1}, "'rate' should be greater than or equal to 0"),
        ({"kind": "pushes", "force": -1}, "'force' must not be negative"),
        ({"kind": "pushes", "duration": 0}, "'duration' should be greater than 0"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])
