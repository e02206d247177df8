"""caster_gym.control.episodes: agents with memory are told of new episodes, and others need no method for that."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.control.episodes import remembers, reset_of
from tests.counting import Counting


class Plain:
    """Without memory."""

    reset = None


def test_reset_is_that_of_the_agent_and_does_nothing_where_there_is_none():
    agent = Counting()
    assert remembers(agent)
    reset_of(agent)(np.array([True, True]))
    assert_array_equal(agent.done, [0, 0])
    for plain in (object(), Plain()):
        assert not remembers(plain)
        reset_of(plain)(np.array([True]))


def test_what_cannot_be_called_is_refused():
    agent = Plain()
    agent.reset = 3  # type: ignore[assignment]
    with pytest.raises(ValueError, match="its reset must be a method that takes a mask of robots, got 3"):
        reset_of(agent)
