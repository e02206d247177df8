"""A time step in rows of tensors, against the same step of plain numbers."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym.engines.tensor.motion import driven_rows
from caster_gym.mechanics.integration import pack_state, unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.plant import driven_step
from caster_gym.mechanics.scalars import flatten, pairs
from tests.random_robots import random_robot

ROBOTS, STEP = 5, 5e-3
ROUNDING = 1e-12  # of some hundred operations on numbers of order 1


@pytest.mark.parametrize("casters", [2, 3, 5])
def test_each_robot_moves_as_if_it_were_alone(casters):
    robot = robot_parameters(random_robot(casters, casters))
    rng = np.random.default_rng(casters)
    angles = rng.uniform(-np.pi, np.pi, (casters + 1, ROBOTS))
    turned = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    bodies = np.concatenate([rng.normal(size=(2, ROBOTS)), turned[0], rng.normal(size=(3, ROBOTS)), *turned[1:]])
    commands, push = rng.uniform(-1.0, 1.0, (2 * casters, ROBOTS)), rng.normal(size=(3, ROBOTS))
    states, torques, wrenches = (torch.as_tensor(rows) for rows in (bodies, commands, push))
    end, done, asks = driven_rows(states, torques, wrenches, STEP, robot, asking=True)
    for i in range(ROBOTS):
        state, wanted = unpack_state(tuple(bodies[:, i].tolist())), pairs(tuple(commands[:, i].tolist()))
        alone, drive = driven_step(state, wanted, tuple(push[:, i].tolist()), STEP, robot)
        assert_allclose(end[:, i], pack_state(alone), rtol=ROUNDING, atol=ROUNDING)
        assert_allclose(done[:, i], (*flatten(drive.torques), drive.power), rtol=ROUNDING, atol=ROUNDING)
        assert_allclose(asks[:, i], drive.asks, rtol=1e-9)  # loads are found from differences of weights
