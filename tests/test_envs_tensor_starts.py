"""caster_gym.envs.tensor.starts: drawn and given starts are those of the compiled batch."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym.envs.tensor.task import TorchTask
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from tests.test_envs_starts import COUNT, KINDS, POOL, SEED, every_option
from tests.test_envs_tensor_vector_env import both


@pytest.mark.parametrize("place", list(KINDS))
def test_torch_starts_as_numba(place):
    """In double precision, up to the rounding of observations to float32 and of Torch's cosines."""
    task = "track" if place == "time" else "follow"
    ours = TorchVectorEnv(task, COUNT, dtype=torch.float64, **POOL)
    theirs = KINDS[place][1](COUNT, autoreset_mode="SameStep", **POOL)
    for options in every_option(place):
        mine, other = ours.reset(seed=SEED, options=options), theirs.reset(seed=SEED, options=options)
        assert_allclose(mine[0], other[0], rtol=0.0, atol=1e-6)
        assert_allclose(mine[1]["progress"], other[1]["progress"], rtol=0.0, atol=1e-12)
        action = np.full((COUNT, 6), 0.3, dtype=np.float32)
        assert_allclose(ours.step(torch.as_tensor(action))[0], theirs.step(action)[0], rtol=0.0, atol=1e-6)
    for options, message in (({"pose": [9.0, 0.0, 0.0]}, "outside the corridor"), ({place: 99.0}, "must lie in 0")):
        with pytest.raises(ValueError, match=message):
            ours.reset(options=options)


def test_resets_without_a_seed_go_on_with_the_sequence_of_episodes():
    theirs, ours = both("track", 4)
    for seed in (3, None, None):
        assert_allclose(ours.reset(seed=seed)[0], theirs.reset(seed=seed)[0], rtol=1e-6, atol=1e-6)
    assert_allclose(ours.reset(path=1)[0], theirs.reset(options={"path": 1})[0], rtol=1e-6, atol=1e-6)


def test_a_start_depends_on_the_robots_key_and_episode_alone():
    """Not on who else starts, nor on what has come before."""
    task = TorchTask("track", **POOL)
    state, _ = task.begin(torch.tensor([7, 8, 9]))
    moved, outcome = task.step(state, torch.ones((3, 6)))
    (later, _), (again, _) = (task.restart(one, outcome, torch.ones(3, dtype=torch.bool)) for one in (moved, state))
    assert torch.equal(later.bodies, again.bodies)
    assert (later.bodies != state.bodies).any(0).all()
    alone, _ = task.begin(torch.tensor([8]))
    assert torch.equal(alone.bodies[:, 0], state.bodies[:, 1])
