"""(D1) to (D6): the dynamics of the whole robot, against Kane's equations and the laws of mechanics."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym import Model
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.dynamics import pivot_inertia
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import Robot
from tests.kane import Kane
from tests.random_robots import CASTER_COUNTS, frictionless, random_motion, random_robot

ORACLE = 1e-9  # relative: two derivations in double precision, with room for ill-conditioned draws


@pytest.fixture(params=CASTER_COUNTS)
def robot(request):
    return random_robot(21, request.param)


def assert_same(ours, theirs, relative):
    """Equal within a share of the greatest entry."""
    assert_allclose(ours, theirs, rtol=0.0, atol=relative * np.abs(theirs).max())


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_dynamics_agree_with_kanes_equations_of_all_bodies(seed, caster_count):
    """(D1), (D2), (D3), (D4), (D5)."""
    robot = random_robot(seed, caster_count)
    model, oracle = Model(robot), Kane(robot)
    steering, twist, torque, wrench = random_motion(seed, robot)
    assert_same(model.inertia(steering), oracle.inertia(steering), ORACLE)
    assert_same(model.bias(steering, twist), oracle.bias(steering, twist), ORACLE)
    assert_same(
        model.forward_dynamics(steering, twist, torque, wrench),
        oracle.forward_dynamics(steering, twist, torque, wrench),
        ORACLE,
    )


def test_the_printed_model_lacks_just_the_off_axis_term(robot):
    """(D1): Σ n η̇ (θ̇ g_η − η̇ g_θ) with n = m_l r (d − l), the rates taken from the oracle; its power is zero."""
    steering, twist, _, _ = random_motion(22, robot)
    missing = Model(robot).bias(steering, twist) - Model(robot, dynamics="chung2008").bias(steering, twist)

    oracle = Kane(robot)
    rows = [oracle.rates(steering, unit) for unit in np.eye(3)]
    eta, theta, _ = oracle.rates(steering, twist)
    expected = np.zeros(3)
    for i, caster in enumerate(robot.casters):
        n = caster.link.mass * caster.radius * (caster.trail - caster.link.com[0])
        expected += [n * eta[i] * (theta[i] * row[0][i] - eta[i] * row[1][i]) for row in rows]
    assert_same(missing, expected, ORACLE)
    assert np.abs(missing).max() > 1e-3 * np.abs(Model(robot).bias(steering, twist)).max()  # it is no rounding
    assert abs(missing @ twist) < 1e-12 * np.abs(missing).max() * np.abs(twist).sum()  # rounding


def test_a_caster_is_a_constant_mass_at_its_pivot(robot):
    """(D6): its energy from the pivot's velocity and ω is that of wheel, link, gears and rotors, body by body."""
    steering, twist, _, _ = random_motion(28, robot)
    velocities = zip(robot.casters, steering, *Kane(robot).rates(steering, twist), strict=True)
    for caster, delta, eta, theta, steer in velocities:
        p = pivot_inertia(robot_parameters(robot.model_copy(update={"casters": (caster, caster)})).casters[0])
        f = np.exp(1j * delta)
        pivot = complex(twist[0] - twist[2] * caster.y, twist[1] + twist[2] * caster.x) * np.conj(f)
        a, b = pivot.real, pivot.imag
        ours = p.along * a * a + 2.0 * p.cross * a * b + p.across * b * b
        ours += twist[2] * (2.0 * p.along_turn * a + 2.0 * p.across_turn * b + p.turn * twist[2])
        wheel, link, (behind, left) = caster.wheel, caster.link, caster.link.com
        mass_centre = pivot + 1j * eta * complex(-behind, left)
        theirs = wheel.mass * (caster.radius * theta) ** 2 + wheel.spin_inertia * theta**2
        theirs += link.mass * abs(mass_centre) ** 2 + (wheel.yaw_inertia + link.inertia) * eta**2
        theirs += caster.roll.armature * theta**2 + caster.steer.armature * steer**2
        for motor, ratios in zip((caster.roll, caster.steer), caster.gear, strict=True):
            theirs += motor.rotor * (ratios[0] * theta + ratios[1] * steer) ** 2
        assert_allclose(ours, theirs, rtol=1e-11)  # rounding


def test_inertia_is_symmetric_and_positive_definite(robot):
    """(D3): and no less than that of the robot without its wheels."""
    steering, _, _, _ = random_motion(23, robot, 200)
    whole = Model(robot).inertia(steering)
    assert_allclose(whole, np.swapaxes(whole, -1, -2), rtol=0.0)
    bare = Model(robot.without_wheels()).inertia(steering)
    assert (np.linalg.eigvalsh(bare) > 0.0).all()
    assert (np.linalg.eigvalsh(whole - bare) > -1e-12).all()  # rounding of entries of order 10


def test_kinetic_energy_is_that_of_the_inertia_matrix(robot):
    """½ νᵀ M ν with the oracle's M."""
    steering, twist, _, _ = random_motion(24, robot)
    energy = 0.5 * twist @ Kane(robot).inertia(steering) @ twist
    assert_allclose(Model(robot).kinetic_energy(steering, twist), energy, rtol=ORACLE)


def test_inverse_dynamics_undoes_forward_dynamics(robot):
    """(D5): the force that inverse dynamics asks for is the one that drives and wrench give."""
    model = Model(robot)
    steering, twist, torque, wrench = random_motion(25, robot, 50)
    rate = model.forward_dynamics(steering, twist, torque, wrench)
    force = model.inverse_dynamics(steering, twist, rate)
    given = np.einsum("bji,bj->bi", model.jacobian(steering), torque) + wrench
    assert_same(force, given, ORACLE)


