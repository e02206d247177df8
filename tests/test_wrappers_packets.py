"""caster_gym.wrappers.packets: observations that get lost, and the last one that did not."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.configuration import ConfigurationError
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import DroppedPackets, read_features, wrap

COUNT, STEPS = 200, 50


def observations(*features):
    """What robots see that are driven about (steps + 1, robots, size)."""
    env = wrap(CasterTrackVectorEnv(COUNT, path="lemniscate", corridor=100.0), *features)
    actions = np.random.default_rng(0).uniform(-0.5, 0.5, (STEPS, COUNT, 6)).astype(np.float32)
    return np.array([env.reset(seed=4)[0], *(env.step(action)[0] for action in actions)])


def test_what_is_lost_is_replaced_by_what_arrived_last():
    probability = 0.3
    shown, true = observations(DroppedPackets(probability=probability)), observations()
    arrived = (shown == true).all(axis=-1)
    assert arrived[0].all()
    last = np.maximum.accumulate(np.where(arrived, np.arange(STEPS + 1)[:, None], 0), axis=0)
    assert_array_equal(shown, np.take_along_axis(true, last[..., None], axis=0))
    lost = 1.0 - arrived[1:].mean()
    assert abs(lost - probability) < 5.0 * np.sqrt(probability * (1.0 - probability) / (COUNT * STEPS))
    after_lost = 1.0 - arrived[2:][~arrived[1:-1]].mean()  # losses are independent of one another
    assert abs(after_lost - probability) < 5.0 * np.sqrt(1.0 / (COUNT * STEPS))


def test_all_or_nothing_may_get_lost():
    true = observations()
    assert_array_equal(observations(DroppedPackets(probability=0.0)), true)
    assert_array_equal(observations(DroppedPackets(probability=1.0)), np.broadcast_to(true[0], true.shape))


def test_a_probability_lies_between_0_and_1():
    with pytest.raises(ConfigurationError, match="'probability'"):
        read_features([{"kind": "dropped_packets", "probability": 1.5}])
