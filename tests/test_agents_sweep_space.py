"""caster_gym.agents.sweep.space: dimensions are read as they are meant, and settings change where their keys lead."""

from typing import Any

import pytest
from pydantic import TypeAdapter, ValidationError

from caster_gym.agents.sweep.space import Choices, Dimension, Range, WholeRange, with_settings
from caster_gym.configuration import ConfigurationError, Frozen, parse

CONTENT: dict[str, Any] = {
    "gamma": 0.9,
    "learning_rate": {"start": 1e-3, "end": 0.0},
    "train": [{"seed": 0}, {"seed": 1}],
}


class Space(Frozen):
    space: dict[str, Dimension]


def read(content):
    return parse(Space, {"space": {"agent.x": content}}, "file").space["agent.x"]


@pytest.mark.parametrize(
    ("content", "dimension"),
    [
        ({"low": 1, "high": 8}, WholeRange(low=1, high=8)),
        ({"low": 1, "high": 8, "log": True}, WholeRange(low=1, high=8, log=True)),
        ({"low": 0, "high": 8, "step": 2}, WholeRange(low=0, high=8, step=2)),
        ({"low": 1.0, "high": 8}, Range(low=1.0, high=8.0)),
        ({"low": 0, "high": 1, "step": 0.25}, Range(low=0.0, high=1.0, step=0.25)),
        ({"choices": [[64, 64], "auto", None, True]}, Choices(choices=([64, 64], "auto", None, True))),
    ],
)
def test_a_dimension_is_of_the_kind_that_is_meant(content, dimension):
    found = read(content)
    assert type(found) is type(dimension) and found == dimension
    assert TypeAdapter(Dimension).validate_python(found) == found


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"low": 3, "high": 3}, "'low' must be below 'high', got 3 and 3"),
        ({"low": 0.0, "high": 1.0, "log": True}, "'low' must be positive where 'log' is true, got 0"),
        ({"low": 1, "high": 9, "log": True, "step": 2}, "'step' is for ranges without 'log'"),
        ({"choices": [1, 2, 1]}, "'choices' must differ"),
        ({"choices": []}, "should have at least 1 item, got 0"),
        ({"low": 1}, "'space.agent.x.high' is missing"),
        ({"low": 1, "high": 2, "lag": True}, "unknown key"),
        (3, "should be a mapping"),
    ],
)
def test_what_is_no_dimension_is_told(content, words):
    with pytest.raises(ConfigurationError) as caught:
        read(content)
    assert words in str(caught.value)


def test_choices_of_any_kind_come_back():
    """Databases know them by words."""
    choices = ([64, 64], [128], "auto", 0.5, None, True, {"start": 1e-3})
    dimension = Choices(choices=choices)
    distribution: Any = dimension.distribution
    labels = distribution.choices
    assert all(isinstance(one, str) for one in labels)
    assert [dimension.value(one) for one in labels] == list(choices)


def test_a_step_ends_at_the_last_number_that_it_reaches():
    assert read({"low": 1, "high": 8, "step": 3}).distribution.high == 7


def test_settings_change_where_their_keys_lead_and_nowhere_else():
    before = {**CONTENT}
    changed = with_settings(CONTENT, {"learning_rate.start": 2e-3, "train.1.seed": 7, "task.preview.steps": 4})
    assert changed == {
        "gamma": 0.9,
        "learning_rate": {"start": 2e-3, "end": 0.0},
        "train": [{"seed": 0}, {"seed": 7}],
        "task": {"preview": {"steps": 4}},
    }
    assert before == CONTENT == {**CONTENT, "learning_rate": {"start": 1e-3, "end": 0.0}}


@pytest.mark.parametrize("key", ["train.2.seed", "train.x.seed", "train.-1"])
def test_items_that_are_not_there_are_told(key):
    with pytest.raises(ConfigurationError, match="is no item of a list of 2, counted from 0"):
        with_settings(CONTENT, {key: 1})


def test_dimensions_are_frozen():
    with pytest.raises(ValidationError):
        Range(low=0.0, high=1.0).low = 0.5
