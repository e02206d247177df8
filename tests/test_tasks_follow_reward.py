"""caster_gym.tasks.follow.reward: laws of what following a path is rewarded for."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.envs.tracking import Errors
from caster_gym.tasks.follow import TASK
from tests.moments import NO_ERROR, terms_of, weights_of

WEIGHTS = weights_of(TASK)
NOTHING = (0.0,) * len(TASK.terms._fields)


def follow_terms(errors=NO_ERROR, share=1.0, effort=0.0, pressing=0.0, failed=0.0):
    return terms_of(TASK, WEIGHTS, errors, share, effort, pressing, failed)


def random_cases(count):
    """Errors from 1e-4 of their usual scale to a hundred times it; any progress, effort and normal impulse."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        size = 10.0 ** rng.uniform(-4.0, 2.0, 5) * rng.choice((-1.0, 1.0), 5)
        turn = rng.uniform(-np.pi, np.pi) * 10.0 ** rng.uniform(-4.0, 0.0)
        errors = Errors(size[0], size[1], np.cos(turn), np.sin(turn), *size[2:])
        share, effort = (rng.choice([0.0, rng.uniform(), 1.0]) for _ in range(2))
        yield errors, share, effort, rng.choice([0.0, 10.0 ** rng.uniform(-4.0, 6.0)])


def test_terms_stay_in_their_ranges():
    for errors, share, effort, pressing in random_cases(2000):
        terms = follow_terms(errors, share, effort, pressing)
        assert 0.0 <= terms.progress <= 0.2
        assert 0.0 <= terms.cross_track <= 0.4
        assert 0.0 <= terms.heading <= 0.4
        assert -0.02 <= terms.effort <= 0.0
        assert -0.5 <= terms.impact <= 0.0
        assert terms.alive == 0.52


def test_terms_are_what_the_documentation_says():
    def k(e, scale):
        return 0.5 / (1.0 + (e / scale) ** 2) + 0.5 / (1.0 + (e / (10.0 * scale)) ** 2)

    for errors, share, effort, pressing in random_cases(500):
        expected = {
            "progress": 0.2 * share,
            "cross_track": 0.4 * share * k(np.hypot(errors.ahead, errors.left), 0.01),
            "heading": 0.4 * share * k(2.0 * np.sin(0.5 * np.arctan2(errors.sin, errors.cos)), 0.15),
            "effort": -0.02 * effort,
            "impact": -0.5 * pressing / (pressing + 0.5),
            "alive": 0.52,
        }
        terms = follow_terms(errors, share, effort, pressing)._asdict()
        for name, value in expected.items():
            # 1 − cos of a small heading error loses 1e-16, in units of the scale's square 2.5e-3
            assert_allclose(terms[name], value, rtol=0.0, atol=1e-12, err_msg=name)


def test_full_progress_on_the_path_without_effort_is_worth_most():
    assert sum(follow_terms()) == pytest.approx(1.52, abs=1e-15)


def test_resting_anywhere_earns_only_alive():
    """Without progress quality is worth nothing, so that the path's start is no better than any other place."""
    for errors, *_ in random_cases(200):
        assert sum(follow_terms(errors, share=0.0)) == 0.52


def test_surviving_always_beats_dying():
    """The worst step in the task is worth no less than nothing, a failing one is worth 0."""
    for errors, share, effort, pressing in random_cases(2000):
        assert sum(follow_terms(errors, share, effort, pressing)) >= 0.0
        assert follow_terms(errors, share, effort, pressing, failed=1.0) == NOTHING


def test_failing_is_worth_nothing_even_where_the_errors_are_no_numbers():
    """A state that is not finite is a failure, too."""
    nowhere = Errors(*[np.nan] * 7)
    assert follow_terms(nowhere, np.nan, np.nan, np.nan, failed=1.0) == NOTHING


@pytest.mark.parametrize("name", ["ahead", "left", "turn"])
def test_each_error_alone_lowers_the_reward(name):
    def reward(size):
        change = {"cos": np.cos(size), "sin": np.sin(size)} if name == "turn" else {name: size}
        return sum(follow_terms(NO_ERROR._replace(**change)))

    sizes = np.linspace(0.0, np.pi, 300)
    for side in (sizes, -sizes):
        assert (np.diff([reward(size) for size in side]) < 0.0).all()


def test_errors_of_speed_cost_nothing():
    """Nobody has to keep to the law's speed."""
    assert follow_terms(NO_ERROR._replace(vx=3.0, vy=-2.0, omega=1.0)) == follow_terms()


def test_progress_effort_and_impacts_each_count():
    shares = np.linspace(0.0, 1.0, 11)
    assert (np.diff([sum(follow_terms(share=share)) for share in shares]) > 0.0).all()
    assert (np.diff([sum(follow_terms(effort=share)) for share in shares]) < 0.0).all()
    assert (np.diff([sum(follow_terms(pressing=10.0 * share)) for share in shares]) < 0.0).all()
