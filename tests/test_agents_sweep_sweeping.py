"""caster_gym.agents.sweep.sweeping: a search ends with the same bytes, stopped or not, by however many workers."""

import csv
from collections import deque
from typing import Any

import pytest
import yaml

from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.registry import read_agent
from caster_gym.agents.sweep.settings import SweepSettings, read_sweep
from caster_gym.agents.sweep.sweeping import run_sweep
from caster_gym.agents.workers.calls import Call, Finished, Workers
from caster_gym.agents.workers.local import LocalWorkers
from caster_gym.configuration import ConfigurationError, parse, read_yaml
from caster_gym.engines.tensor.threads import DEFAULT
from tests.guesses import write_guesses

SPACE: dict[str, Any] = {
    "agent.gain": {"low": 0.01, "high": 1.0, "log": True},
    "agent.width": {"choices": [2, 4]},
}
SAME = ("table.md", "trials.csv", "best.yaml", "search.png")  # files without clock times


class Here(Workers):
    """Calls in this process, one after the other; the last first if they are reversed; stops after so many events."""

    places = 1

    def __init__(self, reverse=False, stop=None):
        self.waiting: deque[tuple[int, Call]] = deque()
        self.count, self.reverse, self.left = 0, reverse, stop

    def submit(self, call):
        self.waiting.append((self.count, call))
        self.count += 1
        return self.count - 1

    def events(self):
        while self.waiting:
            number, call = self.waiting.pop() if self.reverse else self.waiting.popleft()
            yield Finished(number, call.function(*call.arguments, self.hear))

    def hear(self, content):
        assert 0.0 < content[0] <= 1.0
        if self.left is not None:
            self.left -= 1
            if self.left == 0:
                raise KeyboardInterrupt

    def __exit__(self, *_):
        pass


@pytest.fixture(scope="module")
def home(tmp_path_factory):
    folder = tmp_path_factory.mktemp("guesses")
    write_guesses(folder)
    with pytest.MonkeyPatch.context() as patch:
        patch.syspath_prepend(folder)
        yield folder


@pytest.fixture(scope="module")
def read(home):
    """A search of guesses, with some settings of its own."""

    def reader(agent="guess.yaml", **others):
        content = {"task": "task.yaml", "agent": agent, "space": SPACE, "trials": 6, "at_once": 2}
        pruning = {"trials": 2, "validations": 1}
        settings = {**content, "storage": "journal", "pruning": pruning, **others}
        return read_sweep(parse(SweepSettings, settings, "file", home))

    return reader


@pytest.fixture(scope="module")
def undisturbed(read, tmp_path_factory):
    folder = tmp_path_factory.mktemp("undisturbed")
    return folder, run_sweep(read(), folder, Here())


def same_files(one, other):
    """Whether two searches left the same bytes, but for clock times and what Optuna and TensorBoard write."""
    for name in SAME:
        assert (one / name).read_bytes() == (other / name).read_bytes(), name
    policies = sorted(path.relative_to(one) for path in one.glob("trials/**/weights.safetensors"))
    assert policies == sorted(path.relative_to(other) for path in other.glob("trials/**/weights.safetensors"))
    assert all((one / policy).read_bytes() == (other / policy).read_bytes() for policy in policies)
    assert len(policies) > 9


def rows(folder):
    with (folder / "trials.csv").open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_search_leaves_everything_behind(undisturbed):
    folder, text = undisturbed
    assert (folder / "table.md").read_text(encoding="utf-8") == text + "\n"
    assert [row["trial"] for row in rows(folder)] == [str(i) for i in range(6)]
    assert {row["outcome"] for row in rows(folder)} == {"completed", "pruned"}
    assert (folder / "search.png").read_bytes().startswith(b"\x89PNG")
    facts = read_yaml(folder / "run.yaml")
    assert (facts["completed"], facts["threads"], facts["sweep"]["trials"]) == (True, DEFAULT, 6)
    for row in rows(folder):
        run = folder / "trials" / f"{int(row['trial']):04d}"
        assert load_policy(run / "best").description.trained_with["settings"]["gain"] == float(row["agent.gain"])
        assert read_yaml(run / "run.yaml")["completed"] is True


def test_trials_that_fall_behind_end_there(undisturbed):
    folder, _ = undisturbed
    for row in rows(folder):
        checkpoints = list((folder / "trials" / f"{int(row['trial']):04d}" / "checkpoints").glob("0*"))
        assert len(checkpoints) == (3 if row["outcome"] == "completed" else 2)


def test_the_best_is_an_agent_that_train_reads(undisturbed, home):
    folder, text = undisturbed
    completed = [row for row in rows(folder) if row["outcome"] == "completed"]
    best = max(completed, key=lambda row: float(row["score"]))
    assert f"Best is trial {best['trial']}," in text
    (home / "best.yaml").write_bytes((folder / "best.yaml").read_bytes())
    settings = read_agent(str(home / "best.yaml")).model_dump()
    assert (str(settings["gain"]), str(settings["width"])) == (best["agent.gain"], best["agent.width"])


