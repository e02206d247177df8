"""Choices, roots and loops mean the same for floats, arrays and tensors."""

from decimal import Decimal

import numpy as np
import pytest
import torch

import caster_gym.engines.tensor.model  # noqa: F401  teaches the choices and roots of tensors
from caster_gym import load_robot
from caster_gym.mechanics.dynamics import joint_friction
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import (
    absolute,
    add,
    anywhere,
    clip,
    each,
    flatten,
    maximum,
    minimum,
    pairs,
    register,
    sqrt,
    total,
    where,
)

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


class Unheard:
    """A scalar that nobody registered: it compares, is true and becomes a float, as symbols of some packages do."""

    def __lt__(self, other):
        return self

    def __float__(self):
        return float("nan")


class Carrying(float):
    """A float that carries more than its value, which `math.sqrt` would lose."""


@pytest.mark.parametrize("value", [Unheard(), Carrying(2.0), Decimal(2), "2", None, [4.0], 2j])
@pytest.mark.parametrize("use", [sqrt, anywhere, lambda x: where(x, 1.0, 2.0)])
def test_scalars_of_a_kind_that_nobody_registered_are_refused(use, value):
    with pytest.raises(TypeError, match=rf"scalars of the kind [\w.]+\.{type(value).__name__} .*scalars.register"):
        use(value)


def test_the_equations_refuse_what_nobody_registered():
    """Not a number would come out otherwise, and go on."""
    caster = robot_parameters(load_robot("tidybot2")).casters[0]
    with pytest.raises(TypeError, match="Squarable choose and take roots"):
        joint_friction(1.0, caster.roll_viscous, caster.roll_coulomb, Squarable())


class Squarable(Unheard):
    def __mul__(self, other):
        return self

    __rmul__ = __add__ = __radd__ = __mul__


def test_a_registered_kind_and_its_subclasses_are_asked():
    class Heard(Unheard):
        pass

    class Nearer(Heard):
        pass

    class Nearest(Nearer):
        pass

    register(Heard, lambda c, yes, no: "chosen", lambda x: "root", lambda c: True)
    one = Nearest()
    assert (sqrt(one), where(one, 1, 2), anywhere(one)) == ("root", "chosen", True)
    register(Nearer, lambda c, yes, no: "nearer", lambda x: "nearer", lambda c: False)  # what was looked up is not kept
    assert (sqrt(one), where(one, 1, 2), anywhere(one)) == ("nearer", "nearer", False)
    assert sqrt(Heard()) == "root"
    assert where(True, one, 2) is one  # a number decides, whatever it chooses from
    with pytest.raises(TypeError, match="Unheard"):
        sqrt(Unheard())


def test_subclasses_of_arrays_and_tensors_keep_what_they_carry():
    """A root by Python's float would take the gradient away from a parameter, or fail on an array."""
    x = torch.nn.Parameter(torch.tensor(4.0))
    sqrt(x).backward()
    assert x.grad == 0.25

    class Marked(np.ndarray):
        pass

    marked = np.array([4.0, 9.0]).view(Marked)
    assert isinstance(sqrt(marked), Marked)
    assert list(sqrt(marked)) == [2.0, 3.0]


@pytest.mark.parametrize("kind", [int, float, np.float32, np.float64, np.int32, np.longdouble])
def test_numbers_need_no_registering(kind):
    assert sqrt(kind(4)) == 2.0
    assert where(kind(1), 3.0, 5.0) == 3.0
    assert anywhere(kind(0)) is False
    assert where(np.bool_(False), 3.0, 5.0) == 5.0
