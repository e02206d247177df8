"""agents.control.predictive and control.box_riccati: plans are the best within the motors' limits, and are followed."""

from typing import Any

import casadi
import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import ObservationLayout, PredictiveControl, load_robot
from caster_gym.agents.control.predictive import PredictiveSettings, interpolation
from caster_gym.control.box_riccati import Costs, Linearised, improve
from caster_gym.engines.native.derivatives import PeriodDerivatives
from caster_gym.mechanics.integration import pack_state, rk4_step, unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs, register

ROBOT = load_robot("chung2008")
LAYOUT = ObservationLayout(ROBOT, preview=(0.1, 0.2, 0.4))
STAGES, STEP = 4, 0.01
COSTS = Costs(0.1, 0.05, 1e-3, 1.0)
SPREAD = np.diag(ROBOT.max_torques)


def start():
    """A robot that moves, with casters anywhere."""
    angles = np.array([0.3, -2.1, 1.4])
    state = np.array([0.0, 0.0, 1.0, 0.0, 0.3, 0.1, 0.2, *np.zeros(6)])
    state[7::2], state[8::2] = np.cos(angles), np.sin(angles)
    return state


WANTED = np.array([0.01, 0.002, np.cos(0.03), np.sin(0.03), 0.3, 0.1, 0.2])


def planned(limit, rounds):
    """Shares of torques (stages, motors) after so many Gauss-Newton steps."""
    period = PeriodDerivatives(ROBOT, STEP)
    shares = np.zeros((1, STAGES, 6))
    bounds = np.full_like(shares, limit)
    for _ in range(rounds):
        path, ends = [start()[None]], []
        for k in range(STAGES):
            ends.append(period.at(path[-1], shares[:, k] @ SPREAD.T))
            path.append(ends[-1].state)
        around = Linearised(np.array(path), np.array([e.by_state for e in ends]), np.array([e.by_torque for e in ends]))
        improve(shares, around, SPREAD, -bounds, bounds, np.tile(WANTED, (1, STAGES, 1)), COSTS)
    return shares[0]


def by_ipopt(limit):
    """The same problem stated in CasADi's symbols and solved by an interior-point method."""
    register(casadi.SX, casadi.if_else, casadi.sqrt, lambda _: True)
    shares, robot, cost = casadi.SX.sym("u", 6 * STAGES), robot_parameters(ROBOT), 0.0
    row = tuple(casadi.SX(float(number)) for number in start())
    for k in range(STAGES):
        torques = [SPREAD[j, j] * shares[6 * k + j] for j in range(6)]
        row = pack_state(rk4_step(unpack_state(row), pairs(tuple(torques)), (0.0, 0.0, 0.0), STEP, robot))
        x, y, c, s, vx, vy, omega = row[:7]
        turned = casadi.atan2(s * WANTED[2] - c * WANTED[3], c * WANTED[2] + s * WANTED[3])
        errors = [x - WANTED[0], y - WANTED[1], COSTS.length * turned]
        errors += [COSTS.time * (c * vx - s * vy - WANTED[4]), COSTS.time * (s * vx + c * vy - WANTED[5])]
        cost += casadi.sumsqr(casadi.vertcat(*errors, COSTS.time * COSTS.length * (omega - WANTED[6])))
    problem = {"x": shares, "f": 1e4 * (cost + COSTS.effort**2 * casadi.sumsqr(shares))}
    quiet: dict[str, Any] = {"ipopt.print_level": 0, "print_time": False, "ipopt.sb": "yes", "ipopt.tol": 1e-12}
    found = casadi.nlpsol("plan", "ipopt", problem, quiet)(x0=0.0, lbx=-limit, ubx=limit)
    return np.array(found["x"]).reshape(STAGES, 6)


@pytest.mark.parametrize("limit", [10.0, 1.0, 0.3], ids=["free", "some at a limit", "most at a limit"])
def test_plans_are_those_of_an_interior_point_method(limit):
    """1e-6 of a motor's greatest torque; an interior point keeps about 1e-9 away from the limits."""
    found = planned(limit, 12)
    assert np.abs(found).max() <= limit
    assert_allclose(found, by_ipopt(limit), rtol=0.0, atol=1e-6)


def test_a_polynomial_of_few_degrees_is_seen_exactly_from_its_preview():
    """Seven conditions hold a polynomial of degree six; rounding of 1e-15 grows by the inverse's condition, 1e4."""
    points, times = (0.1, 0.2), np.arange(1.0, 11.0) * np.float64(0.02)
    curve = np.polynomial.Polynomial([0.3, -1.0, 2.0, 5.0, -30.0, 100.0, 200.0])
    slope = curve.deriv()
    given = [curve(0.0), slope(0.0), slope.deriv()(0.0)]
    for point in points:
        given += [curve(point), slope(point)]
    places, speeds = interpolation(points, times)
    assert_allclose(places @ given, curve(times), rtol=0.0, atol=1e-10)
    assert_allclose(speeds @ given, slope(times), rtol=0.0, atol=1e-8)


def driven(robots, periods, seed=0):
    """Observations and actions of some periods."""
    env = gym.make_vec("caster_gym:CasterTrack-v0", robots, path="lemniscate")
    controller = PredictiveControl(LAYOUT, 0.02)
    seen, info = env.reset(seed=seed)
    controller.reset(np.ones(robots, dtype=np.bool_))
    record = []
    for _ in range(periods):
        actions = controller.act(seen)
        record.append((seen, actions))
        seen, *_, info = env.step(actions)
    return record, info


def test_the_reference_is_followed_to_a_micrometre_within_the_limits():
    record, info = driven(4, 120)
    assert max(np.abs(actions).max() for _, actions in record) <= 1.0
    assert np.abs(info["position_error"]).max() < 3e-6  # [m]; computed torque has 1e-6 on average, 5e-6 at most


def test_robots_do_alone_what_they_do_in_a_batch_and_one_that_begins_anew_disturbs_none():
    record, _ = driven(3, 6)
    alone = PredictiveControl(LAYOUT, 0.02)
    for seen, actions in record:
        assert_array_equal(alone.act(seen[1:2]), actions[1:2])
    again = PredictiveControl(LAYOUT, 0.02)
    again.reset(np.ones(3, dtype=np.bool_))
    for k, (seen, actions) in enumerate(record):
        if k == 3:
            again.reset(np.array([True, False, False]))
        assert_array_equal(again.act(seen)[1:], actions[1:])


def test_a_horizon_beyond_the_preview_is_refused():
    with pytest.raises(ValueError, match=r"plans 0\.5 s ahead, and observations preview 0\.4 s: give it a shorter"):
        PredictiveControl(LAYOUT, 0.02, horizon=25)
    with pytest.raises(ValueError, match=r"plans 0\.2 s ahead, and observations preview nothing"):
        PredictiveControl(ObservationLayout(ROBOT, preview=()), 0.02)
    with pytest.raises(ValueError, match="follows a reference in time, and this task previews one along its path"):
        PredictiveControl(ObservationLayout(ROBOT, preview=(0.1, 0.2), unit="m"), 0.02)


def test_each_effort_is_a_candidate():
    settings = PredictiveSettings(algorithm="predictive", efforts=(1e-4, 1e-3))
    assert [one.efforts for one in settings.candidates()] == [(1e-4,), (1e-3,)]
