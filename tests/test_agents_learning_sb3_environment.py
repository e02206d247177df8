"""caster_gym.agents.learning.sb3_environment: SB3 learns the same from the native batch as from single environments."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from gymnasium.wrappers import TimeLimit
from numpy.testing import assert_array_equal
from stable_baselines3 import PPO, SAC
from stable_baselines3.common.callbacks import BaseCallback
from stable_baselines3.common.monitor import Monitor
from stable_baselines3.common.vec_env import DummyVecEnv
from stable_baselines3.common.vec_env.base_vec_env import tile_images

from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import Tolerance, wrap

TASK: dict[str, Any] = {
    "corridor": 0.08,
    "path": {"shape": "circle", "radius": 0.5},
}  # starts are up to 0.07 m off
LONGEST = 30
COUNT = 3


@pytest.fixture(autouse=True)
def one_thread():
    """Threads cost networks as small as these more than they bring."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def native(longest=LONGEST, **task):
    batch = CasterTrackVectorEnv(
        COUNT, autoreset_mode=AutoresetMode.SAME_STEP, max_episode_steps=longest, **{**TASK, **task}
    )
    return SB3VecEnv(batch)


def dummy():
    return DummyVecEnv([lambda: Monitor(TimeLimit(CasterTrackEnv(**TASK), LONGEST))] * COUNT)


class Endings(BaseCallback):
    """Counts how episodes end."""

    def __init__(self):
        super().__init__()
        self.counts: Counter[str] = Counter()

    def _on_step(self):
        for done, info in zip(self.locals["dones"], self.locals["infos"], strict=True):
            if done:
                self.counts["time" if info["TimeLimit.truncated"] else "failure"] += 1
        return True


def trained(algorithm, environment, steps, **settings):
    model = algorithm(
        "MlpPolicy", environment, policy_kwargs={"net_arch": [8]}, seed=4, device="cpu", verbose=0, **settings
    )
    endings = Endings()
    model.learn(steps, callback=endings)
    return model, endings.counts


def assert_same_learning(algorithm, steps, **settings):
    """Every weight equal to the last bit, after both kinds of endings."""
    (ours, endings), (theirs, others) = (trained(algorithm, env, steps, **settings) for env in (native(), dummy()))
    assert endings == others
    assert min(endings["time"], endings["failure"]) >= 2
    fresh = trained(algorithm, native(), 0, **settings)[0].policy.state_dict()
    mine, other = ours.policy.state_dict(), theirs.policy.state_dict()
    assert set(mine) == set(other)
    assert all(torch.equal(mine[name], other[name]) for name in mine)
    assert any(not torch.equal(mine[name], fresh[name]) for name in mine)
    episodes = [[(e["l"], round(e["r"], 3)) for e in model.ep_info_buffer] for model in (ours, theirs)]
    assert episodes[0] == episodes[1]
    return ours, theirs


def test_ppo_learns_the_same_from_the_batch():
    assert_same_learning(PPO, 600, n_steps=64, batch_size=64, n_epochs=3)


def test_sac_learns_the_same_from_the_batch():
    """And its replay buffer holds the same: the last observations of episodes, and which ends were only time."""
    settings = {"train_freq": 1, "gradient_steps": 1, "buffer_size": 1000, "learning_starts": 60, "batch_size": 32}
    ours, theirs = assert_same_learning(SAC, 400, **settings)
    for name in ("observations", "next_observations", "actions", "rewards", "dones", "timeouts"):
        assert_array_equal(getattr(ours.replay_buffer, name), getattr(theirs.replay_buffer, name), name)


def test_steps_equal_those_of_single_environments():
    ours, theirs = native(), dummy()
    for env in (ours, theirs):
        env.seed(21)
    assert_array_equal(ours.reset(), theirs.reset())
    rng = np.random.default_rng(6)
    for _ in range(150):
        actions = rng.uniform(-1.0, 1.0, (COUNT, 6)).astype(np.float32)
        mine, other = ours.step(actions), theirs.step(actions)
        for a, b in zip(mine[:3], other[:3], strict=True):
            assert a.dtype == b.dtype
            assert_array_equal(a, b)
        for done, a, b in zip(mine[2], mine[3], other[3], strict=True):
            assert a.get("TimeLimit.truncated", False) == b["TimeLimit.truncated"]
            assert ("terminal_observation" in a) == done
            if done:
                assert_array_equal(a["terminal_observation"], b["terminal_observation"])
                assert a["episode"]["l"] == b["episode"]["l"]
    assert_array_equal(ours.reset(), theirs.reset())


