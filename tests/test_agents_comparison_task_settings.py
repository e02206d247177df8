"""agents.comparison.task_settings: YAML is checked, paths tested on are never trained on, errors say what suffices."""

from importlib.resources import files
from pathlib import Path
from typing import Any

import pytest
import yaml
from gymnasium.vector import AutoresetMode

from caster_gym.agents.comparison.evaluation import bare, make_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.robot import load_robot
from caster_gym.shipped_files import find, read_settings
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.registry import KNOWN
from caster_gym.tasks.track.parameters import TrackParameters

CONFIGS = Path(str(files("caster_gym.configs")))
PATHS: dict[str, Any] = {
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


@pytest.mark.slow
@pytest.mark.parametrize("name", names("tasks"))
def test_each_task_that_comes_with_the_package_loads(name):
    task = read_settings(TaskSettings, "tasks", name)
    for paths in (task.train, task.validation, task.test):
        assert bare(make_batch(task, paths, 1, AutoresetMode.NEXT_STEP)).engine.plan.names


@pytest.mark.parametrize(("kind", "other"), [("test", "train"), ("validation", "train"), ("test", "validation")])
def test_held_out_paths_are_held_out(kind, other):
    shared = {"shape": "random_paths", "seed": 9, "count": 3}
    where = f"{{shape: random_paths, seed: 9}} as {kind} path 2 and as {other}(ing)? path 2; give one"
    with pytest.raises(ConfigurationError, match=f"a {kind} path must not be among the {other}.*, got {where}"):
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
    with pytest.raises(ConfigurationError, match="unknown key 'parameters'; it is called 'task' here"):
        parse(TaskSettings, {**PATHS, "parameters": {"corridor": 1.0}}, "task")
    with pytest.raises(ConfigurationError, match=r"unknown key 'task\.coridor'; did you mean 'corridor'\?"):
        parse(TaskSettings, {**PATHS, "task": {"coridor": 1.0}}, "task")


def test_an_environment_has_tasks_of_its_own():
    assert parse(TaskSettings, PATHS, "task").task == TrackParameters()
    following = parse(TaskSettings, {**PATHS, "environment": "follow", "task": {"speed_limit": 0.5}}, "task")
    assert following.task == FollowParameters(speed_limit=0.5)
    assert parse(TaskSettings, {**PATHS, "environment": "follow"}, "task").task == FollowParameters()
    assert parse(TaskSettings, following.model_dump(mode="json"), "task") == following


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (
            {"environment": "flow"},
            f"task: 'environment' should be {KNOWN}, got 'flow'$",
        ),
        ({"task": {"speed_limit": 1.0}}, "'speed_limit' is for environment 'follow', got it with environment 'track'"),
        (
            {"environment": "follow", "task": {"position_weight": 1.0}},
            "'position_weight' is for environment 'track', got it with environment 'follow'",
        ),
        (
            {"environment": "follow", "task": TrackParameters()},
            "must be a FollowParameters in environment 'follow', got a TrackParameters",
        ),
        ({"environment": "follow", "task": {"speed_limt": 1.0}}, r"'task\.speed_limt'; did you mean 'speed_limit'\?"),
        ({"task": {"margn": 0.5}}, r"unknown key 'task\.margn'; known are (?!.*margin)"),  # a key of the other task
        ({"environment": "follow", "task": {"speed_limit": 0}}, r"'task\.speed_limit' should be greater than 0, got 0"),
        ({"arena": {"beside": {"pillar": 3}}}, r"'arena\.beside\.pillar'; did you mean 'pillars'\?"),
        ({"arena": "nowhere.yaml"}, "'arena': there is no file 'nowhere.yaml'"),
        ({"wrappers": ["motorlag"]}, r"unknown kind 'motorlag'; did you mean 'motor_lag'\?"),
        ({"wrappers": "motor_lag"}, "'wrappers' should be a list"),
        ({"shaping": ["payload"]}, "unknown kind 'payload'; known are effort, impact, potential"),
        ({"shaping": [{"kind": "effort", "weigth": 1.0}]}, r"unknown key 'weigth'; did you mean 'weight'\?"),
    ],
)
def test_what_does_not_fit_an_environment_is_named(content, message):
    with pytest.raises(ConfigurationError, match=message):
        parse(TaskSettings, {**PATHS, **content}, "task")


