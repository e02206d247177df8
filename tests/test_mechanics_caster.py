"""(K1) to (K4): one caster that rolls without slip."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose

from caster_gym import Model
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.caster import joint_rates, link_mass_centre, pivot_velocity, rate_drifts, wheel_centre
from caster_gym.mechanics.parameters import robot_parameters
from tests.kane import Kane
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

ROUNDING = 1e-12  # rates of some 10 to 100 rad/s, each the sum of a handful of products


@pytest.fixture(params=CASTER_COUNTS)
def robot(request):
    return random_robot(11, request.param)


def test_wheel_leaves_its_ground_point_at_rest(robot):
    """(K1), (K2): the material point that touches the floor does not move, whatever the motion.

    Velocity of the wheel's centre as the platform carries its pivot and the link its trail, less what rolling takes.
    """
    steering, twist, _, _ = random_motion(1, robot, 100)
    eta, theta, _ = Model(robot).rates(steering, twist)
    for i, caster in enumerate(robot.casters):
        f = np.stack((np.cos(steering[:, i]), np.sin(steering[:, i])), -1)
        left = np.stack((-f[:, 1], f[:, 0]), -1)
        pivot = twist[:, :2] + twist[:, 2:] * np.array([-caster.y, caster.x])
        arm = -caster.trail * f + caster.offset * left
        centre = pivot + eta[:, i, None] * np.stack((-arm[:, 1], arm[:, 0]), -1)
        slip = centre - theta[:, i, None] * caster.radius * f
        assert_allclose(slip, 0.0, atol=ROUNDING)


def test_rates_are_those_of_the_bodies(robot):
    """(K1), (K2), (K3): against the null space of the rolling constraints, found numerically."""
    steering, twist, _, _ = random_motion(2, robot)
    for ours, theirs in zip(Model(robot).rates(steering, twist), Kane(robot).rates(steering, twist), strict=True):
        assert_allclose(ours, theirs, atol=ROUNDING)


def test_a_trailing_caster_rolls_forward_and_a_leading_one_runs_away():
    """(K2), (K3): going straight along +f turns the wheel forward; a small error dies out, and grows for −f."""
    model = Model(random_robot(12, 3))
    trail = model.robot.casters[0].trail
    for direction in (1.0, -1.0):
        _, theta, delta = model.rates([0.01, 0.0, 0.0], [direction, 0.0, 0.0])
        assert theta[0] * direction > 0.0
        assert_allclose(delta[0], -direction * np.sin(0.01) / trail, rtol=1e-12)


def test_jacobian_rows_give_the_joint_rates(robot):
    """(K1) to (K3): each row times the twist is the rate, and all rows stand in the order of the joints' names."""
    model = Model(robot)
    steering, twist, _, _ = random_motion(3, robot, 20)
    _, theta, delta = model.rates(steering, twist)
    rates = np.einsum("bij,bj->bi", model.jacobian(steering), twist)
    assert_allclose(rates[:, ::2], theta, atol=ROUNDING)
    assert_allclose(rates[:, 1::2], delta, atol=ROUNDING)
    assert_allclose(model.jacobian(steering, ("steer_2", "roll_1")), model.jacobian(steering)[:, [3, 0]], rtol=0.0)
    assert_allclose(model.jacobian(steering, "roll_2"), model.jacobian(steering)[:, [2]], rtol=0.0)


def test_jacobian_is_the_derivative_of_the_rates(robot):
    """Rates are linear in the twist, so that a finite difference of any size is exact but for rounding."""
    model = Model(robot)
    steering, twist, _, _ = random_motion(4, robot)
    for axis, unit in enumerate(np.eye(3)):
        ahead, behind = model.rates(steering, twist + unit), model.rates(steering, twist - unit)
        _, theta, delta = (a - b for a, b in zip(ahead, behind, strict=True))
        column = model.jacobian(steering)[:, axis]
        assert_allclose(column[::2], 0.5 * theta, atol=ROUNDING)
        assert_allclose(column[1::2], 0.5 * delta, atol=ROUNDING)


def test_drifts_are_the_joint_accelerations_at_constant_twist(robot):
    """(K4): derivative of the rates along the steering motion, by automatic differentiation and by differences."""
    steering, twist, _, _ = random_motion(5, robot)
    parameters, model = robot_parameters(robot), TorchModel(robot)
    directions = [(np.cos(angle), np.sin(angle)) for angle in steering]
    ours = np.array([rate_drifts(tuple(twist), f, c) for f, c in zip(directions, parameters.casters, strict=True)]).T

    turning = model.rates(steering, twist)[2]
    _, exact = torch.func.jvp(lambda angle: model.rates(angle, twist), (torch.tensor(steering),), (turning,))[:2]
    for drift, derivative in zip(ours, exact, strict=True):
        assert_allclose(drift, derivative, rtol=1e-12, atol=1e-10)  # rounding of terms of up to 1e3 rad/s²

    h = 1e-6  # s: truncation and rounding are both about 1e-7 of the greatest acceleration
    ahead, behind = (model.rates(steering + sign * h * turning.numpy(), twist) for sign in (1.0, -1.0))
    for drift, a, b in zip(ours, ahead, behind, strict=True):
        assert_allclose(drift, (a - b) / (2.0 * h), atol=1e-6 * np.abs(ours).max())


def test_points_of_a_caster_move_as_its_rates_say(robot):
    """Wheel centre and link mass centre in B, differentiated along the steering motion, obey the rigid link."""
    steering, twist, _, _ = random_motion(6, robot)
    for angle, caster in zip(steering, robot_parameters(robot).casters, strict=True):
        f = (np.cos(angle), np.sin(angle))
        a, b = pivot_velocity(tuple(twist), f, caster)
        _, delta = joint_rates(tuple(twist), f, caster)
        assert_allclose(a * f[0] - b * f[1], twist[0] - twist[2] * caster.y, atol=ROUNDING)
        for point in (wheel_centre, link_mass_centre):
            x, y = point(f, caster)
            turned = torch.tensor(angle)
            speed = torch.func.jvp(
                lambda t, point=point, caster=caster: torch.stack(point((torch.cos(t), torch.sin(t)), caster)),
                (turned,),
                (torch.tensor(delta),),
            )[1]
            assert_allclose(speed, [-delta * (y - caster.y), delta * (x - caster.x)], atol=ROUNDING)
        assert_allclose(
            np.subtract(wheel_centre(f, caster), (caster.x, caster.y)),
            -caster.trail * np.array(f) + caster.offset * np.array([-f[1], f[0]]),
            atol=ROUNDING,
        )
