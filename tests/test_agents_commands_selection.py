"""agents.commands.selection: a policy is tried on what it was trained on, or one is told what else."""

import pytest
import yaml

from caster_gym.agents.commands.selection import choose_task
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.bundle import DESCRIPTION
from caster_gym.shipped_files import names_of, read_settings


def shipped(name):
    return read_settings(TaskSettings, "tasks", name)


def run_of(folder, task, place="best"):
    """A policy in the folder of a training run on a task; what is in it is not read here."""
    policy = folder / place
    policy.mkdir(parents=True)
    (policy / DESCRIPTION).touch()
    content = {"command": "caster-gym train", "task": task.model_dump(mode="json"), "agent": {"algorithm": "ppo"}}
    (folder / "run.yaml").write_text(yaml.safe_dump(content, sort_keys=False, allow_unicode=True), encoding="utf-8")
    return policy


@pytest.mark.parametrize("place", ["best", "checkpoints/0000010000"])
@pytest.mark.parametrize("name", names_of("tasks"))
def test_a_policy_is_tried_on_the_task_that_it_was_trained_on(tmp_path, name, place):
    found = choose_task(str(run_of(tmp_path, shipped(name), place)), None)
    assert found.settings == shipped(name)
    assert found.words == f"Task {name}, on which the policy was trained."


def test_a_task_of_ones_own_goes_by_the_file_that_records_it(tmp_path):
    own = shipped("track").model_copy(update={"actuation": ("roll_1", "steer_1", "roll_2", "steer_2", "roll_3")})
    found = choose_task(str(run_of(tmp_path, own)), None)
    assert found.settings == own
    assert found.words == f"Task of {tmp_path / 'run.yaml'}, on which the policy was trained."


def test_another_task_is_told_beside_that_of_the_training(tmp_path):
    policy = run_of(tmp_path, shipped("slippery_floor"))
    found = choose_task(str(policy), "track")
    assert found.settings == shipped("track")
    assert found.words == "Task track; the policy was trained on another one, slippery_floor."
    assert choose_task(str(policy), "slippery_floor").words == "Task slippery_floor, on which the policy was trained."


def test_without_a_record_the_usual_task_is_taken_and_said_to_be(tmp_path):
    policy = run_of(tmp_path / "run", shipped("slippery_floor"))
    (tmp_path / "run" / "run.yaml").unlink()
    found = choose_task(str(policy), None)
    assert found.settings == shipped("track")
    assert f"Task track, since no run.yaml above {policy} tells" in found.words
    assert choose_task("computed_torque", None).words == "Task track."
    assert choose_task("computed_torque", "follow").settings == shipped("follow")
