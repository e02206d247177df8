"""caster-gym train: what a training run leaves behind when it ends, fails or is interrupted."""

import pytest
import yaml

from tests.command_calls import TASK, TINY


def test_exponents_are_numbers(call, tmp_path):
    tiny = [*TINY[2:], "--set", "n_timesteps=1e2", "--set", "learning_rate=1e-3"]
    assert call("train", "ppo", *tiny, "--task", "task.yaml", "--out", "run").exit_code == 0
    agent = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text(encoding="utf-8"))["agent"]
    assert (agent["n_timesteps"], agent["learning_rate"]) == (100, 0.001)


def test_ctrl_c_ends_quietly_and_keeps_what_was_learned(call, tmp_path, monkeypatch):
    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("caster_gym.agents.learning.sb3_learning.Watcher._watch", interrupted)
    result = call("train", "ppo", *TINY, "--task", "task.yaml", "--out", "run")
    assert result.exit_code == 130
    assert "interrupted" in result.stderr
    assert "Traceback" not in result.output
    assert (tmp_path / "run" / "best" / "policy.yaml").is_file()


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


@pytest.mark.slow
def test_threads_are_those_asked_for_and_in_run_yaml(call, tmp_path):
    arguments = ["--task", "task.yaml", "--threads", "2", "--out"]
    assert call("train", *TINY, *arguments, "run").exit_code == 0
    assert call("evaluate", "computed_torque", *arguments, "results").exit_code == 0
    for folder in ("run", "results"):
        assert yaml.safe_load((tmp_path / folder / "run.yaml").read_text(encoding="utf-8"))["threads"] == 2
    for threads in ("0", "100000"):
        assert call("train", "--threads", threads).exit_code == 2