def energy_rate(robot: Robot, steering: np.ndarray, twist: np.ndarray, twist_rate: np.ndarray) -> float:
    """Derivative of the kinetic energy along the motion, by automatic differentiation. [W]"""
    model = TorchModel(robot)
    turning = model.rates(steering, twist)[2]
    power = torch.func.jvp(
        model.kinetic_energy,
        (torch.tensor(steering), torch.tensor(twist)),
        (turning, torch.tensor(twist_rate)),
    )[1]
    return float(power)


def test_energy_grows_by_the_power_of_torques_and_wrench_less_friction(robot):
    """Energy balance at an instant, friction's power written out joint by joint."""
    model = Model(robot)
    steering, twist, torque, wrench = random_motion(26, robot)
    eta, theta, delta = model.rates(steering, twist)
    lost = 0.0
    for i, caster in enumerate(robot.casters):
        for rate, motor in ((theta[i], caster.roll), (delta[i], caster.steer)):
            lost += motor.viscous * rate**2 + motor.coulomb * rate**2 / np.hypot(rate, 0.1)  # 0.1 rad/s: smoothing
        lost += caster.scrub * eta[i] ** 2
    supplied = torque[::2] @ theta + torque[1::2] @ delta + wrench @ twist
    power = energy_rate(robot, steering, twist, model.forward_dynamics(steering, twist, torque, wrench))
    assert_allclose(power, supplied - lost, rtol=0.0, atol=1e-11 * (np.abs(supplied) + lost))  # rounding
    assert_allclose(twist @ model.friction(steering, twist), lost, rtol=1e-11)


@pytest.mark.parametrize("dynamics", ["exact", "chung2008"])
def test_inertial_forces_do_no_net_work(robot, dynamics):
    """Without torques and friction the energy stays, with (D1) or without: energy does not tell them apart."""
    robot = frictionless(robot)
    steering, twist, torque, _ = random_motion(27, robot)
    rate = Model(robot, dynamics=dynamics).forward_dynamics(steering, twist, 0.0 * torque)
    scale = np.abs(Model(robot).bias(steering, twist)).max()
    assert abs(energy_rate(robot, steering, twist, rate)) < 1e-11 * scale  # rounding, at speeds of about 1


def test_the_order_of_the_casters_does_not_matter(robot):
    """Permuting casters with their steering and torques changes nothing but the order of the sums."""
    steering, twist, torque, wrench = random_motion(28, robot)
    order = np.random.default_rng(28).permutation(robot.caster_count)
    shuffled = Model(robot.model_copy(update={"casters": tuple(robot.casters[i] for i in order)}))
    moved = torque.reshape(-1, 2)[order].reshape(-1)
    model = Model(robot)
    assert_same(shuffled.inertia(steering[order]), model.inertia(steering), 1e-13)  # rounding of the sums
    assert_same(
        shuffled.forward_dynamics(steering[order], twist, moved, wrench),
        model.forward_dynamics(steering, twist, torque, wrench),
        1e-12,
    )


def test_a_whole_turn_of_the_steering_changes_nothing(robot):
    model = Model(robot)
    steering, twist, torque, wrench = random_motion(29, robot)
    turned = steering + 2.0 * np.pi * np.arange(-1, robot.caster_count - 1)
    assert_same(
        model.forward_dynamics(turned, twist, torque, wrench),
        model.forward_dynamics(steering, twist, torque, wrench),
        1e-12,  # rounding of the angle
    )


def test_a_robot_turned_within_its_body_frame_obeys_the_same_law(robot):
    """Turning the body frame by an angle turns every place, steering, twist and force, and nothing else."""
    angle = 0.8
    c, s = np.cos(angle), np.sin(angle)
    turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
    casters = tuple(k.model_copy(update={"x": c * k.x - s * k.y, "y": s * k.x + c * k.y}) for k in robot.casters)
    com = tuple(float(x) for x in turn[:2, :2] @ robot.platform.com)
    turned = robot.model_copy(update={"casters": casters, "platform": robot.platform.model_copy(update={"com": com})})
    steering, twist, torque, wrench = random_motion(30, robot)
    assert_same(
        Model(turned).forward_dynamics(steering + angle, turn @ twist, torque, turn @ wrench),
        turn @ Model(robot).forward_dynamics(steering, twist, torque, wrench),
        1e-12,  # rounding
    )


def test_a_robot_without_wheels_is_a_free_body():
    """(D3), (D4): Newton's second law of one planar body, referred to a point off its mass centre."""
    robot = frictionless(random_robot(31, 3)).without_wheels()
    steering, twist, torque, wrench = random_motion(31, robot)
    model, platform = Model(robot), robot.platform
    rate = model.forward_dynamics(steering, twist, 0.0 * torque, wrench)
    (vx, vy, omega), com = twist, np.array(platform.com)
    acceleration = rate[:2] + omega * np.array([-vy, vx]) + rate[2] * np.array([-com[1], com[0]]) - omega**2 * com
    force = platform.mass * acceleration
    assert_allclose(force, wrench[:2], atol=1e-12)  # N, rounding
    assert_allclose(platform.inertia * rate[2] + com[0] * force[1] - com[1] * force[0], wrench[2], atol=1e-12)
