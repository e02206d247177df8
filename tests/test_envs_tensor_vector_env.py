"""caster_gym.envs.tensor.vector_env: the episodes of the compiled batch, on tensors."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from tests.random_robots import random_robot

IDS = {"track": "caster_gym:CasterTrack-v0", "follow": "caster_gym:CasterFollow-v0"}
PATHS = [{"shape": "circle", "radius": 0.5}, {"shape": "rounded_square"}]
LONGEST = 40
EXACT = 1e-10  # of order 1: rounding is 1e-16, and a control period's motion spreads it little; starts are equal
ROOTS = ("conditioning", "traction_use")  # of numbers that may be differences
OBSTACLES = {
    "beside": {"pillars": 3, "walls": 2, "gap": [0.01, 0.02]},
    "room": [[-2.0, -2.0], [2.0, 2.0]],
    "restitution": 0.6,
    "friction": 0.3,
}


def both(task, count, dtype=torch.float64, **arguments) -> tuple[Any, TorchVectorEnv]:
    """The compiled batch, and ours."""
    arguments = {"path": PATHS, "max_episode_steps": LONGEST, **arguments}
    mode = AutoresetMode.SAME_STEP
    theirs = gym.make_vec(
        IDS[task], count, vectorization_mode="vector_entry_point", autoreset_mode=mode, **arguments
    ).unwrapped
    return theirs, TorchVectorEnv(task, count, dtype=dtype, **arguments)


def random_actions(count, joints, steps, seed=7):
    """Torques that last for some periods, and differ in size from robot to robot."""
    rng = np.random.default_rng(seed)
    size, kept = rng.uniform(0.0, 1.2, (count, 1)), np.zeros((count, joints))
    for _ in range(steps):
        kept = np.where(rng.uniform(size=(count, 1)) < 0.2, rng.uniform(-1.0, 1.0, kept.shape), kept)
        yield (size * kept).astype(np.float32)


def assert_infos_agree(ours, theirs, who=slice(None)):
    for key, value in ours.items():
        if isinstance(value, dict):
            assert_infos_agree(value, theirs[key], who)
        else:
            tolerance = 1e-7 if key in ROOTS else EXACT
            assert_allclose(np.asarray(value)[who], theirs[key][who], rtol=0.0, atol=tolerance, err_msg=key)


def assert_same_episodes(theirs, ours, steps, speed=0.0):
    """Returns how many episodes failed and how many ran out of time, and how many impacts there were."""
    seen, infos = ours.reset(seed=5)
    expected, told = theirs.reset(seed=5)
    assert_allclose(seen, expected, rtol=1e-6, atol=1e-6)  # theirs are in single precision
    assert_infos_agree(infos, told)
    states = theirs.engine.states
    states[:, 5] = speed * np.where(np.arange(len(states)) % 2, 1.0, -1.0)  # to the left and to the right
    theirs.engine.states, ours.states = states, torch.tensor(states)
    failures = ends = impacts = 0
    for actions in random_actions(ours.num_envs, len(ours.robot.driven), steps):
        seen, rewards, terminated, truncated, infos = ours.step(torch.tensor(actions))
        expected, *others, told = theirs.step(actions)
        assert_allclose(seen, expected, rtol=1e-6, atol=1e-6)
        assert_allclose(rewards, others[0], rtol=0.0, atol=EXACT)
        assert_array_equal(terminated, others[1])
        assert_array_equal(truncated, others[2])
        assert_allclose(ours.states, theirs.engine.states, rtol=0.0, atol=EXACT)
        finals = {key: infos.pop(key) for key in ("final_obs", "_final_obs", "final_info")}
        assert_infos_agree(infos, told)
        ended = finals["_final_obs"].numpy()
        assert_array_equal(ended, others[1] | others[2])
        if ended.any():
            last = np.stack(told["final_obs"][ended])
            assert_allclose(finals["final_obs"][ended], last, rtol=1e-6, atol=1e-6)
            assert_infos_agree(finals["final_info"], told["final_info"], ended)
        failures, ends = failures + int(terminated.sum()), ends + int(truncated.sum())
        impacts += int(finals["final_info"]["impacts"].sum())
    return failures, ends, impacts


@pytest.mark.parametrize("task", ["track", pytest.param("follow", marks=pytest.mark.slow)])
def test_episodes_are_those_of_the_compiled_batch(task):
    failures, ends, _ = assert_same_episodes(*both(task, 9, corridor=0.15), 100)
    assert failures >= 3  # both kinds of ends were seen
    assert ends >= 3


@pytest.mark.slow
@pytest.mark.parametrize("task", list(IDS))
def test_episodes_among_obstacles_are_those_of_the_compiled_batch(task):
    """Pillars and walls beside two paths, in a room: impacts and lasting contacts."""
    *_, impacts = assert_same_episodes(*both(task, 4, arena=OBSTACLES, corridor=0.6, nearest=3), 10, 1.5)
    assert impacts >= 1


def test_each_robot_may_have_its_own_numbers():
    theirs, ours = both("track", 3, corridor=0.3)
    robots = [random_robot(seed, 3) for seed in (1, 2, 3)]
    ours.set_robots(robots)
    rows = np.array([pack_parameters(robot_parameters(robot)) for robot in robots])
    theirs.engine.set_parameters(np.arange(3), rows)
    assert_same_episodes(theirs, ours, 30)


def test_driven_joints_are_those_of_the_robot():
    path = {"shape": "circle", "radius": 0.5, "duration": 30.0}  # four motors are weaker than six
    actuation = ["roll_1", "steer_1", "roll_2", "steer_2"]
    assert_same_episodes(*both("track", 3, path=path, actuation=actuation, corridor=0.3), 30)


def test_single_precision_stays_within_a_tenth_of_a_millimetre():
    """Over 40 periods without restarts: 160 steps of 1.2e-7, spread less than a hundred times."""
    theirs, ours = both("track", 8, dtype=torch.float32, corridor=5.0, max_episode_steps=1000)
    theirs.reset(seed=5), ours.reset(seed=5)
    for actions in random_actions(8, 6, 40):
        theirs.step(actions)
        seen, rewards, *_ = ours.step(torch.tensor(actions))
    assert seen.dtype == rewards.dtype == torch.float32
    assert_allclose(ours.states, theirs.engine.states, rtol=0.0, atol=1e-4)


def test_results_are_new_tensors_at_each_call():
    ours = TorchVectorEnv("track", 2, path=PATHS)
    first = ours.reset(seed=1)[0]
    copy = first.clone()
    second = ours.step(torch.ones((2, 6)))[0]
    ours.step(torch.ones((2, 6)))
    assert torch.equal(first, copy)
    assert second.data_ptr() != first.data_ptr()


def test_an_action_that_is_no_number_ends_its_robots_episode_alone():
    ours = TorchVectorEnv("track", 3, path=PATHS)
    ours.reset(seed=1)
    actions = torch.zeros((3, 6))
    actions[1, 4] = torch.nan
    seen, rewards, terminated, _, infos = ours.step(actions)
    assert terminated.tolist() == [False, True, False]
    assert infos["final_info"]["not_finite"].tolist() == [False, True, False]
    assert rewards[1] == 0.0
    assert seen.isfinite().all()


def test_bad_input_is_refused():
    with pytest.raises(
        ValueError, match="the task must be 'track', 'follow', 'hold' or 'module:Name' of your own, got 'race'"
    ):
        TorchVectorEnv("race", 2)
    with pytest.raises(ValueError, match=r"dtype must be torch\.float32 or torch\.float64, got torch\.float16"):
        TorchVectorEnv("track", 2, dtype=torch.float16)
    with pytest.raises(ValueError, match="device must be one that Torch finds on this machine, got 'cuda:99'"):
        TorchVectorEnv("track", 2, device="cuda:99")
    with pytest.raises(ValueError, match=r"a batch of 10,000,000,000,000 robots needs at least .* GiB of memory"):
        TorchVectorEnv("track", 10**13, path=PATHS)
    with pytest.raises(ValueError, match="num_envs must be 1 or more, got 0"):
        TorchVectorEnv("track", 0, path=PATHS)
    with pytest.raises(ValueError, match="corridoor"):
        TorchVectorEnv("track", 2, path=PATHS, corridoor=1.0)
    ours = TorchVectorEnv("track", 2, path=PATHS)
    with pytest.raises(RuntimeError, match="reset the batch before its first step"):
        ours.step(torch.zeros((2, 6)))
    with pytest.raises(ValueError, match="seed must be one number or 2 of them, got 3"):
        ours.reset(seed=[1, 2, 3])
    ours.reset(seed=1)
    with pytest.raises(ValueError, match=r"actions must have shape \(2, 6\), got \(2, 5\)"):
        ours.step(torch.zeros((2, 5)))
    with pytest.raises(ValueError, match=r"the same number of casters, got \[3, 4\]"):
        ours.set_robots([load_robot("chung2008"), random_robot(1, 4)])
    with pytest.raises(ValueError, match=r"rows must have shape \(2, 100\), got \(2, 94\)"):
        ours.set_parameters(torch.zeros((2, 94)))
