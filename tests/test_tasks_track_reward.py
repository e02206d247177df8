"""caster_gym.tasks.track.reward: laws of what tracking is rewarded for."""

import numpy as np
import pytest

from caster_gym.envs.tracking import Errors
from caster_gym.tasks.track import TASK
from tests.moments import NO_ERROR, terms_of, weights_of

WEIGHTS, WITH_IMPACTS = weights_of(TASK), weights_of(TASK, impact_weight=0.3, impact_scale=0.4)
NOTHING = (0.0,) * len(TASK.terms._fields)


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
        terms = terms_of(TASK, WITH_IMPACTS, errors, effort=effort, pressing=(0.0, 1e-3 * k, 1e9)[k % 3])
        assert 0.0 < terms.position <= 0.5
        assert 0.0 < terms.heading <= 0.3
        assert 0.0 < terms.speed <= 0.2
        assert -0.02 <= terms.effort <= 0.0
        assert -0.3 <= terms.impact <= 0.0
        assert terms.alive == 0.02 + 0.3


def test_perfect_tracking_without_effort_is_worth_most():
    """All weights of quality and the one for being alive, which is as great as the greatest costs."""
    assert sum(terms_of(TASK, WEIGHTS)) == pytest.approx(1.02, abs=1e-15)
    assert sum(terms_of(TASK, WITH_IMPACTS)) == pytest.approx(1.32, abs=1e-15)


def test_surviving_always_beats_dying():
    """No step in the task is worth less than nothing, whatever errors, effort and impacts; a failing one is worth 0."""
    for errors, effort in random_errors(2000):
        for weights, pressing in ((WEIGHTS, 0.0), (WITH_IMPACTS, 0.1), (WITH_IMPACTS, 1e6)):
            assert sum(terms_of(TASK, weights, errors, effort=effort, pressing=pressing)) > 0.0
            assert terms_of(TASK, weights, errors, 0.0, effort, pressing, failed=1.0) == NOTHING


def test_impacts_cost_what_the_documentation_says():
    """−w J / (J + J₀), and nothing where the weight is 0, as it is by default."""
    for pressing in (0.0, 0.01, 0.4, 3.0):
        expected = -0.3 * pressing / (pressing + 0.4)
        terms = terms_of(TASK, WITH_IMPACTS, effort=0.5, pressing=pressing)
        assert terms.impact == pytest.approx(expected, abs=1e-15)
        assert terms_of(TASK, WEIGHTS, effort=0.5, pressing=pressing) == terms_of(TASK, WEIGHTS, effort=0.5)
        same = terms_of(TASK, WITH_IMPACTS, effort=0.5)._replace(impact=terms.impact)
        assert terms == same


@pytest.mark.parametrize("name", ["ahead", "left", "turn", "vx", "vy", "omega"])
def test_each_error_alone_lowers_the_reward(name):
    """All the way from nothing to far out, on both sides."""

    def reward(size):
        change = {"cos": np.cos(size), "sin": np.sin(size)} if name == "turn" else {name: size}
        return sum(terms_of(TASK, WEIGHTS, NO_ERROR._replace(**change)))

    sizes = np.linspace(0.0, np.pi, 300)
    for side in (sizes, -sizes):
        assert (np.diff([reward(size) for size in side]) < 0.0).all()


def test_effort_lowers_the_reward():
    values = [sum(terms_of(TASK, WEIGHTS, effort=effort)) for effort in np.linspace(0.0, 1.0, 11)]
    assert (np.diff(values) < 0.0).all()