def test_features_may_be_written_by_their_kind_alone():
    short, long = (
        parse(TaskSettings, {**PATHS, "wrappers": [lag], "shaping": ["effort"]}, "task")
        for lag in ("motor_lag", {"kind": "motor_lag"})
    )
    assert short == long


def test_an_arena_may_be_a_file(tmp_path):
    name = written(tmp_path, {"pillars": [{"centre": [1.0, 2.0]}]})
    assert parse(TaskSettings, {**PATHS, "arena": name}, "task").arena.pillars[0].centre == (1.0, 2.0)
    assert parse(TaskSettings, {**PATHS, "arena": None}, "task") == parse(TaskSettings, PATHS, "task")


@pytest.mark.parametrize("kind", ["agents", "tasks", "benchmarks"])
def test_an_unknown_name_lists_the_known_ones(kind):
    known = ", ".join(names(kind))
    with pytest.raises(ConfigurationError, match=f"no 'nothing' in {kind}; known are {known}, or give the path"):
        find(kind, "nothing")


def test_advice_on_held_out_paths_helps():
    shared = {"shape": "random_paths", "seed": 0, "duration": 5.0}
    with pytest.raises(ConfigurationError, match="give one of them another seed"):
        parse(TaskSettings, {**PATHS, "train": [shared], "test": [shared]}, "task")
    parse(TaskSettings, {**PATHS, "train": [shared], "test": [{**shared, "seed": 3}]}, "task")
    points = {"shape": "spline", "waypoints": [[0.1 * i, 0.01 * i * i] for i in range(60)]}
    with pytest.raises(ConfigurationError, match=r"waypoints: 60 points\} as test path 2 .* or leave it out") as caught:
        parse(TaskSettings, {**PATHS, "train": [points], "test": [{"shape": "circle"}, points]}, "task")
    assert len(str(caught.value)) < 300
    parse(TaskSettings, {**PATHS, "train": [points], "test": [{"shape": "circle"}]}, "task")


@pytest.mark.parametrize("kind", ["agents", "tasks", "benchmarks", "designs"])
def test_a_file_is_known_by_its_suffix_in_any_case(tmp_path, kind):
    assert find(kind, tmp_path / "MINE.YAML") == find(kind, str(tmp_path / "MINE.YAML")) == tmp_path / "MINE.YAML"


def test_the_robot_of_a_task_may_be_a_mapping():
    robot = load_robot("tidybot2")
    settings = parse(TaskSettings, {**PATHS, "robot": robot.model_dump(mode="json")}, "task")
    assert settings.robot == robot
    assert parse(TaskSettings, settings.model_dump(mode="json"), "task") == settings
    with pytest.raises(
        ConfigurationError, match=r"task: 'robot': the robot: unknown key 'nam'; did you mean 'name'\?$"
    ):
        parse(TaskSettings, {**PATHS, "robot": {**robot.model_dump(mode="json"), "nam": 1}}, "task")


def test_paths_are_not_endless_and_the_first_that_is_not_held_out_is_told():
    circles = [{"shape": "circle", "radius": 1.0 + 0.01 * k} for k in range(201)]
    with pytest.raises(ConfigurationError, match="'train' should have at most 200 items"):
        parse(TaskSettings, {**PATHS, "train": circles}, "a")
    twice = {**PATHS, "train": [*circles[:3], *circles[:3]], "test": [{"shape": "circle", "radius": 1.02}]}
    with pytest.raises(ConfigurationError, match="as test path 1 and as training path 3;"):
        parse(TaskSettings, twice, "a")
