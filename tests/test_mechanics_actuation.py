"""(A1): how well the driven motors can push."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model
from caster_gym.mechanics.actuation import characteristic_length, motor_wrenches
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.parameters import caster_parameters, robot_parameters
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

# A singular value near zero is the root of an eigenvalue with some roundings, more when the next one is small too.
HALF_DIGITS = 2e-6


def wrench_matrix(model, steering):
    """Columns: wrench of each driven motor at its greatest torque, moments as forces at the characteristic length."""
    robot = model.robot
    jacobian = model.jacobian(steering)
    length = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in robot.casters]))
    columns = []
    for i, caster in enumerate(robot.casters):
        for row, motor, name in zip(caster.gear, (caster.roll, caster.steer), ("roll", "steer"), strict=True):
            if f"{name}_{i + 1}" in robot.driven:
                wrench = motor.max_torque * (jacobian[2 * i : 2 * i + 2].T @ row)
                columns.append(wrench / [1.0, 1.0, length])
    return np.stack(columns, -1)


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
@pytest.mark.parametrize("driven", ["all", ("roll_1", "steer_1", "roll_2", "steer_2"), ("roll_1", "steer_1", "roll_2")])
def test_conditioning_is_the_ratio_of_singular_values(caster_count, driven):
    """(A1) against a singular value decomposition of the wrenches."""
    robot = random_robot(91, caster_count).with_actuation(driven)
    model = Model(robot)
    steering, _, _, _ = random_motion(91, robot, 50)
    expected = []
    for angles in steering:
        sizes = np.linalg.svd(wrench_matrix(model, angles), compute_uv=False)
        expected.append(sizes[2] / sizes[0])
    assert_allclose(model.conditioning(steering), expected, rtol=1e-6, atol=HALF_DIGITS)


def test_two_motors_cannot_push_everywhere():
    model = Model(random_robot(92, 3).with_actuation(("roll_1", "steer_3")))
    steering, _, _, _ = random_motion(92, model.robot, 50)
    assert (model.conditioning(steering) < HALF_DIGITS).all()


def test_three_rolling_motors_are_singular_when_their_wheels_are_parallel():
    """No push across the wheels: rolling joints push along their wheels only."""
    robot = random_robot(93, 3).with_actuation(("roll_1", "roll_2", "roll_3"))
    casters = tuple(c.model_copy(update={"offset": 0.0, "gear": ((1.0, 0.0), (0.0, 1.0))}) for c in robot.casters)
    model = Model(robot.model_copy(update={"casters": casters}))
    assert model.conditioning([0.4, 0.4, 0.4]) < HALF_DIGITS
    assert model.conditioning([0.4, 1.4, -2.4]) > 1e-3


def test_passive_motors_have_no_wrench():
    robot = robot_parameters(random_robot(94, 2).with_actuation(("steer_2",)))
    roll, steer = motor_wrenches((0.6, 0.8), robot.casters[0])
    assert roll == steer == (0.0, 0.0, 0.0)
    roll, steer = motor_wrenches((0.6, 0.8), robot.casters[1])
    assert roll == (0.0, 0.0, 0.0)
    assert np.linalg.norm(steer) > 0.0


def test_motors_push_along_lines_through_the_wheels_centre():
    """(A1): rolling along the line from the wheel's centre to the pivot, steering along the axle."""
    straight = random_robot(96, 2).casters[0].model_copy(update={"gear": ((1.0, 0.0), (0.0, 1.0))})
    caster, f = caster_parameters(straight, True, True), np.array([0.6, 0.8])
    centre = np.array(wheel_centre(tuple(f), caster))
    arm, axle = (straight.x, straight.y) - centre, np.array([-f[1], f[0]])
    for wrench, line in zip(motor_wrenches(tuple(f), caster), (arm, axle), strict=True):
        force = np.array(wrench[:2])
        assert_allclose(force[0] * line[1] - force[1] * line[0], 0.0, atol=1e-12)  # N m, rounding
        assert_allclose(centre[0] * force[1] - centre[1] * force[0], wrench[2], atol=1e-12)
        assert np.linalg.norm(force) > 1.0  # N


def test_characteristic_length_is_the_mean_distance_of_the_pivots():
    robot = random_robot(95, 4)
    expected = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in robot.casters]))
    assert_allclose(characteristic_length(robot_parameters(robot)), expected, rtol=1e-15)


@pytest.mark.parametrize("driven", ["all", ("steer_1", "roll_2", "steer_2")])
def test_model_gives_the_wrenches_of_its_driven_motors(driven):
    """Columns in the order of the driven joints, equal to gear and Jacobian by hand up to rounding; batch axes lead."""
    robot = random_robot(92, 3).with_actuation(driven)
    model = Model(robot)
    steering, _, _, _ = random_motion(92, robot, 4)
    expected = [wrench_matrix(model, angles) * [[1.0], [1.0], [model.characteristic_length]] for angles in steering]
    assert_allclose(model.motor_wrenches(steering), expected, rtol=1e-12, atol=1e-12)
    assert_allclose(model.motor_wrenches(steering[0]), expected[0], rtol=1e-12, atol=1e-12)
