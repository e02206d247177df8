"""agents.comparison.scenarios: features by name beyond a task's own, drawn alike for everybody."""

import csv

import numpy as np
import pytest
import yaml
from numpy.testing import assert_array_equal

from caster_gym.agents.commands.benchmark import BenchmarkSettings, read_comparison, run_benchmark
from caster_gym.agents.comparison.evaluation import evaluation_batch
from caster_gym.agents.comparison.scenarios import Entrant, tasks_of
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.tasks.track.metrics import TrackMetrics
from caster_gym.wrappers import Payload, Pushes

PATHS = {kind: [{"shape": "circle", "radius": r}] for kind, r in (("train", 0.5), ("validation", 0.6), ("test", 0.7))}
PAYLOAD = {"kind": "payload", "mass": [0.0, 5.0]}
DELAY = {"kind": "action_delay", "periods": [0, 3]}
PUSHES = {"kind": "pushes", "rate": 5.0, "force": [0.0, 5.0]}
NOISE = {"kind": "sensor_noise", "position": 0.01}


RANDOM = {
    kind: [{"shape": "random_paths", "duration": 3.0, "max_speed": 0.3, "seed": seed, "count": 3}]
    for seed, kind in enumerate(("train", "validation", "test"))
}
PPO = {
    "algorithm": "ppo",
    "n_timesteps": 256,
    "net_arch": [8],
    "n_envs": 8,
    "n_steps": 32,
    "batch_size": 64,
    "validations": 1,
}


def write(folder, name, content):
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(file)


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


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


@pytest.mark.slow
def test_scenarios_are_compared_each_for_itself_and_together(tmp_path):
    """Tuned for each or for one of them; a learned agent is trained for what it is prepared for, once for each seed."""
    learner = write(tmp_path, "ppo", PPO)
    controller = write(tmp_path, "controller", {"algorithm": "computed torque", "natural_frequencies": [5.0, 30.0]})
    folder = tmp_path / "out"
    scenarios = {"calm": [], "late": [{"kind": "action_delay", "periods": 2}]}
    compared = settings(
        task=write(tmp_path, "task", RANDOM),
        scenarios=scenarios,
        agents=[
            controller,
            {"agent": controller, "prepared_for": "calm"},
            {"agent": learner, "prepared_for": "late"},
        ],
        seeds=[2],
        settling=1.0,
    )
    comparison = read_comparison(compared)
    text = run_benchmark(comparison, folder)
    assert (folder / "table.md").read_text(encoding="utf-8") == text + "\n"
    told = [row["scenario"] for row in rows(folder / "scenarios.csv")]
    assert {one: told.count(one) for one in told} == dict.fromkeys(scenarios, 3 * len(TrackMetrics._fields))
    assert [one.name for one in (folder / "policies").iterdir()] == ["ppo_for_late-2"]
    facts = yaml.safe_load((folder / "run.yaml").read_text(encoding="utf-8"))
    assert {name: one["natural_frequencies"] for name, one in facts["tuned"].items()} == {
        "controller-calm": [30.0],
        "controller-late": [5.0],  # the stiffer one is unstable with that delay
        "controller_for_calm": [30.0],
    }
    episodes = {one: rows(folder / one / "episodes.csv") for one in scenarios}
    model = ("controller", "controller_for_calm")
    calm = [[row for row in episodes["calm"] if row["agent"] == name] for name in model]
    assert [{**row, "agent": ""} for row in calm[0]] == [{**row, "agent": ""} for row in calm[1]]
    failed = {name: sum(float(row["failed"]) for row in episodes["late"] if row["agent"] == name) for name in model}
    errors = {
        name: np.mean([float(row["position_rmse"]) for row in episodes["late"] if row["agent"] == name])
        for name in model
    }
    assert (failed["controller"], errors["controller"]) < (failed["controller_for_calm"], errors["controller_for_calm"])


def test_an_agent_that_would_see_or_do_what_it_does_not_know_is_told(tmp_path):
    scenarios = {"plain": [], "commanded": ["twist_commands"]}
    (tmp_path / "files").mkdir()
    agents = [{"agent": write(tmp_path / "files", "ppo", PPO), "prepared_for": "plain"}]
    asked = settings(scenarios=scenarios, agents=agents)
    with pytest.raises(ConfigurationError, match=r"'ppo_for_plain' is prepared for scenario 'plain', but actions of"):
        run_benchmark(read_comparison(asked), tmp_path / "out")
    assert not (tmp_path / "out").exists()
