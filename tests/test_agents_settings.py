"""caster_gym.agents.settings: YAML is checked, what is tested on is never trained on, and errors say what would do."""

from importlib.resources import files
from pathlib import Path

import pytest
import yaml

from caster_gym.agents.settings import (
    BenchmarkSettings,
    ComputedTorqueSettings,
    PPOSettings,
    SACSettings,
    TaskSettings,
    find,
    read_agent,
    read_settings,
)
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.paths.specification import build_trajectories
from caster_gym.robot import load_robot

CONFIGS = Path(str(files("caster_gym.configs")))
PATHS = {
    "train": [{"shape": "random_paths", "seed": 0}],
    "validation": [{"shape": "random_paths", "seed": 1}],
    "test": [{"shape": "circle"}],
}


def names(kind):
    return sorted(file.stem for file in (CONFIGS / kind).glob("*.yaml"))


def written(tmp_path, content):
    file = tmp_path / "settings.yaml"
    file.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("name", names("agents"))
def test_each_agent_that_comes_with_the_package_loads(name):
    assert isinstance(read_agent(name), ComputedTorqueSettings | PPOSettings | SACSettings)


@pytest.mark.parametrize("name", names("tasks"))
def test_each_task_that_comes_with_the_package_loads(name):
    task = read_settings(TaskSettings, "tasks", name)
    robot = load_robot(task.robot)
    for paths in (task.train, task.validation, task.test):
        assert build_trajectories(paths, robot, task.task.control_period)


@pytest.mark.parametrize("name", names("benchmarks"))
def test_each_benchmark_that_comes_with_the_package_names_what_there_is(name):
    settings = read_settings(BenchmarkSettings, "benchmarks", name)
    read_settings(TaskSettings, "tasks", settings.task)
    learned = [isinstance(read_agent(agent), PPOSettings | SACSettings) for agent in settings.agents]
    assert any(learned)
    assert not all(learned)
    assert len(set(settings.seeds)) == len(settings.seeds) >= 3


def test_the_kinds_of_agents_are_told_by_their_algorithm():
    kinds = [type(read_agent(name)) for name in ("ppo", "sac", "computed_torque", "computed_torque_without_d1")]
    assert kinds == [PPOSettings, SACSettings, ComputedTorqueSettings, ComputedTorqueSettings]
    assert read_agent("computed_torque_without_wheels").known == "without wheels"


@pytest.mark.parametrize("number", ["1e-3", "1E-3", "0.001", ".001"])
def test_exponents_are_numbers(tmp_path, number):
    settings = read_agent(written(tmp_path, f"algorithm: ppo\nlearning_rate: {number}\nsteps: 1e6\n"))
    assert (settings.learning_rate, settings.steps) == (1e-3, 1_000_000)
    assert isinstance(settings.steps, int)


def test_changes_replace_what_the_file_says(tmp_path):
    name = written(tmp_path, {"algorithm": "ppo", "steps": 5000, "robots": 8, "batch": 64})
    changed = read_agent(name, {"steps": 700})
    assert (changed.steps, changed.robots, changed.batch) == (700, 8, 64)
    with pytest.raises(ConfigurationError, match=r"unknown key .*stepz.*; did you mean 'steps'\?"):
        read_agent(name, {"stepz": 700})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"algorithm": "ppo", "learning_rat": 1e-3}, r"unknown key .*learning_rat'; did you mean 'learning_rate'\?"),
        ({"algorithm": "ppo", "buffer": 10}, "unknown key .*buffer"),  # a key of SAC
        ({"algorithm": "computed torque", "known": "half"}, "known.*'half'"),
        ({"algorithm": "pppo"}, r"unknown algorithm 'pppo'; did you mean 'ppo'\?"),
        ({"steps": 10}, "algorithm"),
        ({"algorithm": "ppo", "steps": 0}, "steps.* greater than 0, got 0"),
        ({"algorithm": "ppo", "steps": "many"}, "steps.* should be a whole number, got 'many'"),
        ({"algorithm": "ppo", "discount": 1.0}, "discount.* less than 1, got 1.0"),
        ({"algorithm": "sac", "soft_update": 0.0}, "soft_update.* greater than 0"),
        ({"algorithm": "ppo", "hidden": []}, "hidden.* at least 1 item"),
        ({"algorithm": "ppo", "falling": 1}, "falling.* true or false, got 1"),
        ({"algorithm": "computed torque", "natural_frequencies": [10.0, -1.0]}, "natural_frequencies.*-1.0"),
    ],
)
def test_what_is_wrong_with_an_agent_is_named(tmp_path, content, message):
    with pytest.raises(ConfigurationError, match=f"settings.yaml: .*{message}"):
        read_agent(written(tmp_path, content))


def test_a_batch_must_fit_into_what_is_collected():
    PPOSettings(algorithm="ppo", robots=4, horizon=8, batch=32)
    with pytest.raises(ConfigurationError, match=r"batch of 33 needs at most robots · horizon = 32 steps"):
        parse(PPOSettings, {"algorithm": "ppo", "robots": 4, "horizon": 8, "batch": 33}, "ppo")


@pytest.mark.parametrize(("kind", "other"), [("test", "train"), ("validation", "train"), ("test", "validation")])
def test_held_out_paths_are_held_out(kind, other):
    shared = {"shape": "random_paths", "seed": 9, "count": 3}
    with pytest.raises(ConfigurationError, match=f"a {kind} path must not be among the {other}.* seed=9"):
        parse(TaskSettings, {**PATHS, kind: [*PATHS[kind], shared], other: [*PATHS[other], shared]}, "task")
    parse(TaskSettings, {**PATHS, kind: [*PATHS[kind], shared]}, "task")


@pytest.mark.parametrize(("kind", "other"), [("test", "train"), ("validation", "train"), ("test", "validation")])
def test_the_same_random_paths_under_another_count_are_not_held_out(kind, other):
    """Path k of a seed is the same for every count."""
    with pytest.raises(ConfigurationError, match=f"{kind} path must not be among the {other}"):
        parse(
            TaskSettings,
            {
                **PATHS,
                kind: [{"shape": "random_paths", "seed": 9, "count": 3}],
                other: [{"shape": "random_paths", "seed": 9, "count": 5}],
            },
            "task",
        )


def test_what_is_wrong_with_a_task_is_named():
    with pytest.raises(ConfigurationError, match="task: 'test' is missing"):
        parse(TaskSettings, {key: PATHS[key] for key in ("train", "validation")}, "task")
    with pytest.raises(ConfigurationError, match=r"unknown key 'trial'; did you mean 'train'\?"):
        parse(TaskSettings, {**PATHS, "trial": []}, "task")
    with pytest.raises(ConfigurationError, match="train"):
        parse(TaskSettings, {**PATHS, "train": []}, "task")
    with pytest.raises(ConfigurationError, match=r"unknown key 'task\.coridor'; did you mean 'corridor'\?"):
        parse(TaskSettings, {**PATHS, "task": {"coridor": 1.0}}, "task")


@pytest.mark.parametrize("kind", ["agents", "tasks", "benchmarks"])
def test_an_unknown_name_lists_the_known_ones(kind):
    known = ", ".join(names(kind))
    with pytest.raises(ConfigurationError, match=f"no 'nothing' in {kind}; known are {known}, or give the path"):
        find(kind, "nothing")


def test_a_path_is_taken_as_it_is(tmp_path):
    assert find("agents", str(tmp_path / "mine.yaml")) == tmp_path / "mine.yaml"
    with pytest.raises(ConfigurationError, match=r"there is no file '.*mine\.yaml'"):
        read_agent(str(tmp_path / "mine.yaml"))
