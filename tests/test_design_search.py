"""caster_gym.design.search: optima against dense grids, and targets refused."""

import re
from typing import Any

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.design.envelope import envelope_loads, motor_uses
from caster_gym.design.isotropy import global_isotropies
from caster_gym.design.region import DesignTarget, redesigned
from caster_gym.design.search import isotropy_interval, optimise
from caster_gym.design.sizing import require
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


def test_bounds_within_which_wheels_always_touch_are_refused():
    target = DesignTarget(**{**LIMITS, **BOUNDS, "trail": (0.08, 0.1)})
    with pytest.raises(ValueError, match=r"could touch those of another caster of robot 'chung2008'.*below 0.0865 m"):
        optimise(ROBOT, target)


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
