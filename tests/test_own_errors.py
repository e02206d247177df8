"""caster_gym.own_errors: what code of users raises is told in a sentence, with the line of theirs."""

import inspect

import numpy as np
import pytest
from pydantic import BaseModel

from caster_gym.own_errors import OwnCodeError, in_own_code


class Springs:
    def push(self, x):
        return np.linalg.inv(x)

    def refuse(self):
        raise ValueError("not at this speed")


def line_of(method):
    return inspect.getsourcelines(method)[1] + 1


def test_an_error_within_a_library_is_placed_at_the_line_of_the_user_that_called_it():
    with pytest.raises(OwnCodeError) as caught, in_own_code("the agent 'springs'", Springs):
        Springs().push(np.zeros((2, 2)))
    where = f"{__file__}, line {line_of(Springs.push)}"
    assert str(caught.value) == f"the agent 'springs': LinAlgError: Singular matrix ({where})"
    assert isinstance(caught.value.__cause__, np.linalg.LinAlgError)


def test_a_sentence_of_the_user_keeps_its_words_and_gets_its_place():
    message = rf"ValueError: not at this speed \(.*, line {line_of(Springs.refuse)}\)"
    with pytest.raises(OwnCodeError, match=message), in_own_code("the agent 'springs'", Springs):
        Springs().refuse()


def test_without_a_line_of_the_user_the_last_line_is_named():
    message = r"crate 1: ZeroDivisionError: division by zero \(.*test_own_errors\.py, line"
    with pytest.raises(OwnCodeError, match=message), in_own_code("crate 1", int):
        1 / 0  # noqa: B018


def test_a_setting_without_a_type_is_told_how_to_write_one():
    message = r"`stiffness = 100\.0`.*: write `name: type = value`, as in `speed: float = 1\.0` \(.*\.py, line \d+\)$"
    with pytest.raises(OwnCodeError, match=message), in_own_code("module 'springs'", Springs):
        type("Stiff", (BaseModel,), {"__module__": __name__, "stiffness": 100.0})


def test_an_interruption_is_no_error_of_the_user():
    with pytest.raises(KeyboardInterrupt), in_own_code("the agent 'springs'", Springs):
        raise KeyboardInterrupt
