"""caster_gym.envs.native.compilation: whoever waits for a task to be compiled is told so, once, and nobody else."""

import os
import subprocess
import sys
from pathlib import Path

import pytest
from numba import njit, typeof

from caster_gym import load_robot
from caster_gym.envs.native import compilation
from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.registry import find_task

ROOT = Path(__file__).resolve().parent.parent
TRACK = find_task("track")
FAR = {"room": [[-50.0, -50.0], [50.0, 50.0]]}


def types_of_restart(engine):
    """Types of the arguments that matter, where they stand."""
    return (None, None, typeof(engine._world), None, None, None, typeof(engine._sizes))


SCALES = {"a": 1.0}


def scaled(x):
    return SCALES["a"] * x


def test_what_cannot_be_compiled_is_told_by_its_innermost_reason_and_line():
    """Numba itself tells it in dozens of lines, once for each function on the way."""
    engine, _ = build_engine(TRACK, "chung2008", "circle", None, None, {}, 1)
    inner = njit(scaled)
    said = r"^the code of CasterTrack cannot be compiled: .*SCALES.* \(.*test_envs_native_compilation\.py, line \d+\)$"
    with pytest.raises(OwnCodeError, match=said), compilation.told_plainly(engine.plan.source):
        njit(lambda x: inner(x))(1.0)


@pytest.mark.parametrize(
    ("task", "robot", "arena", "fields", "words"),
    [
        ("track", "chung2008", None, {}, "3 casters (CasterTrack, 3 previewed points)"),
        ("track", "xr4000", None, {"preview": (0.1,)}, "4 casters (CasterTrack, 1 previewed point)"),
        (
            "follow",
            "chung2008",
            FAR,
            {"nearest": 2},
            "3 casters (CasterFollow among obstacles, 3 previewed points, 2 observed obstacles)",
        ),
    ],
)
def test_what_is_compiled_is_named_by_all_that_it_is_compiled_for(task, robot, arena, fields, words):
    """Another number of casters, task or preview compiles anew, so that the words must tell them apart."""
    definition = find_task(task)
    engine, _ = build_engine(definition, robot, definition.short_path, "all", arena, fields, 1)
    assert compilation.of_restart(types_of_restart(engine)).what == words


def test_more_casters_and_obstacles_take_longer():
    robots = [load_robot(name) for name in ("chung2008", "xr4000")]
    path = {"shape": "circle", "duration": 60.0}
    seconds = [
        compilation.of_restart(types_of_restart(build_engine(TRACK, robot, path, "all", arena, {}, 1)[0])).seconds
        for arena in (None, FAR)
        for robot in robots
    ]
    assert seconds == sorted(seconds)
    assert len(set(seconds)) == 4


COLD = """
import sys
import gymnasium as gym
import caster_gym

def mark(what):
    print(what, file=sys.stderr, flush=True)

robot = caster_gym.load_robot("chung2008")
robot = robot.model_copy(update={"casters": robot.casters[:2], "actuation": "all"})
task = {"robot": robot, "path": {"shape": "circle", "duration": 60.0}}
env = gym.make("caster_gym:CasterTrack-v0", **task)
batch = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, **task)
mark("made")
env.reset(seed=0)
mark("reset")
env.step(env.action_space.sample())
env.reset(options={"path": 0})
mark("stepped")
batch.reset(seed=0)
mark("batch reset")
batch.step(batch.action_space.sample())
mark("batch stepped")
"""

TORCH = """
import torch
from caster_gym.engines.native.compilation import compilations
from caster_gym.envs.tensor.task import TorchTask

task = TorchTask("follow", robot="chung2008", arena={"room": [[-5.0, -5.0], [5.0, 5.0]]})
state, outcome = task.begin(torch.arange(2))
task.step(state, torch.zeros(2, 6))
print(compilations())
"""


def run(code, folder):
    environment = os.environ | {"NUMBA_CACHE_DIR": str(folder), "PYTHONPATH": str(ROOT), "PYTHONWARNINGS": "ignore"}
    return subprocess.run([sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True)


@pytest.fixture(scope="module")
def told(tmp_path_factory):
    """What a process says that makes environments, resets and steps them, with an empty cache and then with its own."""
    folder = tmp_path_factory.mktemp("cold")
    return run(COLD, folder).stderr.splitlines(), run(COLD, folder).stderr.splitlines()


@pytest.mark.slow
def test_a_task_announces_its_compilation_once(told):
    """With the start of an episode its step is compiled, so that there is one wait; that of a batch is another one."""
    announced = "caster_gym: compiling for 2 casters (CasterTrack, 3 previewed points{}), about {} s, once"
    alone, together = (f"{announced.format(*words)} on this machine" for words in (("", 20), (", batches", 15)))
    assert told[0] == ["made", alone, "reset", "stepped", "batch reset", together, "batch stepped"]


@pytest.mark.slow
def test_what_was_compiled_is_not_announced_again(told):
    assert told[1] == ["made", "reset", "stepped", "batch reset", "batch stepped"]


@pytest.mark.slow
def test_torch_alone_compiles_and_announces_nothing(tmp_path):
    done = run(TORCH, tmp_path / "cache")
    assert (done.stdout, done.stderr) == ("0\n", "")
    assert not (tmp_path / "cache").exists()
