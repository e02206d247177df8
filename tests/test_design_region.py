"""caster_gym.design.region: the rule of scaling, room for wheels, and targets that leave nothing to be designed."""

import re
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.analysis.actuation import worst_conditioning
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.design.joint_sets import classify
from caster_gym.design.region import DesignTarget, Region, check_designable, redesigned, wheel_room
from caster_gym.paths.shapes import Circle

ROBOT = load_robot("chung2008")
LIMITS: dict[str, Any] = {
    "speed": 1.0,
    "yaw_rate": 1.5,
    "acceleration": 0.8,
    "yaw_acceleration": 3.0,
    "accelerating_up_to": 0.7,
}
BOUNDS: dict[str, Any] = {"radius": (0.015, 0.05), "trail": (0.01, 0.05)}
EVEN = DesignTarget(**LIMITS, **BOUNDS, objective="isotropy")


def test_a_robot_redesigned_as_it_is_stays_equal():
    assert redesigned(ROBOT, 0.025, 0.025) == ROBOT


def test_wheels_and_links_grow_in_likeness():
    """(S7): a uniform disc m r²/2, m r²/4 and a uniform rod m d²/12 from the pivot to the axle, drawn anew."""
    casters = []
    for radius, trail in ((0.03, 0.02), (0.045, 0.07)):
        content = ROBOT.model_dump()
        for caster in content["casters"]:
            caster |= {"radius": radius, "trail": trail}
            caster["wheel"] |= {"spin_inertia": 0.5 * 0.5 * radius**2, "yaw_inertia": 0.25 * 0.5 * radius**2}
            caster["link"] |= {"inertia": 0.1 * trail**2 / 12.0, "com": (0.5 * trail, 0.003)}
        casters.append(parse(type(ROBOT), content, "robot"))
    small, large = casters
    grown = redesigned(small, 0.045, 0.07)
    for ours, theirs in zip(grown.casters, large.casters, strict=True):
        assert_allclose(ours.wheel.spin_inertia, theirs.wheel.spin_inertia, rtol=1e-12)  # round-off
        assert_allclose(ours.wheel.yaw_inertia, theirs.wheel.yaw_inertia, rtol=1e-12)
        assert_allclose(ours.link.inertia, theirs.link.inertia, rtol=1e-12)
        assert_allclose(ours.link.com, theirs.link.com, rtol=1e-12)
    assert grown.platform == small.platform


@pytest.mark.parametrize(("share", "touch"), [(0.9999, False), (1.0001, True)])
def test_wheels_meet_exactly_where_the_room_ends(share, touch):
    """(S8): ends of two wheels swept around their pivots, 0.1° apart, which misses 4e-7 of a reach."""
    robot = load_robot("tidybot2")
    first, second = robot.casters[0], robot.casters[1]
    radius = 0.05
    trail = share * wheel_room(robot) - radius
    assert (first.y, second.y) == (-0.17015, 0.17015)
    f = np.exp(1j * np.radians(np.arange(0.0, 360.0, 0.1)))
    hindmost = (-(trail + radius) + 1j * first.offset) * f
    assert ((complex(first.x, first.y) + hindmost).imag.max() > 0.0) == touch  # beyond the line between the two
    assert ((complex(second.x, second.y) + hindmost).imag.min() < 0.0) == touch


def test_two_casters_with_all_joints_are_never_singular_within_the_room():
    """E10: only wheels that could meet make both joints of two casters singular."""
    room = wheel_room(ROBOT)
    robot = redesigned(ROBOT, 0.005, 0.98 * (room - 0.005)).with_actuation(["roll_1", "steer_1", "roll_2", "steer_2"])
    assert worst_conditioning(robot)[0] > 1e-3
    beyond = redesigned(robot, 0.005, 1.1 * room)
    assert worst_conditioning(beyond)[0] < 1e-6


