"""caster_gym.envs.caster_env: environments that planners copy, and that go to other processes."""

import copy
import pickle
import subprocess
import sys
from collections.abc import Callable
from typing import Any

import cloudpickle
import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import RecordEpisodeStatistics

from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import ActionDelay, MotorLag, Payload, Potential, Pushes, SensorNoise, Smoothness, wrap

ARENA: dict[str, Any] = {"path": {"shape": "circle", "radius": 0.5}, "arena": {"room": [[-1.0, -1.0], [1.0, 1.0]]}}
TASK: dict[str, Any] = {"path": [{"shape": "circle", "radius": 0.5}, "lemniscate"]}
FEATURES = (
    Payload(mass=(0.0, 2.0)),
    SensorNoise(position=0.01, heading_bias=0.02),
    ActionDelay(periods=(0, 2)),
    MotorLag(),
    Pushes(rate=5.0),
    Potential(quantity="position_error", margin=0.5, discount=0.97),
    Smoothness(),
)
WAYS: dict[str, Callable[[Any], Any]] = {
    "copy": copy.copy,
    "deepcopy": copy.deepcopy,
    "pickle": lambda env: pickle.loads(pickle.dumps(env)),
    "cloudpickle": lambda env: pickle.loads(cloudpickle.dumps(env)),
}
SINGLE: dict[str, Callable[..., Any]] = {
    "track": lambda **how: CasterTrackEnv(**TASK, **how),
    "follow": lambda **how: CasterFollowEnv(**ARENA, **how),
    "wrapped": lambda **how: wrap(CasterFollowEnv(**TASK, **how), *FEATURES),
}
BATCHES: dict[str, Callable[..., Any]] = {
    "tracks": lambda **how: CasterTrackVectorEnv(3, max_episode_steps=12, **TASK, **how),
    "follows": lambda **how: CasterFollowVectorEnv(3, max_episode_steps=12, **ARENA, **how),
    "wrapped batch": lambda **how: wrap(CasterFollowVectorEnv(3, max_episode_steps=12, **TASK, **how), *FEATURES),
}
ALL = {**SINGLE, **BATCHES}


def action(env, size):
    return np.full(env.action_space.shape, size, dtype=np.float32)


def run(env, steps=12):
    """What an environment shows of some steps and of the next episode, alike for equal environments."""
    seen = [env.step(action(env, 0.1 + 0.05 * step)) for step in range(steps)]
    return bits((seen, env.reset(), env.step(action(env, 0.2))))


def bits(value):
    """All of a nest of arrays and numbers, for comparison to the last bit."""
    if isinstance(value, dict):
        return {key: bits(one) for key, one in value.items()}
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [bits(one) for one in value]
    return None if value is None else (np.asarray(value).dtype.str, np.asarray(value).tobytes())


def mid_episode(env):
    env.reset(seed=4)
    for _ in range(5):
        env.step(action(env, 0.3))
    return env


@pytest.mark.parametrize("way", list(WAYS))
@pytest.mark.parametrize("kind", list(ALL))
def test_a_copy_in_the_middle_of_an_episode_goes_on_as_its_original(kind, way):
    """To the last bit, into the next episode; neither is moved by the other."""
    env = mid_episode(ALL[kind]())
    first, second = WAYS[way](env), WAYS[way](env)
    expected = run(first)
    assert run(second) == expected
    assert run(env) == expected


@pytest.mark.parametrize("way", list(WAYS))
@pytest.mark.parametrize("kind", list(ALL))
def test_a_fresh_copy_starts_as_its_original(kind, way):
    env = ALL[kind]()
    other = WAYS[way](env)
    assert bits(env.reset(seed=8)) == bits(other.reset(seed=8))
    assert run(env) == run(other)


@pytest.mark.parametrize("way", [name for name in WAYS if name != "copy"])  # Gymnasium's wrappers share what is inside
@pytest.mark.parametrize(
    "made", [lambda env: env, lambda env: RecordEpisodeStatistics(env)], ids=["make", "statistics"]
)
def test_wrappers_of_gymnasium_are_copied_with_what_is_inside(made, way):
    env = mid_episode(made(gym.make("caster_gym:CasterTrack-v0", max_episode_steps=40, **TASK)))
    other = WAYS[way](env)
    for step in range(5):
        ours, theirs = env.step(action(env, 0.1 * step)), other.step(action(env, 0.1 * step))
        np.testing.assert_array_equal(ours[0], theirs[0])
        assert ours[1:4] == theirs[1:4]
    other.reset(seed=1)
    assert env.get_wrapper_attr("_elapsed_steps") == 10


@pytest.mark.slow
@pytest.mark.parametrize("way", list(WAYS))
@pytest.mark.parametrize(("kind", "mode"), [("track", "rgb_array"), ("wrapped", "rgb_array"), ("tracks", "grid")])
def test_copies_draw_as_their_original(kind, mode, way):
    """The trace of what was driven before included, whether or not anything had been drawn."""
    env = ALL[kind](render_mode=mode)
    env.reset(seed=4)
    env.render()
    for _ in range(3):
        env.step(action(env, 0.3))
    other = WAYS[way](env)
    frame = env.render()
    np.testing.assert_array_equal(other.render(), frame)
    for one in (env, other):
        one.step(action(env, 0.5))
    np.testing.assert_array_equal(other.render(), env.render())


def test_a_copy_with_a_window_opens_its_own(monkeypatch):
    monkeypatch.setenv("SDL_VIDEODRIVER", "dummy")
    env = CasterTrackEnv(render_mode="human", **TASK)
    env.reset(seed=0)
    other = copy.deepcopy(env)
    for one in (other, env, other):
        one.step(action(env, 0.1))
    other.close()
    env.step(action(env, 0.1))
    env.close()


def test_copies_share_the_tables_of_paths():
    """Which nobody writes into, and which may be large: a planner copies its environment thousands of times."""
    env = CasterTrackEnv(**TASK)
    assert copy.deepcopy(env).engine.plan is env.engine.plan


def test_the_environment_of_sb3_is_copied_with_its_batch():
    env = SB3VecEnv(CasterTrackVectorEnv(3, autoreset_mode="SameStep", **TASK))
    env.seed(2)
    env.reset()
    actions = np.full((3, 6), 0.3, dtype=np.float32)
    env.step(actions)
    for other in (copy.deepcopy(env), pickle.loads(pickle.dumps(env))):
        again = copy.deepcopy(env)
        for _ in range(5):
            ours, theirs = again.step(actions), other.step(actions)
            for mine, its in zip(ours[:3], theirs[:3], strict=True):
                np.testing.assert_array_equal(mine, its)


@pytest.mark.slow
def test_another_process_goes_on_with_a_pickled_environment(tmp_path):
    env = mid_episode(gym.make("caster_gym:CasterTrack-v0", **TASK))
    (tmp_path / "env.pkl").write_bytes(pickle.dumps(env))
    code = (
        "import pickle, sys, numpy as np\n"
        "env = pickle.load(open(sys.argv[1], 'rb'))\n"
        "print([env.step(np.full(6, 0.2, np.float32))[0].tobytes().hex() for _ in range(3)])"
    )
    told = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "env.pkl")], capture_output=True, text=True, check=True
    )
    assert told.stdout.strip() == str([env.step(action(env, 0.2))[0].tobytes().hex() for _ in range(3)])
