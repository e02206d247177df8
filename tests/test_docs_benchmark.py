"""docs/benchmark: what was compared can be read, and is what the files of the package still say."""

from pathlib import Path

import pytest
import yaml

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import parse
from caster_gym.robot import Robot, load_robot
from caster_gym.shipped_files import read_settings

RUNS = sorted((Path(__file__).parents[1] / "docs" / "benchmark").glob("*/run.yaml"))


def test_there_are_comparisons():
    assert len(RUNS) >= 4


@pytest.mark.parametrize("run", RUNS, ids=lambda run: run.parent.name)
def test_settings_are_those_that_the_package_has_today(run):
    facts = yaml.safe_load(run.read_text(encoding="utf-8"))
    ends = [f"_for_{scenario}" for scenario in facts["benchmark"].get("scenarios") or {}]
    for name, settings in facts["agents"].items():
        today = read_agent(next((name.removesuffix(end) for end in ends if name.endswith(end)), name))
        assert parse(type(today), settings, f"{run}: {name}") == today
    name = facts["benchmark"]["task"]
    assert parse(TaskSettings, facts["task"], f"{run}: task") == read_settings(TaskSettings, "tasks", name)
    robot = load_robot(facts["task"]["robot"])
    facts["robot"]["platform"].setdefault("height", robot.platform.height)  # moves no robot; older runs had none
    assert parse(Robot, facts["robot"], f"{run}: robot") == robot
