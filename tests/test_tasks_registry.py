"""caster_gym.tasks.registry, .task, .building: every task is one object, and one of one's own is as good as ours."""

import os
import subprocess
import sys
from pathlib import Path
from typing import Any

import gymnasium as gym
import pytest
import torch

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.engines.native.outside_sources import note_outside, outside_digest
from caster_gym.envs.native.reference import TaskCode, register_task
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv
from caster_gym.tasks.registry import TASKS, find_task, register_environments
from caster_gym.tasks.track import TASK as TRACK
from caster_gym.tasks.track.reference import Timetable

ROOT = Path(__file__).resolve().parent.parent
PATHS = {
    kind: [{"shape": shape}] for kind, shape in (("train", "circle"), ("validation", "ellipse"), ("test", "lemniscate"))
}

OWN = """
from typing import NamedTuple

from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv
from caster_gym.tasks.task import Task
from caster_gym.tasks.track import TASK as TRACK
from caster_gym.tasks.track.reference import Timetable, fetch, lay_out
from {helper} import speed_share


class Slow(Timetable):
    __slots__ = ()


class Terms(NamedTuple):
    slowness: float
    alive: float


class Weights(NamedTuple):
    corridor: float
    touching_ends: float


def reward(moment, weights):
    return Terms(speed_share(moment.state.twist), 1.0)


def lay_out_slowly(robot, paths, parameters):
    source, ways = lay_out(robot, paths, parameters)
    return Slow(*source), ways


TASK = Task(
    name="slow", environment="{module}:CasterSlow", purpose="be slow", parameters=TRACK.parameters,
    default_path="circle", short_path=TRACK.short_path, preview_unit="s", source=Slow, lay_out=lay_out_slowly,
    fetch=fetch, weights=Weights, terms=Terms, reward=reward, metrics=TRACK.metrics,
)


class CasterSlowEnv(TaskEnv):
    definition = TASK


class CasterSlowVectorEnv(TaskVectorEnv):
    definition = TASK
"""
HELPER = "def speed_share(twist):\n    return {factor} / (1.0 + twist[0] * twist[0])\n"
RUN = """
import sys
sys.path.insert(0, sys.argv[1])
import gymnasium as gym
import numpy as np
from caster_gym import load_robot
from caster_gym.tasks.registry import register_environments

register_environments("own_slow:TASK")
robot = load_robot("chung2008")
pair = robot.model_copy(update={"casters": robot.casters[:2], "actuation": "all"})  # for speed
env = gym.make("CasterSlow-v0", robot=pair, path={"shape": "circle", "duration": 60.0}, preview=())
env.reset(seed=0)
_, reward, _, _, info = env.step(np.zeros(4, dtype=np.float32))
assert reward == info["reward_terms"]["slowness"] + 1.0
print(info["reward_terms"]["slowness"])
"""


def own_module(folder, monkeypatch, *changes):
    """The name of a module of one's own with some of its text changed; it can be imported."""
    name = f"own_{folder.name}"
    text = OWN.format(helper=f"{name}_helper", module=name)
    for old, new in changes:
        assert old in text
        text = text.replace(old, new)
    (folder / f"{name}.py").write_text(text)
    (folder / f"{name}_helper.py").write_text(HELPER.format(factor=1.0))
    monkeypatch.syspath_prepend(folder)
    return name


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A module of one's own beside its helper, on the path; returns its name."""
    return own_module(tmp_path, monkeypatch)


@pytest.mark.parametrize("name", TASKS)
def test_each_task_has_its_environments_under_an_id_of_its_own(name):
    """The classes of the object are those that Gymnasium finds without importing any task."""
    task = find_task(name)
    assert task.name == name
    spec = gym.spec(f"{task.title}-v0")
    assert spec.entry_point == f"{task.environment}Env"
    assert spec.vector_entry_point == f"{task.environment}VectorEnv"
    assert issubclass(task.single, TaskEnv)
    assert issubclass(task.batch, TaskVectorEnv)
    assert task.single.definition is task.batch.definition is task


