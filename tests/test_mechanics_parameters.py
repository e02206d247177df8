"""The robot's numbers, flat."""

import numpy as np
from numpy.testing import assert_allclose

from caster_gym.mechanics.parameters import CASTER_FIELDS, PLATFORM_FIELDS, pack_parameters, robot_parameters
from tests.random_robots import random_robot


def test_every_number_of_a_robot_arrives_in_its_field():
    robot = random_robot(121, 3).with_actuation(("roll_1", "steer_1", "roll_2"))
    parameters = robot_parameters(robot)
    platform, given = parameters.platform, robot.platform
    assert platform == (
        given.mass,
        given.inertia,
        *given.com,
        given.height,
        robot.floor_friction,
        robot.coulomb_speed,
    )
    for numbers, caster in zip(parameters.casters, robot.casters, strict=True):
        assert numbers[:5] == (caster.x, caster.y, caster.trail, caster.offset, caster.radius)
        assert numbers[5:8] == (caster.wheel.mass, caster.wheel.spin_inertia, caster.wheel.yaw_inertia)
        assert numbers[8:12] == (caster.link.mass, caster.link.inertia, *caster.link.com)
        roll, steer = caster.roll, caster.steer
        gear = np.array(caster.gear)
        seen = np.diag((roll.armature, steer.armature)) + gear.T @ np.diag((roll.rotor, steer.rotor)) @ gear
        assert_allclose(numbers[12:15], (seen[0, 0], seen[1, 1], seen[0, 1]), rtol=1e-14)  # rounding
        assert numbers[15:20] == (roll.viscous, roll.coulomb, steer.viscous, steer.coulomb, caster.scrub)
        assert numbers[20:24] == (roll.max_torque, roll.max_speed, steer.max_torque, steer.max_speed)
        assert numbers[24:28] == (*caster.gear[0], *caster.gear[1])
    assert [caster[28:30] for caster in parameters.casters] == [(1.0, 1.0), (1.0, 0.0), (0.0, 0.0)]


def test_only_the_off_axis_term_tells_the_models_apart():
    robot = random_robot(122, 2)
    exact, printed = robot_parameters(robot), robot_parameters(robot, "chung2008")
    assert [caster.off_axis for caster in exact.casters] == [1.0, 1.0]
    assert printed.casters == tuple(caster._replace(off_axis=0.0) for caster in exact.casters)
    assert printed.platform == exact.platform


def test_packed_parameters_hold_the_platform_then_each_caster():
    parameters = robot_parameters(random_robot(123, 4))
    flat = pack_parameters(parameters)
    assert len(flat) == PLATFORM_FIELDS + 4 * CASTER_FIELDS
    assert flat[:PLATFORM_FIELDS] == parameters.platform
    assert flat[-CASTER_FIELDS:] == parameters.casters[-1]
