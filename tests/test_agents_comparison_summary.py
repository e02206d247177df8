"""agents.comparison.summary: means, intervals that hold what they claim, and tables that say what episodes say."""

import csv
import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.agents.comparison.summary import (
    Estimate,
    Result,
    by_agent,
    estimate,
    table,
    values_of,
    write_episodes,
    write_summary,
)
from caster_gym.tasks.follow.metrics import FollowMetrics
from caster_gym.tasks.measuring import Counted, Printed, shown
from caster_gym.tasks.track.metrics import TrackMetrics

EPISODES = 4


def result(agent, seed, offset=0.0, failed=(0, 0, 0, 0)):
    """Metrics whose numbers differ from field to field and from episode to episode."""
    fields = {
        name: offset + 0.1 * k + 0.01 * np.arange(EPISODES, dtype=np.float64)
        for k, name in enumerate(TrackMetrics._fields)
    }
    fields["failed"] = np.array(failed, dtype=np.float64)
    return Result(agent, seed, ("circle", "random_paths 0", "random_paths 1", "circle"), TrackMetrics(**fields))


RESULTS = [
    result("computed torque", None),
    result("PPO", 3, 1.0, (0, 1, 0, 0)),
    result("PPO", 8, 2.0, (1, 1, 0, 0)),
]


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_estimate_of_known_numbers():
    """Each episode is the mean over its seeds; each seed's mean is over its episodes."""
    found = estimate(np.array([[1.0, 2.0, 3.0], [3.0, 4.0, 8.0]]), 0.95)
    assert found.mean == pytest.approx(21.0 / 6.0)
    assert (found.seed_low, found.seed_high) == (2.0, 5.0)
    assert 2.0 <= found.low < found.mean < found.high <= 5.5  # of resampled episodes 2, 3 and 5.5


def test_the_interval_covers_the_truth_as_often_as_it_claims():
    """Normal data, 300 times. A percentile bootstrap of 40 values takes the spread of the sample for that of the
    normal law, √(39/40) of it: it covers 93.5 % for 95 % and 88.7 % for 90 %. Counting 300 scatters by 1.4 and 1.8 %,
    of which four are given.
    """
    rng = np.random.default_rng(0)
    for confidence, expected, spread in ((0.95, 0.935, 0.057), (0.9, 0.887, 0.073)):
        hits = 0
        for _ in range(300):
            found = estimate(rng.normal(7.0, 2.0, (1, 40)), confidence)
            hits += found.low <= 7.0 <= found.high
        assert hits / 300 == pytest.approx(expected, abs=spread)


def test_seeds_of_the_same_episodes_are_no_further_evidence_for_other_paths():
    """Seeds that do the same everywhere leave the interval as it was: episodes are what is resampled."""
    values = np.random.default_rng(1).normal(size=(1, 30))
    once, five_times = estimate(values, 0.95), estimate(np.repeat(values, 5, axis=0), 0.95)
    assert_allclose(five_times[:3], once[:3], rtol=1e-12)


def test_the_spread_over_seeds_is_no_part_of_the_interval():
    episodes = np.random.default_rng(2).normal(size=20)
    values = episodes + np.array([[-5.0], [0.0], [5.0]])
    found = estimate(values, 0.95)
    assert_allclose(found[:3], estimate(episodes[None], 0.95)[:3], rtol=1e-9)
    assert_allclose((found.seed_low, found.seed_high), (episodes.mean() - 5.0, episodes.mean() + 5.0), rtol=1e-12)


def test_missing_values_are_left_out():
    nan = np.nan
    found = estimate(np.array([[1.0, nan, 3.0, nan], [5.0, 2.0, nan, nan]]), 0.95)
    assert found.mean == pytest.approx((3.0 + 2.0 + 3.0) / 3.0)
    assert (found.seed_low, found.seed_high) == (2.0, 3.5)
    assert all(np.isnan(estimate(np.full((2, 3), nan), 0.95)))


def test_a_seed_without_values_has_no_mean():
    """A seed that failed everywhere is not one without any error."""
    found = estimate(np.array([[np.nan, np.nan], [3.0, 5.0]]), 0.95)
    assert (found.mean, found.seed_low, found.seed_high) == (4.0, 4.0, 4.0)


def test_nothing_to_resample_gives_an_interval_of_no_length():
    assert estimate(np.array([[2.0]]), 0.95) == Estimate(2.0, 2.0, 2.0, 2.0, 2.0)
    assert estimate(np.full((2, 5), 3.0), 0.95) == Estimate(3.0, 3.0, 3.0, 3.0, 3.0)


def test_an_estimate_repeats():
    values = np.random.default_rng(3).normal(size=(2, 12))
    assert estimate(values, 0.9) == estimate(values, 0.9)


def test_more_confidence_needs_a_longer_interval():
    values = np.random.default_rng(4).normal(size=(1, 25))
    lengths = [found.high - found.low for found in (estimate(values, c) for c in (0.5, 0.9, 0.99))]
    assert lengths[0] < lengths[1] < lengths[2]