@pytest.mark.parametrize("name", TASKS)
def test_weights_are_the_parameters_of_their_names(name):
    """Each into the field that means it; a flag is 1 or 0."""
    task = find_task(name)
    fields = [field for field in task.weights._fields if field not in ("corridor", "touching_ends")]
    values: dict[str, Any] = {field: 1.25 + 0.111 * i for i, field in enumerate(fields)}
    parameters = task.parameters(**values, corridor=2.9, touching="ends")
    weights = task.weights(*task.weights_of(parameters).tolist())._asdict()
    assert weights == {**values, "corridor": 2.9, "touching_ends": 1.0}


def test_an_unknown_task_is_told_which_there_are():
    known = ", ".join(map(repr, TASKS))
    with pytest.raises(ValueError, match=f"the task must be {known} or 'module:Name' of your own"):
        TorchTask("folow")
    with pytest.raises(ValueError, match="there is no module 'nowhere' in the working folder or among"):
        find_task("nowhere:TASK")
    with pytest.raises(ValueError, match=r"math:pi must be a caster_gym\.tasks\.task\.Task, got 3\.14"):
        find_task("math:pi")


def test_a_task_of_ones_own_is_taken_wherever_a_task_is_named(own):
    """In settings of tasks, whose file may lie anywhere, and on tensors."""
    settings = parse(TaskSettings, {**PATHS, "environment": f"{own}:TASK", "task": {"corridor": 0.7}}, "task")
    assert settings.task == TRACK.parameters(corridor=0.7)
    task = TorchTask(f"{own}:TASK", path="circle", dtype=torch.float64)
    state, _ = task.begin(torch.arange(2))
    _, outcome = task.step(state, torch.zeros(2, 6, dtype=torch.float64))
    terms = task.info(outcome.report)["reward_terms"]
    assert list(terms) == ["slowness", "alive"]
    assert torch.equal(outcome.rewards, terms["slowness"] + 1.0)


def test_a_task_of_ones_own_is_found_beside_the_file_that_names_it_but_not_among_results(own, tmp_path):
    sys.path.remove(str(tmp_path))
    content = {**PATHS, "environment": f"{own}:TASK"}
    (tmp_path / "run.yaml").touch()
    with pytest.raises(ConfigurationError, match=r"'environment'.* is a folder of results, from which no code is run"):
        parse(TaskSettings, content, "task", tmp_path)
    assert own not in sys.modules
    (tmp_path / "run.yaml").unlink()
    assert parse(TaskSettings, content, "task", tmp_path).environment == f"{own}:TASK"


def test_two_tasks_cannot_share_a_source():
    """What is compiled for its type would be one of both."""
    code = TaskCode("CasterOther", TRACK.fetch, TRACK.weights, TRACK.reward, TRACK.endings)
    with pytest.raises(ValueError, match="Timetable of task 'CasterOther' belongs to task 'CasterTrack': subclass it"):
        register_task(Timetable, code)


def test_an_edit_of_what_a_task_imports_compiles_it_anew(own, tmp_path):
    """Neither its own file nor that of a helper may be read from the cache once it has changed."""
    task = find_task(f"{own}:TASK")
    kind = type("Kind", (), {"instance_class": task.source})()
    first = outside_digest((kind,))
    assert first is not None and own in first
    (tmp_path / f"{own}_helper.py").write_text(HELPER.format(factor=2.0))
    assert outside_digest((kind,)) is None  # this process has read the old one: nothing is kept for others
    note_outside((task.source,), [own])
    assert outside_digest((kind,)) not in (None, first)


def test_our_own_sources_are_in_the_version_alone():
    assert outside_digest((type("Kind", (), {"instance_class": Timetable})(),)) == ""


