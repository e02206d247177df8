"""caster_gym.envs.rows: rows come from the fields of named tuples, in the order of their numbers."""

from typing import NamedTuple

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.envs.rows import check_names, flat, numbered, span
from caster_gym.mechanics.scalars import Scalar


class Inner(NamedTuple):
    a: Scalar
    b: Scalar


class Outer(NamedTuple):
    first: Scalar
    inner: Inner
    last: Scalar


class Wrong(NamedTuple):
    pair: tuple[Scalar, Scalar]


def test_each_number_is_found_in_the_row_of_its_name():
    """Whoever writes flat tuples and whoever reads by rows walks over the same fields."""
    values = Outer(10.0, Inner(20.0, 30.0), 40.0)
    array, rows = np.array(flat(values)), numbered(Outer)
    assert array[rows.first] == values.first and array[rows.last] == values.last
    assert (array[rows.inner.a], array[rows.inner.b]) == values.inner
    assert_array_equal(array[span(rows.inner)], values.inner)
    assert flat(rows) == tuple(range(len(array)))
    assert numbered(Outer, 5).inner.b == rows.inner.b + 5


def test_rows_that_do_not_follow_each_other_are_no_span():
    rows = numbered(Outer)
    with pytest.raises(ValueError, match=r"rows \(0, 3\) do not follow each other"):
        span((rows.first, rows.last))


def test_a_field_that_is_no_number_and_no_named_tuple_is_refused():
    with pytest.raises(TypeError, match="field 'pair' of Wrong must be a number or a named tuple"):
        numbered(Wrong)


def test_names_that_differ_are_both_told():
    check_names(("a", "b"), "fields", ("a", "b"), "columns")
    with pytest.raises(TypeError, match=r"fields \(a, b\) must be columns \(a, c\)"):
        check_names(("a", "b"), "fields", ("a", "c"), "columns")