def test_within_the_room_the_driven_joints_alone_decide_whether_a_design_is_singular():
    """(S8) with (L6): never singular if both joints of two casters are driven, for whatever radius and trail."""
    radius, trail = Region.of(ROBOT, EVEN).design(np.random.default_rng(1).random((5, 2)))
    designs = [redesigned(ROBOT, r, d) for r, d in zip(radius, trail, strict=True)]
    for count in (3, 4, 5, 6):
        for joints in combinations(ROBOT.joints, count):
            paired = sum({f"roll_{i}", f"steer_{i}"} <= set(joints) for i in (1, 2, 3))
            for design in designs:
                assert (classify(design, joints).singular == "never") == (paired >= 2), joints


def test_every_place_of_the_region_is_a_design_within_bounds_and_room():
    region = Region.of(ROBOT, EVEN)
    places = np.random.default_rng(0).random((1000, 2))
    radius, trail = region.design(np.concatenate([places, [[0.0, 0.0], [1.0, 1.0], [0.0, 1.0], [1.0, 0.0]]]))
    assert (radius + trail <= wheel_room(ROBOT) + 1e-12).all()
    assert (radius >= 0.015 - 1e-12).all()
    assert (radius <= 0.05 + 1e-12).all()
    assert (trail >= 0.01 - 1e-12).all()
    assert (trail <= 0.05 + 1e-12).all()


def test_reversed_bounds_are_refused():
    with pytest.raises(ConfigurationError, match=r"radius.*the first bound must be below the second, got \[0.05, 0.01"):
        parse(DesignTarget, {**LIMITS, **BOUNDS, "radius": [0.05, 0.01]}, "target")


def test_wheels_within_the_room_that_a_message_names_do_not_touch():
    with pytest.raises(ValueError, match="must stay below") as error:
        Region.of(ROBOT, DesignTarget(**{**LIMITS, **BOUNDS, "trail": (0.08, 0.1)}))
    room = float(re.findall(r"below ([\d.]+) m", str(error.value))[0])
    least = BOUNDS["radius"][0]
    assert Region.of(ROBOT, DesignTarget(**{**LIMITS, **BOUNDS, "trail": (room - least - 1e-9, 0.1)}))


def test_casters_at_one_place_are_told_that_no_wheels_have_room():
    first, *others = ROBOT.casters
    one_place = ROBOT.model_copy(update={"casters": (first, first, *others)})
    with pytest.raises(ValueError, match="radius and trail have no room at all"):
        Region.of(one_place, EVEN)


def test_bounds_within_which_motors_push_too_unevenly_are_refused_as_such():
    target = DesignTarget(**{**LIMITS, **BOUNDS, "radius": (1e-4, 2e-4)})
    with pytest.raises(ValueError, match=r"with radius 0\.141 mm, trail .* times as strongly in one direction"):
        check_designable(ROBOT, target)


def test_bounds_of_which_a_part_is_sound_are_searched():
    region = check_designable(ROBOT, DesignTarget(**{**LIMITS, **BOUNDS, "radius": (1e-4, 0.05)}))
    assert region.radius == (1e-4, 0.05)


def test_a_path_that_cannot_be_timed_is_refused_before_the_search():
    target = DesignTarget(**LIMITS, **BOUNDS, paths=(Circle(duration=1e-4),))
    with pytest.raises(ValueError, match="a path needs at least 10"):
        check_designable(ROBOT, target)


def test_robots_of_more_casters_than_can_be_searched_are_refused():
    turns = 2.0 * np.pi * np.arange(13) / 13
    places = [{"x": float(np.cos(turn)), "y": float(np.sin(turn))} for turn in turns]
    many = ROBOT.model_copy(update={"casters": tuple(ROBOT.casters[0].model_copy(update=place) for place in places)})
    with pytest.raises(ValueError, match="has 13 casters; designs are searched for at most 12"):
        check_designable(many, DesignTarget(**{**LIMITS, **BOUNDS}))


def test_paths_of_too_many_time_steps_are_refused_before_they_are_made():
    target = DesignTarget(**{**LIMITS, **BOUNDS, "paths": [{"shape": "random_paths", "count": 100_000}]})
    with pytest.raises(ValueError, match=r"the paths take 5e\+07 time steps together, at most 400000 are looked at"):
        check_designable(ROBOT, target)
