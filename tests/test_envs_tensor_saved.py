"""caster_gym.envs.tensor.saved: batches on tensors go on from arrays as they would have, to the last bit."""

from typing import Any

import numpy as np
import pytest
import torch
from numpy.testing import assert_array_equal

from caster_gym.envs.tensor.task import TorchTask
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters

QUICK: dict[str, Any] = {"control_period": 0.01, "substeps": 1}  # one RK4 step a period: uncompiled Torch is slow
COUNT, LONGEST = 3, 6


def make(task="track", count=COUNT, **arguments):
    return TorchVectorEnv(task, count, max_episode_steps=LONGEST, **{**QUICK, **arguments})


def go_on(batch, seed, steps):
    """All tensors that some steps bring."""
    generator = torch.Generator().manual_seed(seed)
    brought = []
    for _ in range(steps):
        actions = 2.0 * torch.rand((batch.num_envs, 6), generator=generator) - 1.0
        *tensors, infos = batch.step(actions)
        brought += [*tensors, infos["position_error"], infos["final_obs"], infos["torque"], infos["clearance"]]
    return brought


def assert_same(ours, theirs):
    for mine, other in zip(ours, theirs, strict=True):
        assert mine.dtype == other.dtype
        assert_array_equal(mine, other)


ARENA = {"beside": {"pillars": 3, "walls": 2, "gap": [0.01, 0.02]}}


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"dtype": torch.float64, "diagnostics": False},
        {"task": "follow", "arena": ARENA},
        {"floor": {"friction": 0.3}},
    ],
    ids=["float32", "float64", "obstacles", "floor"],
)
def test_a_fresh_batch_goes_on_from_arrays(arguments):
    batch, other = make(**arguments), make(**arguments)
    batch.reset(seed=3)
    go_on(batch, 1, 4)
    state = {name: array.copy() for name, array in batch.get_state().items()}
    expected = go_on(batch, 2, 2 * LONGEST)
    other.set_state(state)
    assert_same(go_on(other, 2, 2 * LONGEST), expected)
    assert_same(other.reset()[:1], batch.reset()[:1])
    assert_array_equal(other.single_action_space.sample(), batch.single_action_space.sample())
    assert {array.dtype.kind for array in state.values()} <= set("biuf")


def test_robots_of_their_own_numbers_are_part_of_the_state():
    batch, other = make(), make()
    nominal = torch.tensor(pack_parameters(robot_parameters(batch.robot)), dtype=batch.dtype)
    rows = nominal.repeat(COUNT, 1)
    rows[:, 0] *= torch.linspace(1.0, 1.2, COUNT)  # some are heavier
    untouched = other.get_state()
    batch.set_parameters(rows)
    batch.reset(seed=3)
    other.set_state(batch.get_state())
    assert_same(go_on(other, 1, 3), go_on(batch, 1, 3))
    other.set_state(untouched)  # which had not begun
    assert other.task.parameters == robot_parameters(batch.robot)
    with pytest.raises(RuntimeError, match="reset the batch"):
        go_on(other, 1, 1)


def test_a_differentiable_task_goes_on_from_arrays():
    task, again = (TorchTask("track", max_episode_steps=LONGEST, **QUICK) for _ in "ab")
    state, outcome = task.begin(torch.arange(COUNT))
    arrays = task.to_arrays(state, outcome)
    kept = {name: array.copy() for name, array in arrays.items()}
    gradients = []
    for one, begun in ((task, (state, outcome)), (again, again.from_arrays(arrays))):
        actions = torch.full((COUNT, 6), 0.3, requires_grad=True)
        state, outcome = one.step(begun[0], actions)
        state, outcome = one.step(state, actions)
        outcome.rewards.sum().backward()
        gradients.append((actions.grad, outcome.observations.detach(), state.bodies.detach()))
    assert_same(*gradients)
    assert_same(arrays.values(), kept.values())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"count": 4}, "its number of robots is 4, and here it is 3"),
        ({"task": "hold"}, "its task.kind is 'HoldParameters', and here it is 'TrackParameters'"),
        ({"dtype": torch.float64}, "its dtype is 'torch.float64', and here it is 'torch.float32'"),
        ({"robots/keys": None}, r"the state of the robots lacks 'keys', an array of int64 of shape \(3,\)"),
        ({"robots/paths": np.full(3, 500)}, "got clocks from 0 and paths in 500 … 500"),
        ({"robots/room": np.zeros(3)}, "'room' in the state of the robots must be an array of float32"),
    ],
)
def test_another_state_is_refused(change, message):
    batch = make()
    batch.reset(seed=3)
    before = batch.get_state()
    names = {name for name in change if "/" in name}
    state = {name: array for name, array in {**before, **change}.items() if array is not None}
    if not names:
        state = make(**change).get_state()
    with pytest.raises(ValueError, match=message):
        batch.set_state(state)
    assert_same(batch.get_state().values(), before.values())
