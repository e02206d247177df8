"""caster_gym.tasks.track.metrics: errors of hand-made episodes before and after settling, and what is better."""

import numpy as np
import pytest

from caster_gym.tasks.track.metrics import TrackMetrics, TrackVerdict, measure
from tests.series import STEPS, column, episodes

SETTLING = 2.0  # [s] four steps


def measured(*arguments, **changed):
    return measure(episodes(*arguments, **changed), SETTLING)


def test_transient_and_steady_errors_are_apart():
    found = measured(position_error=column(1, 1, 1, 5, 3, 4), heading_error=column(2, -2, 2, -2, 0.3, -0.4))
    assert found.position_rmse == pytest.approx([np.sqrt((9 + 16) / 2)])
    assert found.heading_rmse == pytest.approx([np.sqrt((0.09 + 0.16) / 2)])
    assert found.worst_position == pytest.approx([4.0])
    assert found.position_rmse_transient == pytest.approx([np.sqrt((1 + 1 + 1 + 25) / 4)])
    assert found.heading_rmse_transient == pytest.approx([2.0])
    assert found.failed.tolist() == [0.0]


def test_what_comes_after_the_end_of_an_episode_does_not_count():
    """The first ends a step after settling, the second not at all."""
    found = measured((5, STEPS), position_error=np.repeat(column(1, 1, 1, 1, 3, 7), 2, axis=1), reward=2.0)
    assert found.position_rmse == pytest.approx([3.0, np.sqrt((9 + 49) / 2)])
    assert found.worst_position == pytest.approx([3.0, 7.0])
    assert found.reward == pytest.approx([2.0, 2.0])
    assert found.failed.tolist() == [1.0, 0.0]


def test_a_failure_before_settling_has_no_steady_values():
    found = measured((3,), position_error=column(1, 2, 2, 9, 9, 9))
    steady = ("position_rmse", "heading_rmse", "worst_position")
    assert all(np.isnan(getattr(found, name)).all() for name in steady)
    assert found.position_rmse_transient == pytest.approx([np.sqrt(3.0)])
    assert found.failed.tolist() == [1.0]
    assert all(np.isfinite(getattr(found, name)).all() for name in TrackMetrics._fields if name not in steady)


def test_the_verdict_is_over_all_episodes_that_settled():
    found = TrackVerdict.of(
        measured(
            (3, STEPS, STEPS),
            position_error=np.hstack([column(9, 9, 9, 9, 9, 9), column(0, 0, 0, 0, 3, 3)])[:, [0, 1, 1]]
            * [1.0, 1.0, 2.0],
        )
    )
    assert found.position_rmse == pytest.approx(np.sqrt((9 + 36) / 2))
    assert (found.worst_position, found.failures) == (6.0, 1)


def test_a_verdict_on_failures_alone_is_the_worst():
    found = TrackVerdict.of(measured((1, 2)))
    assert (found.position_rmse, found.worst_position, found.failures) == (np.inf, np.inf, 2)


def test_fewer_failures_are_better_then_smaller_errors():
    first = TrackVerdict(0.5, 1.0, 0.1, 0, 0.2)
    assert first.merit > first._replace(failures=1, position_rmse=0.001).merit
    assert first._replace(position_rmse=0.4).merit > first.merit