@pytest.mark.slow
def test_a_task_of_ones_own_is_compiled_and_after_an_edit_anew(tmp_path):
    """In processes that share a cache; a robot at rest for 20 ms has hardly any speed."""
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(ROOT)}
    (tmp_path / "own_slow.py").write_text(OWN.format(helper="own_helper", module="own_slow"))
    found, announced = [], []
    for factor in (0.5, 0.5, 0.25):
        (tmp_path / "own_helper.py").write_text(HELPER.format(factor=factor))
        done = subprocess.run(
            [sys.executable, "-c", RUN, str(tmp_path)], env=environment, check=True, capture_output=True, text=True
        )
        found.append(float(done.stdout))
        announced.append("compiling" in done.stderr)
    assert found == pytest.approx([0.5, 0.5, 0.25], rel=1e-3)
    assert announced == [True, False, True]


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ('name="slow"', 'name="track"'),
            r"task 'track' of own_.* has the name of a task of the package: give it anot",
        ),
        (
            ("{TITLE}", "CasterHold"),
            r"task 'slow': CasterHold-v0 is task 'hold' of the package: give its environment an",
        ),
        (('name="slow"', 'name="my:slow"'), r"task 'my:slow': its name must be one word of letters, digits and _"),
        (
            ("{MODULE}:CasterSlow", "CasterSlow"),
            r"task 'slow': its environment must be written as module:Title, such as",
        ),
        (('preview_unit="s"', 'preview_unit="ms"'), r"task 'slow': its preview_unit must be 's' or 'm', got 'ms'"),
        (
            ('purpose="be slow"', 'purpose=" "'),
            r"task 'slow': its purpose must say in words what a robot is to do, got",
        ),
        (
            ("weights=Weights", "weights=float"),
            r"task 'slow': its weights must be a named tuple, got <class",
        ),
        (
            ("parameters=TRACK.parameters", "parameters=dict"),
            r"task 'slow': its parameters must be a subclass of TaskPar",
        ),
        (
            ("metrics=TRACK.metrics", "metrics=TRACK.metrics._replace(verdict=Terms)"),
            r"task 'slow': its verdict, Terms, must be a named tuple with `of`, `failures` and `merit`, and lacks of",
        ),
    ],
)
def test_words_of_a_task_that_cannot_be_meant_are_told_with_its_line(tmp_path, monkeypatch, change, sentence):
    old, new = (
        part.format(MODULE=f"own_{tmp_path.name}", TITLE="CasterSlow") if "{" in part else part for part in change
    )
    name = own_module(tmp_path, monkeypatch, (old, new))
    with pytest.raises(
        ConfigurationError, match=rf"cannot be imported: OwnCodeError: {sentence}.*\(.*{name}\.py, line 34\)"
    ):
        find_task(f"{name}:TASK")


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ("class CasterSlowVectorEnv", "class CasterFastVectorEnv"),
            r"slow. needs a class CasterSlowVectorEnv\(TaskVectorEnv\) with `definition = TASK` in .*\.py, got None; "
            "did you mean 'CasterFastVectorEnv'",
        ),
        (
            ("class CasterSlowEnv(TaskEnv)", "class CasterSlowEnv"),
            r"needs a class CasterSlowEnv\(TaskEnv\) .*, got <class",
        ),
        (
            ("Env):\n    definition = TASK", "Env):\n    pass"),
            "must have `definition =` the task 'slow'.*, and has none",
        ),
        (
            ("{MODULE}:", "nowhere:"),
            "task 'slow' has the environment 'nowhere:CasterSlow': there is no module 'nowhere'",
        ),
    ],
)
def test_a_task_without_its_environments_says_what_is_missing(tmp_path, monkeypatch, change, sentence):
    """Where the environments are asked for; on tensors, nobody needs them."""
    name = own_module(tmp_path, monkeypatch, tuple(part.format(MODULE=f"own_{tmp_path.name}") for part in change))
    with pytest.raises(ConfigurationError, match=sentence):
        register_environments(f"{name}:TASK")


def test_two_tasks_cannot_share_an_identity_for_gymnasium(tmp_path, monkeypatch):
    """The later one would take the place of the earlier."""
    monkeypatch.setitem(
        gym.registry, "CasterSlow-v0", gym.envs.registration.EnvSpec("CasterSlow-v0", "other:CasterSlowEnv")
    )
    name = own_module(tmp_path, monkeypatch)
    with pytest.raises(
        ValueError, match="CasterSlow-v0 is made by other:CasterSlowEnv already: give the environment of"
    ):
        register_environments(f"{name}:TASK")


def test_a_syntax_error_is_told_with_its_own_line(tmp_path, monkeypatch):
    name = own_module(tmp_path, monkeypatch, ("class Terms(NamedTuple):", "class Terms(NamedTuple)"))
    with pytest.raises(
        ConfigurationError, match=rf"cannot be imported: SyntaxError: expected ':' \(\S+{name}\.py, line 15\)$"
    ):
        find_task(f"{name}:TASK")
