"""scripts/measure_training.py: free robots look like ours to PPO, and its tables say what was measured."""

import numpy as np
import pytest
import torch
import yaml

from caster_gym.agents.evaluation import training_batch
from caster_gym.agents.sb3_environment import CasterVecEnv
from caster_gym.agents.settings import TaskSettings
from caster_gym.agents.track_metrics import TrackVerdict
from caster_gym.agents.training import Validation
from caster_gym.configuration import parse
from scripts.measure_training import (
    FREE,
    OURS,
    FreeVecEnv,
    Success,
    main,
    read_learner,
    share_lines,
    share_rows,
    success_lines,
)

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
    ours = CasterVecEnv(training_batch(TASK, 3))
    free = FreeVecEnv(ours, longest=2)
    actions = np.zeros((3, 6), dtype=np.float32)
    answers = [[environment.reset(), *environment.step(actions)[:3]] for environment in (ours, free)]
    for mine, theirs in zip(*answers, strict=True):
        assert (mine.shape, mine.dtype) == (theirs.shape, theirs.dtype)
    assert (free.observation_space, free.action_space) == (ours.observation_space, ours.action_space)


def test_episodes_of_free_robots_end_by_time():
    free = FreeVecEnv(CasterVecEnv(training_batch(TASK, 2)), longest=3)
    free.reset()
    ends = [free.step(np.zeros((2, 6), dtype=np.float32)) for _ in range(6)]
    assert [done.tolist() for _, _, done, _ in ends] == 2 * [[False] * 2, [False] * 2, [True] * 2]
    for observations, _, done, infos in ends:
        for robot, info in enumerate(infos):
            assert info.get("TimeLimit.truncated", False) == done[robot]
            if done[robot]:
                np.testing.assert_array_equal(info["terminal_observation"], observations[robot])


def test_tables_tell_medians_and_shares():
    settings = read_learner("ppo", {}).model_copy(update={"robots": 2, "horizon": 8, "batch": 8, "hidden": (4,)})
    rows = share_rows(TASK, settings)
    assert [row.key for row in rows] == [OURS, FREE]
    assert all(row.measure() > 0.0 for row in rows)
    lines = share_lines(rows, {OURS: [90.0, 96.0, 99.0], FREE: [100.0, 100.0, 100.0]})
    assert lines[2].startswith(f"| {OURS} | 96 steps/s |")
    assert "goal ≥ 95: reached" in lines[4]
    assert "| 96 % | 93 – 97.5 |" in lines[4]


def test_tables_tell_who_reached_the_goal_and_who_did_not():
    verdict = TrackVerdict(position_rmse=0.004, worst_position=0.01, heading_rmse=0.01, failures=0, reward=0.9)
    first = Validation(1000, 12.0, verdict)
    reached, missed = success_lines([Success("ppo", 0, first, first), Success("shac", 1, None, first)], 5e-3)[2:]
    assert reached.startswith("| ppo | 0 | 12 s | 1,000 | position RMSE 4 mm")
    assert missed.startswith("| shac | 1 | not reached |")


def test_a_run_makes_a_page(tmp_path):
    """A smoke test with a goal that everybody meets."""
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(CONTENT), encoding="utf-8")
    arguments = ["--task", str(tmp_path / "task.yaml"), "--agents", "ppo", "--seeds", "0", "--steps", "16384"]
    main([*arguments, "--turns", "1", "--goal", "10", "--out", str(tmp_path / "page.md")])
    text = (tmp_path / "page.md").read_text(encoding="utf-8")
    assert "| ppo | 0 |" in text
    assert "PPO on robots that cost nothing" in text


def test_mistakes_are_named():
    with pytest.raises(ValueError, match="agent 'computed_torque' does not learn"):
        main(["--agents", "computed_torque"])
    with pytest.raises(ValueError, match="the goal is one of tracking, got a task of environment 'follow'"):
        main(["--task", "follow"])
