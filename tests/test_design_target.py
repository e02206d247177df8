"""caster_gym.design.target: payloads against energies, and targets that nothing can meet."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.design.target import Payload, Target, check_actuation, check_conditioning, driven_as, loaded
from tests.random_robots import random_motion, random_robot

LIMITS: dict[str, Any] = {"speed": 1.0, "yaw_rate": 2.0, "acceleration": 1.0, "yaw_acceleration": 3.0}


def test_a_payload_adds_its_own_kinetic_energy_and_nothing_else():
    robot = random_robot(1, 4)
    steering, twist, _, _ = random_motion(2, robot, 20)
    load = Payload(mass=3.0, inertia=0.2, com=(0.3, -0.1))
    vx, vy, omega = twist.T
    speed = np.hypot(vx + omega * 0.1, vy + omega * 0.3)  # v + ω × (0.3, −0.1)
    own = 0.5 * 3.0 * speed**2 + 0.5 * 0.2 * omega**2
    heavy = loaded(robot, Target(**LIMITS, payload=load))
    difference = Model(heavy).kinetic_energy(steering, twist) - Model(robot).kinetic_energy(steering, twist)
    assert_allclose(difference, own, rtol=1e-11)  # round-off of sums of about 50 J


def test_without_a_payload_the_robot_is_the_same():
    robot = load_robot("chung2008")
    assert loaded(robot, Target(**LIMITS)) == robot
    assert loaded(robot, Target(**LIMITS, payload=Payload(mass=0.0))) == robot


def test_the_target_may_name_the_driven_joints():
    robot = load_robot("chung2008")
    joints = ("roll_1", "steer_1", "roll_2", "steer_2")
    assert driven_as(robot, Target(**LIMITS, actuation=joints)).driven == joints
    assert driven_as(robot, Target(**LIMITS)) is robot


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"flip_speed": 1.5}, "flip_speed must be at most the speed of 1 m/s, got 1.5 m/s"),
        ({"margin": 0.9}, "margin"),
        ({"top_speed": 1.0}, "top_speed"),
        ({"acceleration": 0.0}, "acceleration"),
        ({"accelerating_up_to": 1.2}, "accelerating_up_to"),
        ({"payload": {"mass": -1.0}}, "mass"),
        ({"speed": float("nan")}, "speed"),
    ],
)
def test_a_wrong_target_is_refused_by_a_sentence_that_names_the_key(change, words):
    with pytest.raises(ConfigurationError, match=words):
        parse(Target, {**LIMITS, **change}, "target")


def test_driven_joints_that_are_singular_somewhere_are_refused():
    robot = load_robot("chung2008")
    with pytest.raises(ValueError, match=r"; drive roll_1, steer_1, roll_2, steer_2$"):
        check_actuation(robot.with_actuation(["roll_1", "roll_2", "roll_3"]))
    with pytest.raises(ValueError, match=r"three joints or more of robot 'chung2008', got roll_1, steer_1"):
        check_actuation(robot.with_actuation(["roll_1", "steer_1"]))
    check_actuation(robot)


@pytest.mark.parametrize("trail", [0.025, 0.1, 0.3])
@pytest.mark.parametrize("name", ["chung2008", "tidybot2"])
@pytest.mark.parametrize("driven", [("roll_1", "steer_1", "roll_2"), ("steer_1", "steer_2", "steer_3")])
def test_the_joints_that_a_refusal_names_can_push_everywhere_with_trails_of_any_length(name, trail, driven):
    original = load_robot(name)
    casters = tuple(caster.model_copy(update={"trail": trail}) for caster in original.casters)
    robot = original.model_copy(update={"casters": casters})
    with pytest.raises(ValueError, match=r"; drive [\w, ]+$") as error:
        check_actuation(robot.with_actuation(driven))
    check_actuation(robot.with_actuation(str(error.value).rsplit("; drive ", 1)[1].split(", ")))


def test_trails_with_which_two_wheels_can_meet_are_refused_for_their_length():
    """E10: the circles of the wheels of casters 1 and 3 meet where their trails are more than half of 0.1732 m."""
    original = load_robot("chung2008")
    apart = abs(complex(original.casters[0].x - original.casters[2].x, original.casters[0].y - original.casters[2].y))
    for trail, meets in ((0.499 * apart, False), (0.501 * apart, True)):
        casters = tuple(caster.model_copy(update={"trail": trail}) for caster in original.casters)
        robot = original.model_copy(update={"casters": casters})
        driven = robot.with_actuation(["roll_1", "steer_1", "roll_3", "steer_3"])
        if meets:
            with pytest.raises(ValueError, match="choose shorter trails"):
                check_actuation(driven)
        else:
            check_actuation(driven)


def test_motors_that_push_unevenly_are_refused_for_that_and_not_as_singular():
    original = load_robot("chung2008")
    casters = tuple(caster.model_copy(update={"radius": 1e-4}) for caster in original.casters)
    robot = original.model_copy(update={"casters": casters})
    check_actuation(robot)
    with pytest.raises(ValueError, match=r"radius 0\.1 mm, trail 25 mm.*bring radius and trail nearer to each other"):
        check_conditioning(robot)
    check_conditioning(original)
    nearer = tuple(caster.model_copy(update={"radius": 0.02}) for caster in original.casters)
    check_conditioning(original.model_copy(update={"casters": nearer}))
