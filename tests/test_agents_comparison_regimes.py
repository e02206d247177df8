"""agents.comparison.regimes: who is best on each scenario, by how much, and whether that is certain."""

import csv

import numpy as np
import pytest

from caster_gym.agents.comparison.regimes import compared_by, in_words, standings, write_regimes
from caster_gym.agents.comparison.summary import Result
from caster_gym.tasks.registry import all_tasks, find_task
from caster_gym.tasks.track.metrics import METRICS, TrackMetrics

PATHS = ("circle", "ellipse", "spline", "lemniscate")
SPREAD = np.array([0.9, 1.0, 1.1, 1.0])  # of the errors of an agent over episodes


def result(agent, error, failures=0, seed=None):
    """An agent whose RMSE is that error [m] on average, and who fails in the first episodes."""
    ones = np.ones(len(PATHS))
    failed = (np.arange(len(PATHS)) < failures).astype(float)
    values = dict.fromkeys(TrackMetrics._fields, ones) | {"position_rmse": error * SPREAD, "failed": failed}
    return Result(agent, seed, PATHS, TrackMetrics(**values))


def test_fewer_failures_come_before_a_smaller_error():
    ranked = standings([result("reckless", 0.001, failures=2), result("careful", 0.003)], METRICS, 0.95)
    assert [one.agent for one in ranked] == ["careful", "reckless"]
    assert [one.failed for one in ranked] == [0.0, 0.5]
    assert ranked[0].error.mean == pytest.approx(3.0)  # [mm]


def test_seeds_count_by_their_mean():
    """Five seeds with a failure each are no worse than one seed with one."""
    many = [result("learned", 0.002, failures=1, seed=seed) for seed in range(5)]
    ranked = standings([*many, result("model", 0.003, failures=1)], METRICS, 0.95)
    assert [(one.agent, one.failed) for one in ranked] == [("learned", 0.25), ("model", 0.25)]


def test_words_say_how_much_better_and_whether_it_is_certain():
    clear = standings([result("a", 0.001), result("b", 0.004, failures=1)], METRICS, 0.95)
    assert (
        in_words("noise", clear, "mm")
        == "**noise**: a is best, 1 mm; next is b, 4 mm, 25 % failed, 4 times as much; intervals are apart."
    )
    close = standings([result("a", 0.001), result("b", 0.00101)], METRICS, 0.95)
    assert in_words("noise", close, "mm").endswith("1.01 times as much; intervals overlap.")
    assert in_words("noise", clear[:1], "mm") == "**noise**: a is best, 1 mm."


def test_an_agent_that_never_settles_has_no_error():
    lost = result("lost", np.nan, failures=4)
    ranked = standings([lost, result("model", 0.003)], METRICS, 0.95)
    assert in_words("ice", ranked, "mm") == (
        "**ice**: model is best, 3 mm; next is lost, no settled episode, 100 % failed; intervals overlap."
    )


@pytest.mark.parametrize(
    ("task", "name"), [("track", "position_rmse"), ("follow", "cross_track_rmse"), ("hold", "steady_position")]
)
def test_agents_are_compared_by_the_error_that_chooses_policies(task, name):
    how = find_task(task).metrics
    measured = how.measure.__annotations__["return"]
    found, printed = compared_by(measured, how)
    assert found == name
    assert printed.unit == "mm"


def test_all_tasks_have_a_number_to_compare_by():
    for task in all_tasks():
        assert compared_by(task.metrics.measure.__annotations__["return"], task.metrics)


def test_table_csv_and_picture_tell_of_all_scenarios(tmp_path):
    results = {
        "calm": [result("model", 0.00001), *(result("learned", 0.001, seed=seed) for seed in range(2))],
        "noise": [result("model", 0.004), result("learned", 0.002, failures=1, seed=0), result("third", np.nan, 4)],
    }
    text = write_regimes(tmp_path, results, METRICS, 0.95)
    assert (tmp_path / "table.md").read_text(encoding="utf-8") == text + "\n"
    head, _, calm, noise = (line for line in text.splitlines() if line.startswith("|"))
    assert [cell.strip() for cell in head.split("|")[2:-1]] == ["model", "learned", "third"]
    assert "**0.01**" in calm
    assert calm.rstrip(" |").endswith("–")
    assert "**4**" in noise  # without a failure, so that it is better than 2 mm with one
    assert "(25 %)" in noise
    with (tmp_path / "scenarios.csv").open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) == 5 * len(TrackMetrics._fields)
    means = {(row["scenario"], row["agent"]): float(row["mean"]) for row in rows if row["metric"] == "position_rmse"}
    assert means["noise", "learned"] == pytest.approx(0.002)
    assert (tmp_path / "regimes.png").read_bytes().startswith(b"\x89PNG")


def test_own_metrics_without_an_error_are_compared_by_what_is_printed_first():
    assert compared_by(TrackMetrics, METRICS._replace(verdict=tuple))[0] == "position_rmse"
