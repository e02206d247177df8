"""The papers' letters: what they call the same caster, and the robots that they assume."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.notation import (
    CHUNG2008,
    KIM2001,
    Lengths,
    in_letters,
    in_words,
    kim2001_robot,
    lengths_of,
)
from tests.random_robots import random_robot

ROUNDING = 1e-12  # [-] of numbers of order 1


@pytest.mark.parametrize("notation", [CHUNG2008, KIM2001])
def test_translating_twice_changes_nothing(notation):
    angles = np.linspace(-4.0, 4.0, 17)
    assert_allclose(notation.steering(notation.steering(angles)), angles, atol=ROUNDING)
    assert_allclose(notation.rates @ notation.rates, np.eye(3), atol=0.0)


@pytest.mark.parametrize(
    ("notation", "phi", "to_pivot"),
    [
        (CHUNG2008, 0.0, (-1.0, 0.0)),  # O_1A_1 of (6): −d cos φ i + d sin φ j
        (CHUNG2008, 0.5 * np.pi, (0.0, 1.0)),
        (KIM2001, 0.0, (0.0, 1.0)),  # O_wO_s of (6): d sin φ x + d cos φ y
        (KIM2001, 0.5 * np.pi, (1.0, 0.0)),
    ],
)
def test_the_steering_link_lies_as_the_paper_says(notation, phi, to_pivot):
    delta = notation.steering(phi)
    assert_allclose([np.cos(delta), np.sin(delta)], to_pivot, atol=ROUNDING)


@pytest.mark.parametrize("notation", [CHUNG2008, KIM2001])
def test_rates_of_both_papers_obey_their_loop(notation):
    """ω = η̇ + φ̇ of both papers, in Jacobians and their inverses, for any robot."""
    robot = random_robot(51, 4)
    phi = np.random.default_rng(1).uniform(-3.0, 3.0, (20, 4))
    forward, inverse = notation.forward_jacobian(robot, phi), notation.inverse_jacobian(robot, phi)
    assert_allclose(inverse[..., 0, :] + inverse[..., 2, :], np.broadcast_to([0.0, 0.0, 1.0], (20, 4, 3)), atol=1e-12)
    assert_allclose(forward[..., 2, :], np.broadcast_to([1.0, 0.0, 1.0], (20, 4, 3)), atol=0.0)
    product = forward @ inverse
    assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=ROUNDING)


@pytest.mark.parametrize(("notation", "sign"), [(CHUNG2008, -1.0), (KIM2001, 1.0)])
def test_rates_keep_their_meaning(notation, sign):
    """η̇ is the same everywhere, φ̇ is −δ̇, and θ̇ has the paper's sign."""
    robot = load_robot("chung2008")
    phi, twist = np.array([0.3, -1.0, 2.0]), np.array([0.2, -0.4, 0.7])
    eta, theta, delta = Model(robot).rates(notation.steering(phi), twist)
    found = notation.inverse_jacobian(robot, phi) @ twist
    assert_allclose(found.T, [eta, sign * theta, -delta], atol=1e-12)


@pytest.mark.parametrize("notation", [CHUNG2008, KIM2001])
def test_hessians_are_derivatives_with_respect_to_the_papers_angles(notation):
    """(18) by central differences in φ; (19) undoes it: q̈ = 0 where ν̇ = φ̇ᵀ H φ̇."""
    robot = load_robot("chung2008")
    phi, twist, step = np.array([0.3, -1.0, 2.0]), np.array([0.2, -0.4, 0.7]), 1e-6
    hessian = notation.forward_hessian(robot, phi)
    change = notation.forward_jacobian(robot, phi + step) - notation.forward_jacobian(robot, phi - step)
    assert_allclose(hessian[..., 2], change / (2.0 * step), atol=1e-9)  # rounding 1e-16 / step
    inverse = notation.inverse_jacobian(robot, phi)
    rates = inverse @ twist
    twist_rate = np.einsum("ij,ikjl,il->ik", rates, hessian, rates)
    drift = np.einsum("m,ijmn,n->ij", twist, notation.inverse_hessian(robot, phi), twist)
    assert_allclose(np.einsum("ijk,ik->ij", inverse, twist_rate), -drift, rtol=1e-12, atol=1e-10)
    over_ground = np.einsum("ij,ikjl,il->ik", rates, notation.inertial_hessian(robot, phi), rates) - twist_rate
    expected = twist[2] * np.array([-twist[1], twist[0], 0.0])  # ω ẑ × v
    assert_allclose(over_ground, np.broadcast_to(expected, (3, 3)), atol=1e-11)  # of terms up to 1e2


