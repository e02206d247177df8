"""(G1) to (G6): what the floor must hold."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.caster import link_mass_centre, wheel_centre
from caster_gym.mechanics.ground import floor_impulse, ground_force, impact_traction, traction_use
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
    theirs = Kane(robot).contact_forces(steering, twist, torque, wrench)
    ours = Model(robot).ground_forces(steering, twist, torque, wrench)
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


def test_a_robot_whose_mass_centre_lies_outside_its_wheels_tips_over():
    """(G5): no three loads that press could balance it."""
    robot = random_robot(46, 3)
    platform = robot.platform.model_copy(update={"com": (-0.5, 0.3)})
    loads = Model(robot.model_copy(update={"platform": platform})).wheel_loads([0.0, 0.0, 0.0])
    assert loads.min() < 0.0


@pytest.mark.parametrize("caster_count", [4, 5, 6])
def test_a_wheel_that_would_be_pulled_down_lifts_and_the_others_carry(caster_count):
    """(G5): against nonnegative least squares, which knows of no sharing rule but the least sum of squares."""
    robot = random_robot(47, caster_count)
    lifted = 0
    for seed in range(100):
        steering, twist, torque, wrench = random_motion(seed, robot)
        platform = robot.platform.model_copy(update={"height": 0.05 * (1 + seed % 20)})
        tall = robot.model_copy(update={"platform": platform})
        loads = Model(tall).wheel_loads(steering, twist, torque, 3.0 * wrench)
        if (loads < 0.0).any():
            continue  # it tips over
        centres = [
            wheel_centre(f, c) for f, c in zip(directions(steering), robot_parameters(tall).casters, strict=True)
        ]
        contacts = np.array([(1.0, x, y) for x, y in centres]).T
        balance = contacts @ loads
        weight = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
        assert_allclose(balance[0], weight * GRAVITY, rtol=1e-6)  # the damping of the sharing
        down = loads > 0.0
        lifted += not down.all()
        shares = np.linalg.lstsq(contacts[:, down], balance, rcond=None)[0]
        assert_allclose(loads[down], shares, rtol=0.0, atol=1e-5 * balance[0])  # as above
    assert lifted > 3


@pytest.mark.parametrize("caster_count", [3, *(pytest.param(one, marks=pytest.mark.slow) for one in (4, 6))])
def test_loads_of_a_moving_robot_turn_its_momentum(caster_count):
    """(G7): gravity, loads and push change the spin of all bodies about the floor; against Kane's bodies in space."""
    robot = random_robot(52, caster_count)
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 0.23})})
    model, parameters, platform = Model(robot), robot_parameters(robot), robot.platform
    shifts = []
    for seed in range(20):
        steering, twist, torque, wrench = random_motion(seed, robot)
        loads = model.wheel_loads(steering, twist, torque, wrench)
        rate = model.forward_dynamics(steering, twist, torque, wrench)
        _, moment = Kane(robot).momentum_rates(steering, twist, rate)
        ours = GRAVITY * platform.mass * np.array([-platform.com[1], platform.com[0]])
        ours += platform.height * np.array([-wrench[1], wrench[0]])
        for f, caster, n in zip(directions(steering), parameters.casters, loads, strict=True):
            (x_w, y_w), (x_l, y_l) = wheel_centre(f, caster), link_mass_centre(f, caster)
            ours += GRAVITY * (
                caster.wheel_mass * np.array([-y_w, x_w]) + caster.link_mass * np.array([-y_l, x_l])
            ) + n * np.array([y_w, -x_w])
        scale = GRAVITY * platform.mass  # N m at an arm of 1 m
        assert_allclose(ours, moment[:2], rtol=0.0, atol=1e-6 * scale)  # the damping of the sharing
        shifts.append(np.abs(loads - model.wheel_loads(steering)).max() / scale)
    assert np.median(shifts) > 1e-2  # enough to be seen


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
    assert_allclose(traction_use((3.0, -4.0), 10.0, 0.1, 0.5), 1.0, rtol=1e-15)
    assert traction_use((0.0, 0.0), 10.0, 0.1, 0.5) == 0.0
    assert_allclose(traction_use((3.0, -4.0), 0.0, 0.1, 0.5), 100.0, rtol=1e-15)  # lifted


@pytest.mark.parametrize("caster_count", [3, *(pytest.param(one, marks=pytest.mark.slow) for one in (2, 4, 5))])
def test_floor_impulses_are_those_of_kanes_bodies(caster_count):
    """(G8): an impulse on a robot at rest is a push of one second whose acceleration has no time to become motion."""
    for seed in range(10):
        robot = random_robot(seed, caster_count)
        steering, _, _, push = random_motion(seed, robot)
        change = np.linalg.solve(Model(robot).inertia(steering), push)
        pairs = zip(directions(steering), robot_parameters(robot).casters, strict=True)
        ours = np.array([floor_impulse(tuple(change), f, caster) for f, caster in pairs])
        theirs = Kane(robot).contact_forces(steering, np.zeros(3), np.zeros(2 * caster_count), push)
        assert_allclose(ours, theirs, rtol=0.0, atol=1e-9 * np.abs(theirs).max())  # two derivations
        outside = push.copy()
        for f, caster, (along, across) in zip(directions(steering), robot_parameters(robot).casters, ours, strict=True):
            x, y = wheel_centre(f, caster)
            fx, fy = along * f[0] - across * f[1], along * f[1] + across * f[0]
            outside += [fx, fy, x * fy - y * fx]
        momentum = Kane(robot).momentum_rate(steering, np.zeros(3), change)  # Newton's law for the whole robot
        assert_allclose(outside, momentum, rtol=0.0, atol=1e-9 * np.abs(momentum).max())


@pytest.mark.parametrize(("name", "speed"), [("tidybot2", 0.013), ("xr4000", 0.058), ("chung2008", 0.44)])
def test_impacts_soon_ask_more_than_the_floor_has(name, speed):
    """(G9): head-on at this speed with e = 0.5 every second robot slips, steered and hit at random."""
    robot, rng, count = load_robot(name), np.random.default_rng(53), 2000
    steering, angle = rng.uniform(-np.pi, np.pi, (count, robot.caster_count)), rng.uniform(-np.pi, np.pi, count)
    ahead = np.stack((np.cos(angle), np.sin(angle)), -1)
    twist = speed * np.column_stack((ahead, np.zeros(count)))
    _, after = Model(robot).collide(steering, twist, np.zeros((count, 2)), -ahead, 0.5)
    wheels = tuple((np.cos(a), np.sin(a)) for a in steering.T)
    uses = impact_traction(tuple((after - twist).T), wheels, robot_parameters(robot))
    assert robot.floor_friction == 0.7
    assert_allclose(np.median(uses), 1.0, rtol=0.05)  # speeds are rounded to two digits