def test_failure_is_no_time_limit_and_time_is():
    """SB3 bootstraps the value of the last observation where TimeLimit.truncated says so, and only there."""
    env = native(longest=2)
    env.seed(0)
    env.reset()
    states = env.batch.engine.states
    states[1, 0] += 3.0
    env.batch.engine.states = states
    rest = np.zeros((COUNT, 6), dtype=np.float32)
    _, rewards, dones, infos = env.step(rest)
    assert dones.tolist() == [False, True, False]
    assert (infos[1]["TimeLimit.truncated"], infos[1]["episode"]["failed"]) == (False, True)
    assert rewards[1] == 0.0
    _, _, dones, infos = env.step(rest)
    assert dones.tolist() == [True, False, True]
    for info in (infos[0], infos[2]):
        assert (info["TimeLimit.truncated"], info["episode"]["failed"], info["episode"]["l"]) == (True, False, 2)


def test_failure_in_the_last_step_counts_as_failure():
    env = native(longest=1)
    env.seed(0)
    env.reset()
    states = env.batch.engine.states
    states[:, 0] += 3.0
    env.batch.engine.states = states
    infos = env.step(np.zeros((COUNT, 6), dtype=np.float32))[3]
    assert [info["TimeLimit.truncated"] for info in infos] == [False] * COUNT


def test_terminal_observation_is_of_the_ended_episode():
    """Not the start of the next one, and not changed by later steps."""
    env = native(longest=3)
    env.seed(1)
    env.reset()
    actions = np.full((COUNT, 6), 0.3, dtype=np.float32)
    for _ in range(3):
        observations, _, _, infos = env.step(actions)
    last = [info["terminal_observation"] for info in infos]
    kept = np.array(last)
    twist = env.batch.engine.layout.physical(kept, "twist")
    assert (np.abs(twist).max(axis=1) > 0.0).all()
    assert_array_equal(env.batch.engine.layout.physical(observations, "twist"), np.zeros((COUNT, 3)))
    env.step(actions)
    assert_array_equal(np.array(last), kept)


def test_episode_sums_are_those_of_its_steps():
    """Return, length and mean position error, the last step included and the next episode's start not."""
    env = native(longest=7)
    env.seed(2)
    env.reset()
    rng = np.random.default_rng(8)
    for _ in range(3):
        rewards, errors = [], []
        for _ in range(7):
            _, reward, dones, infos = env.step(rng.uniform(-0.2, 0.2, (COUNT, 6)).astype(np.float32))
            rewards.append(reward)
            final = env.last_infos.get("final_info", env.last_infos)
            errors.append(final["position_error"])
        assert dones.all()
        for robot, info in enumerate(infos):
            assert info["episode"]["l"] == 7
            assert info["episode"]["r"] == pytest.approx(np.sum(rewards, axis=0)[robot], rel=1e-6)  # float32 rewards
            assert info["episode"]["position_error"] == pytest.approx(np.mean(errors, axis=0)[robot], rel=1e-12)


def test_a_reset_in_the_middle_begins_new_sums():
    env = native(longest=5)
    env.reset()
    env.step(np.zeros((COUNT, 6), dtype=np.float32))
    env.reset()
    for _ in range(5):
        infos = env.step(np.zeros((COUNT, 6), dtype=np.float32))[3]
    assert [info["episode"]["l"] for info in infos] == [5] * COUNT


def test_seeds_are_used_once():
    env = native()
    env.seed(3)
    first = env.reset()
    second = env.reset()
    env.seed(3)
    assert_array_equal(env.reset(), first)
    assert (second != first).any()


