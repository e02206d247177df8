"""caster_gym.identification.unknowns: what may be identified, and what a value means."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.identification.unknowns import (
    PARAMETERS,
    SIGNED,
    UNITS,
    parameters_with,
    robot_with,
    unknowns,
    value_of,
)
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.robot import load_robot
from caster_gym.wrappers.latency import ActionDelay, MotorLag
from caster_gym.wrappers.plants import Friction, Payload, WheelErrors
from caster_gym.wrappers.pushes import Pushes
from caster_gym.wrappers.sensors import SensorNoise, SteeringOffset
from tests.random_robots import random_robot

ROBOT = load_robot("tidybot2")
VALUES = {
    "payload_mass": 8.0,
    "payload_x": 0.1,
    "payload_y": -0.05,
    "payload_inertia": 0.3,
    "roll_viscous": 0.01,
    "roll_coulomb": 0.03,
    "steer_viscous": 0.02,
    "steer_coulomb": 0.15,
    "scrub": 0.03,
    "trail": 0.0145,
    "radius": 0.05,
}


def second_moments(masses, places, inertias, about):
    """Mass, first moments, and inertia about a point, of bodies."""
    away = np.asarray(places) - about
    return sum(masses), np.asarray(masses) @ places, sum(inertias) + np.asarray(masses) @ (away**2).sum(axis=1)


@pytest.mark.parametrize("mass", [3.0, -1.0])
def test_a_load_adds_its_mass_its_moments_and_its_inertia_about_any_point(mass):
    robot = random_robot(3, 2)  # whose mass centre is not C
    load = {"payload_mass": mass, "payload_x": 0.2, "payload_y": -0.1, "payload_inertia": 0.02}
    p, bare = parameters_with(robot, load).platform, robot.platform
    for about in (np.zeros(2), np.array([0.7, -0.3])):
        parts = second_moments([bare.mass, mass], [bare.com, (0.2, -0.1)], [bare.inertia, 0.02], about)
        whole = second_moments([p.mass], [(p.com_x, p.com_y)], [p.inertia], about)
        for part, sum_ in zip(parts, whole, strict=True):
            assert_allclose(part, sum_, rtol=1e-12)  # rounding


def test_values_of_the_file_change_nothing():
    values = {name: value_of(ROBOT, name) for name in UNITS}
    assert parameters_with(ROBOT, values) == robot_parameters(ROBOT)
    assert robot_with(ROBOT, values) == ROBOT


def test_the_robot_with_values_has_the_parameters_with_them():
    assert set(VALUES) == set(PARAMETERS)
    changed = robot_with(ROBOT, VALUES)
    assert_allclose(
        pack_parameters(robot_parameters(changed)), pack_parameters(parameters_with(ROBOT, VALUES)), rtol=1e-15
    )
    kept = {"name", "actuation", "floor_friction"}
    assert all(getattr(changed, field) == getattr(ROBOT, field) for field in kept)
    assert changed.platform.footprint == ROBOT.platform.footprint


def test_friction_below_zero_becomes_zero_in_a_robot():
    robot = robot_with(ROBOT, {"roll_viscous": -1e-3, "payload_mass": -1.0})
    assert {caster.roll.viscous for caster in robot.casters} == {0.0}
    assert robot.platform.mass == ROBOT.platform.mass - 1.0


def test_starts_are_the_files_numbers_unless_given():
    names = ("trail", "scrub", "payload_mass")
    trail, scrub, mass = unknowns(ROBOT, names, {"scrub": 0.05}, {"payload_mass": (0.0, 20.0)})
    assert (trail.start, scrub.start, mass.bounds) == (0.014008, 0.05, (0.0, 20.0))
    assert [one.unit for one in (trail, scrub, mass)] == ["m", "N m s/rad", "kg"]
    assert all(one.bounds[0] <= one.start < one.bounds[1] for one in unknowns(ROBOT, tuple(UNITS)))


@pytest.mark.parametrize(
    ("names", "starts", "bounds", "words"),
    [
        ((), {}, {}, "at least one unknown must be named"),
        (("payload_weight",), {}, {}, "unknown quantity 'payload_weight' to identify; did you mean"),
        (("trail", "trail"), {}, {}, "named twice"),
        (("trail",), {"trail": 0.5}, {}, "trail must start between its bounds"),
        (("trail",), {}, {"trail": (-0.1, 0.1)}, "lower bound of the trail must be positive"),
        (("radius_1",), {}, {"radius": (0.0, 0.1)}, "lower bound of the radius_1 must be positive"),
        (("motor_lag",), {}, {"motor_lag": (-0.1, 0.1)}, "lower bound of motor_lag must not be negative"),
        (("radius_5",), {}, {}, "has 4 casters, from radius_1 to radius_4"),
        (("radius", "radius_2"), {}, {}, "'radius' is one number that all casters share and 'radius_2'"),
        (("floor_friction",), {}, {}, "no recording determines 'floor_friction': wheels that roll without slip"),
        (("position_bias",), {}, {}, "no recording determines 'position_bias'"),
        (("pushes",), {}, {}, "no recording determines 'pushes'"),
        (("latency",), {}, {}, "did you mean 'torque_delay'"),
        (("wheel_radius",), {}, {}, "did you mean 'radius'"),
    ],
)
def test_unknowns_that_make_no_sense_are_refused(names, starts, bounds, words):
    with pytest.raises(ValueError, match=words):
        unknowns(ROBOT, names, starts, bounds)


def test_an_impossible_robot_is_refused_by_name():
    with pytest.raises(ValueError, match=r"robot 'tidybot2' as identified: 'platform.mass'"):
        robot_with(ROBOT, {"payload_mass": -60.0})


def test_a_caster_of_its_own_is_changed_alone_and_groups_name_each():
    robot = robot_with(ROBOT, {"radius": 0.05, "radius_2": 0.06, "trail_4": 0.02, "roll_strength_1": 0.5})
    assert [caster.radius for caster in robot.casters] == [0.05, 0.06, 0.05, 0.05]
    assert [caster.trail for caster in robot.casters] == [0.014008] * 3 + [0.02]
    torque = ROBOT.casters[0].roll.max_torque
    assert [caster.roll.max_torque for caster in robot.casters] == [0.5 * torque] + [torque] * 3
    named = [one.name for one in unknowns(ROBOT, ("radii", "steering_zeros"), {"radius": 0.051})]
    assert named == [f"{kind}_{i}" for kind in ("radius", "steering_zero") for i in (1, 2, 3, 4)]
    assert [one.start for one in unknowns(ROBOT, ("radii",), {"radius": 0.051})] == [0.051] * 4


def test_all_that_wrappers_disturb_can_be_asked_for_or_is_explained():
    """Every field of features of plants, sensors and drives is an unknown, leads to one, or says why not."""
    fields = [
        name
        for feature in (Payload, Friction, WheelErrors, SteeringOffset, SensorNoise, ActionDelay, MotorLag, Pushes)
        for name in (feature.model_fields["kind"].default, *feature.model_fields)
        if name != "kind"
    ]
    for name in fields:
        try:
            unknowns(ROBOT, (name,))
        except ValueError as error:
            if "no recording determines" in str(error):
                continue
            advised = str(error).split("did you mean ")[1].split("'")[1]
            unknowns(ROBOT, (advised,))  # the advice helps


def test_units_and_signs_speak_of_known_names():
    assert set(SIGNED) < set(UNITS)
