"""Casters that are only pinned to the platform: against Kane's equations over all bodies, and against rolling ones."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model
from caster_gym.arrays import Array
from caster_gym.mechanics.caster import rates as rolling_rates
from caster_gym.mechanics.caster_masses import without_friction
from caster_gym.mechanics.free_casters import (
    border,
    floor_mobility,
    floor_rows,
    own_inertia,
    slip_energy,
    slip_velocity,
)
from caster_gym.mechanics.ground import joint_motion
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs
from tests.free_motion import carry_casters, slip_dynamics, slip_inertia
from tests.kane_free import FreeKane
from tests.random_robots import CASTER_COUNTS, frictionless, random_motion, random_robot

SEEDS = range(4)


def draw(seed, caster_count):
    """A robot, its numbers, directions, and a motion of which nothing is zero."""
    robot = random_robot(seed, caster_count)
    steering, twist, torque, wrench = random_motion(seed, robot)
    rng = np.random.default_rng((seed, 9))
    rates, floor = rng.uniform(-6.0, 6.0, (caster_count, 2)), rng.uniform(-20.0, 20.0, (caster_count, 2))
    directions = tuple((np.cos(angle), np.sin(angle)) for angle in steering)
    return robot, robot_parameters(robot), directions, steering, twist, rates, torque, floor, wrench


def matrix(m):
    xx, xy, xz, yy, yz, zz = m
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def mobility(k):
    ff, fp, pp = k
    return np.array([[ff, fp], [fp, pp]])


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_motion_is_that_of_all_bodies(seed, caster_count):
    """(S2), (S3), (S6), (S7): Kane's equations without any constraint, whose numbers come from differentiation."""
    robot, numbers, f, steering, twist, rates, torque, floor, wrench = draw(seed, caster_count)
    ours = slip_dynamics(
        tuple(twist),
        f,
        tuple(map(tuple, rates)),
        pairs(tuple(torque)),
        tuple(map(tuple, floor)),
        tuple(wrench),
        numbers,
    )
    body, casters = FreeKane(robot).accelerations(steering, twist, rates, torque, floor, wrench)
    assert_allclose(ours[0], body, rtol=0.0, atol=1e-11 * np.abs(body).max())  # rounding of two ways, of 9 to 13 rows
    assert_allclose(ours[1], casters, rtol=0.0, atol=1e-11 * np.abs(casters).max())


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_slip_energy_and_answer_are_those_of_all_bodies(seed, caster_count):
    """(S1), (S4)"""
    robot, numbers, f, steering, twist, rates, *_ = draw(seed, caster_count)
    kane, own = FreeKane(robot), tuple(map(tuple, rates))
    slips = [slip_velocity(tuple(twist), *one) for one in zip(f, own, numbers.casters, strict=True)]
    assert_allclose(slips, kane.slip(steering, twist, rates), rtol=0.0, atol=1e-14)  # rounding of some dm/s
    assert slip_energy(tuple(twist), f, own, numbers) == pytest.approx(kane.energy(steering, twist, rates), rel=1e-13)
    assert_allclose(matrix(slip_inertia(f, numbers)), kane.inertia_beside(steering), rtol=0.0, atol=1e-12 * 30.0)


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_an_impulse_on_the_platform_leaves_the_momenta_of_the_casters(caster_count):
    """(S4): energy of the change is half the impulse times it, which no other change of the rates would give."""
    _, numbers, f, *_ = draw(5, caster_count)
    impulse = np.array([1.0, -2.0, 0.4])
    change = tuple(np.linalg.solve(matrix(slip_inertia(f, numbers)), impulse))
    still = ((0.0, 0.0),) * caster_count
    carried = carry_casters(change, f, still, numbers)
    energy = slip_energy(change, f, carried, numbers)
    assert energy == pytest.approx(0.5 * impulse @ change, rel=1e-13)
    for i, k in np.ndindex(caster_count, 2):  # the least energy that a twist can have: no rate could be better
        for way in (-1e-3, 1e-3):
            moved: Array = np.array(carried)
            moved[i, k] += way
            assert slip_energy(change, f, tuple(map(tuple, moved)), numbers) > energy


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_with_the_forces_of_rolling_the_wheels_roll(seed, caster_count):
    """(S7): the forces of (G1) to (G4) on the floor make it the robot of (D5), accelerations of the joints included."""
    robot, numbers, f, steering, twist, _, torque, _, wrench = draw(seed, caster_count)
    model, v = Model(robot), tuple(twist)
    own = tuple(rolling_rates(v, *one)[:2] for one in zip(f, numbers.casters, strict=True))
    floor = tuple(map(tuple, model.ground_forces(steering, twist, torque, wrench)))
    ours, casters = slip_dynamics(v, f, own, pairs(tuple(torque)), floor, tuple(wrench), numbers)
    rolls = model.forward_dynamics(steering, twist, torque, wrench)
    assert_allclose(ours, rolls, rtol=0.0, atol=1e-11 * np.abs(rolls).max())  # rounding, as a wheel is light
    joints = [joint_motion(v, tuple(rolls), *one) for one in zip(f, numbers.casters, strict=True)]
    expected = np.array([(one.eta_rate, one.theta_rate) for one in joints])
    assert_allclose(casters, expected, rtol=0.0, atol=1e-11 * np.abs(expected).max())
    assert slip_energy(v, f, own, numbers) == pytest.approx(float(model.kinetic_energy(steering, twist)), rel=1e-13)


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
@pytest.mark.parametrize("seed", SEEDS)
def test_wheels_that_are_held_answer_as_rolling_ones(seed, caster_count):
    """(S5): S + Σ G̃ᵀ K⁻¹ G̃ is the M of (D3)."""
    robot, numbers, f, steering, *_ = draw(seed, caster_count)
    answer = matrix(slip_inertia(f, numbers))
    for direction, caster in zip(f, numbers.casters, strict=True):
        own = own_inertia(without_friction(caster), caster)
        rows: Array = np.array(floor_rows(direction, border(direction, own, caster), caster))
        answer = answer + rows.T @ np.linalg.solve(mobility(floor_mobility(own, caster)), rows)
    expected = Model(robot).inertia(steering)
    assert_allclose(answer, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())


def test_without_forces_energy_stays():
    """Power of the forces that turn momenta is zero: the accelerations of a free motion change no energy."""
    robot = frictionless(random_robot(6, 4))
    numbers = robot_parameters(robot)
    steering, twist, *_ = random_motion(6, robot)
    f = tuple((np.cos(angle), np.sin(angle)) for angle in steering)
    rates = np.random.default_rng(6).uniform(-6.0, 6.0, (4, 2))
    none = ((0.0, 0.0),) * 4
    body, casters = slip_dynamics(tuple(twist), f, tuple(map(tuple, rates)), none, none, (0.0, 0.0, 0.0), numbers)
    h = 1e-6  # [s] central differences: an error of h²

    def energy(t):
        turned = tuple(
            (np.cos(angle + t * (eta - twist[2])), np.sin(angle + t * (eta - twist[2])))
            for angle, eta in zip(steering, rates[:, 0], strict=True)
        )
        moving = tuple(map(tuple, rates + t * np.array(casters)))
        return slip_energy(tuple(twist + t * np.array(body)), turned, moving, numbers)

    power = (energy(h) - energy(-h)) / (2.0 * h)
    assert abs(power) < 1e-6 * energy(
        0.0
    )  # rounding of 1e-16 over the step of 1e-6, some digits left; watts without (S6)
