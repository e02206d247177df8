"""Both plants behind the same functions."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.mechanics.floor import Surface
from caster_gym.mechanics.free_casters import slip_energy
from caster_gym.mechanics.grip_or_slip import free_step, power, response, step_with_use, step_with_use_apart
from caster_gym.mechanics.integration import State, rk4_step
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.mechanics.slip_state import rolling_state
from tests.random_robots import CASTER_COUNTS, frictionless, random_motion, random_robot

NOTHING = (0.0, 0.0, 0.0)


def moving(seed, caster_count):
    """A robot without friction, its numbers, a state whose wheels roll, torques and a wrench."""
    robot = frictionless(random_robot(seed, caster_count))
    steering, twist, torque, wrench = random_motion(seed, robot)
    f = tuple((np.cos(angle), np.sin(angle)) for angle in steering)
    state = State((0.0, 0.0), (1.0, 0.0), tuple(twist), f)
    return robot_parameters(robot), state, pairs(tuple(torque)), tuple(wrench)


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_without_friction_the_motors_work_is_the_energy_gained(caster_count):
    """Of wheels that turn by themselves, on a floor that holds nothing."""
    numbers, rolling, torques, _ = moving(3, caster_count)
    state, ice = rolling_state(rolling, numbers), Surface((0.0,) * caster_count, 0.01)
    h = 1e-4
    end = free_step(state, torques, NOTHING, h, numbers, ice)
    before, after = (slip_energy(one.twist, one.directions, one.rates, numbers) for one in (state, end))
    mean = 0.5 * (power(state, torques, numbers, ice) + power(end, torques, numbers, ice))
    assert after - before == pytest.approx(h * mean, rel=1e-4)  # of second order in the step


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_a_floor_that_grips_is_no_other_plant(caster_count):
    numbers, state, torques, wrench = moving(4, caster_count)
    expected = rk4_step(state, torques, wrench, 1e-3, numbers)
    for step in (free_step, lambda *given: step_with_use(*given)[0], lambda *given: step_with_use_apart(*given)[0]):
        assert step(state, torques, wrench, 1e-3, numbers, None) == expected


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_a_great_friction_answers_like_a_floor_that_grips(caster_count):
    """To first order in the step: what a push meets, and where the robot would be without it."""
    numbers, rolling, torques, wrench = moving(5, caster_count)
    state, h = rolling_state(rolling, numbers), 1e-5
    twist, answer = response(state, torques, wrench, h, numbers, Surface((1e6,) * caster_count, 0.01))
    expected, inertia = response(rolling, torques, wrench, h, numbers, None)
    change = np.abs(np.subtract(expected, rolling.twist)).max()
    assert_allclose(twist, expected, rtol=0.0, atol=1e-2 * change)
    assert_allclose(answer, inertia, rtol=0.0, atol=1e-3 * np.abs(inertia).max())


def test_the_floor_gives_what_it_has_and_no_more():
    """Its use is 1 where a wheel slides, and less where all are held."""
    numbers, rolling, torques, _ = moving(6, 4)
    state = rolling_state(rolling, numbers)
    uses = []
    for friction in (0.01, 50.0):
        _, asked = step_with_use(state, torques, NOTHING, 1e-3, numbers, Surface((friction,) * 4, 0.01))
        uses.append(asked.traction)
    assert uses[0] == pytest.approx(1.0, abs=1e-12)
    assert uses[1] < 0.5
