"""caster_gym.envs.specification: how an environment was made can be written as JSON, and makes it again."""

import json
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.envs.registration import EnvSpec
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

from caster_gym import load_robot
from caster_gym.arena.arena import read_arena
from caster_gym.envs.specification import plain
from caster_gym.paths.shapes import Circle, Lemniscate
from caster_gym.wrappers import Payload, SensorNoise, wrap

ROBOT = load_robot("chung2008")
OBJECTS: dict[str, dict[str, Any]] = {
    "robot": {"robot": load_robot("tidybot2")},
    "path": {"path": Circle(radius=0.5)},
    "paths": {"path": (Circle(radius=0.5), "lemniscate", {"shape": "circle", "radius": np.float64(0.4)})},
    "arena": {"arena": read_arena({"room": [[-3.0, -3.0], [3.0, 3.0]]}), "path": {"shape": "circle", "radius": 0.5}},
    "trajectory": {"path": Circle(radius=0.5).trajectories(0.02)[0]},
    "array of points": {"path": np.array([[0.0, 0.0], [0.5, 0.1], [1.0, 0.4]])},
    "array": {"preview": np.array([0.1, 0.2, 0.4])},
    "robot and path": {
        "robot": ROBOT,
        "path": [Lemniscate(duration=20.0)],
        "actuation": ("roll_1", "steer_1", "roll_2", "steer_2"),
    },
}


@pytest.mark.parametrize("given", list(OBJECTS))
def test_a_specification_with_objects_makes_the_same_environment_again(given):
    env: Any = gym.make("caster_gym:CasterTrack-v0", **OBJECTS[given])
    again: Any = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    assert again.unwrapped.robot == env.unwrapped.robot
    assert again.unwrapped.task == env.unwrapped.task
    assert again.spec.to_json() == env.spec.to_json()


@pytest.mark.parametrize("given", list(OBJECTS))
def test_so_does_that_of_a_batch(given):
    env: Any = gym.make_vec(
        "caster_gym:CasterTrack-v0", num_envs=3, autoreset_mode=AutoresetMode.SAME_STEP, **OBJECTS[given]
    )
    again = gym.make_vec(EnvSpec.from_json(env.spec.to_json()))
    assert again.num_envs == 3
    assert again.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
    assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])


def test_so_does_that_of_an_environment_with_features():
    """A wrapper of Gymnasium records what it was given."""
    features = Payload(mass=(0.0, 2.0)), SensorNoise(position=0.01)
    env: Any = wrap(gym.make("caster_gym:CasterTrack-v0", robot=ROBOT), *features)
    again: Any = gym.make(EnvSpec.from_json(env.spec.to_json()))
    assert_array_equal(env.reset(seed=3)[0], again.reset(seed=3)[0])
    assert again.features == env.features


def test_what_was_given_in_plain_values_stays():
    given: dict[str, Any] = {"path": [{"shape": "circle", "radius": 0.5}], "corridor": 0.4}
    env: Any = gym.make("caster_gym:CasterTrack-v0", **given)
    assert env.spec.kwargs == given


def test_plain_values_are_those_of_json():
    value = {"a": (1, np.int64(2), np.arange(2.0)), "b": Path("x.csv"), "c": AutoresetMode.DISABLED, "d": None}
    assert plain(value) == {"a": [1, 2, [0.0, 1.0]], "b": "x.csv", "c": "Disabled", "d": None}
    assert json.loads(json.dumps(plain(ROBOT))) == plain(ROBOT)
    assert load_robot(plain(ROBOT)) == ROBOT
    with pytest.raises(ValueError, match=r"the robot: .*unknown key 'casters_'; did you mean 'casters'"):
        load_robot({"casters_": []})
