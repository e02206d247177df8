"""caster_gym.agents.cli: commands work together, and mistakes get a sentence, not a traceback."""

import csv

import pytest
import yaml
from typer.testing import CliRunner

from caster_gym.agents.cli import app
from caster_gym.agents.run_folder import MARK

RANDOM = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3}
TASK = {
    "train": [{**RANDOM, "seed": 0, "count": 3}],
    "validation": [{**RANDOM, "seed": 1, "count": 2}],
    "test": [{**RANDOM, "seed": 2, "count": 2}],
}
TINY = ["--set", "steps=512", "--set", "robots=8", "--set", "horizon=32", "--set", "batch=64", "--set", "hidden=[8]"]


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Runs a command in an empty folder; returns its result."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    runner = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    return lambda *arguments: runner.invoke(app, [str(argument) for argument in arguments])


def assert_refused(result, message):
    """One sentence that says what is wrong, with exit code 2."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("caster-gym: ")
    assert message in lines[0]
    assert "Traceback" not in result.output


@pytest.mark.parametrize("command", ["train", "evaluate", "benchmark"])
def test_each_command_explains_itself(call, command):
    result = call(command, "--help")
    assert result.exit_code == 0
    assert "--out" in result.stdout
    assert "--overwrite" in result.stdout
    assert command in call("--help").stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "nobody"], "there is no 'nobody' in agents; known are computed_torque"),
        (["train", "--task", "nowhere"], "there is no 'nowhere' in tasks; known are"),
        (["train", "--task", "missing.yaml"], "there is no file 'missing.yaml'"),
        (["train", "computed_torque"], "agent 'computed_torque' does not learn"),
        (["evaluate", "nobody"], "there is no 'nobody' in agents"),
        (["evaluate", "ppo"], "agent 'ppo' must be trained first"),
        (["evaluate", "computed_torque", "--task", "nowhere"], "there is no 'nowhere' in tasks"),
        (["benchmark", "--config", "nothing"], "there is no 'nothing' in benchmarks; known are follow, track"),
        (["train", "--set", "steps"], "--set needs KEY=VALUE, got 'steps'"),
        (["train", "--set", "=3"], "--set needs KEY=VALUE, got '=3'"),
        (["train", "--set", "stepz=3"], "did you mean 'steps'?"),
        (["train", "--set", "steps=many"], "should be a whole number, got 'many'"),
        (["train", "--set", "steps=["], "--set steps=[ cannot be read as YAML: expected the node content"),
    ],
)
def test_mistakes_get_one_sentence(call, tmp_path, arguments, message):
    assert_refused(call(*arguments, "--out", "results"), message)
    assert not (tmp_path / "results").exists()


def test_exponents_are_numbers(call, tmp_path):
    tiny = [*TINY[2:], "--set", "steps=1e2", "--set", "learning_rate=1e-3"]
    assert call("train", "ppo", *tiny, "--task", "task.yaml", "--out", "run").exit_code == 0
    agent = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text(encoding="utf-8"))["agent"]
    assert (agent["steps"], agent["learning_rate"]) == (100, 0.001)


def test_a_folder_that_is_no_policy_is_refused(call, tmp_path):
    (tmp_path / "folder").mkdir()
    assert_refused(call("evaluate", "folder", "--task", "task.yaml", "--out", "results"), "there is no file 'folder")
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize("command", [["train", *TINY], ["evaluate", "computed_torque"], ["benchmark"]])
def test_results_are_not_overwritten(call, tmp_path, command):
    """What is there stays as it is, unless --overwrite is given."""
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "precious.txt").write_text("a week of work", encoding="utf-8")
    task = [] if command[0] == "benchmark" else ["--task", "task.yaml"]
    assert_refused(call(*command, *task, "--out", "results"), "results is not empty; choose another --out")
    assert [file.name for file in (tmp_path / "results").iterdir()] == ["precious.txt"]
    assert (tmp_path / "results" / "precious.txt").read_text(encoding="utf-8") == "a week of work"


def test_overwrite_begins_with_an_empty_folder(call, tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "old.txt").write_text("old", encoding="utf-8")
    (tmp_path / "results" / MARK).touch()
    result = call("evaluate", "computed_torque", "--task", "task.yaml", "--out", "results", "--overwrite")
    assert result.exit_code == 0, result.output
    assert not (tmp_path / "results" / "old.txt").exists()
    assert (tmp_path / "results" / "table.md").is_file()


def test_only_folders_of_results_are_overwritten(call, tmp_path, monkeypatch):
    (tmp_path / "home").mkdir()
    (tmp_path / "home" / "precious.txt").write_text("a week of work", encoding="utf-8")
    arguments = ["evaluate", "computed_torque", "--task", "task.yaml", "--overwrite", "--out"]
    assert_refused(call(*arguments, "home"), "does not hold results of caster-gym alone")
    (tmp_path / MARK).touch()
    assert_refused(call(*arguments, "."), f"{tmp_path} lies in it")
    assert (tmp_path / "home" / "precious.txt").is_file()


def test_a_file_in_the_way_is_told_in_a_sentence(call, tmp_path):
    (tmp_path / "file").write_text("", encoding="utf-8")
    assert_refused(call("train", *TINY, "--task", "task.yaml", "--out", "file/run"), "Not a directory")


def test_a_mistake_is_found_before_anything_is_deleted(call, tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "precious.txt").write_text("a week of work", encoding="utf-8")
    (tmp_path / "results" / MARK).touch()
    for arguments in (
        ["train", "nobody"],
        ["evaluate", "nobody"],
        ["benchmark", "--config", "nothing"],
        ["benchmark", "--set", "steps"],
        ["benchmark", "--set", "stepz=3"],
    ):
        assert call(*arguments, "--out", "results", "--overwrite").exit_code == 2
        assert (tmp_path / "results" / "precious.txt").is_file()


def test_a_policy_is_trained_and_then_evaluated(call, tmp_path):
    trained = call("train", "ppo", *TINY, "--task", "task.yaml", "--seed", "4", "--out", "run")
    assert trained.exit_code == 0, trained.output
    assert "Best on validation paths after" in trained.stdout
    assert yaml.safe_load((tmp_path / "run" / "run.yaml").read_text(encoding="utf-8"))["seed"] == 4
    result = call("evaluate", "run/best", "--task", "task.yaml", "--starts", "2", "--out", "results")
    assert result.exit_code == 0, result.output
    table = (tmp_path / "results" / "table.md").read_text(encoding="utf-8")
    assert table in result.stdout
    assert "PPO" in table
    with (tmp_path / "results" / "episodes.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 2 * 2
    assert {"summary.csv", "run.yaml", "paths.png", "errors.png", "torques.png"} <= {
        file.name for file in (tmp_path / "results").iterdir()
    }


def test_a_policy_that_does_not_fit_the_task_is_refused(call, tmp_path):
    assert call("train", "ppo", *TINY, "--task", "task.yaml", "--out", "run").exit_code == 0
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({**TASK, "task": {"preview": [0.1]}}), encoding="utf-8")
    result = call("evaluate", "run/best", "--task", "other.yaml", "--out", "results")
    assert_refused(result, "the policy needs a preview of (0.1, 0.2, 0.4) s, the task shows (0.1,) s")


def test_model_based_control_is_evaluated_by_name(call):
    result = call("evaluate", "computed_torque", "--task", "task.yaml", "--out", "results")
    assert result.exit_code == 0, result.output
    assert "computed torque" in result.stdout
    assert "0 of 2" in result.stdout


def test_a_policy_is_not_evaluated_in_the_other_environment(call, tmp_path):
    other = {kind: [{"shape": "circle", "radius": 0.5 + i}] for i, kind in enumerate(TASK)}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({"environment": "follow", **other}), encoding="utf-8")
    assert call("train", "ppo", *TINY, "--task", "task.yaml", "--out", "run").exit_code == 0
    result = call("evaluate", "run/best", "--task", "other.yaml", "--out", "results")
    assert_refused(result, "the policy has learned to follow a timetable")
    assert not (tmp_path / "results").exists()


def test_ctrl_c_ends_quietly_and_keeps_what_was_learned(call, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("caster_gym.agents.sb3_learning.Watcher._watch", interrupted)
    result = call("train", "ppo", *TINY, "--task", "task.yaml", "--out", "run")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert "Traceback" not in result.output
    assert (tmp_path / "run" / "best" / "policy.yaml").is_file()
