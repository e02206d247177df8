"""caster_gym.states: an environment whose state is set goes on as the other one would have, to the last bit."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

from caster_gym import load_robot, states
from caster_gym.envs.specification import plain
from caster_gym.tasks.follow.environment import CasterFollowVectorEnv
from caster_gym.tasks.hold.environment import CasterHoldVectorEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv

TASK: dict[str, Any] = {"corridor": 0.12, "path": [{"shape": "circle", "radius": 0.5}, "lemniscate"]}
SHIPPED = plain(load_robot("chung2008"))
BATCHES: dict[str, Any] = {"track": CasterTrackVectorEnv, "follow": CasterFollowVectorEnv, "hold": CasterHoldVectorEnv}
BEFORE, AFTER = 25, 60  # steps; episodes last 20 at most


def make(task="track", count=5, mode=AutoresetMode.SAME_STEP, **arguments):
    own = TASK if task == "track" else {}
    return BATCHES[task](count, autoreset_mode=mode, **{"max_episode_steps": 20, **own, **arguments})


def go_on(env, seed, steps):
    """What some steps bring, as copies; robots that wait for a reset get one."""
    rng = np.random.default_rng(seed)
    brought = []
    for _ in range(steps):
        actions = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
        brought.append(copy.deepcopy(env.step(actions)))
        done = np.asarray(brought[-1][2]) | np.asarray(brought[-1][3])
        if not isinstance(env, gym.Env):
            if env.metadata["autoreset_mode"] is AutoresetMode.DISABLED and done.any():
                brought.append(copy.deepcopy(env.reset(options={"reset_mask": done})))
        elif done:
            brought.append(copy.deepcopy(env.reset()))
    return brought


def flat(value):
    """All numbers of what steps brought, in their order."""
    if isinstance(value, dict):
        return [one for key in sorted(value) for one in [key, *flat(value[key])]]
    if isinstance(value, list | tuple) or (isinstance(value, np.ndarray) and value.dtype == object):
        return [one for part in value for one in flat(part)]
    return [np.asarray(value)]


def assert_same(ours, theirs):
    for mine, other in zip(flat(ours), flat(theirs), strict=True):
        if isinstance(mine, np.ndarray):
            assert mine.dtype == other.dtype
        assert_array_equal(mine, other)


def ends(brought):
    return sum(int(np.sum(step[2]) + np.sum(step[3])) for step in brought if len(step) == 5)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(("task", "count"), [("track", 5), ("track", 35), ("follow", 3), ("hold", 1)])
def test_a_fresh_batch_goes_on_from_a_state(task, count, mode):
    env = make(task, count, mode)
    env.reset(seed=3)
    go_on(env, 1, BEFORE)
    env.np_random[0].uniform()  # somebody has drawn from a robot's generator, others were never made
    state = {name: array.copy() for name, array in env.get_state().items()}
    expected, drawn = go_on(env, 2, AFTER), env.np_random[0].uniform()
    other = make(task, count, mode)
    other.set_state(state)
    assert_same(go_on(other, 2, AFTER), expected)
    assert ends(expected) >= 2 * count  # so that starts were drawn
    assert other.np_random[0].uniform() == drawn
    assert other.np_random_seed == env.np_random_seed
    assert_same(other.reset(), env.reset())
    for space in ("action_space", "single_action_space"):
        assert_array_equal(getattr(other, space).sample(), getattr(env, space).sample())


def test_a_running_batch_goes_back_to_a_state_and_arrays_are_copies():
    env = make()
    env.reset(seed=3)
    state = env.get_state()
    kept = copy.deepcopy(state)
    first = go_on(env, 1, BEFORE)
    assert all(np.array_equal(state[name], kept[name]) for name in kept)
    env.set_state(state)
    assert_same(go_on(env, 1, BEFORE), first)
    assert all(np.array_equal(state[name], kept[name]) for name in kept)


def test_a_state_before_the_first_reset_is_one_too():
    env, other = make(), make()
    other.set_state(env.get_state())
    with pytest.raises(RuntimeError, match="reset every robot"):
        other.step(np.zeros(other.action_space.shape, np.float32))


def test_late_starts_own_parameters_and_pictures_are_part_of_the_state():
    env, other = (make(render_mode="rgb_array", max_episode_steps=400) for _ in range(2))
    env.reset(seed=3, options={"time": np.array([0.0, 0.5, 1.0, 2.0, 3.0])})
    rows = env.engine.parameters
    rows[:, 0] *= np.linspace(1.0, 1.2, 5)  # some are heavier
    env.engine.set_parameters(np.arange(5), rows)
    go_on(env, 1, 3)
    other.set_state(env.get_state())
    assert_array_equal(other.engine.parameters, rows)
    for mine, theirs in zip(other.render(), env.render(), strict=True):
        assert_array_equal(mine, theirs)
    assert_same(go_on(other, 2, AFTER), go_on(env, 2, AFTER))
    plain = make(max_episode_steps=400)
    plain.reset(seed=1)
    other.set_state(plain.get_state())  # nominal robots, of which nothing was drawn
    assert (other.engine.parameters == other.engine.parameters[0]).all()
    assert other.render()[0].shape == env.render()[0].shape
    assert_same(go_on(other, 2, AFTER), go_on(plain, 2, AFTER))


def test_one_robot_goes_on_from_a_state_also_with_gymnasiums_wrappers():
    env = CasterTrackEnv(**TASK)
    env.reset(seed=2**130)  # a seed may be of any size
    go_on(env, 1, BEFORE)
    state = env.get_state()
    expected = go_on(env, 2, 4 * AFTER)
    other = gym.make("caster_gym:CasterTrack-v0", **TASK)
    other.reset()  # which Gymnasium's wrappers want
    other.unwrapped.set_state(state)  # type: ignore[attr-defined]
    assert_same(go_on(other, 2, 4 * AFTER), expected)
    assert ends(expected) >= 2
    assert other.unwrapped.np_random_seed == 2**130
    assert other.unwrapped.np_random.uniform() == env.np_random.uniform()
    assert_array_equal(other.unwrapped.action_space.sample(), env.action_space.sample())


@pytest.mark.parametrize(
    ("other", "message"),
    [
        ({"count": 4}, "its number of robots is 4, and here it is 5"),
        ({"task": "hold"}, "its task.kind is 'HoldParameters', and here it is 'TrackParameters'"),
        ({"corridor": 0.2}, "its task.corridor is 0.2, and here it is 0.12"),
        ({"robot": {**SHIPPED, "name": "mine"}}, "its robot.name is 'mine', and here it is 'chung2008'"),
        ({"mode": AutoresetMode.DISABLED}, "its autoreset_mode is 'Disabled', and here it is 'SameStep'"),
        ({"path": "lemniscate"}, "its fingerprint of paths is"),
        ({"max_episode_steps": 21}, "its fingerprint of paths is"),
    ],
)
def test_a_state_of_another_batch_is_refused(other, message):
    env = make()
    env.reset(seed=3)
    before = env.get_state()
    with pytest.raises(ValueError, match=message):
        env.set_state(make(**other).get_state())
    after = env.get_state()
    assert all(np.array_equal(before[name], after[name]) for name in before)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"made_of": None}, "lacks 'made_of'"),
        ({"done": None}, r"the state of the batch lacks 'done', an array of bool of shape \(5,\)"),
        ({"more": np.zeros(1)}, "the state of the batch holds 'more', which the batch has not"),
        ({"done": np.zeros(4, np.bool_)}, r"'done' .* must be an array of bool of shape \(5,\), got .* \(4,\)"),
        ({"engine/blocks": np.zeros((1, 8))}, "'blocks' in the state of the robots must be an array of float64"),
        ({"engine/seeds": np.zeros((2, 5))}, "'seeds' in the state of the robots must be .* uint64 .* got .* float64"),
        ({"engine/clocks": np.full((2, 5), 7)}, "paths in 0 … 1, got clocks from 7 and paths in 7 … 7"),
        ({"made_of": np.zeros(3, np.uint8)}, "its description is None"),
    ],
)
def test_a_state_that_lost_something_is_refused(change, message):
    env = make()
    state = {**env.get_state(), **change}
    with pytest.raises(ValueError, match=message):
        env.set_state({name: array for name, array in state.items() if array is not None})


def test_arrays_are_of_plain_types():
    env = make()
    env.reset(seed=3)
    assert {array.dtype.kind for array in env.get_state().values()} <= set("biuf")


def test_generators_and_seeds_survive_as_words():
    generator = np.random.default_rng(5)
    generator.integers(2**32, dtype=np.uint32)  # so that half a word is left
    other = states.make_generator(states.generator_words(generator))
    assert_array_equal(
        other.integers(2**32, size=9, dtype=np.uint32), generator.integers(2**32, size=9, dtype=np.uint32)
    )
    assert_array_equal(other.normal(size=9), generator.normal(size=9))
    seeds = [None, 0, -1, 2**64, 2**254]
    assert states.read_seeds(states.seed_arrays(seeds)) == seeds
    with pytest.raises(ValueError, match=r"seeds of 2\*\*255 or more cannot be saved, got 2894"):
        states.seed_arrays([5 * 2**255])
    with pytest.raises(ValueError, match="if it is a PCG64, as Gymnasium's are, got a MT19937"):
        states.generator_words(np.random.Generator(np.random.MT19937(1)))


def test_fingerprints_tell_types_shapes_and_depth_apart():
    row = np.arange(4.0)
    things = [(row,), (row.reshape(2, 2),), (row.astype(np.float32),), ((row,),), (row, None), ((row, None),), ("a",)]
    assert len({states.fingerprint(*thing) for thing in things}) == len(things)
    assert states.fingerprint(row) == states.fingerprint(row.copy())
