"""caster_gym.envs.plan: what the environments tell of their paths, and where these lead."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest

import caster_gym  # noqa: F401  (registers the environments)

T = np.linspace(0.0, 2.0, 60)
RECORDED = {"shape": "spline", "waypoints": np.column_stack([T, np.sin(T)]).round(3).tolist(), "duration": 20.0}


@pytest.mark.parametrize("task", ["CasterTrack-v0", "CasterFollow-v0"])
def test_environments_tell_what_was_made_of_their_waypoints(task):
    single: Any = gym.make(f"caster_gym:{task}", path=["circle", RECORDED])
    batch: Any = gym.make_vec(f"caster_gym:{task}", num_envs=2, path=["circle", RECORDED])
    told = single.unwrapped.path_descriptions
    assert told == batch.unwrapped.path_descriptions
    assert told[0] == "circle"
    assert told[1].startswith("spline of 60 waypoints; smoothed")
    single.close()
    batch.close()


def test_a_robot_that_turns_on_the_spot_is_led_there():
    """Half of a turn of 90° at half of the time, at one place."""
    path = {"shape": "spline", "waypoints": [[0, 0, 0], [0, 0, np.pi / 2]], "duration": 3.0}
    env = gym.make("caster_gym:CasterTrack-v0", path=path)
    env.reset(seed=0)
    for _ in range(75):
        info = env.step(0.0 * env.action_space.sample())[-1]
    assert info["reference_pose"] == pytest.approx([0.0, 0.0, np.cos(np.pi / 4), np.sin(np.pi / 4)], abs=0.05)
    env.close()
