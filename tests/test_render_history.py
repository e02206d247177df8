"""caster_gym.render.history: the past of one episode, and of no other."""

import numpy as np
from numpy.testing import assert_array_equal

from caster_gym.render.history import IMPACT_LIFE, History
from tests.scenes import CIRCLE, scene


def driven(times, **changes):
    history = History()
    for time in times:
        history.add(scene(x=time, time=time, **changes))
    return history


def test_it_holds_where_the_robot_was_in_order():
    times = np.arange(1000) * 0.02  # more than it makes room for at first
    history = driven(times)
    assert_array_equal(history.times, times)
    assert_array_equal(history.positions, np.stack([times, 0.0 * times], axis=1))
    assert_array_equal(history.errors, np.abs(times - 1.0))  # the reference is at (1, 0)


def test_the_same_moment_counts_once():
    """So that a frame may be asked for twice."""
    once, twice = driven([0.0, 0.1, 0.2]), driven([0.0, 0.1, 0.1, 0.2, 0.2])
    assert_array_equal(once.positions, twice.positions)


def test_it_begins_anew_when_time_falls_back():
    assert_array_equal(driven([0.0, 0.1, 0.2, 0.0, 0.1]).times, [0.0, 0.1])


def test_it_begins_anew_on_another_path():
    history = driven([0.0, 0.1])
    history.add(scene(time=0.1, path=2.0 * CIRCLE))
    assert_array_equal(history.times, [0.1])


def hit(time):
    return scene(time=time, impulse=np.array([0.0, 1.0]), impact_point=np.array([1.0, -0.1]))


def test_impacts_live_shortly():
    history = History()
    history.add(hit(0.0))
    history.add(scene(time=0.9 * IMPACT_LIFE))
    assert [impact.time for impact in history.impacts] == [0.0]
    history.add(scene(time=1.1 * IMPACT_LIFE))
    assert history.impacts == []


def test_an_impact_counts_once_however_often_it_is_shown():
    history = History()
    for _ in range(3):
        history.add(hit(0.5))
    assert len(history.impacts) == 1


def test_impacts_of_another_episode_are_forgotten():
    history = History()
    history.add(hit(0.5))
    history.add(scene(time=0.0))
    assert history.impacts == []
