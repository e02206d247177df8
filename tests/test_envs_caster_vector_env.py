"""caster_gym.envs.caster_vector_env: the native batch equals Gymnasium's SyncVectorEnv of single environments."""

import copy
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.testing import assert_array_equal

from caster_gym.engines.native.lanes import LANES
from caster_gym.engines.native.threads import BLOCKS_PER_SHARE, get_threads, set_threads
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv

TASK: dict[str, Any] = {
    "corridor": 0.12,
    "path": {"shape": "circle", "radius": 0.5},
}  # random torques leave it, sooner or later
LONGEST = 40
SEED = 11


def batch(count, mode, **arguments):
    return CasterTrackVectorEnv(count, autoreset_mode=mode, max_episode_steps=LONGEST, **{**TASK, **arguments})


def singles(count, mode):
    return SyncVectorEnv([lambda: TimeLimit(CasterTrackEnv(**TASK), LONGEST)] * count, autoreset_mode=mode)


def assert_same(ours, theirs, where=""):
    """Equal to the last bit, keys, types and masks included."""
    assert type(ours) is type(theirs), where
    if isinstance(ours, dict):
        assert set(ours) == set(theirs), where
        for key in ours:
            assert_same(ours[key], theirs[key], f"{where}[{key!r}]")
    elif isinstance(ours, tuple):
        for i, (mine, other) in enumerate(zip(ours, theirs, strict=True)):
            assert_same(mine, other, f"{where}[{i}]")
    elif ours.dtype == object:
        for mine, other in zip(ours, theirs, strict=True):
            assert type(mine) is type(other), where
            assert_array_equal(mine, other, where)
    else:
        assert ours.dtype == theirs.dtype, where
        assert_array_equal(ours, theirs, where)


