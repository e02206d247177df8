"""caster_gym.agents.sweep.outcome: scores are in the order of merits, and who is behind is found by hand."""

import math
from itertools import combinations, pairwise

import numpy as np
import pytest

from caster_gym.agents.sweep.outcome import Outcome, is_behind, least_scores, score_of


def test_scores_are_in_the_order_of_merits():
    """Whole numbers first, as of failures, and then any number."""
    rng = np.random.default_rng(0)
    last = [-math.inf, *(-(10.0 ** rng.uniform(-4, 2, 20))), *rng.uniform(-3.0, 3.0, 20)]
    merits = [(-int(a), -int(b), float(c)) for a, b, c in zip(*rng.integers(0, 3, (2, 41)), last, strict=True)]
    ordered = sorted(set(merits))
    scores = [score_of(merit) for merit in ordered]
    assert all(low < high for low, high in pairwise(scores))
    for one, other in combinations(merits, 2):
        assert (one[1:] < other[1:]) == (score_of(one[1:]) < score_of(other[1:]))


def test_what_is_not_a_number_is_the_worst():
    assert score_of((0, math.nan)) == score_of((0, -math.inf)) == -0.5
    assert score_of((-3, math.nan)) > score_of((-4, 1e9))
    assert score_of((math.nan,)) == -math.inf


def test_a_single_number_is_its_own_score():
    assert score_of((0.25,)) == 0.25


def test_a_trial_scores_by_its_mean_or_its_worst_seed():
    outcome = Outcome("completed", [[1.0, 2.0], [3.0, 6.0]])
    assert outcome.score("mean") == 4.0
    assert outcome.score("worst") == 2.0
    assert Outcome("failed").score("mean") == -math.inf


THREE = [Outcome("completed", [[i, 10.0 * i, 100.0 * i]]) for i in (3.0, 1.0, 2.0)]


@pytest.mark.parametrize(
    ("percentile", "least"), [(50.0, [2.0, 20.0, 200.0]), (100.0, [1.0, 10.0, 100.0]), (10.0, [3.0, 30.0, 300.0])]
)
def test_a_training_must_be_among_the_best_so_many(percentile, least):
    others = [Outcome("pruned", [[9.0]]), Outcome("failed")]  # they do not count
    assert least_scores([*THREE, *others], percentile, 3, 0) == least
    assert least_scores([*THREE, *others], percentile, 3, 2) == [-math.inf, -math.inf, least[2]]
    assert least_scores([*THREE[:2], *others], percentile, 3, 0) == []


def test_who_is_below_at_any_validation_is_behind():
    assert not is_behind([2.0, 30.0], [2.0, 20.0, 200.0])
    assert is_behind([1.9, 30.0], [2.0, 20.0, 200.0])
    assert is_behind([2.0, 19.0, 300.0], [2.0, 20.0, 200.0])
    assert not is_behind([2.0], [])
