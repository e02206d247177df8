"""caster_gym.design.search: optima against dense grids, the rule of scaling, room for wheels, targets refused."""

import re
from itertools import combinations
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.analysis.actuation import worst_conditioning
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.design.envelope import envelope_loads, motor_uses
from caster_gym.design.isotropy import global_isotropies
from caster_gym.design.joint_sets import classify
from caster_gym.design.search import (
    DesignTarget,
    Region,
    check_designable,
    isotropy_interval,
    optimise,
    redesigned,
    wheel_room,
)
from caster_gym.design.sizing import require
from caster_gym.paths.shapes import Circle
from caster_gym.robot import Robot
from tests.random_robots import random_robot

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
STRONG = DesignTarget(**LIMITS, **BOUNDS, objective="use")
LIGHT = DesignTarget(**LIMITS, **BOUNDS, objective="torque")


@pytest.fixture(scope="module")
def even():
    return optimise(ROBOT, EVEN)


@pytest.fixture(scope="module")
def light():
    return optimise(ROBOT, LIGHT)


@pytest.fixture(scope="module")
def strong():
    shares: list[float] = []
    design = optimise(ROBOT, STRONG, shares.append)
    return design, shares


def allowed(count):
    """Radii and trails (K,) of a grid over the bounds, without those whose wheels could touch."""
    radius, trail = (x.ravel() for x in np.meshgrid(*(np.linspace(low, high, count) for low, high in BOUNDS.values())))
    apart = radius + trail <= 0.0865  # half the distance of the pivots at x = ±0.0865
    return radius[apart], trail[apart]


def test_no_design_of_a_dense_grid_is_more_isotropic(even):
    """The grid's step of 1.2 mm is 3 % of the optimum's radius, around which the index falls by a tenth of that."""
    radius, trail = allowed(31)
    tops = [motor.max_speed for caster in ROBOT.casters for motor in (caster.roll, caster.steer)]
    values = global_isotropies(ROBOT, ROBOT.joints, (1.0, 1.0, 1.5), tops, radius, trail, isotropy_interval(3))
    assert values.max() <= even.value + 1e-9
    assert values.max() == pytest.approx(even.value, rel=2e-2)


def test_the_grid_of_the_picture_holds_the_objective(even):
    radius, trail, values = even.grid
    k = np.unravel_index(values.argmax(), values.shape)
    assert values[k] == pytest.approx(even.value, rel=1e-2)  # the grid's neighbour of the optimum
    assert np.hypot(radius[k] / even.radius - 1.0, trail[k] / even.trail - 1.0) < 0.1
    assert values.min() > 0.0


def test_with_all_joints_driven_alike_the_best_radius_equals_the_trail(even):
    """As kim2001 finds with six active joints for every demand (Table 2); the search stops at 1e-5 of its region."""
    assert even.radius / even.trail == pytest.approx(1.0, abs=1e-3)
    assert even.bounds == ("the room between the wheels",)


@pytest.mark.slow
def test_no_design_of_a_grid_needs_less_of_the_motors(strong):
    """Two per mille: motions were added for the best design alone, and its neighbours are easier without them."""
    design, _ = strong
    values = []
    for radius, trail in zip(*allowed(11), strict=True):
        robot = redesigned(ROBOT, radius, trail)
        values.append(motor_uses(envelope_loads(design.motions, robot, STRONG), robot, STRONG.margin).max())
    assert min(values) >= design.value * (1.0 - 2e-3)
    assert design.value == pytest.approx(min(values), rel=3e-2)  # steps of the grid: 3.5 mm of radius
    assert design.value < design.own[2]


@pytest.mark.slow
def test_no_design_of_a_grid_needs_less_torque(light):
    """Every design of a grid, by torque over the file's. The corner is the optimum; the search stops 1e-5 beside it."""
    sizes = np.array([[motor.max_torque] for caster in ROBOT.casters for motor in (caster.roll, caster.steer)])
    values = []
    for radius, trail in zip(*allowed(7), strict=True):
        loads = envelope_loads(light.motions, redesigned(ROBOT, radius, trail), LIGHT)
        values.append((LIGHT.margin * np.maximum(loads.along, loads.against) / sizes).max())
    assert light.value == pytest.approx(min(values), rel=1e-4)
    assert light.value < light.own[2]