def random_actions(space, seed):
    """Torques that last for a while, and differ in size from robot to robot: only some leave the corridor."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.0, 1.3, (space.shape[0], 1))
    kept = np.zeros(space.shape)
    while True:
        new = rng.uniform(-1.0, 1.0, space.shape)
        kept = np.where(rng.uniform(size=(space.shape[0], 1)) < 0.2, new, kept)
        yield (size * kept).astype(np.float32)


@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize(("count", "steps"), [(3, 400), (LANES + 3, 100)])
def test_a_batch_equals_single_environments(mode, count, steps):
    ours, theirs = batch(count, mode), singles(count, mode)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.metadata["autoreset_mode"] is mode is theirs.metadata["autoreset_mode"]
    assert_same(ours.reset(seed=SEED), theirs.reset(seed=SEED))
    failures, ends = 0, 0
    for _, actions in zip(range(steps), random_actions(ours.action_space, 1), strict=False):
        mine, other = ours.step(actions), theirs.step(actions)
        assert_same(mine, other)
        terminated, truncated = mine[2:4]
        failures, ends = failures + terminated.sum(), ends + truncated.sum()
        done = terminated | truncated
        if mode is AutoresetMode.DISABLED and done.any():
            assert_same(*(env.reset(options={"reset_mask": done.copy()}) for env in (ours, theirs)))
    assert failures >= 3  # both kinds of ends were seen
    assert ends >= 3


def test_a_batch_on_several_threads_equals_single_environments(request):
    """Large enough for two threads, and one robot short of full blocks."""
    before = get_threads()
    set_threads(2)
    request.addfinalizer(lambda: set_threads(before))
    count = 2 * BLOCKS_PER_SHARE * LANES - 1
    ours, theirs = batch(count, "SameStep"), singles(count, AutoresetMode.SAME_STEP)
    assert_same(ours.reset(seed=SEED), theirs.reset(seed=SEED))
    for _, actions in zip(range(5), random_actions(ours.action_space, 2), strict=False):
        assert_same(ours.step(actions), theirs.step(actions))


def test_seeds_may_be_given_one_by_one_and_some_not_at_all():
    ours, theirs = batch(3, AutoresetMode.NEXT_STEP), singles(3, AutoresetMode.NEXT_STEP)
    assert_same(ours.reset(seed=[5, 900, 5]), theirs.reset(seed=[5, 900, 5]))
    assert_same(ours.reset(seed=[None, 7, None]), theirs.reset(seed=[None, 7, None]))
    assert_same(ours.reset(), theirs.reset())
    observations, _ = ours.reset(seed=[5, 6, 5])
    assert_array_equal(observations[0], observations[2])
    assert (observations[0] != observations[1]).any()


def test_some_robots_restart_with_new_seeds():
    """Seeds of robots outside the mask are not used; these go on as if nothing had happened."""
    ours, theirs = (make(3, AutoresetMode.DISABLED) for make in (batch, singles))
    for env in (ours, theirs):
        env.reset(seed=SEED)
        env.step(np.zeros((3, 6), dtype=np.float32))
    mask = np.array([False, True, False])
    assert_same(*(env.reset(seed=50, options={"reset_mask": mask.copy()}) for env in (ours, theirs)))
    assert_same(*(env.step(np.zeros((3, 6), dtype=np.float32)) for env in (ours, theirs)))
    assert_same(*(env.reset() for env in (ours, theirs)))


def test_paths_of_the_pool_can_be_chosen():
    """One for all, as for single environments, or one for each robot."""
    pool = {"path": [{"shape": "circle", "radius": 0.5}, "lemniscate", "ellipse"]}
    env = batch(3, AutoresetMode.DISABLED, **pool)
    env.reset(seed=0, options={"path": 1})
    assert env.engine.paths.tolist() == [1, 1, 1]
    env.reset(seed=0, options={"path": np.array([2, 0, 1])})
    assert env.engine.paths.tolist() == [2, 0, 1]
    env.reset(options={"path": np.array([0, 2, 2]), "reset_mask": np.array([False, True, False])})
    assert env.engine.paths.tolist() == [2, 2, 1]
    with pytest.raises(ValueError, match="path must be a whole number in 0 … 2"):
        env.reset(options={"path": 3})


def test_robots_without_a_seed_differ():
    first, _ = batch(4, AutoresetMode.NEXT_STEP).reset()
    again, _ = batch(4, AutoresetMode.NEXT_STEP).reset()
    assert len(np.unique(np.concatenate((first, again)), axis=0)) == 8


def test_what_a_step_returned_is_never_changed_later():
    env = batch(3, AutoresetMode.SAME_STEP)
    actions = random_actions(env.action_space, 3)
    seen = [env.reset(seed=SEED)]
    copies = [copy.deepcopy(seen[0])]
    for _, action in zip(range(60), actions, strict=False):
        seen.append(env.step(action))
        copies.append(copy.deepcopy(seen[-1]))
    env.reset(seed=1)
    assert_same(tuple(seen), tuple(copies))


def test_changing_what_was_returned_changes_nothing():
    spoiled, clean = batch(3, AutoresetMode.SAME_STEP), batch(3, AutoresetMode.SAME_STEP)
    for step, actions in zip(range(60), random_actions(clean.action_space, 4), strict=False):
        results = [env.reset(seed=SEED) if step == 0 else env.step(actions) for env in (spoiled, clean)]
        assert_same(*results)
        _spoil(results[0])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_a_reset_of_some_does_not_show_what_was_written_into_the_observations(mode):
    """The others' entries are what they see, not what has become of an array that was handed out."""
    env, clean = batch(3, mode), batch(3, mode)
    for one in (env, clean):
        one.reset(seed=SEED)
    for step in range(3):
        results = [one.step(np.full((3, 6), 0.2 * step, dtype=np.float32)) for one in (env, clean)]
    results[0][0][:] = 0.0
    mask = np.array([False, True, False])
    shown, expected = (one.reset(options={"reset_mask": mask.copy()})[0] for one in (env, clean))
    assert_array_equal(shown, expected)
    assert_array_equal(shown[~mask], results[1][0][~mask])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_masks_of_infos_are_arrays_of_their_own(mode):
    """No two share memory, nor does the batch look at one again."""
    env = batch(3, mode)
    _, infos = env.reset(seed=SEED)
    everything = [_masks(infos)]
    for _, actions in zip(range(LONGEST), random_actions(env.action_space, 5), strict=False):
        *_, terminated, truncated, infos = env.step(actions)
        everything.append(_masks(infos))
        if mode is AutoresetMode.DISABLED and (terminated | truncated).any():
            everything.append(_masks(env.reset(options={"reset_mask": terminated | truncated})[1]))
    assert max(len(masks) for masks in everything) >= 24  # a mask for each quantity and each term
    for masks in everything:
        for i, mask in enumerate(masks):
            mask[:] = False
            mask[0] = True
            assert not any(other.tolist() == [True, False, False] for other in masks[i + 1 :] if other.sum() != 1)
            assert not any(np.shares_memory(mask, other) for other in masks[i + 1 :])


def test_seeds_and_generators_are_those_of_gymnasiums_own_batch():
    """Tuples with one entry a robot, in the state that the resets have left them in."""
    ours, theirs = batch(3, AutoresetMode.DISABLED), singles(3, AutoresetMode.DISABLED)
    mask = np.array([False, True, False])
    resets: list[dict[str, Any]] = [
        {"seed": 7},
        {},
        {"seed": [1, None, 3]},
        {"seed": 20, "options": {"reset_mask": mask}},
    ]
    for how in resets:
        for env in (ours, theirs):
            env.reset(**copy.deepcopy(how))
        assert ours.np_random_seed == theirs.np_random_seed
        assert [one.bit_generator.state for one in ours.np_random] == [
            one.bit_generator.state for one in theirs.np_random
        ]
    drawn = [one.random() for one in ours.np_random]
    assert [one.random() for one in ours.np_random] != drawn  # they are kept from one look to the next
    ours.reset(seed=7)
    assert ours.np_random[1].random() != drawn[1]


