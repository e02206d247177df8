"""scripts/measure_speed.py: its arithmetic, and a smoke test of everything that it measures in this process."""

import pytest

from caster_gym import load_robot
from scripts.measure_speed import Row, page, rate, rows, shown


@pytest.mark.parametrize(
    ("unit", "goal", "value", "said"),
    [
        ("steps/s", 1e6, 1e6, "≥ 1,000,000: reached"),
        ("steps/s", 1e6, 9.9e5, "≥ 1,000,000: missed"),
        ("s", 0.5, 0.4, "≤ 0.5: reached"),
        ("s", 0.5, 0.6, "≤ 0.5: missed"),
        ("s", None, 0.6, ""),
    ],
)
def test_rates_must_be_great_and_times_small(unit, goal, value, said):
    assert Row("something", unit, lambda: value, goal).reached(value) == said


def test_rate_counts_steps_over_the_time_they_took(monkeypatch):
    """Ten steps in each half second of a clock that only calls move; the first call is not counted."""
    clock = 0.0

    def call():
        nonlocal clock
        clock += 0.5
        return 10

    monkeypatch.setattr("scripts.measure_speed.time.perf_counter", lambda: clock)
    assert rate(call, 2.0) == 20.0


@pytest.mark.parametrize(("value", "text"), [(1234567.0, "1,230,000"), (999.7, "1,000"), (12.34, "12.3"), (0.5, "0.5")])
def test_three_digits_are_shown(value, text):
    assert shown(value) == text


def test_everything_is_measured_and_shown():
    """Smoke: one call of each row; what starts other processes is given a number instead."""
    table = [
        (row, [row.measure()] if row.unit != "s" else [1.0]) for row in rows(load_robot("chung2008"), "chung2008", 1e-9)
    ]
    assert all(value > 0.0 for _, (value,) in table)
    text = page(table, "python -m scripts.measure_speed", (0.0, 0.0))
    assert all(f"| {row.name} |" in text for row, _ in table)
