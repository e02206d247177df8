"""Choices, roots and loops mean the same for floats, arrays and tensors."""

import numpy as np
import pytest
import torch

import caster_gym.engines.torch_model  # noqa: F401  teaches the choices and roots of tensors
from caster_gym.mechanics.scalars import absolute, add, clip, each, flatten, maximum, minimum, pairs, sqrt, total, where

SAMPLES = (-2.0, -0.0, 0.0, 0.5, 3.0)


@pytest.mark.parametrize("kind", [float, np.array, np.float64, lambda x: torch.tensor(x, dtype=torch.float64)])
def test_choices_and_roots_agree_with_pythons_own(kind):
    for a in SAMPLES:
        assert float(absolute(kind(a))) == abs(a)
        assert float(sqrt(kind(abs(a)))) == np.sqrt(abs(a))
        assert float(clip(kind(a), kind(-1.0), kind(1.0))) == min(max(a, -1.0), 1.0)
        for b in SAMPLES:
            assert float(minimum(kind(a), kind(b))) == min(a, b)
            assert float(maximum(kind(a), kind(b))) == max(a, b)
            assert float(where(kind(a) < kind(b), kind(1.0), kind(2.0))) == (1.0 if a < b else 2.0)


def test_choices_work_element_by_element():
    a, b = np.array([1.0, 5.0]), np.array([2.0, -3.0])
    assert list(minimum(a, b)) == [1.0, -3.0]
    assert list(maximum(torch.tensor(a), torch.tensor(b))) == [2.0, 5.0]


@pytest.mark.parametrize("kind", [float, np.array, torch.tensor])
def test_a_number_that_is_none_gives_way_to_the_bound(kind):
    """A comparison with NaN is false, so that the second argument is taken, in every engine."""
    assert float(maximum(kind(np.nan), kind(1.0))) == 1.0
    assert float(minimum(kind(np.nan), kind(1.0))) == 1.0


def test_loops_over_casters_keep_their_order():
    assert each(lambda h, a, b: h * a - b, (10,), (1, 2), (3, 4)) == (7, 16)
    assert add((1, 2), (3, 4)) == (4, 6)
    assert total(((1, 2), (3, 4), (5, 6))) == (9, 12)
    assert pairs((1, 2, 3, 4)) == ((1, 2), (3, 4))
    assert flatten(((1, 2), (3, 4))) == (1, 2, 3, 4)


def test_columns_of_unequal_length_are_refused():
    """A robot of three casters with the directions of two is a mistake, not a smaller robot."""
    with pytest.raises(ValueError, match="shorter"):
        each(lambda a, b: a, (), (1, 2, 3), (1, 2))
