"""caster_gym.tasks.measuring: what torques cost, means of series with gaps, and what is printed."""

from typing import Annotated, NamedTuple

import numpy as np
import pytest

from caster_gym.tasks.measuring import Counted, Printed, costs, greatest, mean, overall, rms, shown
from tests.series import MOTORS, PERIOD, STEPS, column, episodes


def spent(*arguments, **changed):
    return costs(episodes(*arguments, **changed))


def test_torque_variation_is_the_way_of_the_shares_per_second():
    """One driven motor goes up and down by 0.5 in every step, the other rests; motors that are not driven are not
    asked."""
    share = np.zeros((STEPS, 1, MOTORS))
    share[::2, 0, 0] = 0.5
    share[:, 0, 1] = np.arange(STEPS)
    way = 0.5 * (STEPS - 1) / (STEPS * PERIOD)
    assert spent(share=share).torque_variation == pytest.approx([way / 2])
    ways = spent((3, STEPS), share=share.repeat(2, axis=1)).torque_variation
    assert ways == pytest.approx([0.5 * 2 / (3 * PERIOD) / 2, way / 2])


def test_effort_and_peak_torque():
    share = np.zeros((STEPS, 1, MOTORS))
    share[..., 0], share[..., 2] = 0.6, -0.8
    torque = 0.2 * share
    torque[2, 0, 2] = -0.7
    found = spent(share=share, torque=torque)
    assert found.effort == pytest.approx([(0.36 + 0.64) / 2])
    assert found.peak_torque == pytest.approx([0.7])


def test_saturation_counts_commands_at_the_limit_and_torques_that_were_cut():
    """One of twelve was asked at the limit, one got less than it asked for."""
    share = np.zeros((STEPS, 1, MOTORS))
    command = np.zeros((STEPS, 1, 2))
    command[0, 0, 0], share[0, 0, 0] = 1.0, 1.0
    command[3, 0, 1], share[3, 0, 2] = -0.8, -0.5
    command[4, 0, 1], share[4, 0, 2] = 0.4, 0.4
    assert spent(share=share, command=command).saturation == pytest.approx([2 / 12])
    assert spent((2,), share=share, command=command).saturation == pytest.approx([1 / 4])


def test_gaps_do_not_count():
    nan = np.nan
    series = np.hstack([column(3, nan, 4), column(nan, nan, nan)])
    for measured, expected in ((mean, 3.5), (rms, np.sqrt(12.5)), (greatest, 4.0)):
        first, second = measured(series)
        assert first == pytest.approx(expected)
        assert np.isnan(second)
    assert greatest(column(-3, -1, -2)) == [-1.0]


def test_the_overall_error_is_infinite_where_there_is_none():
    assert overall(np.array([3.0, np.nan, 4.0])) == pytest.approx(np.sqrt(12.5))
    assert overall(np.array([np.nan])) == np.inf


def test_a_field_tells_how_it_is_printed():
    class Quantities(NamedTuple):
        hidden: float
        way: Annotated[float, Printed("way", "mm", 1e3)]
        done: Annotated[float, Counted("done")]
        runs: Annotated[float, Printed("runs")]

    assert [(name, how.label) for name, how in shown(Quantities)] == [
        ("way", "way [mm]"),
        ("done", "done"),
        ("runs", "runs"),
    ]


def test_nothing_has_no_greatest_value():
    """As of episodes that are over before they have settled."""
    assert np.isnan(greatest(np.zeros((0, 3)))).all()
