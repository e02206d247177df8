"""brief: values in messages are short, however large they are."""

import pytest

from caster_gym.brief import LONGEST_VALUE, brief, cut


@pytest.mark.parametrize("value", [1.5, "word", None, [1, 2], {"a": (1,)}])
def test_short_values_are_shown_as_python_writes_them(value):
    assert brief(value) == repr(value)


@pytest.mark.parametrize(
    "value", ["x" * 10_000, list(range(10_000)), {"a": ["x" * 300] * 300}, 10**300, [[[[[1]]]]] * 50]
)
def test_large_values_are_cut(value):
    assert len(brief(value)) <= LONGEST_VALUE


def test_texts_are_cut_with_an_ellipsis():
    assert cut("abcdef", 6) == "abcdef"
    assert cut("abcdefg", 6) == "abcde…"


class Silent:
    """Says nothing of itself."""


def test_objects_and_functions_appear_by_name_not_by_their_place_in_memory():
    assert brief(Silent()) == "an object of class Silent"
    assert brief([Silent]) == repr([Silent])
    assert brief(len) == "the function len"
    assert brief({"one": test_texts_are_cut_with_an_ellipsis}).endswith(
        "the function test_texts_are_cut_with_an_ellipsis}"
    )