def test_joints_in_letters_and_words():
    assert in_letters(("roll_1", "steer_1", "roll_2")) == "(θ_1, φ_1, θ_2)"
    assert in_words("θ_1 φ_1 θ_2") == ("roll_1", "steer_1", "roll_2")


def test_the_robot_of_kim2001_is_an_equilateral_triangle():
    """b = 2a, l = 2√3 a: sides of l, C at the centre, all pivots at the distance b."""
    robot = kim2001_robot(radius=0.3, trail=0.7, a=0.5)
    assert_allclose(lengths_of(robot), Lengths(np.sqrt(3.0), 0.5, 1.0, 0.3, 0.7), rtol=1e-15)
    pivots = np.array([(caster.x, caster.y) for caster in robot.casters])
    assert_allclose(pivots.mean(axis=0), 0.0, atol=1e-15)
    assert_allclose(np.hypot(*pivots.T), 1.0, rtol=1e-15)
    assert_allclose(np.hypot(*(pivots - np.roll(pivots, 1, axis=0)).T), np.sqrt(3.0), rtol=1e-15)
    assert robot.driven == robot.joints


def test_lengths_of_chung2008_are_those_of_its_table_1():
    assert lengths_of(load_robot("chung2008")) == Lengths(l=0.173, a=0.05, b=0.1, r=0.025, d=0.025)


@pytest.mark.parametrize("name", ["radius", "trail", "a"])
@pytest.mark.parametrize("value", [0.0, -0.1, float("nan"), float("inf")])
def test_a_length_that_is_none_is_refused(name, value):
    with pytest.raises(ValueError, match=f"{name} must be a positive length, got {value}"):
        kim2001_robot(**{"radius": 0.1, "trail": 0.1, "a": 1.0, name: value})


def test_robots_of_another_geometry_are_refused():
    robot = kim2001_robot(0.3, 0.7)

    def changed(number, **values):
        casters = [c.model_copy(update=values if i == number else {}) for i, c in enumerate(robot.casters)]
        return robot.model_copy(update={"casters": tuple(casters)})

    with pytest.raises(ValueError, match="for 3 casters, robot 'random_52' has 4"):
        lengths_of(random_robot(52, 4))
    with pytest.raises(ValueError, match=r"pivots must be \(−l/2, −a\), \(l/2, −a\) and \(0, b\), robot 'kim2001'"):
        lengths_of(changed(2, x=0.1))
    for values in ({"radius": 0.2}, {"trail": 0.2}, {"offset": 0.01}):
        (name, value) = next(iter(values.items()))
        with pytest.raises(ValueError, match=f"one radius, one trail and no lateral offset.*{name} {value:g}"):
            lengths_of(changed(1, **values))


@pytest.mark.parametrize("letters", ["x_1", "θ1", "θ_", "θ_1 η_2", "roll_1"])
def test_what_is_no_joint_of_the_papers_is_named(letters):
    with pytest.raises(ValueError, match=f"a letter θ or φ with a number, such as θ_1, got '{letters.split()[-1]}'"):
        in_words(letters)


def test_a_robot_that_is_only_drawn_gives_no_warning():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        kim2001_robot(radius=0.1, trail=10.0)