@pytest.mark.parametrize("stops", [pytest.param((1,), marks=pytest.mark.slow), (9, 4)])
def test_a_search_that_was_stopped_ends_with_the_same_bytes(undisturbed, read, tmp_path, stops):
    """After so many reports of trainings, and again."""
    for stop in stops:
        with pytest.raises(KeyboardInterrupt):
            run_sweep(read(), tmp_path, Here(stop=stop), resume=True)
        assert read_yaml(tmp_path / "run.yaml")["completed"] is False
    run_sweep(read(), tmp_path, Here(), resume=True)
    same_files(undisturbed[0], tmp_path)


def test_more_trials_go_on_as_if_they_had_been_asked_for_at_once(undisturbed, read, tmp_path):
    run_sweep(read(trials=3), tmp_path, Here())
    run_sweep(read(), tmp_path, Here(), resume=True)
    same_files(undisturbed[0], tmp_path)


@pytest.mark.slow
def test_which_trial_ends_first_changes_no_byte(undisturbed, read, tmp_path):
    run_sweep(read(), tmp_path, Here(reverse=True))
    same_files(undisturbed[0], tmp_path)


@pytest.mark.slow
def test_processes_of_which_one_is_killed_leave_the_same_bytes(undisturbed, read, home, tmp_path, monkeypatch):
    """Its trial is taken up by another one. The other search finds no file that lets it die."""
    monkeypatch.setenv("PYTHONPATH", str(home))
    folders = []
    for name in ("killed", "not killed"):
        die = tmp_path / "die"
        if name == "killed":
            die.touch()
        folders.append(tmp_path / name)
        run_sweep(read(fixed={"agent.dies_at": str(die)}, trials=3), folders[-1], LocalWorkers(2))
        assert not die.exists()
    same_files(*folders)
    assert rows(folders[0]) == rows(undisturbed[0])[:3]


def test_another_setting_is_named_and_refused(undisturbed, read):
    folder, _ = undisturbed
    before = (folder / "run.yaml").read_bytes()
    with pytest.raises(ConfigurationError, match=r"holds a search with sweep\.seed 0, and now it is 1: a search"):
        run_sweep(read(seed=1), folder, Here(), resume=True)
    with pytest.raises(ConfigurationError, match="agent 'computed_torque' does not learn"):
        read(agent="computed_torque")
    assert (folder / "run.yaml").read_bytes() == before


def test_a_completed_search_trains_nothing_again(undisturbed, read):
    folder, text = undisturbed
    times = {path: path.stat().st_mtime_ns for path in folder.glob("trials/**/*")}
    assert run_sweep(read(), folder, Here(stop=1), resume=True) == text
    assert {path: path.stat().st_mtime_ns for path in folder.glob("trials/**/*")} == times


def test_seeds_of_a_trial_are_trained_one_after_the_other(read, tmp_path):
    text = run_sweep(read(trials=2, seeds=(3, 5), pruning=None), tmp_path, Here())
    assert sorted(one.name for one in (tmp_path / "trials").iterdir()) == ["0000-3", "0000-5", "0001-3", "0001-5"]
    seeds = [load_policy(one / "best").description.trained_with["seed"] for one in (tmp_path / "trials").iterdir()]
    assert sorted(seeds) == [3, 3, 5, 5]
    assert "trials/0000-3, trials/0000-5" in text or "trials/0001-3, trials/0001-5" in text


@pytest.mark.slow
def test_settings_that_fail_do_not_end_a_search(read, tmp_path):
    """Neither those that diverge, nor those that do not go together."""
    space = {"agent.gain": {"choices": [0.1, 0.2, 1.5]}, "agent.width": {"choices": [2, -1]}}
    run_sweep(read(trials=8, space=space, sampler="random"), tmp_path, Here())
    kinds = {(row["agent.gain"], row["agent.width"]): (row["outcome"], row["reason"]) for row in rows(tmp_path)}
    assert kinds[("1.5", "2")][0] == "failed" and "training has diverged after 100 steps" in kinds[("1.5", "2")][1]
    assert kinds[("0.1", "-1")][0] == "failed" and "'width' should be greater than 0" in kinds[("0.1", "-1")][1]
    assert {kinds[(gain, "2")][0] for gain in ("0.1", "0.2")} <= {"completed", "pruned"}


def test_a_search_of_which_nothing_is_completed_says_why(read, tmp_path):
    space = {"agent.gain": {"low": 1.5, "high": 2.0}}
    with pytest.raises(ConfigurationError, match=r"no trial was completed: .*diverged.*; the space may be too wide"):
        run_sweep(read(trials=2, space=space), tmp_path, Here())


def test_settings_of_the_task_are_searched_too(read, tmp_path):
    space = {"task.task.position_weight": {"low": 0.5, "high": 2.0}, "task.validation.0.count": {"choices": [1, 2]}}
    sweep = read(trials=2, space=space)
    run_sweep(sweep, tmp_path, Here())
    best = yaml.safe_load((tmp_path / "best_task.yaml").read_text(encoding="utf-8"))
    weights = [float(row["task.task.position_weight"]) for row in rows(tmp_path)]
    assert best["task"]["position_weight"] in weights
    assert read_yaml(tmp_path / "best.yaml") == {"algorithm": "guesses:Guess"}
