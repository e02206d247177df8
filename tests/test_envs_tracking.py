"""caster_gym.envs.tracking: laws of its reward, endings, observation and start."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.engines.native.fleet import Fleet
from caster_gym.envs import tracking
from caster_gym.envs.track_task import TrackTask
from caster_gym.envs.tracking import Errors, Record, Reference, Terms, Weights
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from tests.random_robots import random_robot

EXACT = 1e-12  # rounding of a few hundred operations on numbers of order 1


def untouched(power=0.0):
    """The record of a control period without impacts."""
    return Record(*(0.0,) * len(Record._fields))._replace(power=power)


WEIGHTS = TrackTask().weights()
WITH_IMPACTS = TrackTask(impact_weight=0.3, impact_scale=0.4).weights()
NO_ERROR = Errors(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def reward_terms(errors, effort, failed=0.0, weights=WEIGHTS, pressing=0.0):
    return tracking.reward_terms(errors, effort, untouched()._replace(pressing=pressing), failed, weights)


def random_errors(count):
    """Errors of all sizes, from 1e-4 of their usual scale to a hundred times it."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        size = 10.0 ** rng.uniform(-4.0, 2.0, 5) * rng.choice((-1.0, 1.0), 5)
        turn = rng.uniform(-np.pi, np.pi) * 10.0 ** rng.uniform(-4.0, 0.0)
        yield Errors(size[0], size[1], np.cos(turn), np.sin(turn), *size[2:]), rng.choice([0.0, rng.uniform(), 1.0])


def test_reward_terms_stay_in_their_ranges():
    """Whatever the errors, the effort and the normal impulse [N s]."""
    for k, (errors, effort) in enumerate(random_errors(2000)):
        terms = reward_terms(errors, effort, 0.0, WITH_IMPACTS, pressing=(0.0, 1e-3 * k, 1e9)[k % 3])
        assert 0.0 < terms.position <= 0.5
        assert 0.0 < terms.heading <= 0.3
        assert 0.0 < terms.speed <= 0.2
        assert -0.02 <= terms.effort <= 0.0
        assert -0.3 <= terms.impact <= 0.0
        assert terms.alive == 0.02 + 0.3


def test_perfect_tracking_without_effort_is_worth_most():
    """All weights of quality and the one for being alive, which is as great as the greatest costs."""
    assert sum(reward_terms(NO_ERROR, 0.0)) == pytest.approx(1.02, abs=1e-15)
    assert sum(reward_terms(NO_ERROR, 0.0, 0.0, WITH_IMPACTS)) == pytest.approx(1.32, abs=1e-15)


def test_surviving_always_beats_dying():
    """No step in the task is worth less than nothing, whatever errors, effort and impacts; a failing one is worth 0."""
    for errors, effort in random_errors(2000):
        for weights, pressing in ((WEIGHTS, 0.0), (WITH_IMPACTS, 0.1), (WITH_IMPACTS, 1e6)):
            assert sum(reward_terms(errors, effort, 0.0, weights, pressing)) > 0.0
            assert reward_terms(errors, effort, 1.0, weights, pressing) == (0.0,) * len(Terms._fields)


def test_impacts_cost_what_the_documentation_says():
    """−w J / (J + J₀), and nothing where the weight is 0, as it is by default."""
    for pressing in (0.0, 0.01, 0.4, 3.0):
        expected = -0.3 * pressing / (pressing + 0.4)
        terms = reward_terms(NO_ERROR, 0.5, 0.0, WITH_IMPACTS, pressing)
        assert terms.impact == pytest.approx(expected, abs=1e-15)
        assert reward_terms(NO_ERROR, 0.5, 0.0, WEIGHTS, pressing) == reward_terms(NO_ERROR, 0.5)
        same = reward_terms(NO_ERROR, 0.5, 0.0, WITH_IMPACTS)._replace(impact=terms.impact)
        assert terms == same


@pytest.mark.parametrize("name", ["ahead", "left", "turn", "vx", "vy", "omega"])
def test_each_error_alone_lowers_the_reward(name):
    """All the way from nothing to far out, on both sides."""

    def reward(size):
        change = {"cos": np.cos(size), "sin": np.sin(size)} if name == "turn" else {name: size}
        return sum(reward_terms(NO_ERROR._replace(**change), 0.0))

    sizes = np.linspace(0.0, np.pi, 300)
    for side in (sizes, -sizes):
        assert (np.diff([reward(size) for size in side]) < 0.0).all()


def test_effort_lowers_the_reward():
    values = [sum(reward_terms(NO_ERROR, effort)) for effort in np.linspace(0.0, 1.0, 11)]
    assert (np.diff(values) < 0.0).all()


def test_full_torque_everywhere_is_an_effort_of_one():
    """Per driven motor, however many there are."""
    robot = random_robot(301, 3)
    for driven in (robot, robot.with_actuation(["roll_1", "steer_3"])):
        full = tuple(
            tuple(
                (1.0 if f"{kind}_{i}" in driven.driven else 0.0) * motor.max_torque
                for kind, motor in (("roll", caster.roll), ("steer", caster.steer))
            )
            for i, caster in enumerate(driven.casters, start=1)
        )
        assert tracking.mean_effort(full, robot_parameters(driven)) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(("distance", "outside"), [(0.4999999, 0.0), (0.5000001, 1.0), (np.inf, 1.0)])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5, -1.6])
def test_the_corridor_is_a_circle(distance, outside, angle):
    ahead, left = (distance, 0.0) if np.isinf(distance) else (distance * np.cos(angle), distance * np.sin(angle))
    assert tracking.left_corridor(NO_ERROR._replace(ahead=ahead, left=left), WEIGHTS.corridor) == outside


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
    weights = TrackTask(touching=touching).weights()
    assert tracking.touched(untouched()._replace(pressing=pressing), weights.touching_ends) == ends


def test_an_obstacle_is_seen_from_the_robot():
    """Gap, at most 1 m, and the direction from it turned into B; too far away it has none."""
    state = unpack_state((1.0, 2.0, np.cos(0.7), np.sin(0.7), 0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 1.0))
    gap, nx, ny = tracking.neighbour_seen(state, (0.4, np.cos(1.1), np.sin(1.1)))
    assert_allclose([gap * 0.25, nx, ny], [0.4, np.cos(0.4), np.sin(0.4)], rtol=0.0, atol=EXACT)
    assert tracking.neighbour_seen(state, (-0.01, 1.0, 0.0))[0] == -0.04
    for far in (1.0, 3.0, np.inf):
        assert tracking.neighbour_seen(state, (far, 1.0, 0.0)) == (4.0, 0.0, 0.0)


def test_observed_numbers_stay_within_the_space():
    given = [-np.inf, -21.0, -20.0, 0.5, 20.0, 21.0, np.inf, np.nan]
    assert [tracking.observed(x) for x in given] == [-20, -20, -20, 0.5, 20, 20, 20, -20]


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


def test_weights_carry_every_number_of_the_task():
    """Each into the field that means it."""
    fields = [name for name in Weights._fields if name not in ("coarse", "corridor", "touching_ends")]
    named = {f"{name}_weight" if f"{name}_weight" in TrackTask.model_fields else name: name for name in fields}
    for i, (field, weight) in enumerate(named.items()):
        value = 0.111 * (i + 1)
        assert getattr(TrackTask(**{field: value}).weights(), weight) == value
    weights = TrackTask(coarse=7.0, corridor=0.9).weights()
    assert (weights.coarse, weights.corridor, weights.touching_ends) == (7.0, 0.9, 0.0)
    assert TrackTask(touching="ends").weights().touching_ends == 1.0
