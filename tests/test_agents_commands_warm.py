"""caster_gym.agents.commands.warm: compiling ahead, piece by piece."""

import pytest
from typer.testing import CliRunner

from caster_gym.agents.commands.cli import app
from caster_gym.agents.commands.warm import Piece, read_pieces, warm
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.configuration import ConfigurationError
from caster_gym.engines.native import compiled_files
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import compiled
from caster_gym.engines.native.fleet import Fleet
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.robot import load_robot
from caster_gym.shipped_files import names_of, read_settings


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    monkeypatch.setattr(compiled_files._SETTINGS, "CACHE_DIR", str(tmp_path / "cache"))


TASKS = [read_settings(TaskSettings, "tasks", name) for name in names_of("tasks")]
KINDS = {task.environment for task in TASKS if task.task.slippery is None}


def names(*arguments):
    return [piece.name for piece in read_pieces(*arguments)]


def test_what_comes_with_the_package_is_compiled_unless_something_is_named():
    """Each number of casters, each kind of task: alone and in batches, with and without obstacles; the mechanics."""
    pieces = names([], [], [])
    counts = {load_robot(name).caster_count for name in names_of("robots")}
    assert len(set(pieces)) == len(pieces) == len(counts) * (len(KINDS) * 2 * 2 + 2)
    assert {name.split(",")[0] for name in pieces} == {f"{count} casters" for count in counts}
    assert names(["tidybot2"], ["track"], []) == [
        name for name in pieces if name.startswith("4 casters, track") or name.startswith("4 casters, mechanics")
    ]


def test_tasks_on_slippery_floors_are_compiled_if_they_are_named():
    pieces = names(["chung2008"], ["track", "slippery_floor"], [])
    assert len(set(pieces)) == 2 * 2 * 2 + 2
    assert sum("on a floor of finite friction" in name for name in pieces) == 2 * 2


def test_other_numbers_of_casters():
    assert {name.split(",")[0] for name in names([], ["track"], [2, 7])} == {"2 casters", "7 casters"}
    with pytest.raises(ValueError, match="2 casters or more, got 1"):
        names([], [], [1])


@pytest.mark.parametrize("casters", [2, 3, 5, 8])
def test_a_robot_with_any_number_of_casters_can_be_made(casters, monkeypatch):
    """Path, arena and time step suit it; only the compiled calls are left out."""
    steps = []
    for kind, name in ((TaskEngine, "restart"), (TaskEngine, "step"), (TaskEngine, "step_alone"), (Fleet, "step")):
        monkeypatch.setattr(kind, name, lambda self, *_: steps.append(self))
    for piece in read_pieces([], [], [casters]):
        piece.run()
    assert len(steps) == len(KINDS) * 2 * 2 * 2 + 2  # a restart and a step of each piece


def test_a_robot_that_is_not_there():
    with pytest.raises(ConfigurationError, match="unknown robot 'chung2009'"):
        names(["chung2009"], [], [])


def test_an_interrupted_run_goes_on_where_it_stopped(capfd):
    """A piece that was compiled stays so; nothing is announced beside the bar."""
    done = []

    def increased(x):
        return x + 1.0

    def run():  # as a new process, which knows only what is on disk
        compiled(increased, lambda types: Work("a test", 1.0))(1.0)

    def stop(count, name):
        done.append(name)
        if name == "second":
            raise KeyboardInterrupt

    pieces = [Piece("first", run), Piece("second", pytest.fail)]
    with pytest.raises(KeyboardInterrupt):
        warm(pieces, stop)
    result = warm(pieces[:1], lambda count, name: done.append(name))
    assert done == ["first", "second", "first", ""]
    assert (result.pieces, result.compiled) == (1, 0)
    assert "compiling" not in capfd.readouterr().err


def test_command_says_what_it_does_not_know():
    result = CliRunner().invoke(app, ["warm", "--robot", "chung2009"])
    assert result.exit_code == 2
    assert "unknown robot 'chung2009'" in result.output
