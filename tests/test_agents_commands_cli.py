"""caster_gym.agents.commands.cli: commands work together, and mistakes get a sentence, not a traceback."""

import csv
import shutil
from typing import Any

import pytest
import yaml
from typer.main import get_command
from typer.testing import CliRunner

import caster_gym
from caster_gym.agents.commands.cli import app
from caster_gym.report.run_folder import MARK

RANDOM = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3}
TASK = {
    "train": [{**RANDOM, "seed": 0, "count": 3}],
    "validation": [{**RANDOM, "seed": 1, "count": 2}],
    "test": [{**RANDOM, "seed": 2, "count": 2}],
}
SIZES = ("n_timesteps=512", "n_envs=8", "n_steps=32", "batch_size=64", "net_arch=[8]")
TINY = [word for size in SIZES for word in ("--set", size)]


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Runs a command in an empty folder; returns its result."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    runner = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    return lambda *arguments: runner.invoke(app, [str(argument) for argument in arguments])


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
        (["evaluate", "nobody"], "neither a folder of a policy nor a model-based agent called 'nobody'; such are comp"),
        (["evaluate", "ppo"], "agent 'ppo' must be trained first"),
        (["evaluate", "computed_torque", "--task", "nowhere"], "there is no 'nowhere' in tasks"),
        (["benchmark", "--config", "nothing"], "there is no 'nothing' in benchmarks; known are follow, patch_of_ice,"),
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
        (["train", "--set", "n_timesteps=["], "--set n_timesteps=[ cannot be read as YAML: expected the node content"),
    ],
)
def test_mistakes_get_one_sentence(call, tmp_path, arguments, message):
    assert_refused(call(*arguments, "--out", "results"), message)
    assert not (tmp_path / "results").exists()


def test_exponents_are_numbers(call, tmp_path):
    tiny = [*TINY[2:], "--set", "n_timesteps=1e2", "--set", "learning_rate=1e-3"]
    assert call("train", "ppo", *tiny, "--task", "task.yaml", "--out", "run").exit_code == 0
    agent = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text(encoding="utf-8"))["agent"]
    assert (agent["n_timesteps"], agent["learning_rate"]) == (100, 0.001)


def test_a_folder_that_is_no_policy_is_refused(call, tmp_path):
    (tmp_path / "folder").mkdir()
    assert_refused(
        call("evaluate", "folder", "--task", "task.yaml", "--out", "results"), "there is no policy in folder: it has no"
    )
    assert not (tmp_path / "runs").exists()


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


def test_model_based_control_is_evaluated_by_name(call):
    result = call("evaluate", "computed_torque", "--task", "task.yaml", "--out", "results")
    assert result.exit_code == 0, result.output
    assert "computed torque" in result.stdout
    assert "0 of 2" in result.stdout


def test_a_policy_is_not_evaluated_in_the_other_environment(trained, call, tmp_path):
    other = {kind: [{"shape": "circle", "radius": 0.5 + i}] for i, kind in enumerate(TASK)}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump({"environment": "follow", **other}), encoding="utf-8")
    result = call("evaluate", trained[1] / "best", "--task", "other.yaml", "--out", "results")
    assert_refused(result, "the policy has learned to follow a timetable")
    assert not (tmp_path / "results").exists()


def test_ctrl_c_ends_quietly_and_keeps_what_was_learned(call, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("caster_gym.agents.learning.sb3_learning.Watcher._watch", interrupted)
    result = call("train", "ppo", *TINY, "--task", "task.yaml", "--out", "run")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert "Traceback" not in result.output
    assert (tmp_path / "run" / "best" / "policy.yaml").is_file()


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
    assert "Time step of the model [s]; MuJoCo's slip" in " ".join(call("export", "-h").stdout.split())


def test_version_is_shown(call):
    result = call("--version")
    assert (result.exit_code, result.stdout) == (0, f"caster_gym {caster_gym.__version__}\n")


def test_completion_is_offered(call):
    assert "--install-completion" in call("--help").stdout


@pytest.mark.slow
@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        (["--task", "fast.yaml"], "a duration of at least"),
        (["--task", "lost.yaml"], "there is no file"),
        (
            ["--set", "learning_rate=1e9"],
            "training has diverged after 64 steps, with a learning_rate of 1e+09; try a small",
        ),
        (["--set", "horizon=8"], "unknown key 'horizon'; it is called 'n_steps' here"),
    ],
)
def test_a_start_that_fails_is_in_nobodys_way(call, tmp_path, wrong, message):
    """After the mistake is mended, the same --out is taken; what was to be overwritten is there until then."""
    (tmp_path / "fast.yaml").write_text(yaml.safe_dump({**TASK, "train": [{"shape": "circle", "duration": 0.5}]}))
    (tmp_path / "lost.yaml").write_text(yaml.safe_dump({**TASK, "robot": "nowhere.yaml"}))
    usual = [*TINY[:2], "--set", "n_envs=2", *TINY[4:], "--task", "task.yaml", "--out", "run"]
    failed = call("train", *usual, *wrong)
    assert failed.exit_code == 2
    assert message in failed.stderr.strip().splitlines()[-1]
    assert not (tmp_path / "run").exists()
    assert call("train", *usual).exit_code == 0
    kept = (tmp_path / "run" / "validation.csv").read_bytes()
    assert call("train", *usual, *wrong, "--overwrite").exit_code == 2
    assert (tmp_path / "run" / "validation.csv").read_bytes() == kept
    assert not list(tmp_path.glob(".run*"))


def test_a_learning_rate_that_diverges_can_be_made_smaller(call):
    arguments = ["train", *TINY, "--task", "task.yaml", "--out", "run", "--set"]
    assert_refused_at_last(call(*arguments, "learning_rate=1e9"), "try a smaller one")
    assert call(*arguments, "learning_rate=1e-3").exit_code == 0


def assert_refused_at_last(result, message):
    """The same, below the bar of a run that had begun."""
    assert result.exit_code == 2
    last = result.stderr.strip().splitlines()[-1]
    assert last.startswith("caster-gym: ")
    assert message in last
    assert "Traceback" not in result.output


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


@pytest.mark.slow
def test_threads_are_those_asked_for_and_in_run_yaml(call, tmp_path):
    arguments = ["--task", "task.yaml", "--threads", "2", "--out"]
    assert call("train", *TINY, *arguments, "run").exit_code == 0
    assert call("evaluate", "computed_torque", *arguments, "results").exit_code == 0
    for folder in ("run", "results"):
        assert yaml.safe_load((tmp_path / folder / "run.yaml").read_text(encoding="utf-8"))["threads"] == 2
    for threads in ("0", "100000"):
        assert call("train", "--threads", threads).exit_code == 2
