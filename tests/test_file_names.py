"""caster_gym.file_names: a relative name in a YAML file starts from that file's folder, whoever reads it and where."""

import shutil
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

from caster_gym.agents.commands.benchmark import BenchmarkSettings, read_comparison
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError, Frozen, parse
from caster_gym.design.command import read_design
from caster_gym.file_names import FileName, NameOrFile, from_working_folder, is_file_name
from caster_gym.paths.splines import Spline
from caster_gym.shipped_files import find, read_settings

CONFIGS = Path(str(files("caster_gym.configs")))
PATHS = {kind: [{"shape": "random_paths", "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))}


class Both(Frozen):
    file: FileName = "a.csv"
    robot: NameOrFile = "chung2008"


@pytest.fixture
def project(tmp_path, monkeypatch):
    """A folder of files that name one another; the command runs somewhere else."""
    folder, elsewhere = tmp_path / "project", tmp_path / "elsewhere"
    (folder / "robots").mkdir(parents=True)
    elsewhere.mkdir()
    shutil.copy(CONFIGS / "robots" / "xr4000.yaml", folder / "robots" / "mine.yaml")
    shutil.copy(CONFIGS / "agents" / "ppo.yaml", folder / "learner.yaml")
    contents = {
        "arena.yaml": {"pillars": [{"centre": [30.0, 0.0]}]},
        "task.yaml": {"robot": "robots/mine.yaml", "arena": "arena.yaml", **PATHS},
        "comparison.yaml": {"task": "task.yaml", "agents": ["computed_torque", "learner.yaml"]},
        "points.yaml": {**PATHS, "test": [{"shape": "spline", "file": "paths/points.csv"}]},
        "target.yaml": {
            **yaml.safe_load((CONFIGS / "designs" / "indoor.yaml").read_text(encoding="utf-8")),
            "robot": "robots/mine.yaml",
            "paths": [{"shape": "spline", "file": "paths/points.csv", "duration": 20.0}],
        },
    }
    (folder / "paths").mkdir()
    (folder / "paths" / "points.csv").write_text("x,y\n0,0\n1,0\n1,1\n", encoding="utf-8")
    for name, content in contents.items():
        (folder / name).write_text(yaml.safe_dump(content), encoding="utf-8")
    monkeypatch.chdir(elsewhere)
    return folder


@pytest.mark.parametrize("relative", [False, True])
def test_files_that_name_one_another_are_found_from_anywhere(project, relative):
    start = Path("../project") if relative else project
    task = read_settings(TaskSettings, "tasks", str(start / "task.yaml"))
    assert isinstance(task.robot, str) and Path(task.robot).samefile(project / "robots" / "mine.yaml")
    assert task.arena.pillars[0].centre == (30.0, 0.0)
    comparison = read_comparison(read_settings(BenchmarkSettings, "benchmarks", str(start / "comparison.yaml")))
    assert comparison.task == task
    assert list(comparison.agents) == ["computed_torque", "learner"]
    target = read_design(str(start / "target.yaml"))
    assert Path(target.robot).samefile(project / "robots" / "mine.yaml")
    points = read_settings(TaskSettings, "tasks", str(start / "points.yaml")).test[0]
    of_target = target.paths[0]
    assert isinstance(points, Spline) and isinstance(of_target, Spline)
    assert points.waypoints == of_target.waypoints == ((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))


def test_what_was_read_means_the_same_in_another_file(project):
    """run.yaml keeps the settings of a run, in another folder."""
    task = read_settings(TaskSettings, "tasks", "../project/task.yaml")
    assert parse(TaskSettings, task.model_dump(mode="json"), "run.yaml", project / "run") == task


def test_the_working_folder_is_no_second_place_to_look(project):
    """Which file is meant must not depend on where the command runs."""
    Path("arena.yaml").write_text("pillars: []", encoding="utf-8")
    assert read_settings(TaskSettings, "tasks", str(project / "task.yaml")).arena.pillars
    (project / "arena.yaml").unlink()
    with pytest.raises(ConfigurationError, match=f"there is no file '{project / 'arena.yaml'}'"):
        read_settings(TaskSettings, "tasks", str(project / "task.yaml"))


def test_names_on_the_command_line_start_from_the_working_folder(project):
    shutil.copy(CONFIGS / "robots" / "tidybot2.yaml", "here.yaml")
    by_option = read_design(str(project / "target.yaml"), robot="here.yaml")
    by_change = read_design(str(project / "target.yaml"), changes={"robot": "here.yaml"})
    assert Path(by_option.robot).samefile("here.yaml")
    assert by_change == by_option
    nested = from_working_folder({"paths": [{"file": "points.csv", "laps": 2, "shape": "spline"}]})
    assert nested == {"paths": [{"file": str(Path("points.csv").absolute()), "laps": 2, "shape": "spline"}]}


def test_names_of_what_comes_with_the_package_stay(tmp_path):
    assert parse(Both, {}, "both", tmp_path) == Both()
    assert parse(Both, {"robot": "tidybot2"}, "both", tmp_path).robot == "tidybot2"
    assert parse(Both, {"robot": "tidybot2.yaml", "file": "b"}, "both", tmp_path) == Both.model_construct(
        robot=str(tmp_path / "tidybot2.yaml"), file=str(tmp_path / "b")
    )
    assert parse(Both, {"robot": "/robots/mine.yaml"}, "both", tmp_path).robot == "/robots/mine.yaml"
    assert parse(Both, {"robot": "mine.yaml"}, "both").robot == "mine.yaml"


@pytest.mark.parametrize(("name", "answer"), [("a.yaml", True), ("b.CSV", True), ("chung2008", False), ("v2.5", False)])
def test_files_have_a_suffix(name, answer):
    assert is_file_name(name) == answer


@pytest.mark.parametrize("kind", ["tasks", "agents", "robots", "benchmarks", "designs", "sweeps"])
def test_names_that_no_file_can_have_are_told(kind):
    """With a suffix and without one; a name that only its suffix makes too long is an unknown one."""
    with pytest.raises(ValueError, match="is no name of a file: it is too long"):
        find(kind, f"{'n' * 300}.yaml")
    for length in (253, 300):
        with pytest.raises(ConfigurationError, match=f"there is no 'n{{30,60}}.*' in {kind}; known are"):
            find(kind, "n" * length)
