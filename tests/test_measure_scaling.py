"""scripts.measure_scaling: what is computed for many cores follows from what was measured, by hand."""

import pytest

from scripts.measure_scaling import RUNS, Measured, computed, page

FOUND = Measured(
    begin={"local": 10.0, "ray": 20.0},
    call={"local": 0.5, "ray": 1.0},
    choose=0.1,
    sent=5000,
    returned=500,
    left=2_000_000,
    steps=100.0,
    wanted=1000,
)


@pytest.mark.parametrize(
    ("kind", "cores", "seconds"),
    [
        ("local", 2, 10.0 + 500 * 10.5),
        ("ray", 64, 20.0 + 16 * 11.0),
        ("local", 1000, 100.0),  # one after the other, trials are chosen for 100 s
    ],
)
def test_rounds_of_trainings_take_their_time_or_choosing_does(kind, cores, seconds):
    hours, share, busy = computed(FOUND, kind, cores)
    assert hours * 3600.0 == pytest.approx(seconds, rel=1e-12)
    assert share == pytest.approx(1.0 - -(-RUNS // cores) * 10.0 / seconds, rel=1e-12)
    assert busy == pytest.approx(100.0)


def test_the_page_says_what_is_measured_and_what_is_computed():
    text = page(FOUND, "ppo_track", "python -m scripts.measure_scaling")
    assert "| sent to a trial's process [kB] | 5 |" in text
    assert "| local | 2 | 1.46 | 4.94 | 2 |" in text
    assert "Computed from these numbers, not measured" in text