def test_a_batch_that_was_never_seeded_tells_the_seeds_that_it_uses():
    env = batch(3, AutoresetMode.NEXT_STEP)
    seeds = env.np_random_seed
    assert len(set(seeds)) == 3
    first, _ = env.reset()
    assert env.np_random_seed == seeds
    again, _ = batch(3, AutoresetMode.NEXT_STEP).reset(seed=list(seeds))
    assert_array_equal(first, again)


def test_a_broken_robot_leaves_its_neighbours_alone_and_starts_anew():
    broken, sound = batch(3, AutoresetMode.SAME_STEP), batch(3, AutoresetMode.SAME_STEP)
    broken.reset(seed=SEED)
    sound.reset(seed=SEED)
    states = broken.engine.states
    states[1, 5] = np.nan
    broken.engine.states = states
    actions = np.full((3, 6), 0.1, dtype=np.float32)
    ours, theirs = broken.step(actions), sound.step(actions)
    assert ours[2].tolist() == [False, True, False]
    assert ours[4]["final_info"]["not_finite"].tolist() == [False, True, False]
    assert ours[1][1] == 0.0
    for mine, other in zip(ours[:4], theirs[:4], strict=True):
        assert_array_equal(mine[[0, 2]], other[[0, 2]])
    assert all(broken.observation_space.contains(env_obs) for env_obs in (ours[0], broken.step(actions)[0]))
    assert np.isfinite(broken.engine.states).all()


@pytest.mark.parametrize(
    "mask",
    [
        [True, False, True],
        np.array([1, 0, 1]),
        np.array([True, False]),
        np.array([False, False, False]),
        np.array([[True, False, True]]),
    ],
)
def test_a_mask_that_is_none_is_refused(mask):
    env = batch(3, AutoresetMode.DISABLED)
    env.reset(seed=0)
    with pytest.raises(
        ValueError, match=r"reset_mask'\] must be a boolean array of shape \(3,\) with at least one True"
    ):
        env.reset(options={"reset_mask": mask})


def test_an_ended_robot_must_be_reset_before_its_next_step():
    env = batch(3, AutoresetMode.DISABLED)
    env.reset(seed=0)
    states = env.engine.states
    states[2, 0] += 3.0
    env.engine.states = states
    actions = np.zeros((3, 6), dtype=np.float32)
    assert env.step(actions)[2].tolist() == [False, False, True]
    with pytest.raises(RuntimeError, match="robot 2 has ended its episode: reset it before the next step"):
        env.step(actions)
    env.reset(options={"reset_mask": np.array([False, False, True])})
    assert not env.step(actions)[2].any()


def test_a_first_reset_of_some_leaves_the_others_unstarted():
    """A robot that never started has no state to move from."""
    env = batch(3, AutoresetMode.DISABLED)
    env.reset(seed=0, options={"reset_mask": np.array([True, False, True])})
    with pytest.raises(RuntimeError, match="reset every robot before its first step"):
        env.step(np.zeros((3, 6), dtype=np.float32))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: batch(0, "NextStep"), ValueError, "num_envs must be 1 or more, got 0"),
        (
            lambda: CasterTrackVectorEnv(2, max_episode_steps=0),
            ValueError,
            "max_episode_steps must be 1 or more, got 0",
        ),
        (lambda: batch(3, "NextStep").reset(seed=[1, 2]), ValueError, "seed must be one number or 3 of them, got 2"),
        (lambda: batch(3, "NextStep").step(np.zeros((3, 6))), RuntimeError, "before its first step"),
        (lambda: _started().step(np.zeros((2, 6))), ValueError, r"actions must have shape \(3, 6\), got \(2, 6\)"),
        (lambda: _started().step(np.full((3, 6), np.nan)), ValueError, r"actions must hold numbers, got \[nan"),
        (lambda: batch(3, "sometimes"), ValueError, "sometimes"),
    ],
)
def test_wrong_use_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def test_make_vec_gives_the_native_batch():
    env = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=5, **TASK)
    assert isinstance(env.unwrapped, CasterTrackVectorEnv)
    assert (
        env.reset(seed=0)[0].shape == env.observation_space.shape == (5, *env.unwrapped.single_observation_space.shape)
    )
    assert env.step(env.action_space.sample())[1].shape == (5,)


def test_make_vec_makes_single_environments_too():
    env = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, vectorization_mode="sync", **TASK)
    native = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, **TASK)
    assert_same(env.reset(seed=3), native.reset(seed=3))


def _started():
    env = batch(3, AutoresetMode.NEXT_STEP)
    env.reset(seed=0)
    return env


def _masks(infos):
    """Every mask, of inner dictionaries too."""
    masks = [value for key, value in infos.items() if key.startswith("_")]
    return masks + [mask for value in infos.values() if isinstance(value, dict) for mask in _masks(value)]


def _spoil(value):
    """Overwrite every array inside."""
    if isinstance(value, dict | tuple):
        for item in value.values() if isinstance(value, dict) else value:
            _spoil(item)
    else:
        value[...] = None if value.dtype == object else 7
