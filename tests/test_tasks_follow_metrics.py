"""caster_gym.tasks.follow.metrics: times, errors and impacts of hand-made episodes, and what is better."""

import numpy as np
import pytest

from caster_gym.tasks.follow.metrics import FollowVerdict, measure
from tests.series import PERIOD, STEPS, column, episodes

SETTLING = 1.0  # [s] two steps
GOAL = 4.0  # [m]
LAW = 2.5  # [s]
WAY = column(1, 2, 3, 4, 4.5, 4.5)  # [m] the goal is reached with the fourth step


def measured(*arguments, **changed):
    return measure(episodes(*arguments, **{"goal": GOAL, "law": LAW, **changed}), SETTLING)


def test_time_counts_until_the_goal_is_reached():
    found = measured(progress=WAY)
    assert found.finished.tolist() == [1.0]
    assert found.lap_time == pytest.approx([4 * PERIOD])
    assert found.lap_share == pytest.approx([4 * PERIOD / LAW])
    assert found.mean_speed == pytest.approx([4.0 / (4 * PERIOD)])


def test_a_path_that_is_not_finished_has_a_speed_but_no_time():
    found = measured((STEPS, 2), progress=0.5 * WAY[:, [0, 0]])
    assert found.finished.tolist() == [0.0, 0.0]
    assert np.isnan(found.lap_time).all()
    assert np.isnan(found.lap_share).all()
    assert found.mean_speed == pytest.approx([2.25 / (6 * PERIOD), 1.0 / (2 * PERIOD)])


def test_each_path_has_a_goal_of_its_own():
    found = measured((STEPS, STEPS), progress=WAY[:, [0, 0]], goal=[2.0, 5.0], law=[2.0, 3.0])
    assert found.finished.tolist() == [1.0, 0.0]
    assert found.lap_share[0] == pytest.approx(2 * PERIOD / 2.0)


def test_errors_count_on_the_way_after_settling():
    """Neither the start's nor those of resting at the end."""
    found = measured(progress=WAY, position_error=column(9, 9, 3, 4, 9, 9), heading_error=column(2, 2, -0.3, 0.4, 2, 2))
    assert found.cross_track_rmse == pytest.approx([np.sqrt(12.5)])
    assert found.worst_cross_track == pytest.approx([4.0])
    assert found.heading_rmse == pytest.approx([np.sqrt(0.125)])


def test_an_episode_that_is_over_before_settling_has_no_errors():
    found = measured((2,), progress=WAY, position_error=1.0)
    assert np.isnan(found.cross_track_rmse).all()
    assert np.isnan(found.worst_cross_track).all()
    assert found.failed.tolist() == [1.0]


def test_impacts_count_in_the_whole_episode():
    found = measured(
        progress=WAY,
        impacts=column(2, 0, 0, 0, 0, 1),
        normal_impulse=column(0.3, 0, 0, 0, 0, 0.5),
        clearance=column(0.2, 0.1, -0.001, 0.3, 0.3, 0.0),
    )
    assert found.impacts.tolist() == [3.0]
    assert found.greatest_impulse.tolist() == [0.5]
    assert found.least_clearance.tolist() == [-0.001]


def test_there_is_no_clearance_without_obstacles():
    assert np.isnan(measured(progress=WAY, clearance=np.inf).least_clearance).all()


def test_steps_that_a_failure_cost_earn_nothing():
    assert measured((3, STEPS), progress=WAY[:, [0, 0]], reward=1.2).reward == pytest.approx([0.6, 1.2])


def test_the_verdict_is_over_all_episodes():
    found = FollowVerdict.of(
        measured(
            (STEPS, STEPS, 3),
            progress=np.hstack([WAY, 0.5 * WAY, WAY]),
            position_error=np.broadcast_to([3.0, 4.0, 5.0], (STEPS, 3)),
            impacts=np.broadcast_to([0.0, 1.0, 0.0], (STEPS, 3)),
            reward=1.0,
        )
    )
    assert found.lap_share == pytest.approx(4 * PERIOD / LAW)
    assert found.cross_track_rmse == pytest.approx(np.sqrt((9 + 16 + 25) / 3))
    assert (found.impacts, found.unfinished, found.failures) == (2.0, 2, 1)
    assert found.reward == pytest.approx((1 + 1 + 0.5) / 3)


def test_nothing_finished_takes_for_ever():
    assert FollowVerdict.of(measured((1,), progress=WAY)).lap_share == np.inf


def test_fewer_failures_are_better_then_finishing_then_more_reward():
    first = FollowVerdict(1.0, 0.01, 0.1, 0.0, 1, 0, 1.0)
    assert first.merit > first._replace(failures=1, unfinished=0, reward=2.0).merit
    assert first.merit > first._replace(unfinished=2, reward=2.0).merit
    assert first._replace(reward=1.1, lap_share=1.2).merit > first.merit
