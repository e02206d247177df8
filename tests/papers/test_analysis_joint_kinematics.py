"""(J2), (J5) to (J8): casters as chains from the floor to the platform, to first and second order."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose
from torch.func import jvp

from caster_gym import Model, load_robot
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.caster import rate_drifts
from caster_gym.mechanics.parameters import robot_parameters
from papers.analysis.joint_kinematics import (
    DELTA,
    ETA,
    THETA,
    forward_hessian,
    forward_jacobian,
    inertial_hessian,
    inverse_hessian,
    inverse_jacobian,
)
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

ROUNDING = 1e-12  # [-] of numbers of order 1, sums of a handful of products
FINE = 1e-6  # [rad] of central differences: truncation 1e-12, rounding 1e-16 / 1e-6
DIFFERENCES = 1e-8  # accordingly, with a wide margin

EVERY = (inverse_jacobian, forward_jacobian, forward_hessian, inertial_hessian, inverse_hessian)


@pytest.fixture(params=CASTER_COUNTS)
def robot(request):
    return random_robot(31, request.param)


def quadratic(hessian, rates):
    """q̇ᵀ H q̇ of every caster, plane by plane."""
    return np.einsum("...j,...kjl,...l->...k", rates, hessian, rates)


def joint_motion(robot, seed, count=40):
    """Steering, twist, a twist rate, and rates and accelerations (..., N, 3) of all joints by automatic derivatives."""
    steering, twist, _, _ = random_motion(seed, robot, count)
    twist_rate = np.random.default_rng(seed).uniform(-1.0, 1.0, twist.shape)
    model = TorchModel(robot)
    turning = Model(robot).rates(steering, twist)[2]
    point, change = (steering, twist), (turning, twist_rate)
    rates, accelerations = jvp(
        lambda delta, v: torch.stack(model.rates(delta, v), -1),
        tuple(map(torch.as_tensor, point)),
        tuple(map(torch.as_tensor, change)),
    )[:2]
    return steering, twist, twist_rate, rates.numpy(), accelerations.numpy()


def test_forward_jacobian_undoes_the_rows_of_the_mechanics(robot):
    """(J2): closed form beside the rows (K1) to (K3)."""
    steering, twist, _, _ = random_motion(1, robot, 50)
    forward, inverse = forward_jacobian(robot, steering), inverse_jacobian(robot, steering)
    product = forward @ inverse
    assert_allclose(product, np.broadcast_to(np.eye(3), product.shape), atol=ROUNDING)
    rates = np.stack(Model(robot).rates(steering, twist), -1)
    assert_allclose(np.einsum("...ijk,...k->...ij", inverse, twist), rates, atol=1e-11)  # rates of up to 100 rad/s


def test_determinant_is_trail_times_radius(robot):
    """(J2): whatever the steering angle, the pivot and the lateral offset."""
    steering, _, _, _ = random_motion(2, robot, 50)
    product = np.array([caster.trail * caster.radius for caster in robot.casters])
    determinant = np.linalg.det(forward_jacobian(robot, steering))
    assert_allclose(determinant, np.broadcast_to(product, determinant.shape), rtol=1e-12)


def test_forward_hessian_is_the_derivative_of_the_forward_jacobian(robot):
    """(J5): central differences in δ; η and θ do not appear."""
    steering, _, _, _ = random_motion(3, robot, 20)
    change = (forward_jacobian(robot, steering + FINE) - forward_jacobian(robot, steering - FINE)) / (2.0 * FINE)
    hessian = forward_hessian(robot, steering)
    assert_allclose(hessian[..., DELTA], change, atol=DIFFERENCES)
    assert (hessian[..., (ETA, THETA)] == 0.0).all()
    assert (hessian[..., 2, :, :] == 0.0).all()  # the yaw rate is η̇ − δ̇ everywhere


def test_twist_rate_comes_of_joint_accelerations(robot):
    """(J5): ν̇ = G q̈ + q̇ᵀ H q̇, with the accelerations of a motion by automatic differentiation."""
    steering, _, twist_rate, rates, accelerations = joint_motion(robot, 4)
    found = np.einsum("...kj,...j->...k", forward_jacobian(robot, steering), accelerations)
    found += quadratic(forward_hessian(robot, steering), rates)
    # accelerations of up to 1e4 rad/s² times lengths of 0.3 m cancel to numbers of order 1
    assert_allclose(found, np.broadcast_to(twist_rate[:, None], found.shape), atol=1e-10)


def test_joint_accelerations_come_of_the_twist_rate(robot):
    """(J8): q̈ = g ν̇ + νᵀ h ν, the same motion backwards."""
    steering, twist, twist_rate, _, accelerations = joint_motion(robot, 5)
    found = np.einsum("...jk,...k->...j", inverse_jacobian(robot, steering), twist_rate[:, None])
    found += quadratic(inverse_hessian(robot, steering), twist[:, None])
    assert_allclose(found, accelerations, rtol=1e-9, atol=1e-9)  # of accelerations of up to 1e4 rad/s²


def test_inverse_hessian_holds_the_drifts_of_the_mechanics(robot):
    """(J8) beside (K4)."""
    steering, twist, _, _ = random_motion(6, robot, 50)
    found = quadratic(inverse_hessian(robot, steering), twist[:, None])
    for i, caster in enumerate(robot_parameters(robot).casters):
        drifts = rate_drifts(tuple(twist.T), (np.cos(steering[:, i]), np.sin(steering[:, i])), caster)
        assert_allclose(found[:, i], np.stack(drifts, -1), rtol=1e-9, atol=1e-9)  # of up to 1e3 rad/s²


def test_hessians_hold_along_a_simulated_motion():
    """(J5), (J8): joint rates and twists of a driven robot, differenced in time over ±0.1 ms."""
    model = Model(load_robot("chung2008"))
    state = np.array([0.0, 0.0, 0.0, 0.2, -0.1, 0.5, 0.4, -1.0, 2.0])
    step = 1e-4  # [s] differences are off by step² times a third derivative of about 1e3
    before, now, after = model.simulate(state, [0.1, 0.02, -0.1, 0.05, 0.2, -0.03], step, 2)
    rates = [np.stack(model.rates(s[6:], s[3:6]), -1) for s in (before, now, after)]
    accelerations, twist_rate = (rates[2] - rates[0]) / (2.0 * step), (after[3:6] - before[3:6]) / (2.0 * step)
    found = inverse_jacobian(model.robot, now[6:]) @ twist_rate
    found += quadratic(inverse_hessian(model.robot, now[6:]), now[3:6])
    assert np.abs(accelerations).max() > 10.0
    assert_allclose(found, accelerations, rtol=1e-4, atol=1e-3)


def test_acceleration_over_ground_has_the_turning_of_the_frame_in_it(robot):
    """(J6): a_C = v̇ + ω ẑ × v."""
    steering, twist, _, rates, _ = joint_motion(robot, 7)
    more = quadratic(inertial_hessian(robot, steering), rates) - quadratic(forward_hessian(robot, steering), rates)
    vx, vy, omega = twist.T
    expected = np.stack((-omega * vy, omega * vx, 0.0 * omega), -1)[:, None]
    assert_allclose(more, np.broadcast_to(expected, more.shape), atol=1e-10)  # of terms up to 1e3


def test_inertial_hessian_is_the_derivative_in_the_world(robot):
    """(J6): differences of R(β) G with β = η − δ, at β = 0."""
    steering, _, _, _ = random_motion(8, robot, 10)

    def in_the_world(step):
        eta, delta = step[ETA], step[DELTA]
        c, s = np.cos(eta - delta), np.sin(eta - delta)
        turn = np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
        return turn @ forward_jacobian(robot, steering + delta)

    hessian = inertial_hessian(robot, steering)
    for joint in (ETA, THETA, DELTA):
        step = FINE * np.eye(3)[joint]
        change = (in_the_world(step) - in_the_world(-step)) / (2.0 * FINE)
        assert_allclose(hessian[..., joint], change, atol=DIFFERENCES)


def test_all_pairs_of_joints_but_one_are_symmetric_over_ground(robot):
    """(J7): rolling and yaw differ by r f⊥, all else commutes."""
    steering, _, _, _ = random_motion(9, robot, 20)
    hessian = inertial_hessian(robot, steering)
    skew = hessian - np.swapaxes(hessian, -1, -2)
    radius = np.array([caster.radius for caster in robot.casters])
    assert_allclose(skew[..., 0, THETA, ETA], -radius * np.sin(steering), atol=ROUNDING)
    assert_allclose(skew[..., 1, THETA, ETA], radius * np.cos(steering), atol=ROUNDING)
    skew[..., THETA, ETA] = skew[..., ETA, THETA] = 0.0
    assert_allclose(skew, 0.0, atol=ROUNDING)


@pytest.mark.parametrize(("first", "second", "closes"), [(THETA, ETA, False), (ETA, DELTA, True), (THETA, DELTA, True)])
def test_a_loop_of_two_joints_closes_where_the_hessian_is_symmetric(first, second, closes):
    """(J7): forth by ε with one joint after the other, then back: C ends at −r ε² f⊥, or where it began.

    Places by plane geometry alone: the wheel's centre rolls along f, the link turns about it, the platform about A.
    """
    robot, eps = random_robot(32, 3), 1e-3
    caster, steering = robot.casters[0], np.array([0.7, 0.0, 0.0])
    pivot = complex(caster.x, caster.y)
    arm = complex(-caster.trail, caster.offset)  # from A to O, along f and f⊥
    q = np.array([steering[0], 0.0, steering[0]])  # β = η − δ = 0
    centre = pivot + arm * np.exp(1j * steering[0])
    for joint, sign in ((first, 1.0), (second, 1.0), (first, -1.0), (second, -1.0)):
        if joint == THETA:
            centre += caster.radius * sign * eps * np.exp(1j * q[ETA])
        q[joint] += sign * eps
    body = centre - arm * np.exp(1j * q[ETA]) - pivot * np.exp(1j * (q[ETA] - q[DELTA]))  # C
    hessian = inertial_hessian(robot, steering)[0]
    gap = hessian[:2, second, first] - hessian[:2, first, second]
    assert (np.abs(gap).max() < ROUNDING) == closes
    assert_allclose([body.real, body.imag], gap * eps**2, atol=2e-3 * caster.radius * eps**2)  # the next order, ε³


@pytest.mark.parametrize("function", EVERY)
def test_batch_axes_lead(function):
    robot = random_robot(33, 4)
    steering = np.random.default_rng(0).uniform(-3.0, 3.0, (2, 5, 4))
    batch = function(robot, steering)
    assert batch.shape[:3] == (2, 5, 4)
    assert_allclose(batch[1, 3], function(robot, steering[1, 3]), rtol=0.0, atol=1e-12)  # products in another order


@pytest.mark.parametrize("function", EVERY)
def test_what_is_wrong_with_steering_angles_is_said(function):
    robot = random_robot(34, 3)
    with pytest.raises(ValueError, match=r"steering must have a last axis of 3, got shape \(4,\)"):
        function(robot, np.zeros(4))
    with pytest.raises(ValueError, match=r"last axis of 3, got shape \(\)"):
        function(robot, 0.0)
    with pytest.raises(ValueError, match="steering must be finite, got nan"):
        function(robot, [0.0, np.nan, 0.0])
