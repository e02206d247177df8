"""agents.comparison.scenarios: features by name beyond a task's own, drawn alike for everybody."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.agents.commands.benchmark import BenchmarkSettings
from caster_gym.agents.comparison.evaluation import evaluation_batch
from caster_gym.agents.comparison.scenarios import Entrant, tasks_of
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.wrappers import Payload, Pushes

PATHS = {kind: [{"shape": "circle", "radius": r}] for kind, r in (("train", 0.5), ("validation", 0.6), ("test", 0.7))}
PAYLOAD = {"kind": "payload", "mass": [0.0, 5.0]}
DELAY = {"kind": "action_delay", "periods": [0, 3]}
PUSHES = {"kind": "pushes", "rate": 5.0, "force": [0.0, 5.0]}
NOISE = {"kind": "sensor_noise", "position": 0.01}


def settings(**content):
    return parse(BenchmarkSettings, {"agents": ["computed_torque"], **content}, "comparison.yaml")


def test_features_of_a_scenario_follow_those_of_the_task():
    task = parse(TaskSettings, {**PATHS, "wrappers": [PAYLOAD]}, "task.yaml")
    scenarios = settings(scenarios={"calm": [], "pushed": ["pushes"]}).scenarios
    tasks = tasks_of(task, scenarios)
    assert list(tasks) == ["calm", "pushed"]
    assert tasks["calm"] == task
    assert [type(one) for one in tasks["pushed"].wrappers] == [Payload, Pushes]
    assert tasks["pushed"].test == task.test


def test_without_scenarios_there_is_the_task_alone():
    task = parse(TaskSettings, PATHS, "task.yaml")
    assert tasks_of(task, {}) == {"": task}


def test_each_or_one_scenario_is_prepared_for():
    assert Entrant(agent="ppo").prepared("noise") == "noise"
    assert Entrant(agent="ppo", prepared_for="calm").prepared("noise") == "calm"


@pytest.mark.parametrize("order", [(3, 2, 1, 0), (1, 3, 0, 2)])
def test_what_features_draw_does_not_depend_on_their_place(order):
    """Poses of robots that get the same torques are equal to the last bit, in whatever order features are listed.

    Noise is only seen here, so that it may stand anywhere; a delay and pushes act on the plant.
    """
    features = [PAYLOAD, DELAY, PUSHES, NOISE]
    poses = []
    for listed in (features, [features[i] for i in order]):
        task = parse(TaskSettings, {**PATHS, "wrappers": listed}, "task.yaml")
        batch = evaluation_batch(task, task.test, starts=4)
        batch.reset(seed=7)
        actions = np.full((batch.num_envs, 6), 0.3, dtype=np.float32)
        poses.append(np.stack([batch.step(actions)[4]["pose"] for _ in range(20)]))
    assert_array_equal(poses[0], poses[1])


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"scenarios": {"each": []}}, "names of scenarios consist of"),
        ({"scenarios": {"a/b": []}}, "names of scenarios consist of"),
        ({"scenarios": {"windy": ["wind"]}}, "wind"),
        ({"agents": [{"agent": "ppo", "prepared_for": "calm"}]}, "unknown scenario 'calm'"),
        (
            {"scenarios": {"calm": []}, "agents": [{"agent": "ppo", "prepared_for": "clam"}]},
            "agent 'ppo': unknown scenario 'clam'; did you mean 'calm'",
        ),
        (
            {"agents": [{"agent": "ppo", "trained_on": "calm"}]},
            "unknown key 'trained_on'; it is called 'prepared_for' here",
        ),
        ({"agents": [{"prepared_for": "each"}]}, "'agent' is missing"),
        ({"agents": [3]}, "number 1 of 'agents' should be a mapping of keys to values, got 3"),
    ],
)
def test_what_makes_no_sense_is_told(content, said):
    with pytest.raises(ConfigurationError) as caught:
        settings(**content)
    assert said in str(caught.value)
    assert str(caught.value).startswith("comparison.yaml")
