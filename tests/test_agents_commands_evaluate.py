"""caster_gym.agents.commands.evaluate: policies and controllers are evaluated by name, on the task asked for."""

import csv
import shutil

import pytest
import yaml
from typer.testing import CliRunner

from caster_gym.agents.commands.cli import app
from tests.command_calls import TASK, TINY, assert_refused


@pytest.fixture(scope="module")
def trained(tmp_path_factory):
    """What a short run of PPO printed, and its folder, which tests copy."""
    folder = tmp_path_factory.mktemp("trained")
    (folder / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    arguments = [
        "train",
        "ppo",
        *TINY,
        "--task",
        str(folder / "task.yaml"),
        "--seed",
        "4",
        "--out",
        str(folder / "run"),
    ]
    result = CliRunner().invoke(app, arguments)
    assert result.exit_code == 0, result.output
    return result, folder / "run"


def test_a_policy_is_trained_and_then_evaluated(trained, call, tmp_path):
    result, run = trained
    assert "Best on validation paths after" in result.stdout
    assert yaml.safe_load((run / "run.yaml").read_text(encoding="utf-8"))["seed"] == 4
    result = call("evaluate", run / "best", "--task", "task.yaml", "--starts", "2", "--out", "results")
    assert result.exit_code == 0, result.output
    table = (tmp_path / "results" / "table.md").read_text(encoding="utf-8")
    assert table in result.stdout
    assert "PPO" in table
    with (tmp_path / "results" / "episodes.csv").open(newline="", encoding="utf-8") as file:
        assert len(list(csv.DictReader(file))) == 2 * 2
    assert {"summary.csv", "run.yaml", "paths.png", "errors.png", "torques.png"} <= {
        file.name for file in (tmp_path / "results").iterdir()
    }


@pytest.mark.slow
def test_a_policy_is_evaluated_on_its_own_task_unless_another_is_asked_for(call, tmp_path):
    slippery = {**TASK, "task": {"floor": {"friction": 0}}}
    (tmp_path / "ice.yaml").write_text(yaml.safe_dump(slippery), encoding="utf-8")
    trained = call("train", "ppo", *TINY, "--task", "ice.yaml", "--out", "run")
    assert trained.exit_code == 0, trained.output
    own = call("evaluate", "run/best", "--out", "own")
    assert own.exit_code == 0, own.output
    assert own.stdout.startswith(f"Task of {tmp_path / 'run' / 'run.yaml'}, on which the policy was trained.\n")
    recorded = yaml.safe_load((tmp_path / "own" / "run.yaml").read_text(encoding="utf-8"))
    assert recorded["task"]["task"]["floor"]["friction"] == 0
    assert (tmp_path / "own" / "table.md").read_text(encoding="utf-8").startswith("Task of ")
    other = call("evaluate", "run/best", "--task", "task.yaml", "--out", "other")
    assert "Task task.yaml; the policy was trained on another one, that of" in other.stdout


def test_a_policy_that_does_not_fit_the_task_is_refused(trained, call, tmp_path):
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({**TASK, "task": {"preview": [0.1]}}), encoding="utf-8")
    result = call("evaluate", trained[1] / "best", "--task", "other.yaml", "--out", "results")
    assert_refused(result, "the policy needs a preview of (0.1, 0.2, 0.4) s, the task shows (0.1,) s")


def test_model_based_control_is_evaluated_by_name(call, tmp_path):
    result = call("evaluate", "computed_torque", "--task", "task.yaml", "--out", "results")
    assert result.exit_code == 0, result.output
    assert "computed torque" in result.stdout
    assert "0 of 2" in result.stdout
    assert "Control periods simulated to tune and to learn: computed torque " in result.stdout
    with (tmp_path / "results" / "tuning.csv").open(newline="", encoding="utf-8") as file:
        assert sum(row["chosen"] == "1" for row in csv.DictReader(file)) == 1


def test_a_policy_is_not_evaluated_in_the_other_environment(trained, call, tmp_path):
    other = {kind: [{"shape": "circle", "radius": 0.5 + i}] for i, kind in enumerate(TASK)}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({"environment": "follow", **other}), encoding="utf-8")
    result = call("evaluate", trained[1] / "best", "--task", "other.yaml", "--out", "results")
    assert_refused(result, "the policy has learned to follow a timetable")
    assert not (tmp_path / "results").exists()


def test_a_folder_that_is_no_policy_is_refused(call, tmp_path):
    (tmp_path / "folder").mkdir()
    assert_refused(
        call("evaluate", "folder", "--task", "task.yaml", "--out", "results"), "there is no policy in folder: it has no"
    )
    assert not (tmp_path / "runs").exists()


@pytest.mark.slow
def test_folders_that_hold_policies_say_where(trained, call, tmp_path):
    """And what is advised is accepted."""
    shutil.copytree(trained[1], tmp_path / "runs" / "first")
    last = sorted((tmp_path / "runs" / "first" / "checkpoints").iterdir())[-1].relative_to(tmp_path)
    for given, message in (
        ("runs/first", "is the folder of a training run; give the policy in it that did best, runs/first/best"),
        ("runs", "is no policy itself, but has policies in it: give runs/first/best"),
        ("runs/first/checkpoints", f"or {last}"),
        ("runs/first/bst", "there is no folder 'runs/first/bst' of a policy; there is runs/first/best"),
        ("runs/first/best/policy.yaml", "is a file of a policy; give its folder, runs/first/best"),
        ("runs/second/best", "there is no folder 'runs/second/best' of a policy"),
        ("task.yaml", "'algorithm' is missing"),
    ):
        assert_refused(call("evaluate", given, "--task", "task.yaml", "--out", "results"), message)
    for advised in ("runs/first/best", last):
        assert call("evaluate", advised, "--task", "task.yaml", "--out", f"results/{advised}").exit_code == 0


OWN = """
import numpy as np
from caster_gym.agents.control.protocol import ControllerSettings

class Pusher:
    name = "pusher"
    def act(self, observations):
        return np.linalg.inv(np.zeros((2, 2)))

class Pushing(ControllerSettings):
    def controller(self, layout, period):
        return Pusher()
"""


def test_what_a_controller_of_ones_own_raises_names_it_with_its_file_and_line(call, tmp_path, monkeypatch):
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")  # restores sys.path afterwards
    (tmp_path / "own_pushers.py").write_text(OWN, encoding="utf-8")
    (tmp_path / "stiff.yaml").write_text("algorithm: own_pushers:Pushing", encoding="utf-8")
    result = call("evaluate", "stiff.yaml", "--task", "task.yaml", "--out", "results")
    assert_refused(result, "agent 'stiff.yaml' (own_pushers:Pushing): its method act: LinAlgError: Singular matrix (")
    assert f"{tmp_path / 'own_pushers.py'}, line 8)" in result.stderr
    assert not (tmp_path / "results").exists()
    assert_refused(
        call("evaluate", "stiff", "--task", "task.yaml"), "called 'stiff'; did you mean the file 'stiff.yaml'?"
    )
