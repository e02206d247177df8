"""caster_gym.envs.tensor.task: one control period as a function of tensors."""

from typing import Any

import pytest
import torch

from caster_gym import load_robot
from caster_gym.envs.tensor.task import TorchTask

CIRCLE = {"shape": "circle", "radius": 0.5}


@pytest.fixture(scope="module", params=["track", "follow"])
def task(request):
    return TorchTask(request.param, path=CIRCLE)


def test_a_step_leaves_the_given_state_as_it_was(task):
    state, _ = task.begin(torch.arange(3))
    copies = [tensor.clone() for tensor in state]
    task.step(state, torch.ones((3, 6)))
    assert all(torch.equal(tensor, copy) for tensor, copy in zip(state, copies, strict=True))


def test_the_same_state_and_actions_give_the_same_outcome(task):
    state, _ = task.begin(torch.arange(3))
    for ours, theirs in zip(*(task.step(state, torch.ones((3, 6)))[1] for _ in range(2)), strict=True):
        assert torch.equal(ours, theirs)


def test_only_chosen_robots_start_again(task):
    state, _ = task.begin(torch.arange(3))
    state, outcome = task.step(state, torch.ones((3, 6)))
    chosen = torch.tensor([True, False, True])
    after, seen = task.restart(state, outcome, chosen)
    assert after.clocks.tolist() == [0, 1, 0]
    assert after.episodes.tolist() == [2, 1, 2]
    assert torch.equal(after.bodies[:, 1], state.bodies[:, 1])
    assert torch.equal(seen.observations[1], outcome.observations[1])
    assert torch.equal(seen.rewards, outcome.rewards)


def test_a_wrench_of_another_shape_is_refused():
    task = TorchTask("track", path=CIRCLE)
    state, _ = task.begin(torch.arange(2))
    with pytest.raises(ValueError, match=r"wrench must have shape \(2, 3\), got \(3,\)"):
        task.step(state, torch.zeros((2, 6)), torch.ones(3))


PAIR = load_robot("chung2008")
PAIR = PAIR.model_copy(update={"casters": PAIR.casters[:2], "actuation": "all"})
SMALL: dict[str, Any] = {"robot": PAIR, "preview": (0.1,), "control_period": 0.005, "substeps": 1}  # to compile


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "part"),
    [("track", "_move"), ("track", "_look"), ("track", "_place"), ("follow", "_look"), ("follow", "_place")],
)
def test_each_part_is_one_graph_for_the_compiler(name, part):
    """So that nothing in it waits for the device; a break of the graph is an error of the compiler."""
    task = TorchTask(name, path=CIRCLE, dtype=torch.float64, **SMALL)
    state, _ = task.begin(torch.arange(3))
    actions = torch.full((3, 4), 0.3)
    expected = task.restart(*task.step(state, actions), torch.ones(3, dtype=torch.bool))
    setattr(task, part, torch.compile(getattr(task, part), fullgraph=True, backend="eager", dynamic=False))
    seen = task.restart(*task.step(state, actions), torch.ones(3, dtype=torch.bool))
    assert torch.equal(seen[0].bodies, expected[0].bodies)
    assert torch.equal(seen[1].rewards, expected[1].rewards)


def episodes(compiled):
    """A task, its state and outcome after two control periods, and the gradient of rewards by the actions."""
    task = TorchTask("track", path=CIRCLE, dtype=torch.float64, compile=compiled, diagnostics=False, **SMALL)
    state, _ = task.begin(torch.arange(4))
    generator = torch.Generator().manual_seed(3)
    actions = torch.rand((2, 4, 4), generator=generator, dtype=torch.float64).sub(0.5).requires_grad_()
    rewards = []
    for action in actions:
        state, outcome = task.step(state, action)
        rewards.append(outcome.rewards.sum())
    torch.stack(rewards).sum().backward()
    return task, state, outcome, actions.grad


@pytest.fixture(scope="module")
def compiled():
    return episodes(True)


@pytest.mark.slow
def test_compiled_gradients_are_the_eager_ones(compiled):
    """1e-12 of order 1: the same products in another order; a gradient through a wrong buffer differs by 3e-5."""
    torch.testing.assert_close(compiled[-1], episodes(False)[-1], rtol=0.0, atol=1e-12)


@pytest.mark.slow
def test_a_compiled_task_goes_on_from_arrays_without_compiling_anew(compiled):
    """To the last bit, since the arrays have the types and strides that it was compiled for."""
    task, state, outcome, _ = compiled
    actions = torch.full((4, 4), 0.3, dtype=torch.float64, requires_grad=True)
    with torch.compiler.set_stance("fail_on_recompile"):
        expected = task.step(state.detached(), actions)
        seen = task.step(task.from_arrays(task.to_arrays(state, outcome))[0], actions)
    for ours, theirs in zip((*seen[0], *seen[1]), (*expected[0], *expected[1]), strict=True):
        assert torch.equal(ours, theirs)