@pytest.mark.slow
def test_least_torque_runs_to_the_smallest_wheels_and_trails_and_pays_in_speed(light, strong):
    """Torques are forces times radius or trail; the rolling motors turn faster in inverse proportion to the radius."""
    assert light.bounds == ("the least radius", "the least trail")
    assert (light.radius, light.trail) == pytest.approx((0.015, 0.01), rel=1e-3)  # bounds are met to 1e-3 of the region
    nearby = {words: value for words, _, _, value in light.nearby}
    assert nearby["radius / 1.1"] < light.value < nearby["radius × 1.1"]
    fast, slow = (require(one.robot, LIGHT, one.motions) for one in (light, strong[0]))
    assert fast.motors[0].joint == "roll_1"
    assert fast.motors[0].speed * light.radius == pytest.approx(slow.motors[0].speed * strong[0].radius, rel=1e-2)
    assert fast.motors[0].speed > slow.motors[0].speed
    assert fast.use > slow.use
    assert max(m.torque / m.has_torque for m in fast.motors) == pytest.approx(light.value, rel=6e-3)  # as for use


@pytest.mark.slow
def test_the_least_use_keeps_away_from_wheels_that_turn_too_fast():
    slow = [
        caster.model_copy(
            update={kind: getattr(caster, kind).model_copy(update={"max_speed": 50.0}) for kind in ("roll", "steer")}
        )
        for caster in ROBOT.casters
    ]
    robot = ROBOT.model_copy(update={"casters": tuple(slow)})
    bounds: dict[str, Any] = {"radius": (0.02, 0.04), "trail": (0.02, 0.03)}
    strong = optimise(robot, DesignTarget(**LIMITS, **bounds, objective="use"))
    assert np.isinf(strong.own[2])  # 1 m/s over 25 mm is 40 rad/s, with the margin of 1.3 52 of 50
    assert strong.radius > 0.026  # with which the margin's 1.3 m/s are 50 rad/s


def test_the_design_is_what_is_sized_afterwards(strong):
    """The requirement searches once more and finds at most half a per cent, at which the search ended."""
    design, _ = strong
    assert require(design.robot, STRONG, design.motions).use == pytest.approx(design.value, rel=6e-3)
    assert design.robot == redesigned(ROBOT, design.radius, design.trail)
    assert design.own[:2] == (0.025, 0.025)


def test_a_bound_is_reported_where_the_optimum_would_go_beyond(strong):
    design, _ = strong
    assert design.bounds == ("the least trail",)
    assert design.trail == BOUNDS["trail"][0]
    nearby = {words: value for words, _, _, value in design.nearby}
    assert nearby["trail / 1.1"] < design.value < nearby["trail × 1.1"]
    assert design.value < min(nearby["radius / 1.1"], nearby["radius × 1.1"])


def test_progress_rises_to_the_whole(strong):
    _, shares = strong
    assert shares == sorted(shares)
    assert shares[-1] == 1.0


def test_the_same_target_gives_the_same_design_again(even):
    again = optimise(ROBOT, EVEN)
    assert (again.radius, again.trail, again.value) == (even.radius, even.trail, even.value)


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


def test_bounds_within_which_wheels_always_touch_are_refused():
    target = DesignTarget(**{**LIMITS, **BOUNDS, "trail": (0.08, 0.1)})
    with pytest.raises(ValueError, match=r"could touch those of another caster of robot 'chung2008'.*below 0.0865 m"):
        optimise(ROBOT, target)


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


def test_casters_that_differ_are_refused():
    with pytest.raises(ValueError, match="must have the same radius to be designed together, got"):
        optimise(random_robot(0, 3), EVEN)


@pytest.mark.slow
def test_motors_that_are_too_slow_for_every_design_are_refused():
    target = DesignTarget(**{**LIMITS, **BOUNDS, "objective": "use", "speed": 20.0})
    with pytest.raises(ValueError, match=r"no design within the bounds reaches the target.* would suffice") as error:
        optimise(ROBOT, target)
    factor = float(re.findall(r"motors (\S+) times as fast", str(error.value))[0])
    content = ROBOT.model_dump()
    for caster in content["casters"]:
        for joint in ("roll", "steer"):
            caster[joint]["max_speed"] *= factor
    assert optimise(Robot.model_validate(content), target).value > 0.0


@pytest.mark.parametrize("joints", [("roll_1", "roll_2", "roll_3"), ("roll_1", "steer_1", "roll_2", "steer_3")])
def test_singular_driven_joints_are_refused(joints):
    target = DesignTarget(**LIMITS, **BOUNDS, actuation=joints)
    with pytest.raises(
        ValueError, match=r"cannot push itself in every direction .* drive roll_1, steer_1, roll_2, steer_2"
    ):
        optimise(ROBOT, target)


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
