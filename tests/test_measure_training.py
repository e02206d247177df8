"""scripts/measure_training.py and its page: free robots look like ours to PPO, and the page says what was measured."""

import csv
import subprocess

import numpy as np
import pytest
import torch
import yaml

from caster_gym.agents.comparison.evaluation import training_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.sb3_learning import make_learner
from caster_gym.agents.learning.settings import PPOSettings, SHACSettings
from caster_gym.agents.learning.training_run import Run
from caster_gym.configuration import parse
from caster_gym.tasks.track.metrics import TrackVerdict
from scripts import measure_training
from scripts.measure_training import (
    FreeVecEnv,
    main,
    rate_on_tensors,
    read_learner,
    share_rows,
    train_timed,
    window_costs,
)
from scripts.training_busy import Beside, Round, busy_processes, section, train_beside
from scripts.training_page import FREE, OURS, page
from scripts.training_results import Course, Occasion, Point, Results, Trial, WindowCosts

PATH = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3, "count": 2}
CONTENT = {kind: [{**PATH, "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))}
TASK = parse(TaskSettings, CONTENT, "task")


@pytest.fixture(autouse=True)
def one_thread():
    """Training sets the number of threads of the whole process."""
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


def test_free_robots_answer_with_the_shapes_and_types_of_ours():
    ours = SB3VecEnv(training_batch(TASK, 3))
    free = FreeVecEnv(ours, longest=2)
    actions = np.zeros((3, 6), dtype=np.float32)
    answers = [[environment.reset(), *environment.step(actions)[:3]] for environment in (ours, free)]
    for mine, theirs in zip(*answers, strict=True):
        assert (mine.shape, mine.dtype) == (theirs.shape, theirs.dtype)
    assert (free.observation_space, free.action_space) == (ours.observation_space, ours.action_space)


def test_episodes_of_free_robots_end_by_time():
    free = FreeVecEnv(SB3VecEnv(training_batch(TASK, 2)), longest=3)
    free.reset()
    ends = [free.step(np.zeros((2, 6), dtype=np.float32)) for _ in range(6)]
    assert [done.tolist() for _, _, done, _ in ends] == 2 * [[False] * 2, [False] * 2, [True] * 2]
    for observations, _, done, infos in ends:
        for robot, info in enumerate(infos):
            assert info.get("TimeLimit.truncated", False) == done[robot]
            if done[robot]:
                np.testing.assert_array_equal(info["terminal_observation"], np.asarray(observations)[robot])


def small_ppo():
    settings = read_learner("ppo", {}).model_copy(update={"n_envs": 2, "n_steps": 8, "batch_size": 8, "net_arch": (4,)})
    assert isinstance(settings, PPOSettings)
    return settings


@pytest.mark.slow
def test_speeds_are_measured():
    """A smoke test."""
    settings = small_ppo()
    rows = share_rows(TASK, settings)
    assert [row.key for row in rows] == [OURS, FREE]
    assert all(row.measure() > 0.0 for row in rows)


def point(steps, seconds, error, failures=0):
    return Point(steps, seconds, TrackVerdict(error, 2.0 * error, 0.01, failures, 0.9))


@pytest.mark.slow
def test_training_is_measured_in_pairs_beside_busy_processes(monkeypatch):
    """Each thread count as often as the other, and nothing is left running."""
    started = []
    popen = subprocess.Popen

    def noted(*one, **more):
        started.append(popen(*one, **more))
        return started[-1]

    monkeypatch.setattr(subprocess, "Popen", noted)
    settings = small_ppo()
    environment = SB3VecEnv(training_batch(TASK, 2))
    beside = train_beside(make_learner(settings, environment, seed=0), periods=16, pairs=2)
    assert sorted(one.threads for one in beside.rounds) == [1, 1, 2, 2]
    assert {one.threads for one in beside.rounds[:2]} == {1, 2}
    assert min(min(one.seconds, one.processor) for one in beside.rounds) > 0.0
    assert len(started) == beside.processes
    assert all(one.poll() is not None for one in started)


def test_busy_processes_end_with_the_work():
    with pytest.raises(ValueError, match="over"), busy_processes(1):
        raise ValueError("over")


def test_a_section_tells_what_a_second_thread_costs():
    """Ratios pair by pair: 3, 4 and 5 times as long; 10, 20 and 30 times as much of the processor."""
    rounds = [
        Round(threads, seconds, processor)
        for ratio, share in ((3.0, 10.0), (4.0, 20.0), (5.0, 30.0))
        for threads, seconds, processor in ((1, 2.0, 1.0), (2, 2.0 * ratio, share))
    ]
    text = " ".join(section(Beside(rounds, periods=1000, processes=1)).split())
    assert "beside 1 busy process, so that one core is left to it, in 3 pairs of rounds" in text
    assert "takes 4 times as long by the clock and 20 times as much processor time" in text
    assert "| 1 | 500 steps/s | 1,000 µs |" in text
    assert "| 2 | 125 steps/s | 20,000 µs |" in text


def test_a_goal_is_met_without_failures_alone():
    early, failed, met, later = (
        point(1, 1.0, 0.02),
        point(2, 2.0, 0.001, failures=1),
        point(3, 3.0, 0.004),
        point(4, 4.0, 0.003),
    )
    course = Course("ppo", 0, (early, failed, met, later))
    assert course.first(5e-3) is met
    assert course.first(1e-3) is None
    assert course.best is later


def results(*courses):
    agents = {name: read_learner(name, {"validations": 50}) for name in dict.fromkeys(one.learner for one in courses)}
    share = {OURS: [90.0, 96.0, 99.0], FREE: [100.0, 100.0, 100.0]}
    costs = {"shac": WindowCosts(1024, 2, 0.02, 0.01, 0.01, compiling=50.0, fetching=4.0)} if "shac" in agents else {}
    rates = {"ppo_gpu": (read_learner("ppo_gpu", {}), 12345.0)}
    return Results(agents, share, courses, costs, rates)


def told(*courses):
    """The page with its lines joined."""
    return " ".join(page(results(*courses), Occasion("a command", 15, 5e-3, (0.5, 1.0)), "training").split())


PPO = [Course("ppo", seed, (point(100_000, 10.0 + seed, 0.02), point(400_000, 30.0, 0.004))) for seed in (0, 1, 2)]
SHAC = [Course("shac", seed, (point(20_000, 6.0, 0.02), point(100_000, 10.0 + seed, 0.002))) for seed in (0, 1, 2)]


def test_a_page_tells_who_is_faster_and_by_how_much():
    text = told(*PPO, *SHAC)
    assert "`shac` needs 4 times fewer control periods than `ppo` and 2.73 times less processor time" in text
    assert "| shac | 1 | 100,000 | 11.0 s | 2.00 mm, after 11 s of 11 s |" in text
    assert "| **shac** | 3 of 3 seeds | **100,000** (100,000 – 100,000) | **11.0** (10.0 – 12.0) s | **2.00** (" in text
    assert "takes 50 s of processor time until the first window is over" in text
    assert "The very first run therefore reaches the goal after 57 s." in text  # 11 + 50 − 4
    assert "| backward: the gradient through all of these | 10.0 | 25 % |" in text
    assert "39 µs per control period" in text  # 40 ms over 1,024
    assert "trains at 12,300 steps/s" in text


def test_a_page_tells_what_was_lost():
    slow = [Course("shac", seed, (point(800_000, 60.0 + seed, 0.0049),)) for seed in (0, 1, 2)]
    text = told(*PPO, *slow)
    assert "`shac` needs 2 times more control periods than `ppo` and 2.03 times more processor time" in text
    never = Course("shac", 0, (point(800_000, 60.0, 0.001, failures=2),))
    text = told(*PPO, never)
    assert "`shac` does not reach the goal with every seed." in text
    assert "| shac | 0 | not reached | | 1.00 mm, 2 failures" in text
    assert "times fewer" not in text


def test_a_page_tells_the_share_of_a_zero_cost_environment():
    text = told(*PPO)
    assert "the goal, ≥ 95 % of that speed, is reached" in text
    assert f"| {OURS} | 96 steps/s |" in text
    assert "| 96 % | 93 – 97.5 |" in text


def test_time_of_validations_is_left_out(monkeypatch):
    """With a clock that moves on in validations alone, training takes no time."""
    clock = [0.0]
    monkeypatch.setattr(measure_training, "processor_seconds", lambda: clock[0])
    original = Run.validate

    def slow_validation(self, actor):
        clock[0] += 100.0
        original(self, actor)

    monkeypatch.setattr(Run, "validate", slow_validation)
    settings = read_learner(
        "ppo", {"n_envs": 2, "n_steps": 8, "batch_size": 8, "net_arch": [4], "n_timesteps": 48, "validations": 3}
    )
    course = train_timed("ppo", TASK, settings, 1)
    assert [(one.steps, one.seconds) for one in course.points] == [(16, 0.0), (32, 0.0), (48, 0.0)]
    assert clock[0] == 300.0


@pytest.mark.slow
def test_learners_on_tensors_are_measured(monkeypatch):
    """A smoke test, uncompiled."""
    monkeypatch.setattr(measure_training, "WINDOWS", 1)
    fields = {"compile": False, "n_envs": 2, "net_arch": [4]}
    shac = read_learner("shac", {**fields, "n_steps": 2, "batch_size": 4})
    assert isinstance(shac, SHACSettings)
    costs = window_costs(TASK, shac)
    assert (costs.periods, costs.substeps) == (4, 2)
    assert min(costs[2:]) > 0.0
    ppo = read_learner("ppo_gpu", {**fields, "n_steps": 2, "batch_size": 4})
    assert rate_on_tensors(TASK, ppo) > 0.0
    with pytest.raises(ValueError, match=r"only PPO on tensors .* got algorithm 'ppo'"):
        rate_on_tensors(TASK, read_learner("ppo", {}))


@pytest.mark.slow
def test_a_run_makes_a_page(tmp_path, monkeypatch):
    """A smoke test with a goal that everybody meets; what takes long beside busy processes is left out."""
    rounds = [Round(1, 1.0, 1.0), Round(2, 2.0, 3.0)]
    monkeypatch.setattr(measure_training, "train_beside", lambda learner, periods: Beside(rounds, periods, 1))
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(CONTENT), encoding="utf-8")
    arguments = ["--task", str(tmp_path / "task.yaml"), "--agents", "ppo", "--tensors", "--seeds", "0"]
    main([*arguments, "--steps", "16384", "--turns", "1", "--goal", "10", "--out", str(tmp_path / "page.md")])
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "| ppo | 0 | 16,384 |" in text
    assert "(page/learning.png)" in text
    assert "## Beside other processes" in text
    assert (tmp_path / "page" / "learning.png").stat().st_size > 10_000  # a picture with something in it
    with (tmp_path / "page" / "validations.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["learner"], row["steps"]) for row in rows] == [("ppo", "16384")]


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="agent 'computed_torque' does not learn"):
        main(["--agents", "computed_torque"])
    with pytest.raises(ValueError, match="the goal is one of tracking, got a task of environment 'follow'"):
        main(["--task", "follow"])
    with pytest.raises(ValueError, match="results cannot be written to /proc/training"):
        main(["--out", "/proc/training.md"])


def test_failures_on_test_paths_are_told_for_each_kind():
    """Errors are those of episodes that did not fail."""
    trials = (Trial("random_paths 0", 1e-3, False), Trial("random_paths 1", 3e-3, False), Trial("circle", 0.4, True))
    text = told(PPO[0]._replace(trials=trials), PPO[1]._replace(trials=(Trial("circle", 2e-3, False),)))
    assert "| ppo | random paths | 0 of 2 | 2.00 mm |" in text
    assert "| ppo | circle | 1 of 2 | 2.00 mm |" in text
    assert "On test paths" not in told(PPO[0])
