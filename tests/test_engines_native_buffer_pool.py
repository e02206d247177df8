"""Recycled arrays: never one that somebody still holds, and few that nobody holds."""

import weakref
from typing import Any

import gymnasium as gym
import numpy as np
import torch

from caster_gym.engines.native.buffer_pool import KEPT, BufferPool

STEPS = 20


def test_an_array_comes_back_once_nobody_holds_it():
    pool = BufferPool((3, 4), np.float32)
    first = pool.take()
    assert first.shape == (3, 4)
    assert first.dtype == np.float32
    place = first.ctypes.data
    second = pool.take()
    assert second.ctypes.data != place
    del first
    assert pool.take().ctypes.data == place


def test_whatever_looks_at_an_array_keeps_it():
    """Views, views of views, tensors and buffers all hold the array they show."""
    looks: tuple[Any, ...] = (lambda a: a[1], lambda a: a.T[:2].reshape(-1), torch.from_numpy, memoryview)
    for look in looks:
        pool = BufferPool((2, 2), np.float64)
        seen = look(pool.take())
        other = pool.take()
        other[:] = 7.0
        assert not np.shares_memory(other, np.asarray(seen))


def test_who_keeps_many_arrays_does_not_make_the_pool_keep_them():
    pool = BufferPool((2, 2), np.float64)
    held = [pool.take() for _ in range(3 * KEPT)]
    assert len({array.ctypes.data for array in held}) == 3 * KEPT
    spare = [weakref.ref(array) for array in held]
    held.clear()
    assert sum(one() is not None for one in spare) == KEPT


def test_what_a_batch_gave_stays_as_it_was():
    """Observations, rewards and infos of all steps, kept, equal copies taken at once."""
    batch = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=5)
    kept, copies = [], []
    batch.reset(seed=0)
    batch.action_space.seed(0)
    for _ in range(STEPS):
        observations, rewards, _, _, infos = batch.step(batch.action_space.sample())
        kept.append((observations, rewards, infos["pose"], infos["reward_terms"]["position"]))
        copies.append(tuple(array.copy() for array in kept[-1]))
    for given, copied in zip(kept, copies, strict=True):
        for one, other in zip(given, copied, strict=True):
            np.testing.assert_array_equal(one, other)


def test_a_batch_whose_steps_are_not_kept_goes_on_in_the_same_memory():
    """Two sets of arrays take turns: what the user has in hand, and what is being written."""
    batch = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=5)
    batch.reset(seed=0)
    batch.action_space.seed(0)
    places = set()
    for _ in range(STEPS):
        observations, *_ = batch.step(batch.action_space.sample())
        places.add(observations.ctypes.data)
    assert len(places) == 2
