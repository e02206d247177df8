"""caster_gym.agents.learning.resuming: a training that was killed goes on, and ends as if nothing had happened."""

import csv
import random
import shutil
import threading
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
import yaml

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.settings import LearnerSettings, PPOSettings, RslPPOSettings, SACSettings, SHACSettings
from caster_gym.agents.learning.training import train
from caster_gym.agents.learning.training_run import Run
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.durable_files import FolderInUseError, FolderLock

CLOCKS = ("seconds", "validation/seconds", "time/fps", "time/time_elapsed")  # columns that tell the time of day
TINY: dict[str, Any] = {"net_arch": (8,), "n_envs": 8, "batch_size": 64, "validations": 2, "save_every": 0.0}
TENSORS: dict[str, Any] = {"net_arch": (8,), "n_envs": 4, "compile": False, "device": "cpu", "save_every": 0.0}
LEARNERS = {
    "ppo": PPOSettings(algorithm="ppo", n_timesteps=2048, n_steps=64, n_epochs=2, **TINY),
    "sac": SACSettings(
        algorithm="sac", n_timesteps=1600, gradient_steps=1, buffer_size=900, learning_starts=200, **TINY
    ),
    "rsl_ppo": RslPPOSettings(algorithm="rsl_ppo", n_timesteps=80, n_steps=4, batch_size=16, validations=2, **TENSORS),
    "shac": SHACSettings(algorithm="shac", n_timesteps=48, n_steps=2, batch_size=8, validations=3, **TENSORS),
}
PATHS = {"shape": "random_paths", "count": 3, "duration": 1.0, "max_speed": 0.3}
PLAIN = {"train": [{**PATHS, "seed": 0}], "validation": [{**PATHS, "seed": 1}], "test": [{**PATHS, "seed": 2}]}
FEATURES = {"wrappers": [{"kind": "sensor_noise", "position": 0.001}], "shaping": [{"kind": "effort"}]}
ON_TENSORS = parse(TaskSettings, PLAIN, "task")
ON_ARRAYS = parse(TaskSettings, {**PLAIN, **FEATURES}, "task")  # which know features
TASKS = {"ppo": ON_ARRAYS, "sac": ON_ARRAYS, "rsl_ppo": ON_TENSORS, "shac": ON_TENSORS}


def nothing(steps, verdict):
    pass


def table(path):
    """A CSV file without the columns that tell the time."""
    with path.open(newline="", encoding="utf-8") as file:
        return [{name: cell for name, cell in row.items() if name not in CLOCKS} for row in csv.DictReader(file)]


def content(folder):
    """What a training has left: bytes of its policies, and its tables without the time."""
    files = sorted(path for place in ("best", "checkpoints") for path in (folder / place).rglob("*") if path.is_file())
    policies = {str(path.relative_to(folder)): path.read_bytes() for path in files}
    return policies, table(folder / "validation.csv"), table(folder / "progress.csv")


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    """A learner's training that nobody disturbed, and copies of its folder as a kill at some instants leaves it."""

    @cache
    def finish(name):
        above = tmp_path_factory.mktemp(name)
        folder, copies = above / "run", list[Path]()

        def look(steps, verdict):
            if steps >= LEARNERS[name].n_timesteps * (len(copies) + 1) / 4:
                copies.append(above / f"killed-{len(copies)}")
                shutil.copytree(folder, copies[-1])

        train(TASKS[name], LEARNERS[name], 3, folder, look)
        return folder, copies

    return finish


@pytest.mark.parametrize("name", LEARNERS)
def test_a_killed_training_ends_as_one_that_nobody_disturbed(undisturbed, tmp_path, name):
    """Whatever the global generators of the new process are."""
    folder, copies = undisturbed(name)
    assert len(copies) >= 3
    for number, killed in enumerate(copies):
        assert (killed / "state" / "state.safetensors").exists()
        copy = tmp_path / killed.name
        shutil.copytree(killed, copy)
        random.seed(number)
        np.random.seed(number)  # noqa: NPY002
        torch.manual_seed(number)
        train(TASKS[name], LEARNERS[name], 3, copy, nothing, resume=True)
        assert content(copy) == content(folder)
        assert not (copy / "state").exists()
        assert yaml.safe_load((copy / "run.yaml").read_text(encoding="utf-8"))["completed"] is True


