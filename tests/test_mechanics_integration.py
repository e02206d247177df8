"""(I1), (I2): motion through time, with directions instead of angles."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.integration import (
    State,
    pack_state,
    rk4_step,
    runge_kutta,
    state_at_rest,
    state_rows,
    unit,
    unpack_state,
)
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.slip_state import rolling_state, unpack_slip_state
from tests.kane import Kane
from tests.random_robots import frictionless, random_motion, random_robot


def start(robot, seed, speed=0.5):
    """A state somewhere in the world and torques that move it on."""
    steering, twist, torque, _ = random_motion(seed, robot)
    return np.concatenate(([0.3, -0.2, 2.0], speed * twist, steering)), 0.2 * torque


@pytest.mark.parametrize("caster_count", [2, 3])
def test_a_state_has_as_many_numbers_as_are_counted_whether_wheels_slip_or_not(caster_count):
    rolling = state_at_rest(caster_count)
    slipping = rolling_state(rolling, robot_parameters(random_robot(70, caster_count)))
    for state, slips, unpack in ((rolling, False, unpack_state), (slipping, True, unpack_slip_state)):
        numbers = pack_state(state)
        assert len(numbers) == state_rows(caster_count, slips)
        assert unpack(numbers) == state


def energies(model, states):
    return model.kinetic_energy(states[..., 6:], states[..., 3:6])


@pytest.mark.parametrize("caster_count", [2, pytest.param(3, marks=pytest.mark.slow)])
def test_energy_is_kept_without_actuation_or_friction(caster_count):
    """Ten seconds of free motion; at a step of 2 ms the method itself loses some 1e-11."""
    model = Model(frictionless(random_robot(71, caster_count)))
    state, torque = start(model.robot, 71)
    states = model.simulate(state, 0.0 * torque, 2e-3, 5000)
    assert np.hypot(*(states[-1] - states[0])[:2]) > 0.5  # m: it does move
    assert_allclose(energies(model, states), energies(model, state), rtol=1e-9)


@pytest.mark.slow
def test_energy_of_the_published_robot_is_kept():
    """Its trail of 25 mm turns casters within 25 ms at 1 m/s, so that a step of 2 ms loses a little more: 1e-9."""
    model = Model(load_robot("chung2008"))
    states = model.simulate([0.0, 0.0, 0.0, 0.3, 0.1, 0.4, 0.5, 1.0, 2.0], np.zeros(6), 2e-3, 5000)
    assert_allclose(energies(model, states), energies(model, states[0]), rtol=1e-9)


def test_energy_grows_by_the_work_of_torques_less_that_of_friction():
    """Along a driven motion: work summed by Simpson's rule over states 2 ms apart, good to 1e-6 of the turnover."""
    model = Model(random_robot(72, 3))
    state, torque = start(model.robot, 72)
    states = model.simulate(state, torque, 2e-3, 500)
    twist, steering = states[:, 3:6], states[:, 6:]
    _, theta, delta = model.rates(steering, twist)
    power = theta @ torque[::2] + delta @ torque[1::2] - (twist * model.friction(steering, twist)).sum(-1)
    weights = np.r_[1.0, np.tile([4.0, 2.0], 249), 4.0, 1.0] * 2e-3 / 3.0
    change = energies(model, states[-1]) - energies(model, state)
    assert_allclose(change, weights @ power, rtol=0.0, atol=1e-6 * (weights @ np.abs(power)))


def test_the_integrator_is_of_fourth_order():
    """Halving the step divides the error by about 16; the slope of all errors is 4 within the next order's share."""
    model = Model(frictionless(random_robot(73, 3)))  # smooth: dry friction would need steps far below its passage
    state, torque = start(model.robot, 73)
    steps = np.array([25, 50, 100, 200])
    exact = model.simulate(state, torque, 0.2 / 3200, 3200)[-1]
    errors = [np.linalg.norm(model.simulate(state, torque, 0.2 / n, n)[-1] - exact) for n in steps]
    assert errors[-1] > 1e-13  # above rounding
    ratios = np.divide(errors[:-1], errors[1:])
    assert ((ratios > 12.0) & (ratios < 20.0)).all()
    assert_allclose(-np.polyfit(np.log(steps), np.log(errors), 1)[0], 4.0, atol=0.2)


def test_a_short_step_follows_the_oracle():
    """The state's rate of change is that of Kane's equations and of the plane's geometry."""
    robot = random_robot(74, 4)
    model, oracle = Model(robot), Kane(robot)
    state, torque = start(robot, 74, speed=1.0)
    beta, twist, steering = state[2], state[3:6], state[6:]
    h = 1e-4  # s: central differences, whose truncation is h² times the third derivative, some 1e3 per second cubed
    ahead = model.simulate(state, torque, h, 1)[-1]
    turn = np.array([[np.cos(beta), -np.sin(beta)], [np.sin(beta), np.cos(beta)]])
    expected = np.concatenate(
        (
            turn @ twist[:2],
            twist[2:],
            oracle.forward_dynamics(steering, twist, torque, np.zeros(3)),
            oracle.rates(steering, twist)[2],
        )
    )
    once, twice = (ahead - state) / h, (model.simulate(state, torque, 2.0 * h, 1)[-1] - state) / (2.0 * h)
    assert_allclose(2.0 * once - twice, expected, atol=1e-4 * np.abs(expected).max())