def test_agents_keep_their_order():
    groups = by_agent([RESULTS[1], RESULTS[0], RESULTS[2]])
    assert list(groups) == ["PPO", "computed torque"]
    assert [one.seed for one in groups["PPO"]] == [3, 8]
    assert values_of(groups["PPO"], "effort").shape == (2, EPISODES)


def cells(line):
    return [cell.strip() for cell in line.strip("|").split(" | ")]


def test_the_table_says_what_the_episodes_say():
    head, rule, *lines = table(RESULTS, 0.95).splitlines()
    assert cells(head)[1:] == ["computed torque", "PPO, 2 seeds"]
    assert set(rule) == {"|", "-", " "}
    assert len({len(line) for line in (head, rule, *lines)}) == 1  # columns stand below one another
    assert [cells(line)[0] for line in lines] == [how.label for _, how in shown(TrackMetrics)]
    assert cells(lines[-1])[1:] == ["0 of 4", "3 of 8"]
    printed = [(name, how) for name, how in shown(TrackMetrics) if isinstance(how, Printed)]
    for (name, how), line in zip(printed, lines, strict=False):
        for cell, group in zip(cells(line)[1:], (RESULTS[:1], RESULTS[1:]), strict=True):
            values = how.factor * np.array([getattr(one.metrics, name) for one in group])
            mean, low, high = (float(number) for number in re.findall(r"[-\d.e+]+", cell)[:3])
            assert mean == pytest.approx(values.mean(), rel=5e-3)  # three digits are printed
            assert low <= mean <= high
        low, high = cell.split("seeds ")[1].split(" … ")
        means = values.mean(axis=1)
        assert (float(low), float(high)) == pytest.approx((means.min(), means.max()), rel=5e-3)


@pytest.mark.parametrize("metrics", [TrackMetrics, FollowMetrics])
def test_units_of_the_table_are_those_it_prints(metrics):
    factors = {"mm": 1e3, "mrad": 1e3, "%": 1e2, "% of limits squared": 1e2}
    for _, how in shown(metrics):
        if isinstance(how, Printed):
            assert how.factor == factors.get(how.unit, 1.0)


def test_each_kind_of_metrics_has_a_table():
    values = {name: np.array([0.5, 0.25]) for name in FollowMetrics._fields}
    values["lap_time"] = np.full(2, np.nan)
    values["finished"] = np.array([0.0, 1.0])
    lines = table([Result("PPO", 0, ("circle", "ellipse"), FollowMetrics(**values))], 0.95).splitlines()
    found = {cells(line)[0]: cells(line)[1] for line in lines[2:]}
    assert list(found) == [how.label for _, how in shown(FollowMetrics)]
    assert found["finished"] == "1 of 2"
    assert found["time for the path [s]"] == "–"  # nobody has one
    assert found["cross-track RMSE [mm]"].startswith("375 [")
    assert sum(isinstance(how, Counted) for _, how in shown(FollowMetrics)) == 2


def test_one_run_is_no_range():
    """Neither a model-based agent nor a single seed."""
    assert cells(table(RESULTS[1:2], 0.95).splitlines()[0])[1] == "PPO, 1 seed"
    for one in (RESULTS[:1], RESULTS[1:2]):
        assert "…" not in table(one, 0.95)


def test_every_episode_is_written(tmp_path):
    write_episodes(tmp_path / "episodes.csv", RESULTS)
    written = rows(tmp_path / "episodes.csv")
    assert len(written) == len(RESULTS) * EPISODES
    assert list(written[0]) == ["agent", "seed", "episode", "path", *TrackMetrics._fields]
    for k, row in enumerate(written):
        one, episode = RESULTS[k // EPISODES], k % EPISODES
        assert (row["agent"], row["path"], int(row["episode"])) == (one.agent, one.paths[episode], episode)
        assert row["seed"] == ("" if one.seed is None else str(one.seed))
        for name in TrackMetrics._fields:
            assert float(row[name]) == getattr(one.metrics, name)[episode]  # to the last bit


def test_missing_values_are_written_as_nan(tmp_path):
    broken = RESULTS[0]._replace(
        metrics=RESULTS[0].metrics._replace(position_rmse=np.array([np.nan, 1.0, 2.0, 3.0])),
    )
    write_episodes(tmp_path / "episodes.csv", [broken])
    assert [row["position_rmse"] for row in rows(tmp_path / "episodes.csv")] == ["nan", "1.0", "2.0", "3.0"]


def test_the_summary_holds_an_estimate_of_every_metric(tmp_path):
    write_summary(tmp_path / "summary.csv", RESULTS, 0.95)
    written = rows(tmp_path / "summary.csv")
    assert [(row["agent"], row["metric"]) for row in written] == [
        (agent, metric) for agent in ("computed torque", "PPO") for metric in TrackMetrics._fields
    ]
    for row in written:
        group = [one for one in RESULTS if one.agent == row["agent"]]
        assert (int(row["seeds"]), int(row["episodes"])) == (len(group), EPISODES)
        expected = estimate(values_of(group, row["metric"]), 0.95)
        assert tuple(float(row[name]) for name in Estimate._fields) == expected
