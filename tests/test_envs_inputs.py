"""caster_gym.envs.inputs: what cannot be used is refused with a sentence, alone and in batches, and changes nothing."""

import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.inputs import check_keywords, checked_seeds, read_actions
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import SensorNoise, wrap

TASK: dict[str, Any] = {"path": {"shape": "circle", "radius": 0.5}}
WIDTH = 6  # driven joints of the default robot


def single():
    return CasterTrackEnv(**TASK)


def batch(count=1):
    return CasterTrackVectorEnv(count, **TASK)


FACES = {
    "single": single,
    "batch": batch,
    "wrapped single": lambda: wrap(single(), SensorNoise(position=0.01)),
    "wrapped batch": lambda: wrap(batch(), SensorNoise(position=0.01)),
}


@pytest.fixture(params=list(FACES))
def env(request):
    made = FACES[request.param]()
    made.reset(seed=0)
    return made


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.ones(WIDTH) * 1j, "must hold real numbers, got complex numbers"),
        (["0.1"] * WIDTH, "must hold real numbers, got words"),
        ([True] * WIDTH, "must hold real numbers, got true or false"),
        ([None] * WIDTH, "must hold real numbers, got other objects"),
        ([10**400] * WIDTH, "must hold real numbers, got other objects"),
        ([np.nan] * WIDTH, "must hold numbers, got"),
        ([0.0] * (WIDTH - 1), r"must have shape \((1, )?6,?\), got \((1, )?5,?\)"),
    ],
)
def test_what_is_no_action_is_refused_and_moves_nothing(env, action, message):
    shaped = [action] if env.action_space.shape == (1, WIDTH) else action
    before = env.unwrapped.engine.states
    with warnings.catch_warnings(), pytest.raises(ValueError, match=f"actions? {message}"):
        warnings.simplefilter("error")
        env.step(shaped)
    assert_array_equal(env.unwrapped.engine.states, before)


def test_numbers_of_any_real_type_and_layout_act_alike():
    """Compiled code gets one type and layout: any other, of a read-only array for instance, would be compiled anew."""
    plain = np.array([1, 0, -1, 1, 0, -1], dtype=np.float32)
    frozen = plain.copy()
    frozen.flags.writeable = False
    strided = np.zeros((WIDTH, 2), dtype=np.float32)
    strided[:, 0] = plain
    big_endian = plain.astype(">f4")
    for given in (plain.tolist(), plain.astype(int), plain.astype(np.int8), frozen, strided[:, 0], big_endian):
        read = read_actions(given, (WIDTH,))
        assert read.flags.carray
        assert read.dtype == np.float32
        assert_array_equal(read, plain)
    assert read_actions(plain, (WIDTH,)) is plain


def test_an_action_too_large_for_its_type_is_clipped_as_any_other():
    first, second = single(), single()
    for env in (first, second):
        env.reset(seed=0)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ours = first.step(np.full(WIDTH, 1e300))
    assert_array_equal(ours[0], second.step(np.ones(WIDTH))[0])


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ("x", "options must be None or a mapping of names to values, got 'x'"),
        ([], r"options must be None or a mapping of names to values, got \[\]"),
        ({"paht": 0}, "reset knows no option 'paht'; did you mean 'path'"),
        ({"pos": [0, 0, 0]}, "reset knows no option 'pos'; did you mean 'pose'"),
        ({"progres": 0.5}, "no option 'progres'; here the place along the path is 'time', in seconds"),
        ({3: 4}, "reset knows no option 3; known are path, pose"),
    ],
)
def test_unknown_options_are_refused_and_change_nothing(env, options, message):
    before = env.unwrapped.engine.states
    with pytest.raises(ValueError, match=message):
        env.reset(options=options)
    assert_array_equal(env.unwrapped.engine.states, before)


@pytest.mark.parametrize("seed", ["x", 1.5, -1, True, np.float64(2.0), {1: 2}, np.array(1.0)])
def test_seeds_that_are_none_are_refused(env, seed):
    with pytest.raises(ValueError, match=r"seed must be None(,| or) a whole number"):
        env.reset(seed=seed)


@pytest.mark.parametrize("seed", [7, np.int64(7), np.uint8(7)])
def test_whole_numbers_of_any_type_are_seeds(env, seed):
    ours = env.reset(seed=seed)[0]
    assert_array_equal(ours, env.reset(seed=7)[0])


def test_seeds_of_a_batch_are_one_a_robot():
    assert checked_seeds(3, 2) == [3, 4]
    assert checked_seeds(np.array([5, 6]), 2) == [5, 6]
    assert checked_seeds((5, None), 2) == [5, None]
    assert checked_seeds(range(2), 2) == [0, 1]
    with pytest.raises(ValueError, match="seed must be one number or 2 of them, got 3"):
        checked_seeds([1, 2, 3], 2)
    with pytest.raises(ValueError, match="a whole number of 0 or more, got 'x'"):
        checked_seeds([1, "x"], 2)


@pytest.mark.parametrize("count", [1.5, "2", True, None, np.float64(2.0)])
@pytest.mark.parametrize("name", ["CasterTrack", "CasterFollow"])
def test_parts_of_environments_are_refused(name, count):
    with pytest.raises(ValueError, match="num_envs must be a whole number, got"):
        gym.make_vec(f"caster_gym:{name}-v0", num_envs=count, **TASK)
    with pytest.raises(ValueError, match="num_envs must be a whole number, got"):
        TorchVectorEnv(num_envs=count, **TASK)


@pytest.mark.parametrize("steps", [1.5, "2", True])
def test_parts_of_steps_are_refused(steps):
    with pytest.raises(ValueError, match="max_episode_steps must be a whole number, got"):
        gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, max_episode_steps=steps, **TASK)


@pytest.mark.parametrize(
    "make",
    [
        CasterTrackEnv,
        CasterFollowEnv,
        CasterTrackVectorEnv,
        CasterFollowVectorEnv,
        TorchVectorEnv,
        TorchTask,
        lambda **given: SB3VecEnv(CasterTrackVectorEnv(1, autoreset_mode="SameStep"), **given),
        lambda **given: gym.make("caster_gym:CasterTrack-v0", **given),
        lambda **given: gym.make_vec("caster_gym:CasterFollow-v0", num_envs=2, **given),
    ],
    ids=["track", "follow", "tracks", "follows", "torch", "torch task", "sb3", "make", "make_vec"],
)
def test_unknown_keywords_are_type_errors_in_pythons_words(make):
    """Libraries probe so what an environment understands."""
    with pytest.raises(TypeError, match="unexpected keyword argument 'frameskip'"):
        make(frameskip=1)


@pytest.mark.parametrize("make", [CasterTrackEnv, CasterFollowEnv, CasterTrackVectorEnv, CasterFollowVectorEnv])
def test_unknown_keywords_are_told_the_nearest(make):
    """Of the task's fields and of the constructor's own; and they are errors of a configuration still."""
    for wrong, right in (("corider", "corridor"), ("paht", "path"), ("rendermode", "render_mode")):
        with pytest.raises(ConfigurationError, match=f"keyword argument '{wrong}'; did you mean '{right}'"):
            make(**{wrong: 1})


def test_every_unknown_keyword_is_told():
    told = "Thing got an unexpected keyword argument 'aa'; did you mean 'a'.; unexpected keyword argument 'x'; .*'b'"
    with pytest.raises(TypeError, match=told):
        check_keywords(["aa", "a", "x"], ["a", "b"], "Thing", {"x": "b"})
