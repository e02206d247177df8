"""caster_gym.engines.native.fleet, .compiler, .lanes: the mechanics compiled, and in batches."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.native.lanes import LANES, block_count, from_lanes, to_lanes
from caster_gym.engines.native.threads import BLOCKS_PER_SHARE, get_threads, set_threads
from caster_gym.engines.tensor.model import TorchModel
from tests.random_robots import random_robot

STEP = 2e-3  # s
MANY = 1003  # fills 31 blocks and leaves most of another one empty


def different_robots(count, caster_count=3):
    """Robots that all differ, as many as asked for, out of seven."""
    seven = [random_robot(200 + i, caster_count) for i in range(7)]
    return [seven[i % 7] for i in range(count)]


def random_states(seed, count, caster_count=3):
    """The same states with angles, as `Model` has them, and with unit vectors, as `Fleet` has them."""
    rng = np.random.default_rng((seed, caster_count))
    place, heading = rng.uniform(-2.0, 2.0, (count, 2)), rng.uniform(-np.pi, np.pi, (count, 1))
    twist, steering = rng.uniform(-1.0, 1.0, (count, 3)), rng.uniform(-np.pi, np.pi, (count, caster_count))
    return np.concatenate((place, heading, twist, steering), 1), with_directions(
        np.concatenate((place, heading, twist, steering), 1)
    )


def with_directions(states):
    """(x, y, cos β, sin β, twist, cos δ_1, sin δ_1, …) from (x, y, β, twist, δ_1, …)."""
    beta, steering = states[..., 2], states[..., 6:]
    wheels = np.stack((np.cos(steering), np.sin(steering)), -1).reshape(*steering.shape[:-1], -1)
    return np.concatenate((states[..., :2], np.stack((np.cos(beta), np.sin(beta)), -1), states[..., 3:6], wheels), -1)


def random_torques(seed, count, caster_count=3):
    return np.random.default_rng((seed, 1)).uniform(-0.5, 0.5, (count, 2 * caster_count))


@pytest.mark.parametrize("caster_count", [3, pytest.param(4, marks=pytest.mark.slow)])
def test_each_robot_of_a_fleet_moves_as_its_model_says(caster_count):
    """Robots with different parameters in one compiled call; NumPy and Torch move them one by one."""
    robots = different_robots(5, caster_count)
    angles, directions = random_states(1, 5, caster_count)
    torques = random_torques(1, 5, caster_count)
    fleet = Fleet(robots)
    fleet.state = directions
    fleet.step(torques, STEP, 50)
    for i, robot in enumerate(robots):
        expected = Model(robot).simulate(angles[i], torques[i], STEP, 50)[-1]
        tensors = TorchModel(robot).simulate(angles[i], torques[i], STEP, 50)[-1].numpy()
        # rounding of 50 steps of numbers of order 1; these motions do not amplify it a thousandfold in 0.1 s
        assert_allclose(fleet.state[i], with_directions(expected), rtol=0.0, atol=1e-11)
        assert_allclose(fleet.state[i], with_directions(tensors), rtol=0.0, atol=1e-11)


def test_the_printed_model_of_chung2008_is_another_one():
    """Without (D1) the motion differs, and differs as the NumPy face says."""
    robot, (angles, directions), torques = random_robot(210, 3), random_states(2, 1), random_torques(2, 1)
    ends = {}
    for dynamics in ("exact", "chung2008"):
        fleet = Fleet(robot, dynamics=dynamics)
        fleet.state = directions
        fleet.step(torques, STEP, 50)
        ends[dynamics] = fleet.state[0]
        expected = Model(robot, dynamics).simulate(angles[0], torques[0], STEP, 50)[-1]
        assert_allclose(ends[dynamics], with_directions(expected), rtol=0.0, atol=1e-11)  # rounding, as above
    assert np.abs(ends["exact"] - ends["chung2008"]).max() > 1e-5  # far above rounding


def test_one_robot_alone_equals_the_same_robot_in_a_batch():
    """To the last bit: strict arithmetic, whatever the lane and whoever the neighbours are."""
    robots, (_, directions), torques = different_robots(MANY), random_states(3, MANY), random_torques(3, MANY)
    batch = Fleet(robots)
    batch.state = directions
    batch.step(torques, STEP, 20)
    together = batch.state
    for i in (0, 1, LANES - 1, LANES, 500, MANY - 2, MANY - 1):
        alone = Fleet(robots[i])
        alone.state = directions[i : i + 1]
        alone.step(torques[i : i + 1], STEP, 20)
        assert_array_equal(alone.state[0], together[i])


def test_batches_on_one_and_on_several_threads_are_equal():
    """To the last bit: a small batch runs on one thread, a large one on all of them."""
    few = 3 * LANES + 5
    assert block_count(few) < 2 * BLOCKS_PER_SHARE <= block_count(MANY)
    robots, (_, directions), torques = different_robots(MANY), random_states(4, MANY), random_torques(4, MANY)
    large, small = Fleet(robots), Fleet(robots[:few])
    large.state, small.state = directions, directions[:few]
    large.step(torques, STEP, 20)
    small.step(torques[:few], STEP, 20)
    assert_array_equal(small.state, large.state[:few])


@pytest.mark.parametrize("threads", [2, 3, 7])
def test_the_number_of_threads_changes_no_bit(threads):
    """Every robot is computed by one thread; how blocks are shared out leaves nothing behind."""
    robots, (_, directions), torques = different_robots(MANY), random_states(7, MANY), random_torques(7, MANY)
    before, states = get_threads(), []
    for count in (1, threads):
        set_threads(count)
        fleet = Fleet(robots)
        fleet.state = directions
        fleet.step(torques, STEP, 20)
        states.append(fleet.state)
    set_threads(before)
    first, second = states
    assert_array_equal(first, second)


def test_many_steps_equal_single_ones():
    (_, directions), torques = random_states(5, 3), random_torques(5, 3)
    once, often = Fleet(different_robots(3)), Fleet(different_robots(3))
    once.state = often.state = directions
    once.step(torques, STEP, 10)
    for _ in range(10):
        often.step(torques, STEP)
    assert_array_equal(once.state, often.state)


def test_directions_keep_their_length():
    """The Newton step after each time step removes what the step added, for ever."""
    fleet = Fleet(load_robot("chung2008"), 3)
    fleet.state = random_states(6, 3)[1]
    fleet.step(0.01 * random_torques(6, 3), STEP, 20_000)
    pairs = fleet.state[:, [2, 3, *range(7, 13)]].reshape(3, -1, 2)
    assert np.isfinite(fleet.state).all()
    # one time step turns a wheel by at most 0.2 rad here; RK4 then misses the unit circle by 0.2⁶/144 ≈ 4e-7, and
    # the Newton step leaves 1.5 times the square of that
    assert_allclose(np.hypot(pairs[..., 0], pairs[..., 1]), 1.0, rtol=0.0, atol=1e-12)


def test_a_new_fleet_stands_at_the_origin_with_its_wheels_ahead():
    expected = np.array([0.0, 0, 1, 0, 0, 0, 0, 1, 0, 1, 0, 1, 0])
    assert_array_equal(Fleet(load_robot("chung2008"), 4).state, np.tile(expected, (4, 1)))


def test_states_are_copies():
    fleet = Fleet(load_robot("chung2008"), 2)
    before = fleet.state
    fleet.state[0, 0] = 5.0
    assert_array_equal(fleet.state, before)


def test_what_is_put_into_lanes_comes_out_again():
    """Any number of robots, from any row on; other rows stay as they are."""
    rng = np.random.default_rng(7)
    for count in (1, LANES - 1, LANES, LANES + 1, 3 * LANES):
        blocks = rng.normal(size=(block_count(count), 9 * LANES))
        before = from_lanes(blocks, 0, 9, count)
        rows = rng.normal(size=(count, 4))
        to_lanes(rows, blocks, 3)
        after = from_lanes(blocks, 0, 9, count)
        assert_array_equal(after[:, 3:7], rows)
        assert_array_equal(after[:, [0, 1, 2, 7, 8]], before[:, [0, 1, 2, 7, 8]])


def test_spare_lanes_hold_the_last_robot():
    """They are computed too: with zeros for masses they would divide by zero."""
    blocks = np.zeros((1, 2 * LANES))
    to_lanes(np.array([[1.0, 2.0], [3.0, 4.0]]), blocks, 0)
    assert_array_equal(blocks.reshape(2, LANES)[:, 1:], np.tile([[3.0], [4.0]], LANES - 1))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda f: f.step(np.zeros((2, 6)), STEP), r"torque must have shape \(3, 6\), got \(2, 6\)"),
        (lambda f: f.step(np.full((3, 6), np.nan), STEP), "torque must be finite, got nan"),
        (lambda f: f.step(np.full((3, 6), -np.inf), STEP), "torque must be finite, got -inf"),
        (lambda f: f.step(np.zeros((3, 6)), 0.02), r"0\.02 s cannot follow .* at most 0\.01 s"),  # 0.025 m by 2.5 m/s
        (lambda f: f.step(np.zeros((3, 6)), 0.0), "must be positive"),
        (lambda f: setattr(f, "state", np.zeros((3, 12))), r"state must have shape \(3, 13\), got \(3, 12\)"),
        (lambda f: setattr(f, "state", np.full((3, 13), np.inf)), "state must be finite, got inf"),
        (lambda f: setattr(f, "state", 0.5 * f.state), "directions must be unit vectors, got a length of 0.5"),
    ],
)
def test_bad_input_is_refused_and_changes_nothing(change, message):
    fleet = Fleet(load_robot("chung2008"), 3)
    before = fleet.state
    with pytest.raises(ValueError, match=message):
        change(fleet)
    assert_array_equal(fleet.state, before)


@pytest.mark.parametrize(
    ("robots", "count", "message"),
    [
        ([], None, "got 0"),
        (different_robots(2), 3, "3 of them, got 2"),
        ([random_robot(220, 3), random_robot(220, 4)], None, r"same number of casters, got \[3, 4\]"),
    ],
)
def test_a_fleet_that_cannot_be_is_refused(robots, count, message):
    with pytest.raises(ValueError, match=message):
        Fleet(robots, count)


def test_the_slowest_robot_decides_the_time_step():
    """Every robot of the fleet is checked, not only the first."""
    quick = random_robot(230, 3)
    slow = quick.model_copy(update={"casters": tuple(c.model_copy(update={"trail": 1e-4}) for c in quick.casters)})
    with pytest.raises(ValueError, match=r"trail of 0\.0001 m"):
        Fleet([quick, slow]).step(np.zeros((2, 6)), STEP)
