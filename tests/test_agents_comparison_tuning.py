"""caster_gym.agents.comparison.tuning: what is chosen of what was tried, at what cost, and whose settings are wrong."""

import csv
from typing import Any

import numpy as np
import pytest

from caster_gym.agents.comparison.evaluation import evaluation_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.tuning import Tried, Tuned, best_of, front_of, told, tune, write_tuning
from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.observer_torque import ObserverTorque
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.tasks.track.metrics import TrackVerdict

TASK = parse(
    TaskSettings,
    {
        "wrappers": [{"kind": "action_delay", "periods": 1}],
        **{
            kind: [{"shape": "random_paths", "seed": seed, "count": 2, "duration": 2.5, "max_speed": 0.3}]
            for seed, kind in enumerate(("train", "validation", "test"))
        },
    },
    "task",
)


LAYOUT = ObservationLayout(load_robot("chung2008"), ())


def settings(**fields: Any) -> ComputedTorqueSettings:
    return parse(ComputedTorqueSettings, {"algorithm": "computed torque", **fields}, "test")


def tried(*rows: tuple[int, float, float]) -> list[Tried]:
    """Settings that had so many failures, such an error and such a torque variation."""
    some = []
    for i, (failures, error, variation) in enumerate(rows):
        one = settings(natural_frequencies=[1.0 + i])
        verdict = TrackVerdict(error, 1.0, 1.0, failures, 0.0)
        some.append(Tried(one.controller(LAYOUT, 0.02), one, verdict, variation, 100))
    return some


def test_the_least_error_wins_and_with_slack_the_calmest_torques_of_those_near_it():
    some = tried((0, 1.00, 5.0), (0, 1.04, 2.0), (0, 1.06, 1.0), (1, 0.5, 0.1))
    assert best_of(some, 0.0) is some[0]
    assert best_of(some, 0.05) is some[1]
    assert best_of(some, 0.10) is some[2]  # one that fails is never near


def test_the_front_holds_what_nothing_surpasses_in_both():
    assert front_of(tried((0, 1.0, 5.0), (0, 1.1, 5.0), (0, 1.2, 1.0), (0, 1.2, 1.0), (1, 0.1, 9.0))) == [
        True,
        False,
        True,
        True,
        False,
    ]


def test_all_that_was_tried_is_written_with_its_cost(tmp_path):
    some = tried((0, 1.0, 5.0), (0, 1.1, 7.0))
    tuned = {"mine": Tuned(some[0].controller, some[0].settings, tuple(some))}
    write_tuning(tmp_path / "tuning.csv", tuned)
    with (tmp_path / "tuning.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [(row["agent"], row["position_rmse"], row["on_front"], row["chosen"]) for row in rows] == [
        ("mine", "1.0", "1", "1"),
        ("mine", "1.1", "0", "0"),
    ]
    assert '"natural_frequencies": [2.0]' in rows[1]["settings"]
    words = told(tuned, {"PPO": 2_000_000})
    assert "mine 200 (2 settings); PPO 2,000,000." in words
    assert told({"alone": Tuned(some[0].controller, some[0].settings)}) == ""


def test_a_controller_is_tuned_for_the_delay_of_its_scenario():
    batch = evaluation_batch(TASK, TASK.validation, starts=1)
    found = tune(settings(predict="scenario", natural_frequencies=[1.0, 30.0]), batch, "early")
    assert isinstance(found.controller, ObserverTorque)
    assert found.settings.model_dump()["predict"] == {"delay": 1, "lag": 0.0, "mismatch": False}
    assert found.settings.model_dump()["natural_frequencies"] == (30.0,)
    assert found.periods == 2 * 2 * 125
    assert np.isfinite(found.tried[0].torque_variation)


def test_what_is_stated_wrongly_is_told_with_agent_and_scenario():
    batch = evaluation_batch(TASK, TASK.validation, starts=1)
    with pytest.raises(
        ConfigurationError, match=r"^agent 'early' in scenario 'late': 'predict' has a delay of 3 control"
    ):
        tune(settings(predict={"delay": 3}), batch, "early", "late")
    with pytest.raises(ConfigurationError, match=r"^agent 'early': 'predict' must look no farther than the preview"):
        tune(settings(predict={"delay": 30, "mismatch": True}), batch, "early")