def test_an_interrupted_training_ends_as_one_that_nobody_disturbed(undisturbed, tmp_path):
    """What it validated when it was interrupted, at a step at which it would not have, is gone again."""

    def interrupt(steps, verdict):
        if steps >= 1400:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(ON_ARRAYS, LEARNERS["ppo"], 3, tmp_path, interrupt)
    assert content(tmp_path)[1] != content(undisturbed("ppo")[0])[1]
    train(ON_ARRAYS, LEARNERS["ppo"], 3, tmp_path, nothing, resume=True)
    assert content(tmp_path) == content(undisturbed("ppo")[0])


def test_a_completed_training_is_left_as_it_is(undisturbed):
    folder, _ = undisturbed("shac")
    before = content(folder), (folder / "run.yaml").read_bytes()

    def refuse(steps, verdict):
        raise AssertionError("it trains")

    best = train(ON_TENSORS, LEARNERS["shac"], 3, folder, refuse, resume=True)
    assert (content(folder), (folder / "run.yaml").read_bytes()) == before
    assert any(int(row["steps"]) == best.steps for row in before[0][1])


@pytest.mark.parametrize(
    ("seed", "changes", "words"),
    [(4, {}, "seed 3, and now it is 4"), (3, {"gamma": 0.5}, r"agent.gamma 0.97, and now it is 0.5")],
)
def test_other_settings_than_those_of_the_folder_are_refused_by_name(undisturbed, seed, changes, words):
    folder, _ = undisturbed("shac")
    before = content(folder)
    with pytest.raises(ConfigurationError, match=words):
        train(ON_TENSORS, LEARNERS["shac"].model_copy(update=changes), seed, folder, nothing, resume=True)
    assert content(folder) == before


def test_how_often_state_is_saved_may_change(undisturbed):
    folder, _ = undisturbed("shac")
    train(ON_TENSORS, LEARNERS["shac"].model_copy(update={"save_every": 7.0}), 3, folder, nothing, resume=True)


def test_a_folder_without_a_training_begins_one(tmp_path, undisturbed):
    train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path / "new", nothing, resume=True)
    assert content(tmp_path / "new") == content(undisturbed("shac")[0])


def test_a_state_that_is_none_says_so(undisturbed, tmp_path):
    shutil.copytree(undisturbed("shac")[1][0], tmp_path / "run")
    (tmp_path / "run" / "state" / "state.safetensors").write_bytes(b"nothing")
    with pytest.raises(ConfigurationError, match="holds no state from which a training can go on"):
        train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path / "run", nothing, resume=True)


def test_the_state_of_another_training_says_so(undisturbed, tmp_path):
    """As when folders were mixed up by hand."""
    shutil.copytree(undisturbed("rsl_ppo")[1][0], tmp_path / "run")
    shutil.copytree(undisturbed("shac")[1][0] / "state", tmp_path / "run" / "state", dirs_exist_ok=True)
    with pytest.raises(ConfigurationError, match="is the state of another training: delete it to begin anew"):
        train(ON_TENSORS, LEARNERS["rsl_ppo"], 3, tmp_path / "run", nothing, resume=True)


def test_a_record_that_was_deleted_says_so(undisturbed, tmp_path):
    shutil.copytree(undisturbed("shac")[1][0], tmp_path / "run")
    (tmp_path / "run" / "progress.csv").unlink()
    with pytest.raises(ValueError, match=r"progress\.csv has 0 rows, and had \d+"):
        train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path / "run", nothing, resume=True)


