"""caster_gym.engines.tensor.fleet: the same trajectories as compiled by Numba; precision, parameters, bad input."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.tensor.fleet import TorchFleet
from tests.random_robots import random_robot

STEP = 1e-3  # s


def both(robots, count=None, **arguments):
    """A Numba and a Torch fleet in the same motion, and torques for them."""
    theirs, ours = Fleet(robots, count), TorchFleet(robots, count, **arguments)
    rng = np.random.default_rng(5)
    state = theirs.state
    state[:, 4:7] = 0.3 * rng.normal(size=(theirs.count, 3))
    theirs.state, ours.state = state, torch.tensor(state)
    return theirs, ours, rng.uniform(-0.02, 0.02, (theirs.count, 2 * theirs.robots[0].caster_count))


@pytest.mark.slow
@pytest.mark.parametrize("caster_count", [2, 3, 4])
def test_100_steps_agree_with_numba(caster_count):
    """1e-10 of order 1: rounding is 1e-16, and the motion spreads it less than a million times."""
    theirs, ours, torque = both([random_robot(seed, caster_count) for seed in range(3)], dtype=torch.float64)
    theirs.step(torque, STEP, 100)
    ours.step(torch.tensor(torque), STEP, 100)
    assert_allclose(ours.state, theirs.state, rtol=0.0, atol=1e-10)


@pytest.mark.slow
def test_single_precision_stays_within_a_tenth_of_a_millimetre():
    """1.2e-7 a step, over 500 steps at random signs 3e-6; the motion spreads that about thirty times."""
    theirs, ours, torque = both(load_robot("chung2008"), 20)
    theirs.step(torque, 5e-3, 500)
    ours.step(torch.tensor(torque), 5e-3, 500)
    assert ours.state.dtype == torch.float32
    assert_allclose(ours.state, theirs.state, rtol=0.0, atol=1e-4)


def test_a_state_that_is_read_is_not_changed_by_the_next_step():
    _, ours, torque = both(load_robot("chung2008"), 2)
    before = ours.state
    copy = before.clone()
    ours.step(torch.tensor(torque), STEP)
    assert torch.equal(before, copy)
    assert not torch.equal(ours.state, copy)


@pytest.mark.parametrize("dtype", [torch.float16, torch.bfloat16, torch.int64])
def test_other_precisions_are_refused(dtype):
    with pytest.raises(ValueError, match=f"dtype must be torch.float32 or torch.float64, got {dtype}"):
        TorchFleet(load_robot("chung2008"), dtype=dtype)


@pytest.mark.parametrize("device", ["cuda:99", "abacus"])
def test_a_device_that_is_not_there_is_refused(device):
    with pytest.raises(ValueError, match=f"device must be one that Torch finds on this machine, got '{device}'"):
        TorchFleet(load_robot("chung2008"), device=device)


def test_a_batch_too_large_for_the_memory_is_refused():
    with pytest.raises(ValueError, match=r"a batch of 1,000,000,000,000,000 robots needs at least .* GiB of memory"):
        TorchFleet(load_robot("chung2008"), 10**15)


def test_robots_with_different_numbers_of_casters_are_refused():
    with pytest.raises(ValueError, match=r"the same number of casters, got \[2, 3\]"):
        TorchFleet([random_robot(1, 2), random_robot(1, 3)])
    with pytest.raises(ValueError, match="a batch needs one robot for all or 3 of them, got 2"):
        TorchFleet([random_robot(1, 2), random_robot(2, 2)], 3)


def test_wrong_shapes_and_steps_are_refused():
    fleet = TorchFleet(load_robot("chung2008"), 4)
    with pytest.raises(ValueError, match=r"state must have shape \(4, 13\), got \(4, 12\)"):
        fleet.state = torch.zeros((4, 12))
    with pytest.raises(ValueError, match=r"torque must have shape \(4, 6\), got \(6,\)"):
        fleet.step(torch.zeros(6), STEP)
    with pytest.raises(ValueError, match="steps must be 0 or more, got -1"):
        fleet.step(torch.zeros((4, 6)), STEP, -1)
    with pytest.raises(ValueError, match=r"a time step of 0.02 s cannot follow the casters"):
        fleet.step(torch.zeros((4, 6)), 0.02)


@pytest.mark.slow
def test_a_compiled_fleet_agrees_with_an_eager_one():
    """The compiler keeps the order of roundings, not their number: 1e-12 of order 1 after 20 steps."""
    robot = random_robot(3, 2)
    theirs, ours, torque = both(robot, 8, dtype=torch.float64, compile=True)
    theirs.step(torque, STEP, 20)
    ours.step(torch.tensor(torque), STEP, 20)
    assert_allclose(ours.state, theirs.state, rtol=0.0, atol=1e-12)
