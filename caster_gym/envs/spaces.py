"""Action and observation spaces of the environments."""

import numpy as np
from gymnasium.spaces import Box

from caster_gym.envs.native.engine import TaskEngine
from caster_gym.envs.observation import OBSERVATION_LIMIT


def observation_space(engine: TaskEngine) -> "Box[np.float32]":
    """Space of one robot's observation."""
    return Box(-OBSERVATION_LIMIT, OBSERVATION_LIMIT, (engine.layout.size,), np.float32)


def action_space(engine: TaskEngine) -> "Box[np.float32]":
    """Space of one robot's action: a share of its greatest torque for each driven motor."""
    return Box(-1.0, 1.0, (len(engine.robot.driven),), np.float32)
