"""caster_gym.envs.observation: named parts fill the observation, and give physical quantities back."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym import load_robot
from caster_gym.envs.observation import (
    CHANNELS,
    GAP_UNIT,
    Channel,
    Neighbour,
    ObservationLayout,
    check_channels,
    directions,
    observation_size,
    preview,
    twist,
)
from tests.random_robots import random_robot


@pytest.mark.parametrize("caster_count", [2, 3, 4])
@pytest.mark.parametrize("preview", [(), (0.1,), (0.1, 0.2, 0.4)])
def test_parts_of_the_observation_fill_it_without_gap(caster_count, preview):
    layout = ObservationLayout(random_robot(303, caster_count), preview)
    ends = [0]
    for part in layout.parts:
        assert part.place.start == ends[-1]
        assert len(part.scale) == part.place.stop - part.place.start
        ends.append(part.place.stop)
    assert ends[-1] == layout.size == observation_size(caster_count, len(preview), 0)
    assert len(layout.table().splitlines()) == 2 + len(layout.parts)
    assert all(part.name in layout.table() for part in layout.parts)


def test_nearest_obstacles_come_last_in_the_observation():
    robot = random_robot(303, 3)
    without, layout = ObservationLayout(robot, (0.1,)), ObservationLayout(robot, (0.1,), "m", 2)
    assert layout.size == without.size + 2 * len(Neighbour._fields)
    assert [part.name for part in layout.parts][-3:] == ["preview_0.1m", "obstacle_1", "obstacle_2"]
    assert_array_equal(layout.physical(np.ones(layout.size), "obstacle_2"), [GAP_UNIT, 1.0, 1.0])


def test_a_batch_of_observations_is_decoded_along_its_last_axis():
    layout = ObservationLayout(random_robot(304, 3), (0.1,))
    batch = np.random.default_rng(5).normal(size=(2, 4, layout.size)).astype(np.float32)
    assert_array_equal(layout.physical(batch, "twist")[1, 2], layout.physical(batch[1, 2], "twist"))


PAIR = (1.0, 1.0)


@pytest.mark.parametrize(
    ("channels", "sentence"),
    [
        ([Channel("mine", directions, PAIR, "")], r"'mine' of the observation has 2 units per robot, and its function"),
        (
            [Channel("mine", directions, PAIR, "")],
            r'directions gives 4 numbers for a robot .* each; per="caster" would',
        ),
        ([Channel("mine", preview, (1.0,) * 7, "")], r'preview gives 21 numbers .*; per="point" would fit$'),
        (
            [Channel("mine", directions, PAIR, "", "obstacle")],
            r'2 units per obstacle.*gives 4 .*per="caster" would fit',
        ),
        ([Channel("mine", twist, PAIR, "")], r"twist gives 3 numbers .*: there must be one for each$"),
        (
            [Channel("mine", lambda view: view.errors.ahead, (1.0,), "")],
            r"'mine' .* gives a float, and must give a tuple",
        ),
        (
            [Channel("mine", directions, PAIR, "", "casters")],  # type: ignore[arg-type]
            r"'mine' of the observation is per='casters', which must be one of .robot., .caster., .point., .obstacle.$",
        ),
        ([*CHANNELS, CHANNELS[0]], r"the observation has 2 channels 'position_error': each needs a name of its own"),
    ],
)
def test_a_channel_that_would_shift_the_others_is_refused(channels, sentence):
    """Its values are counted on a robot that has of nothing one, and of nothing as many as of another thing."""
    with pytest.raises(TypeError, match=sentence):
        check_channels(tuple(channels))


def test_parts_and_units_that_there_are_not_are_told_with_those_that_there_are():
    layout = ObservationLayout(load_robot("chung2008"), (0.1,))
    with pytest.raises(
        ValueError, match=r"no part 'twists'; its parts are position_error, .*directions, .*preview_0.1s$"
    ):
        layout.physical(np.zeros(layout.size), "twists")
    with pytest.raises(ValueError, match="the unit of previews must be 's' or 'm', got 'ms'"):
        ObservationLayout(load_robot("chung2008"), (0.1,), "ms")  # type: ignore[arg-type]
