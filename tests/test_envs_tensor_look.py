"""caster_gym.envs.tensor.look: what robots on tensors see, and which of it takes no part in anything else."""

import math

import pytest
import torch

from caster_gym.envs.report import REPORT
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from tests.test_envs_tensor_vector_env import random_actions

CIRCLE = {"shape": "circle", "radius": 0.5}


@pytest.mark.parametrize("name", ["track", "follow"])
def test_nobody_looks_at_what_others_are(name):
    """Robots that are looked at one by one have the rewards, reports and observations that they have in a batch."""
    task = TorchTask(name, path=CIRCLE, dtype=torch.float64)
    whole = task.begin(torch.arange(3))[1]
    for robot in range(3):
        alone = task.begin(torch.tensor([robot]))[1]
        assert torch.equal(alone.observations[0], whole.observations[robot])
        assert torch.equal(alone.report[:, 0], whole.report[:, robot])


def test_rewards_are_the_sum_of_the_terms_that_are_reported():
    task = TorchTask("track", path=CIRCLE, dtype=torch.float64)
    outcome = task.step(task.begin(torch.arange(3))[0], torch.full((3, 6), 0.3))[1]
    terms = task.info(outcome.report)["reward_terms"]
    assert len(terms) > 3
    # 1e-15: the same numbers of order 1, perhaps added in another order
    torch.testing.assert_close(sum(terms.values()), outcome.rewards, rtol=0.0, atol=1e-15)


def test_time_is_over_with_the_last_period_of_the_path():
    task = TorchTask("track", path=CIRCLE, corridor=50.0)
    state, _ = task.begin(torch.arange(2))
    last = len(task.engine.plan.tables[0]) - 1  # control periods
    state = state._replace(clocks=torch.tensor([last - 2, last - 1]))
    outcome = task.step(state, torch.zeros((2, 6)))[1]
    assert outcome.truncated.tolist() == [False, True]
    assert not outcome.terminated.any()


def test_where_no_obstacle_is_the_nearest_is_infinitely_far():
    _, outcome = TorchTask("track", path=CIRCLE).begin(torch.arange(2))
    assert outcome.report[REPORT.situation.clearance].tolist() == [math.inf, math.inf]


def test_what_is_seen_at_a_start_depends_on_the_robots_own_numbers():
    """Its casters' trails scale their observed rates, and more."""
    task = TorchTask("track", path=CIRCLE, dtype=torch.float64)
    trail = torch.full((2,), 0.02, dtype=torch.float64, requires_grad=True)
    casters = tuple(caster._replace(trail=trail) for caster in task.parameters.casters)
    task.parameters = task.parameters._replace(casters=casters)
    _, outcome = task.begin(torch.arange(2))
    (slope,) = torch.autograd.grad(outcome.report[REPORT.deviation.conditioning].sum(), trail)
    assert (slope != 0.0).all()


def test_without_diagnostics_everything_else_is_the_same():
    whole, lean = (TorchVectorEnv("track", 8, path="lemniscate", diagnostics=given) for given in (True, False))
    whole.reset(seed=0), lean.reset(seed=0)
    for actions in random_actions(8, 6, 20):
        *ours, infos = whole.step(torch.as_tensor(actions))
        *theirs, fewer = lean.step(torch.as_tensor(actions))
        assert all(torch.equal(a, b) for a, b in zip(ours, theirs, strict=True))
    assert set(infos) - set(fewer) == {"traction_use", "wheels_lifted", "conditioning"}
    assert all(torch.equal(infos[name], fewer[name]) for name in ("position_error", "progress", "power"))
