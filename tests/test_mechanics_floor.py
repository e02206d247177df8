"""Which friction is under which wheel."""

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.floor import Floor, Patch
from caster_gym.mechanics.caster import wheel_centre
from caster_gym.mechanics.floor import check_slips, floor_table, on_floor, parameters_on, wheel_frictions
from caster_gym.mechanics.parameters import robot_parameters
from tests.random_robots import random_robot


def test_wheels_feel_the_last_patch_under_their_contact_point():
    """By the distance of the contact points in W, worked out with a rotation matrix."""
    robot = random_robot(1, 5)
    rng = np.random.default_rng(1)
    patches = tuple(
        Patch(friction=float(f), x=float(x), y=float(y), radius=float(r))
        for f, x, y, r in rng.uniform((0.0, 0.5, 0.5, 0.1), (0.5, 1.5, 1.5, 0.4), (12, 4))
    )
    floor = Floor(friction=0.8, patches=patches)
    numbers, table = on_floor(robot_parameters(robot), floor), floor_table(floor)
    seen = set()
    for _ in range(50):
        position, beta, steering = rng.uniform(0.5, 1.5, 2), rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi, 5)
        f = tuple((np.cos(a), np.sin(a)) for a in steering)
        found = wheel_frictions(tuple(position), (np.cos(beta), np.sin(beta)), f, table.patches, numbers)
        turn = np.array([[np.cos(beta), -np.sin(beta)], [np.sin(beta), np.cos(beta)]])
        for friction, direction, caster in zip(found, f, numbers.casters, strict=True):
            point = position + turn @ wheel_centre(direction, caster)
            inside = [one.friction for one in patches if np.hypot(one.x - point[0], one.y - point[1]) < one.radius]
            assert friction == (inside[-1] if inside else 0.8)
            seen.add(float(friction))
    assert len(seen) > 6


def test_a_floor_without_a_friction_has_the_robots_own():
    robot = load_robot("tidybot2")
    assert parameters_on(robot, "exact", Floor()).platform.floor_friction == robot.floor_friction
    assert parameters_on(robot, "exact", Floor(friction=0.2)).platform.floor_friction == 0.2
    assert parameters_on(robot, "exact", None) == robot_parameters(robot)


def test_a_caster_without_inertia_of_its_own_is_refused_and_what_the_message_says_helps():
    robot = load_robot("chung2008").without_wheels()
    with pytest.raises(
        ValueError, match=r"caster 1 of robot .* has none about its axle: give it a 'wheel.spin_inertia'"
    ):
        check_slips(robot)
    wheel = robot.casters[0].wheel
    spun = [c.model_copy(update={"wheel": wheel.model_copy(update={"spin_inertia": 1e-4})}) for c in robot.casters]
    with pytest.raises(
        ValueError, match=r"caster 1 of robot .* has none about its pivot: give it a 'wheel.yaw_inertia'"
    ):
        check_slips(robot.model_copy(update={"casters": tuple(spun)}))
    both = wheel.model_copy(update={"spin_inertia": 1e-4, "yaw_inertia": 1e-4})
    check_slips(
        robot.model_copy(update={"casters": tuple(c.model_copy(update={"wheel": both}) for c in robot.casters)})
    )