@pytest.mark.parametrize("stopped", [False, True])
@pytest.mark.parametrize("what", ["checkpoints", "checkpoints/0000000016/weights.safetensors"])
def test_a_policy_that_is_gone_is_told_and_nothing_is_changed(undisturbed, tmp_path, stopped, what):
    """Of a completed training, and of one that was stopped."""
    folder, copies = undisturbed("shac")
    shutil.copytree(copies[-1] if stopped else folder, tmp_path / "run")
    gone = tmp_path / "run" / what
    shutil.rmtree(gone) if gone.is_dir() else gone.unlink()
    before = sorted(tmp_path.rglob("*"))
    remedy = "delete .*state to begin anew" if stopped else "put it back, or train anew"
    with pytest.raises(ConfigurationError, match=rf"there is no file '.*0000000016.*{remedy}"):
        train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path / "run", nothing, resume=True)
    if not stopped:
        assert sorted(tmp_path.rglob("*")) == before


@pytest.mark.parametrize(
    ("file", "damage", "words"),
    [
        ("best/weights.safetensors", lambda content: content[:50], "of which something is gone: .*weights"),
        ("best/policy.yaml", None, "of which something is gone: there is no policy in"),
        ("validation.csv", None, "of which something is gone: there is no file .*validation.csv"),
        ("run.yaml", None, "holds best, but no run.yaml, which says how that was made"),
        ("run.yaml", lambda content: content.replace(b"agent:", b"agnt:", 1), "does not say with which 'agent' the"),
        (
            "run.yaml",
            lambda content: content.replace(b"completed: true", b"completed: 3"),
            "run.yaml says completed: 3, which should be true or false",
        ),
    ],
)
def test_a_completed_training_that_is_damaged_says_so(undisturbed, tmp_path, file, damage, words):
    folder, _ = undisturbed("shac")
    shutil.copytree(folder, tmp_path / "run")
    path = tmp_path / "run" / file
    path.unlink() if damage is None else path.write_bytes(damage(path.read_bytes()))
    with pytest.raises(ConfigurationError, match=words):
        train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path / "run", nothing, resume=True)


class Counting(LearnerSettings):
    """A learner of a user's own, which goes on as docs/resuming.md says; it learns nothing."""

    n_timesteps: int = 6
    validations: int = 2
    save_every: float = 0.0

    def learn(self, run: Run) -> None:
        numbers: list[float] = [] if run.saved is None else list(run.saved.numbers["numbers"])
        bias = np.zeros(6, np.float32) if run.saved is None else np.array(run.saved.arrays["bias"])
        steps = run.steps

        def actor():
            made = Actor(run.layout.size, (2,), run.actions, "clip")
            with torch.no_grad():
                for weights in made.parameters():
                    weights.zero_()
                made.head.bias.copy_(torch.from_numpy(bias))
            return made

        try:
            while steps < self.n_timesteps:
                run.advance(steps, actor)
                run.save(steps, lambda: ({"bias": bias}, {"numbers": numbers}))
                steps += 1
                np.add(bias, np.float32(0.01 * (1 + len(numbers))), out=bias)
                numbers.append(float(bias[0]))
                run.record(steps, {"train/sum": sum(numbers)})
        finally:
            run.finish(steps, actor)


def test_a_learner_of_a_users_own_goes_on(tmp_path):
    def interrupt(steps, verdict):
        if steps >= 4:
            raise KeyboardInterrupt

    settings = Counting(algorithm="counting:Counting")
    train(ON_ARRAYS, settings, 0, tmp_path / "whole", nothing)
    with pytest.raises(KeyboardInterrupt):
        train(ON_ARRAYS, settings, 0, tmp_path / "stopped", interrupt)
    train(ON_ARRAYS, settings, 0, tmp_path / "stopped", nothing, resume=True)
    assert content(tmp_path / "stopped") == content(tmp_path / "whole")
    assert len(content(tmp_path / "whole")[2]) == 6 + len(content(tmp_path / "whole")[1])


def test_a_folder_in_use_is_refused(tmp_path):
    """As a second process would be."""
    refused: list[str] = []

    def start_another():
        with pytest.raises(FolderInUseError, match="is in use by process") as caught:
            train(ON_TENSORS, LEARNERS["shac"], 3, tmp_path, nothing, resume=True)
        refused.append(str(caught.value))

    with FolderLock(tmp_path):
        other = threading.Thread(target=start_another)
        other.start()
        other.join()
    assert len(refused) == 1
