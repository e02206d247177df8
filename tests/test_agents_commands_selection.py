"""agents.commands.selection: a policy is tried on what it was trained on, or one is told what else."""

import pytest
import yaml

from caster_gym.agents.commands.selection import choose_agent, choose_task
from caster_gym.agents.comparison.evaluation import evaluation_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import DESCRIPTION, Bundle, PolicyDescription, save_bundle
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.shipped_files import names_of, read_settings
from caster_gym.tasks.track.parameters import TrackParameters


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


BUNDLE_CODE = "from pathlib import Path\nPath(__file__).with_suffix('.ran').touch()\n"


@pytest.fixture
def stranger(tmp_path, monkeypatch):
    """A policy in its run, with a module beside each of its files; some file of it names the module."""
    policy = run_of(tmp_path, shipped("track"))
    layout = ObservationLayout(load_robot("chung2008"), TrackParameters().preview)
    description = PolicyDescription(
        format=1,
        name="stranger:Policy",
        squash="clip",
        hidden=(4,),
        robot=layout.robot,
        task=TrackParameters(),
        trained_with={"settings": {"algorithm": "stranger:Learner"}},
        versions={},
    )
    save_bundle(policy, Bundle(description, Actor(layout.size, (4,), 6, "clip")))
    for folder in (policy, tmp_path):
        (folder / "stranger.py").write_text(BUNDLE_CODE, encoding="utf-8")
    monkeypatch.syspath_prepend(tmp_path)  # so that whoever imports it would find it
    monkeypatch.chdir(policy)
    return policy


def changed(file, **changes):
    content = {**yaml.safe_load(file.read_text(encoding="utf-8")), **changes}
    file.write_text(yaml.safe_dump(content), encoding="utf-8")


def try_policy(policy):
    settings = choose_task(str(policy), None).settings
    return choose_agent(str(policy), settings, evaluation_batch(settings, settings.test[:1], 1)).agent


def test_a_policy_is_evaluated_without_a_look_at_its_code(stranger):
    """Settings of the learner are a record: nothing is imported for them."""
    changed(stranger.parent / "run.yaml", agent={"algorithm": "stranger:Learner"}, source={"module": "stranger"})
    assert try_policy(stranger).name == "stranger:Policy"
    assert not list(stranger.parent.rglob("*.ran"))


@pytest.mark.parametrize("file", ["run.yaml", "best/policy.yaml"])
@pytest.mark.parametrize("key", ["environment", "robot", "wrappers", "task", "arena", "algorithm"])
def test_no_file_of_a_policy_brings_code(stranger, file, key):
    named = ["stranger:Thing"] if key == "wrappers" else "stranger:Thing"
    place = stranger.parent / file
    if file == "run.yaml":
        changed(place, task={**yaml.safe_load(place.read_text(encoding="utf-8"))["task"], key: named})
    else:
        changed(place, **{key: named})
    with pytest.raises(ConfigurationError):
        try_policy(stranger)
    assert not list(stranger.parent.rglob("*.ran"))


@pytest.mark.parametrize("file", ["run.yaml", "best/policy.yaml", "best/agent.yaml"])
def test_no_file_beside_a_policy_is_an_agent_with_code(stranger, file):
    place = stranger.parent / file
    place.touch()
    place.write_text("algorithm: stranger:Thing", encoding="utf-8")
    settings = shipped("track")
    with pytest.raises(ConfigurationError):
        choose_agent(str(place), settings, evaluation_batch(settings, settings.test[:1], 1))
    assert not list(stranger.parent.rglob("*.ran"))
