"""caster_gym.envs.tensor.drive: a control period of motion; on a floor of finite friction, with gradients."""

import math

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym.envs.tensor.task import TorchTask
from tests.test_envs_floor import ISLANDS, OBSTACLES
from tests.test_envs_tensor_task import SMALL
from tests.test_envs_tensor_vector_env import assert_same_episodes, both, random_actions

CIRCLE = {"shape": "circle", "radius": 0.5}


def test_a_wrench_pushes_the_robot():
    """1 N forward for a control period of 20 ms: Δv = F h / M, M between platform and all bodies, 5 and 9 kg."""
    task = TorchTask("track", path=CIRCLE, dtype=torch.float64)
    state, _ = task.begin(torch.arange(1))
    moved, _ = task.step(state, torch.zeros((1, 6)), torch.tensor([[1.0, 0.0, 0.0]]))
    speed = math.hypot(moved.bodies[4].item(), moved.bodies[5].item())
    assert 0.02 / 9.0 < speed < 0.02 / 5.0


@pytest.mark.parametrize("floor", ["grip", ISLANDS])
def test_substeps_one_by_one_are_all_of_them_at_once(floor):
    """To the last bit: one by one where a gradient is wanted, so that the compiler has less to look at."""
    task = TorchTask("track", path=CIRCLE, floor=floor, dtype=torch.float64)
    state, _ = task.begin(torch.arange(3))
    actions = torch.full((3, 6), 0.3)
    at_once, _ = task.step(state, actions)
    one_by_one, _ = task.step(state._replace(bodies=state.bodies.clone().requires_grad_()), actions)
    assert torch.equal(one_by_one.bodies, at_once.bodies)


@pytest.mark.slow
@pytest.mark.parametrize("task", ["track", "follow"])
def test_episodes_on_islands_of_ice_are_those_of_the_compiled_batch(task):
    failures, ends, _ = assert_same_episodes(*both(task, 9, corridor=0.09, floor=ISLANDS), 100)
    assert failures + ends >= 3


@pytest.mark.slow
def test_episodes_among_obstacles_on_a_slippery_floor_are_those_of_the_compiled_batch():
    """Pillars and walls beside two paths: impacts in which wheels slip, and lasting contacts."""
    floor = {"friction": 0.4}
    *_, impacts = assert_same_episodes(*both("follow", 4, arena=OBSTACLES, corridor=0.6, floor=floor), 8, 1.5)
    assert impacts >= 1


@pytest.mark.slow
def test_single_precision_stays_within_a_millimetre():
    """Over 40 periods: 160 steps of 1.2e-7, spread by casters that swing freely."""
    theirs, ours = both("track", 8, dtype=torch.float32, corridor=5.0, max_episode_steps=1000, floor=ISLANDS)
    theirs.reset(seed=5), ours.reset(seed=5)
    for actions in random_actions(8, 6, 40):
        *_, infos = theirs.step(actions)
        *_, told = ours.step(torch.tensor(actions))
    assert_allclose(told["pose"], infos["pose"], rtol=0.0, atol=1e-3)
    assert_allclose(told["wheel_slip"], infos["wheel_slip"], rtol=0.0, atol=0.02)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", [torch.float64, torch.float32])
def test_gradients_pass_and_are_those_of_differences(dtype):
    """From slips and poses, where wheels slide and where they stand still at first, back to the actions."""
    task = TorchTask("track", path=CIRCLE, floor={"friction": 0.3}, corridor=5.0, dtype=dtype)
    start, _ = task.begin(torch.arange(3))

    def outcome(actions):
        state = start
        for _ in range(3):
            state, told = task.step(state, actions)
        return state.bodies[:7].sum() + 0.1 * task.info(told.report)["wheel_slip"].sum()

    actions = torch.full((3, 6), 0.35, dtype=dtype, requires_grad=True)
    (slope,) = torch.autograd.grad(outcome(actions), actions)
    assert torch.isfinite(slope).all() and slope.abs().max() > 1e-3
    if dtype is torch.float64:
        way = torch.tensor(np.random.default_rng(0).normal(size=(3, 6)))
        with torch.no_grad():
            difference = (outcome(actions + 1e-6 * way) - outcome(actions - 1e-6 * way)) / 2e-6
        assert_allclose(float((slope * way).sum()), float(difference), rtol=1e-4)


@pytest.mark.slow
@pytest.mark.parametrize("part", ["_move", "_look", "_place"])
def test_each_part_is_one_graph_for_the_compiler_on_every_floor(part):
    task = TorchTask("track", path=CIRCLE, floor=ISLANDS, dtype=torch.float64, **SMALL)
    state, _ = task.begin(torch.arange(3))
    actions = torch.full((3, 4), 0.3)
    expected, _ = task.restart(*task.step(state, actions), torch.ones(3, dtype=torch.bool))
    setattr(task, part, torch.compile(getattr(task, part), fullgraph=True, backend="eager", dynamic=False))
    seen, _ = task.restart(*task.step(state, actions), torch.ones(3, dtype=torch.bool))
    assert_allclose(seen.bodies, expected.bodies, rtol=0.0, atol=1e-12)


def test_numbers_of_the_robots_may_be_replaced():
    """Each robot on a floor of its own: the friction is one of a robot's numbers."""
    task = TorchTask("track", path=CIRCLE, floor={"friction": 0.7}, dtype=torch.float64)
    frictions = torch.tensor([0.7, 0.01], dtype=torch.float64)
    task.parameters = task.parameters._replace(platform=task.parameters.platform._replace(floor_friction=frictions))
    state, _ = task.begin(torch.zeros(2, dtype=torch.int64))
    _, outcome = task.step(state, torch.full((2, 6), 0.2))
    slip = task.info(outcome.report)["wheel_slip"].max(1).values
    assert slip[0] < 1e-9 and slip[1] > 1e-3
