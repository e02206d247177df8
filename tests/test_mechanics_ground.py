"""(G1) to (G6): what the floor must hold."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.caster import link_mass_centre, wheel_centre
from caster_gym.mechanics.ground import ground_force, traction_use
from caster_gym.mechanics.parameters import GRAVITY, robot_parameters
from tests.kane import Kane
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot


@pytest.fixture(params=CASTER_COUNTS)
def robot(request):
    return random_robot(41, request.param)


def directions(steering):
    return tuple((np.cos(angle), np.sin(angle)) for angle in steering)


def test_ground_forces_are_the_constraint_forces_of_kanes_equations(robot):
    """(G1), (G2), (G3), (G4): wheel by wheel, the multipliers of the rolling constraints."""
    steering, twist, torque, wrench = random_motion(42, robot)
    theirs = Kane(robot).contact_forces(steering, twist, torque, 0.0 * wrench)
    ours = Model(robot).ground_forces(steering, twist, torque)
    assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())  # two derivations in double precision


def test_newtons_law_holds_for_the_whole_robot(robot):
    """(G1) to (G4): the forces of the floor, scrub and wrench change the momentum of all bodies, nothing else does."""
    steering, twist, torque, wrench = random_motion(43, robot)
    rate = Model(robot).forward_dynamics(steering, twist, torque, wrench)
    eta, _, _ = Model(robot).rates(steering, twist)
    outside = wrench.copy()
    for i, (f, caster) in enumerate(zip(directions(steering), robot_parameters(robot).casters, strict=True)):
        along, across = ground_force(
            tuple(twist), tuple(rate), robot.coulomb_speed, f, caster, (torque[2 * i], torque[2 * i + 1])
        )
        x, y = wheel_centre(f, caster)
        fx, fy = along * f[0] - across * f[1], along * f[1] + across * f[0]
        outside += [fx, fy, x * fy - y * fx - caster.scrub * eta[i]]
    momentum = Kane(robot).momentum_rate(steering, twist, rate)
    assert_allclose(outside, momentum, rtol=0.0, atol=1e-9 * np.abs(momentum).max())  # as above


def test_a_robot_at_rest_pushes_the_floor_by_its_torques_alone():
    """(G1): held back by a wrench, every wheel pushes with τ_θ / r along f and (s τ_θ / r − τ_δ) / −d across."""
    robot = random_robot(44, 3)
    _, _, torque, _ = random_motion(44, robot)
    for i, caster in enumerate(robot_parameters(robot).casters):
        roll, steer = torque[2 * i], torque[2 * i + 1]
        along, across = ground_force((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), 0.1, (0.6, 0.8), caster, (roll, steer))
        assert_allclose(along, roll / caster.radius, rtol=1e-12)
        # balance of moments about the pivot: steering torque, and the force at the arm (−d, s)
        assert_allclose(steer - caster.trail * across - caster.offset * along, 0.0, atol=1e-12)


def standing(caster_count):
    """Robots and steering for which every wheel carries weight, so that no load is cut off."""
    robot = random_robot(49, caster_count)
    return robot, random_motion(49, robot, 50)[0]


@pytest.mark.parametrize("caster_count", [3, 4, 5])
def test_wheel_loads_balance_weight_and_moments(caster_count):
    """(G5)."""
    robot, steering = standing(caster_count)
    loads = Model(robot).wheel_loads(steering)
    parameters = robot_parameters(robot)
    platform = robot.platform
    for angles, load in zip(steering, loads, strict=True):
        balance = np.zeros(3)
        weights = GRAVITY * platform.mass * np.array([1.0, *platform.com])
        for f, caster, n in zip(directions(angles), parameters.casters, load, strict=True):
            balance += n * np.array([1.0, *wheel_centre(f, caster)])
            weights += GRAVITY * caster.wheel_mass * np.array([1.0, *wheel_centre(f, caster)])
            weights += GRAVITY * caster.link_mass * np.array([1.0, *link_mass_centre(f, caster)])
        assert (load > 1.0).all()  # N
        assert_allclose(balance[0], weights[0], rtol=1e-9)
        assert_allclose(balance[1:], weights[1:], atol=1e-7 * weights[0])  # the damping of the sharing, 1e-9 relative


def test_a_lifted_wheel_counts_as_barely_loaded():
    """A robot whose mass centre lies outside the triangle of its wheels: no load becomes negative or zero."""
    robot = random_robot(46, 3)
    platform = robot.platform.model_copy(update={"com": (-0.5, 0.3)})
    loads = Model(robot.model_copy(update={"platform": platform})).wheel_loads([0.0, 0.0, 0.0])
    mass = platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
    assert_allclose(loads.min(), 1e-3 * mass * GRAVITY / 3, rtol=1e-12)  # the least load, a thousandth of the mean


def test_a_symmetric_robot_stands_equally_on_its_wheels():
    """(G5): pivots on a circle about the mass centre and all casters turned alike about it."""
    model = Model(load_robot("chung2008"))
    around = np.arctan2([c.y for c in model.robot.casters], [c.x for c in model.robot.casters])
    mass = 5.0 + 3 * (0.5 + 0.1)  # kg
    for turn in (0.0, 1.0, np.pi):
        # the file's 0.0865 m for √3/2 · 0.1 m makes the triangle equilateral to 1e-3
        assert_allclose(model.wheel_loads(around + turn), mass * GRAVITY / 3, rtol=1e-3)


def test_two_wheels_share_the_weight_though_they_cannot_balance_it():
    """(G5): a robot on two wheels is held upright by something else; the loads still carry it."""
    robot, steering = standing(2)
    mass = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
    loads = Model(robot).wheel_loads(steering)
    assert np.isfinite(loads).all()
    assert (loads > 0.0).all()
    assert_allclose(loads.sum(-1), mass * GRAVITY, rtol=1e-6)  # the damping of 1e-9 multiplies rounding


def test_traction_use_is_the_share_of_the_friction_cone():
    """(G6)."""
    assert_allclose(traction_use((3.0, -4.0), 10.0, 0.5), 1.0, rtol=1e-15)
    assert traction_use((0.0, 0.0), 10.0, 0.5) == 0.0
