"""caster_gym.agents.commands.cli: the commands explain themselves, and an export refuses what MuJoCo cannot read."""

from typing import Any

import pytest
from typer.main import get_command

import caster_gym
from caster_gym.agents.commands.cli import app
from tests.command_calls import assert_refused


@pytest.mark.parametrize("command", ["train", "evaluate", "benchmark"])
def test_each_command_explains_itself(call, command):
    result = call(command, "--help")
    assert result.exit_code == 0
    assert "--out" in result.stdout
    assert "--overwrite" in result.stdout
    assert command in call("--help").stdout


def all_commands():
    """Every command by name, and the group of them."""
    group: Any = get_command(app)
    return {"": group, **group.commands}


@pytest.mark.parametrize("name", all_commands())
def test_help_shows_every_word_that_was_written(call, name):
    """Units in brackets too, which a help page may take for markup. Lines are broken at blanks."""
    command = all_commands()[name]
    for flag in ("-h", "--help"):
        result = call(*([name] if name else []), flag)
        assert result.exit_code == 0, result.output
        shown = " ".join(result.stdout.split())
        written = [command.help, *(one.help for one in command.params if getattr(one, "help", None))]
        for text in written:
            assert " ".join(text.split()) in shown


def test_help_of_export_has_its_unit(call):
    assert "Time step of the model [s]; the slip" in " ".join(call("export", "-h").stdout.split())


def test_version_is_shown(call):
    result = call("--version")
    assert (result.exit_code, result.stdout) == (0, f"caster_gym {caster_gym.__version__}\n")


def test_completion_is_offered(call):
    assert "--install-completion" in call("--help").stdout


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["robot.urdf"], "what is written is MJCF, for MuJoCo, got the name 'robot.urdf'; call it 'robot.xml'"),
        (["robot"], "call it 'robot.xml'"),
        ([""], "got the name ''; call it 'robot.xml'"),
        ([".."], "got the name '..'; call it 'robot.xml'"),
        (["robot.xml", "--time-step", "nan"], "time_step must be positive and finite, got nan s"),
        (["robot.xml", "--time-step", "inf"], "time_step must be positive and finite, got inf s"),
        (["robot.xml", "--time-step", "-0.1"], "time_step must be positive and finite, got -0.1 s"),
        (["robot.xml", "--friction", "nan"], "friction must be positive and finite, got nan"),
        (["robot.xml", "--friction", "0"], "friction must be positive and finite, got 0"),
        (["nowhere/robot.xml"], "there is no folder 'nowhere' to write robot.xml in; make it first"),
        (["/proc/robot.xml"], "/proc/robot.xml cannot be written: new files are not possible there"),
    ],
)
def test_mistakes_in_an_export_get_one_sentence(call, tmp_path, arguments, message):
    assert_refused(call("export", "chung2008", "--mjcf", *arguments), message)
    assert [one.name for one in tmp_path.iterdir()] == ["task.yaml"]
    assert call("export", "chung2008", "--mjcf", "robot.xml").exit_code == 0
