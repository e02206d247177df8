"""caster_gym.agents.commands.command_line: mistakes get a sentence, not a traceback, and no results are lost."""

import io
import sys

import pytest
import yaml

from caster_gym.agents.commands.command_line import progress
from caster_gym.durable_files import MARK
from tests.command_calls import TASK, TINY, assert_refused


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["train", "nobody"], "there is no 'nobody' in agents; known are computed_torque"),
        (["train", "--task", "nowhere"], "there is no 'nowhere' in tasks; known are"),
        (["train", "--task", "missing.yaml"], "there is no file 'missing.yaml'"),
        (["train", "computed_torque"], "agent 'computed_torque' does not learn"),
        (["evaluate", "nobody"], "neither a folder of a policy nor a model-based agent called 'nobody'; such are comp"),
        (
            ["evaluate", "code/pushers.py"],
            "code/pushers.py is Python code, not the settings of an agent: give a YAML file with the line 'algorithm: "
            "pushers:Name'",
        ),
        (["train", "pushers.py"], "pushers.py is Python code, not the settings of an agent"),
        (["evaluate", "ppo"], "agent 'ppo' must be trained first"),
        (["evaluate", "computed_torque", "--task", "nowhere"], "there is no 'nowhere' in tasks"),
        (["benchmark", "--config", "nothing"], "there is no 'nothing' in benchmarks; known are follow, "),
        (["train", "--set", "steps"], "--set needs KEY=VALUE, got 'steps'"),
        (["train", "--set", "=3"], "--set needs KEY=VALUE, got '=3'"),
        (
            ["train", "--set", "num_minibatches=4"],
            "unknown key 'num_minibatches'; 'batch_size' is the size of a batch: n_envs · n_steps over their number",
        ),
        (
            ["train", "--set", "train_batch_size=4000"],
            "unknown key 'train_batch_size'; n_envs · n_steps steps come before each update",
        ),
        (
            ["identify", "drive.csv", "--set", "start={radius:0.0265}"],
            "--set start={radius:0.0265}: a colon needs a space after it, as in 'radius: 0.0265'",
        ),
        (["train", "--set", "stepz=3"], "did you mean 'n_steps'?"),
        (["train", "--set", "n_timesteps=many"], "should be a whole number, got 'many'"),
        (
            ["train", "--set", "n_timesteps=["],
            "--set n_timesteps=[ cannot be read as YAML: did not find expected node content",
        ),
    ],
)
def test_mistakes_get_one_sentence(call, tmp_path, arguments, message):
    assert_refused(call(*arguments, "--out", "results"), message)
    assert not (tmp_path / "results").exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            ["evaluate", "computed_torque", "--task", "task"],
            "there is no 'task' in tasks; did you mean the file 'task.yaml'?",
        ),
        (["train", "--task", "track.yaml"], "what comes with the package is called 'track'"),
        (
            ["train", "sac", "--set", "n_timesteps=5000"],
            "'learning_starts' must be below n_timesteps, 5000, got 10000",
        ),
        (["train", "--set", "net_arch=[1e9]"], "number 1 of 'net_arch' should be less than or equal to 16384"),
        (["train", "--set", "n_envs=1e12"], "robots at most"),
        (["watch", "--seconds", "1e400", "--save", "a.gif"], "seconds must be positive and finite, got inf"),
        (
            ["watch", "--save", "a.gif", "--path", "7", "--task", "task.yaml"],
            "path must be a number from 0 to 1, or the name",
        ),
        (["identify", "--example", "nowhere/a.csv"], "there is no folder 'nowhere' to write a.csv in; make it first"),
        (["train", "--task", "arena.yaml"], "'arena': an arena is a mapping or the name of a YAML file, got 'room'"),
        (["train", "--task", "points.yaml"], "points.csv'"),
        (["design", "--set", "robot=7"], "'robot' should be text, got 7"),
    ],
)
def test_more_mistakes_get_one_sentence(call, tmp_path, arguments, message):
    (tmp_path / "arena.yaml").write_text(yaml.safe_dump({**TASK, "arena": "room"}))
    (tmp_path / "points.yaml").write_text(yaml.safe_dump({**TASK, "test": [{"shape": "spline", "file": "points.csv"}]}))
    assert_refused(call(*arguments), message)
    assert {one.name for one in tmp_path.iterdir()} == {"task.yaml", "arena.yaml", "points.yaml"}


def test_a_missing_library_is_named_with_its_extra(call, monkeypatch):
    def missing(*_):
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    monkeypatch.setattr("caster_gym.design.design", missing)
    assert_refused(call("design"), "this needs the Python package 'torch': pip install 'caster_gym[train]'")


@pytest.mark.parametrize(
    ("package", "command"),
    [
        ("optuna", ["sweep", "ppo_track"]),
        ("ray", ["sweep", "ppo_track", "--workers", "ray"]),
        ("ray", ["benchmark", "--workers", "ray"]),
    ],
)
def test_many_machines_need_the_extra_scale(call, tmp_path, monkeypatch, package, command):
    """Nothing is begun without its packages."""
    users = ("caster_gym.agents.sweep.", "caster_gym.agents.workers.on_ray", f"{package}.")
    for name in [one for one in sys.modules if one.startswith(users)]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, package, None)  # its import fails
    refused = call(*command, "--out", "results")
    assert_refused(refused, f"this needs the Python package {package!r}: pip install 'caster_gym[scale]'")
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


@pytest.mark.slow
def test_overwrite_begins_with_an_empty_folder(call, tmp_path):
    (tmp_path / "results").mkdir()
    (tmp_path / "results" / "learning.png").write_text("old", encoding="utf-8")
    (tmp_path / "results" / MARK).touch()
    result = call("evaluate", "computed_torque", "--task", "task.yaml", "--out", "results", "--overwrite")
    assert result.exit_code == 0, result.output
    assert not (tmp_path / "results" / "learning.png").exists()
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
    assert_refused(
        call("train", *TINY, "--task", "task.yaml", "--out", "file/run"), "file is not a folder; choose another --out"
    )


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


@pytest.mark.parametrize("out", ["/proc/results", "file/results", "file"])
@pytest.mark.parametrize(
    "command",
    [
        ["train", *TINY, "--task", "task.yaml"],
        ["evaluate", "computed_torque", "--task", "task.yaml"],
        ["benchmark", "--config", "track_sac"],
        ["design"],
        ["identify", "recording.csv"],
    ],
    ids=lambda command: command[0],
)
def test_commands_try_their_folder_before_they_compute(call, tmp_path, monkeypatch, command, out):
    """Nothing that takes long is reached."""
    (tmp_path / "file").touch()
    (tmp_path / "recording.csv").touch()
    for place in (
        "caster_gym.agents.learning.training.train",
        "caster_gym.agents.commands.evaluate.compare",
        "caster_gym.agents.commands.benchmark.run_benchmark",
        "caster_gym.design.command.make_design",
        "caster_gym.identification.fit.identify",
    ):
        monkeypatch.setattr(place, lambda *_, **__: pytest.fail("computed before the folder was tried"))
    assert_refused(call(*command, "--out", out), "choose another --out")


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.mark.parametrize(("stream", "shown"), [(io.StringIO, False), (Terminal, True)])
def test_progress_is_shown_in_a_terminal_and_not_in_a_file(monkeypatch, stream, shown):
    written = stream()
    monkeypatch.setattr(sys, "stderr", written)
    with progress(total=3, desc="parts", mininterval=0.0) as show:
        for done in (1, 2, 3):
            show(done, "so far")
    assert ("parts: 100%" in written.getvalue()) is shown
    assert bool(written.getvalue()) is shown