def test_motion_does_not_depend_on_where_the_world_is():
    """Turning and shifting the start turns and shifts the path, and twist and steering stay the same."""
    model = Model(random_robot(75, 3))
    state, torque = start(model.robot, 75)
    angle, shift = 1.1, np.array([3.0, -2.0])
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    moved = np.concatenate((turn @ state[:2] + shift, [state[2] + angle], state[3:]))
    one, other = (model.simulate(s, torque, 2e-3, 200) for s in (state, moved))
    assert_allclose(other[:, :2], one[:, :2] @ turn.T + shift, atol=1e-12)  # rounding of metres
    assert_allclose(other[:, 2], one[:, 2] + angle, atol=1e-12)
    assert_allclose(other[:, 3:], one[:, 3:], rtol=0.0, atol=0.0)  # the pose does not enter the dynamics


def test_angles_are_continuous_and_count_their_turns():
    """A robot that spins in place turns through several revolutions, as its yaw rate says."""
    model = Model(load_robot("chung2008"))
    around = np.arctan2([c.y for c in model.robot.casters], [c.x for c in model.robot.casters])
    states = model.simulate(np.r_[0.0, 0.0, 0.0, 0.0, 0.0, 5.0, around + 0.5 * np.pi], np.zeros(6), 5e-3, 1000)
    assert states[-1, 2] > 3.0 * 2.0 * np.pi
    turned = np.concatenate(([0.0], np.cumsum(0.5 * 5e-3 * (states[1:, 5] + states[:-1, 5]))))
    assert_allclose(states[:, 2], turned, atol=1e-3)  # rad: the trapezoidal rule while the casters settle
    assert np.abs(np.diff(states[:, 6:], axis=0)).max() < 1.0


def test_directions_keep_their_length():
    """(I2): one Newton step leaves 3/2 (|f| − 1)² of a wrong length."""
    for length in (0.99, 1.001, 1.0):
        c, s = unit((0.6 * length, 0.8 * length))
        assert_allclose(np.hypot(c, s), 1.0, atol=1.6 * (length - 1.0) ** 2 + 1e-15)
        assert_allclose(c * 0.8, s * 0.6, rtol=1e-15)


def test_directions_stay_of_length_one_over_many_steps():
    robot = random_robot(76, 3)
    parameters = robot_parameters(robot)
    steering, twist, torque, _ = random_motion(76, robot)
    now = State((0.0, 0.0), (1.0, 0.0), tuple(twist), tuple((np.cos(a), np.sin(a)) for a in steering))
    for _ in range(300):
        now = rk4_step(now, tuple(map(tuple, torque.reshape(-1, 2))), (0.0, 0.0, 0.0), 5e-3, parameters)
        for c, s in (now.heading, *now.directions):
            # a step turns by up to 0.5 rad, where RK4 misses the circle by 0.5⁶/144 and (I2) squares that
            assert abs(c * c + s * s - 1.0) < 1e-7


def test_a_wrench_acts_within_the_step():
    """Constant push on a robot at rest with casters along it: the speed gained is force over mass times time."""
    robot = frictionless(random_robot(77, 3)).without_wheels()
    platform = robot.platform.model_copy(update={"com": (0.0, 0.0)})
    parameters = robot_parameters(robot.model_copy(update={"platform": platform}))
    now = State((0.0, 0.0), (1.0, 0.0), (0.0, 0.0, 0.0), ((1.0, 0.0),) * 3)
    after = rk4_step(now, ((0.0, 0.0),) * 3, (2.0, 0.0, 0.0), 0.01, parameters)
    assert_allclose(after.twist, (2.0 / platform.mass * 0.01, 0.0, 0.0), atol=1e-15)
    assert_allclose(after.position, (0.5 * 2.0 / platform.mass * 0.01**2, 0.0), atol=1e-15)


def test_packing_a_state_keeps_it():
    state = State((1.0, 2.0), (0.6, 0.8), (3.0, 4.0, 5.0), ((1.0, 0.0), (0.0, 1.0)))
    assert pack_state(state) == (1.0, 2.0, 0.6, 0.8, 3.0, 4.0, 5.0, 1.0, 0.0, 0.0, 1.0)
    assert unpack_state(pack_state(state)) == state


def test_the_method_is_the_classical_one_of_fourth_order():
    """y' = a y: a step multiplies by the first five terms of e^(a h), whatever kind of thing y is."""
    for a, h in ((1.0, 0.3), (-2.0, 0.7), (1j, 1.1)):
        after = runge_kutta(lambda y, rate: rate * y, lambda y, h, rate: y + h * rate, 1.0, h, (a,))
        z = a * h
        assert after == pytest.approx(1.0 + z + z**2 / 2.0 + z**3 / 6.0 + z**4 / 24.0, rel=1e-15)  # rounding