def test_other_ways_of_resetting_are_refused():
    with pytest.raises(ValueError, match=r"SB3 needs AutoresetMode.SAME_STEP, got AutoresetMode.NEXT_STEP"):
        SB3VecEnv(CasterTrackVectorEnv(2, **TASK))


def test_robots_of_a_batch_have_nothing_of_their_own():
    env = native()
    assert env.get_attr("task") == [env.batch.task] * COUNT
    assert env.get_attr("robot", indices=[0, 2]) == [env.batch.robot] * 2
    assert env.env_is_wrapped(Monitor) == [False] * COUNT
    with pytest.raises(AttributeError, match="'task' cannot be set"):
        env.set_attr("task", None)
    with pytest.raises(AttributeError, match="'reset' cannot be called"):
        env.env_method("reset")


def test_what_features_add_is_learned_from():
    """Rewards are shaped, and so are the returns that are told; attributes are still those of the batch."""
    bonus = Tolerance(quantity="position_error", margin=1.0, weight=10.0)
    plain = native(longest=4)
    shaped = SB3VecEnv(wrap(native(longest=4).batch, bonus))
    assert shaped.get_attr("task") == plain.get_attr("task")
    assert shaped.actions == plain.actions == 6
    for env in (plain, shaped):
        env.seed(5)
        env.reset()
    rest = np.zeros((COUNT, 6), dtype=np.float32)
    sums = np.zeros((2, COUNT))
    for _ in range(4):
        told = [env.step(rest) for env in (plain, shaped)]
        sums += [step[1] for step in told]
    assert (sums[1] > sums[0] + 4 * 8.0).all()  # a gaussian of at most 7 cm over 1 m is worth over 0.98
    assert [info["episode"]["r"] for info in told[1][3]] == pytest.approx(sums[1].tolist(), rel=1e-6)


def test_actions_are_those_of_the_call():
    """Not what becomes of their array until the step is waited for; what was handed out may be written into as well."""
    ours, theirs = native(), native()
    for env in (ours, theirs):
        env.seed(3)
        env.reset()[:] = 0.0 if env is ours else 1.0
    actions = np.full((COUNT, 6), 0.3, dtype=np.float32)
    theirs.step_async(actions.copy())
    ours.step_async(actions)
    actions[:] = 0.0
    mine, other = ours.step_wait(), theirs.step_wait()
    assert_array_equal(mine[0], other[0])
    assert_array_equal(mine[1], other[1])


def test_sb3_films_all_robots_or_their_grid():
    """Side by side from frames of their own, or the one image that a grid is."""
    for mode, count in (("rgb_array", COUNT), ("grid", 1)):
        env = native(render_mode=mode)
        env.reset()
        assert env.render_mode == "rgb_array"
        images = env.get_images()
        assert len(images) == count
        assert all(image.shape == images[0].shape for image in images)
        assert_array_equal(env.render("rgb_array"), tile_images(images))
    assert native().get_images() == [None] * COUNT


def test_a_fresh_batch_goes_on_from_a_state():
    batch, other = native(), native()
    batch.seed(3)
    pending = batch.get_state()  # with seeds for the coming reset
    first = batch.reset()
    other.set_state(pending)
    assert_array_equal(other.reset(), first)
    rng = np.random.default_rng(1)
    actions = rng.uniform(-1.0, 1.0, (3 * LONGEST, COUNT, 6)).astype(np.float32)
    for one in actions[:20]:
        batch.step(one)
    other.set_state(batch.get_state())
    ended = 0
    for one in actions[20:]:
        ours, theirs = other.step(one), batch.step(one)
        for mine, expected in zip(ours[:3], theirs[:3], strict=True):
            assert_array_equal(mine, expected)
        assert [info.get("episode") for info in ours[3]] == [info.get("episode") for info in theirs[3]]
        ended += int(theirs[2].sum())
    assert ended > COUNT
    assert_array_equal(other.action_space.sample(), batch.action_space.sample())
    with pytest.raises(ValueError, match="the batch for SB3 lacks 'lengths'"):
        other.set_state({name: array for name, array in batch.get_state().items() if name != "lengths"})
