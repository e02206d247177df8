"""agents.learning.rsl_rl: rsl-rl-lib sees TorchVectorEnv's episodes, and leaves policies that everybody reads."""

import importlib
import sys
from typing import Any

import numpy as np
import pytest
import torch
import yaml
from gymnasium.error import DependencyNotInstalled
from rsl_rl.env import VecEnv

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.rsl_rl import RslVecEnv, actor_of, make_runner
from caster_gym.agents.learning.settings import RslPPOSettings
from caster_gym.agents.learning.training import train
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.own_errors import OwnCodeError

SEED, COUNT, LONGEST = 5, 3, 3
QUICK: dict[str, Any] = {
    "control_period": 0.01,
    "substeps": 1,
}  # one RK4 step a period: uncompiled Torch is slow
SETTINGS = RslPPOSettings(
    algorithm="rsl_ppo", n_timesteps=24, n_envs=COUNT, n_steps=4, batch_size=6, n_epochs=2, net_arch=(8,), validations=2
)
PATH = {"shape": "random_paths", "duration": 2.5, "max_speed": 0.3, "count": 2}
TASK = {kind: [{**PATH, "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))}


@pytest.fixture(autouse=True)
def one_thread():
    """Training sets the number of threads of the whole process."""
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    yield
    torch.set_num_threads(threads)


def batch(**fields):
    return TorchVectorEnv("track", COUNT, path={"shape": "circle"}, max_episode_steps=LONGEST, **QUICK, **fields)


def task(**changes):
    return parse(TaskSettings, {**TASK, "task": QUICK, **changes}, "task")


def test_episodes_are_those_of_the_batch():
    """Ends by time after three periods; ends by failure in a corridor that some starts barely leave room in."""
    narrow = {"corridor": 0.0705, "start_offset": 0.0495}
    ours, theirs = RslVecEnv(batch(**narrow), SEED), batch(**narrow)
    assert isinstance(ours, VecEnv)
    assert (ours.num_envs, ours.num_actions, ours.max_episode_length) == (COUNT, 6, LONGEST)
    first, _ = theirs.reset(seed=SEED)
    assert torch.equal(ours.get_observations()["policy"], first)
    generator = torch.Generator().manual_seed(1)
    lengths = torch.zeros(COUNT, dtype=torch.int64)
    for _ in range(2 * LONGEST):
        actions = 2.0 * torch.rand(COUNT, 6, generator=generator) - 1.0
        seen, rewards, dones, extras = ours.step(actions)
        observations, others, terminated, truncated, infos = theirs.step(actions)
        assert torch.equal(seen["policy"], observations)
        assert torch.equal(ours.get_observations()["policy"], observations)
        assert torch.equal(rewards, others)
        assert torch.equal(dones > 0, terminated | truncated)
        assert torch.equal(extras["time_outs"], truncated & ~terminated)
        assert torch.equal(extras["log"]["/position_error"], infos["position_error"])
        lengths = torch.where(terminated | truncated, 0, lengths + 1)
        assert torch.equal(ours.episode_length_buf, lengths)


def test_failure_is_no_time_out():
    """rsl-rl-lib adds the value of what comes after time-outs, and of nothing else."""
    environment = RslVecEnv(batch(), SEED)
    not_a_number = torch.zeros(COUNT, 6)
    not_a_number[1] = torch.nan
    *_, dones, extras = environment.step(not_a_number)
    assert dones.tolist() == [0, 1, 0]
    assert extras["time_outs"].tolist() == [False] * COUNT
    for _ in range(LONGEST - 1):
        *_, dones, extras = environment.step(torch.zeros(COUNT, 6))
    assert dones.tolist() == [1, 0, 1]
    assert extras["time_outs"].tolist() == [True, False, True]


def test_rewards_that_are_not_finite_are_told_after_the_round():
    environment = RslVecEnv(batch(), SEED)
    step = environment.batch.step

    def spoilt(actions):
        observations, rewards, terminated, truncated, infos = step(actions)
        term, values = next(iter(infos["reward_terms"].items()))
        infos["reward_terms"][term] = values * torch.nan
        return observations, rewards * torch.nan, terminated, truncated, infos

    environment.check_rewards()
    environment.batch.step = spoilt  # type: ignore[method-assign]
    environment.step(torch.zeros(COUNT, 6))
    with pytest.raises(OwnCodeError, match=r"the reward term 'position' of task 'track' .* was nan in a step"):
        environment.check_rewards()


def test_episodes_cannot_be_given_other_lengths():
    environment = RslVecEnv(batch(), SEED)
    with pytest.raises(AttributeError, match="as long as its path: learn with init_at_random_ep_len=False"):
        make_runner(SETTINGS, environment, SEED).learn(1, init_at_random_ep_len=True)


def test_our_actor_acts_as_their_policy_and_keeps_its_weights():
    environment = RslVecEnv(batch(), SEED)
    runner = make_runner(SETTINGS, environment, SEED)
    seen = environment.get_observations()
    with torch.no_grad():
        runner.alg.get_policy().mlp[-1].weight *= 500.0  # else no action comes near its limits
        before = runner.alg.get_policy()(seen).clamp(-1.0, 1.0)
    actor = actor_of(runner, SETTINGS)
    assert before.abs().max() == 1.0
    acted = actor(seen["policy"]).detach()
    torch.testing.assert_close(acted, before, rtol=0.0, atol=1e-6)  # round-off of float32 actions up to 1
    runner.learn(1)
    assert torch.equal(actor(seen["policy"]), acted)
    assert (actor_of(runner, SETTINGS)(seen["policy"]) - acted).abs().max() > 1e-3


def test_a_run_leaves_a_policy_that_evaluates_alike_after_loading(tmp_path):
    best = train(task(), SETTINGS, SEED, tmp_path, lambda steps, verdict: None, threads=1)
    facts = yaml.safe_load((tmp_path / "run.yaml").read_text(encoding="utf-8"))
    assert parse(RslPPOSettings, facts["agent"], "run.yaml") == SETTINGS
    assert facts["completed"] is True
    assert [one["steps"] for one in facts["validations"]] == [12, 24]
    bundle = load_policy(tmp_path / "best")
    assert bundle.description.name == "RSL_PPO"
    assert bundle.description.trained_with["steps"] == best.steps
    again = train(task(), SETTINGS, SEED, tmp_path / "again", lambda steps, verdict: None, threads=1)
    assert again.verdict == best.verdict
    observations = np.random.default_rng(0).normal(size=(5, bundle.description.layout.size)).astype(np.float32)
    other = load_policy(tmp_path / "again" / "best")
    np.testing.assert_array_equal(bundle.agent.act(observations), other.agent.act(observations))


def test_what_works_on_arrays_alone_is_refused(tmp_path):
    for kind in ("wrappers", "shaping"):
        feature = {"wrappers": "motor_lag", "shaping": "effort"}[kind]
        with pytest.raises(ValueError, match=f"'{kind}' of the task need NumPy arrays, .* leave out '{feature}'"):
            train(task(**{kind: [feature]}), SETTINGS, SEED, tmp_path, lambda steps, verdict: None, threads=1)


def test_a_device_that_is_not_there_is_named(tmp_path):
    elsewhere = SETTINGS.model_copy(update={"device": "cuda:99"})
    with pytest.raises(ValueError, match="device must be one that Torch finds on this machine, got 'cuda:99'"):
        train(task(), elsewhere, SEED, tmp_path, lambda steps, verdict: None, threads=1)


def test_batches_must_be_whole():
    fields: dict[str, Any] = {"algorithm": "rsl_ppo", "n_envs": 4, "n_steps": 8}
    parse(RslPPOSettings, {**fields, "batch_size": 16}, "agent")
    with pytest.raises(
        ConfigurationError, match=r"'batch_size' must divide n_envs · n_steps = 32 steps, got 12: .* is 8$"
    ):
        parse(RslPPOSettings, {**fields, "batch_size": 12}, "agent")
    with pytest.raises(ConfigurationError, match=r"'batch_size' must be at most n_envs · n_steps = 32 steps, got 33"):
        parse(RslPPOSettings, {**fields, "batch_size": 33}, "agent")


def test_the_settings_for_a_gpu_are_meant_for_one():
    settings = read_agent("ppo_gpu")
    assert isinstance(settings, RslPPOSettings)
    assert (settings.device, settings.compile) == ("cuda", True)


def test_a_missing_library_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "rsl_rl.env", None)
    monkeypatch.delitem(sys.modules, "caster_gym.agents.learning.rsl_rl")
    with pytest.raises(DependencyNotInstalled, match=r"pip install 'caster_gym\[gpu\]'"):
        importlib.import_module("caster_gym.agents.learning.rsl_rl")


def test_a_fresh_batch_goes_on_from_a_state():
    batch, other = (RslVecEnv(TorchVectorEnv("track", COUNT, max_episode_steps=LONGEST, **QUICK), s) for s in (1, 2))
    actions = 2.0 * torch.rand((3 * LONGEST, COUNT, 6), generator=torch.Generator().manual_seed(4)) - 1.0
    for one in actions[:2]:
        batch.step(one)
    other.set_state(batch.get_state())
    assert torch.equal(other.get_observations()["policy"], batch.get_observations()["policy"])
    for one in actions[2:]:
        ours, theirs = other.step(one), batch.step(one)
        assert torch.equal(ours[0]["policy"], theirs[0]["policy"])
        assert all(torch.equal(mine, expected) for mine, expected in zip(ours[1:3], theirs[1:3], strict=True))
        assert torch.equal(other.episode_length_buf, batch.episode_length_buf)
