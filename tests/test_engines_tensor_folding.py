"""Zeros are taken out of what Torch compiles, and nothing else changes."""

from typing import Any

import torch
from numpy.testing import assert_array_equal

from caster_gym.engines.tensor.folding import Folding

X, Y = torch.linspace(-2.0, 3.0, 7), torch.linspace(1.0, 4.0, 7)


def folded(function, *arguments):
    """What a function gives after the pass, and the arithmetic that is left of it."""
    left: list[Any] = []

    def backend(module, _):
        Folding()(module.graph)
        module.recompile()
        left.extend(node.target.__name__ for node in module.graph.nodes if node.op == "call_function")
        return module.forward

    torch.compiler.reset()
    return torch.compile(function, backend=backend, fullgraph=True)(*arguments), left


def test_terms_with_a_zero_vanish_and_the_sum_stays():
    def friction(x, y):
        return x * y + 0.0 * (x / y) - 0.0 * y * x + (x - 0.0 * y) * 1.0

    result, left = folded(friction, X, Y)
    assert_array_equal(result, friction(X, Y))
    assert sorted(left) == ["add", "mul"]


def test_a_quotient_of_zero_vanishes_and_one_by_zero_does_not():
    result, left = folded(lambda x, y: x + (0.0 * x) / y, X, Y)
    assert_array_equal(result, X)
    assert left == []
    result, left = folded(lambda x: x / (x * 0.0), Y)
    assert torch.isinf(result).all()
    assert "truediv" in left


def test_a_result_that_is_zero_keeps_its_shape():
    result, _ = folded(lambda x: x * 0.0, X)
    assert_array_equal(result, torch.zeros_like(X))


def test_what_is_spread_over_robots_stays_spread():
    """(7,) + 0 · (3, 1) has the shape (3, 7), whatever the zero says."""
    result, _ = folded(lambda x, y: x + 0.0 * y, X, torch.ones(3, 1))
    assert result.shape == (3, 7)


def test_products_with_other_numbers_stay():
    result, left = folded(lambda x, y: 2.0 * x - y / 3.0, X, Y)
    assert_array_equal(result, 2.0 * X - Y / 3.0)
    assert sorted(left) == ["mul", "sub", "truediv"]


def filled(x):
    y = 0.0 * x
    y[0] = 5.0
    return y + x


def grown(x):
    y = 1.0 * x
    y += 1.0
    return y.add_(x)


def test_graphs_that_write_into_tensors_are_left_alone():
    for function in (filled, grown):
        mine = X.clone()
        result, _ = folded(function, mine)
        assert_array_equal(result, function(X.clone()))
        assert_array_equal(mine, X)


def test_whole_numbers_stay_whole():
    whole = torch.arange(4)
    result, _ = folded(lambda i: (0 * i) - i, whole)
    assert result.dtype == torch.int64
    assert_array_equal(result, -whole)
