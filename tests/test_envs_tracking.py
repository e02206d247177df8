"""caster_gym.envs.tracking: laws of its effort, endings, observation and start."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.engines.native.fleet import Fleet
from caster_gym.envs import tracking
from caster_gym.envs.observation import GAP_LIMIT, OBSERVATION_LIMIT, Neighbour, neighbour_seen, observed
from caster_gym.envs.tracking import Reference
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.tasks.track.parameters import TrackParameters
from tests.moments import NO_ERROR, untouched
from tests.random_robots import random_robot

EXACT = 1e-12  # rounding of a few hundred operations on numbers of order 1


CORRIDOR = 0.5  # [m]


def test_full_torque_everywhere_is_an_effort_of_one():
    """Per driven motor, however many there are."""
    robot = random_robot(301, 3)
    for driven in (robot, robot.with_actuation(["roll_1", "steer_3"])):
        full = tuple(
            (
                caster.roll.max_torque if f"roll_{i}" in driven.driven else 0.0,
                caster.steer.max_torque if f"steer_{i}" in driven.driven else 0.0,
            )
            for i, caster in enumerate(driven.casters, start=1)
        )
        assert tracking.mean_effort(full, robot_parameters(driven)) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(("distance", "outside"), [(0.4999999, 0.0), (0.5000001, 1.0), (np.inf, 1.0)])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5, -1.6])
def test_the_corridor_is_a_circle(distance, outside, angle):
    ahead, left = (distance, 0.0) if np.isinf(distance) else (distance * np.cos(angle), distance * np.sin(angle))
    assert tracking.left_corridor(NO_ERROR._replace(ahead=ahead, left=left), CORRIDOR) == outside


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_any_number_that_is_not_finite_is_noticed(bad):
    good = Fleet(random_robot(302, 3)).state[0]
    assert tracking.not_finite(unpack_state(tuple(good))) == 0.0
    for i in range(len(good)):
        broken = good.copy()
        broken[i] = bad
        with np.errstate(invalid="ignore"):
            assert tracking.not_finite(unpack_state(tuple(broken))) == 1.0


@pytest.mark.parametrize(("touching", "pressing", "ends"), [("ends", 1e-9, 1), ("ends", 0.0, 0), ("allowed", 5.0, 0)])
def test_touching_ends_an_episode_only_where_the_task_says_so(touching, pressing, ends):
    flag = float(TrackParameters(touching=touching).touching_ends)
    assert tracking.touched(untouched()._replace(pressing=pressing), flag) == ends


def test_an_obstacle_is_seen_from_the_robot():
    """Gap, at most 1 m, and the direction from it turned into B; too far away it has none."""
    state = unpack_state((1.0, 2.0, np.cos(0.7), np.sin(0.7), 0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 1.0))
    seen = neighbour_seen(state, Neighbour(0.4, np.cos(1.1), np.sin(1.1)))
    assert_allclose(seen, [0.4, np.cos(0.4), np.sin(0.4)], rtol=0.0, atol=EXACT)
    assert neighbour_seen(state, Neighbour(-0.01, 1.0, 0.0))[0] == -0.01
    for far in (GAP_LIMIT, 3.0, np.inf):
        assert neighbour_seen(state, Neighbour(far, 1.0, 0.0)) == (GAP_LIMIT, 0.0, 0.0)


def test_observed_numbers_stay_within_the_space():
    most = OBSERVATION_LIMIT
    given = [-np.inf, -most - 1.0, -most, 0.5, most, most + 1.0, np.inf, np.nan]
    assert [observed(x, 1.0) for x in given] == [-most, -most, -most, 0.5, most, most, most, -most]
    assert observed(0.5, 0.25) == 2.0


def test_a_start_lies_in_the_frame_of_the_trajectory():
    """Offset ahead and left of the reference, turned from its heading, at rest."""
    heading, turn = 0.8, -0.3
    reference = Reference(1.0, 2.0, np.cos(heading), np.sin(heading), 0.3, 0.1, 0.2, 0.0, 0.0, 0.0)
    state = tracking.start(reference, (0.04, -0.02), (np.cos(turn), np.sin(turn)), ((0.6, 0.8), (0.0, 1.0)))
    rotation = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    assert_allclose(state.position, [1.0, 2.0] + rotation @ [0.04, -0.02], rtol=0.0, atol=EXACT)
    assert_allclose(state.heading, [np.cos(heading + turn), np.sin(heading + turn)], rtol=0.0, atol=EXACT)
    assert state.twist == (0.0, 0.0, 0.0)
    assert state.directions == ((0.6, 0.8), (0.0, 1.0))
