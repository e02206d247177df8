"""caster_gym.paths.time_law: laws against hand formulas, TOPP-RA, and the motors that must drive them."""

import re

import numpy as np
import pytest
import toppra
import toppra.constraint
from numpy.testing import assert_allclose
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline

from caster_gym import Model, load_robot
from caster_gym.paths.course import build_courses
from caster_gym.paths.feasibility import motor_use
from caster_gym.robot import Robot

ROBOT = load_robot("chung2008")
MARGIN = 0.8
LINE = {"shape": "spline", "waypoints": [(0, 0), (2, 0)], "heading": "fixed"}
FORCE = MARGIN * 3 * 0.2 / 0.025  # [N] of three wheels that roll ahead
MASS = Model(ROBOT).inertia(np.zeros(3))[0, 0]


def robot_with(**caster_changes):
    content = ROBOT.model_dump()
    content["casters"] = [{**caster, **caster_changes} for caster in content["casters"]]
    return Robot(**content)


# motors that know no top speed, so that the limits are those that TOPP-RA and hand formulas are made for
TIRELESS = robot_with(
    roll={"max_torque": 0.2, "max_speed": 1e9},
    steer={"max_torque": 0.1, "max_speed": 1e9},
)


def law(path, robot=TIRELESS, speed_limit=100.0, **options):
    (course,) = build_courses(path, robot, speed_limit, **options)
    return course, course.samples[:, -1]


def test_a_straight_line_is_driven_bang_bang():
    """v² = 2 a s up to the middle, and T = 2 √(L / a); the middle is a row."""
    course, square = law(LINE)
    s, a = np.linspace(0.0, 2.0, len(square)), FORCE / MASS
    assert_allclose(square, 2.0 * a * np.minimum(s, 2.0 - s), rtol=1e-6)
    assert course.duration == pytest.approx(2.0 * np.sqrt(2.0 / a), rel=1e-6)


def test_a_speed_limit_is_reached_and_kept():
    """T = L / v + v / a, but that the corner of the law lies inside a row: less than spacing / v lost at each."""
    course, square = law(LINE, speed_limit=0.7)
    assert square.max() == pytest.approx(0.49, rel=1e-9)
    exact = 2.0 / 0.7 + 0.7 * MASS / FORCE
    assert exact <= course.duration < exact + 2.0 * 0.02 / 0.7


def test_torque_that_falls_with_the_speed_lets_the_speed_grow_as_a_first_order_lag_does():
    """M v̇ = F (1 − v/v₁): s = v₁ T (−ln(1 − v/v₁) − v/v₁) with T = M v₁/F; full torque is there to brake.

    An interval takes the torque at its faster end: the law lags behind by an error of first order, and by the second
    order of its last correction, which does not fall with the spacing.
    """
    slow = robot_with(roll={"max_torque": 0.2, "max_speed": 80.0}, steer={"max_torque": 0.1, "max_speed": 1e9})
    top, errors = 80.0 * 0.025, []
    for spacing in (0.02, 0.01):
        _, square = law({**LINE, "waypoints": [(0, 0), (1, 0)]}, slow, spacing=spacing)
        peak = int(np.argmax(square))
        share = np.sqrt(square[:peak]) / top
        way = MASS * top**2 / FORCE * (-np.log1p(-share) - share)
        behind = spacing * np.arange(peak) - way
        assert (behind > -1e-9).all()
        errors.append(behind.max())
        assert_allclose(-np.diff(square[peak + 1 :]), 2.0 * spacing * FORCE / MASS, rtol=1e-6)
    assert errors[0] < 0.015 and errors[1] < 0.008  # [m] of 0.65 m


def test_no_motor_turns_faster_than_the_margin_of_its_top_speed():
    slow = robot_with(roll={"max_torque": 0.2, "max_speed": 10.0})
    _, square = law({**LINE, "waypoints": [(0, 0), (6, 0)]}, slow)
    assert np.sqrt(square.max()) == pytest.approx(MARGIN * 10.0 * 0.025, rel=1e-2)
    assert np.sqrt(square.max()) <= MARGIN * 10.0 * 0.025 * (1.0 + 1e-9)


def test_a_straight_line_is_driven_the_same_backwards_in_time():
    _, square = law(LINE, speed_limit=1.0)
    assert_allclose(square, square[::-1], rtol=1e-6)  # the spline's ends are straight to 1e-8


def test_a_mirrored_path_has_the_same_law():
    """The robot is its own mirror image in its y-axis, with its first two casters exchanged."""
    points = [(0, 0), (0.5, 0.3), (1.2, -0.2), (1.5, 0.6)]
    path = {"shape": "spline", "waypoints": points, "heading": "fixed"}
    mirrored = {**path, "waypoints": [(-x, y) for x, y in points]}
    assert_allclose(law(mirrored, ROBOT)[1], law(path, ROBOT)[1], rtol=1e-6, atol=1e-12)


@pytest.mark.parametrize("path", ["ellipse", {"shape": "lemniscate", "heading": "fixed"}])
def test_toppra_takes_as_long(path):
    """The same limits, from the model, a pseudo-inverse and steering by SciPy, given to Pham and Pham's own solver.

    Its limits hold at the rows, ours at points between them too, and it splines the rows: 1 %.
    """
    course, square = law(path)
    s, robot = np.linspace(0.0, course.length, len(square)), Model(TIRELESS)
    heading = np.unwrap(np.arctan2(course.samples[:, 6], course.samples[:, 5]))
    pose = CubicSpline(s, np.column_stack([course.samples[:, 0:2], heading]))
    steering = _steering(pose, s, robot)
    size = np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in TIRELESS.casters]).ravel()
    weights = np.array([1.0, 1.0, 1.0 / robot.characteristic_length])

    def shares(q, rate, acceleration):
        turn = np.exp(-1j * q[2])
        v, a = turn * complex(*rate[:2]), turn * complex(*acceleration[:2]) - 1j * rate[2] * turn * complex(*rate[:2])
        wrench = robot.inverse_dynamics(q[3:], [v.real, v.imag, rate[2]], [a.real, a.imag, acceleration[2]])
        push = robot.jacobian(q[3:]).T * size
        return np.linalg.pinv(push * weights[:, None]) @ (wrench * weights)

    planes, most = np.vstack([np.eye(6), -np.eye(6)]), np.full(12, MARGIN)
    limit = toppra.constraint.SecondOrderConstraint(shares, lambda q: planes, lambda q: most, dof=6)
    line = toppra.SplineInterpolator(s, np.column_stack([pose(s), steering]))
    _, speed, _ = toppra.algorithm.TOPPRA([limit], line, gridpoints=s).compute_parameterization(0.0, 0.0)
    duration = (2.0 * np.diff(s) / (speed[1:] + speed[:-1])).sum()
    assert course.duration == pytest.approx(duration, rel=0.01)
    assert_allclose(np.sqrt(square), speed, atol=0.05 * speed.max())


def _steering(pose, s, model):
    """Steering angles along a path, from casters that point where their pivots start to, by the model's rates."""

    def twist(at):
        x, y, omega = pose(at, 1)
        v = np.exp(-1j * pose(at)[2]) * complex(x, y)
        return np.array([v.real, v.imag, omega])

    first = twist(0.0)
    pivots = np.array([complex(caster.x, caster.y) for caster in model.robot.casters])
    start = np.angle(complex(first[0], first[1]) + 1j * first[2] * pivots)
    found = solve_ivp(lambda at, d: model.rates(d, twist(at))[2], (0.0, s[-1]), start, t_eval=s, rtol=1e-8, atol=1e-8)
    return found.y.T


KEPT = 1.001  # of the margin: 0.03 % that laws may go beyond, and what the steering of `motor_use` errs by


def use_along(course, robot):
    """Greatest use of the motors, at every 0.3 ms: closer than the points that the law looks at."""
    return motor_use([course.trajectory(0.0003)], robot).use[0]


def with_friction(name, factor):
    """The robot with so many times the friction in its joints."""
    content = load_robot(name).model_dump()
    for caster in content["casters"]:
        for joint in (caster["roll"], caster["steer"]):
            joint.update({kind: factor * joint[kind] for kind in ("viscous", "coulomb")})
    return Robot(**content)


@pytest.mark.parametrize(
    "name", ["chung2008", *(pytest.param(one, marks=pytest.mark.slow) for one in ("tidybot2", "xr4000"))]
)
@pytest.mark.parametrize("shape", ["circle", "ellipse", "lemniscate", "rounded_square"])
@pytest.mark.parametrize("margin", [0.3, 0.8, 1.0])
def test_no_motor_is_used_beyond_the_margin_and_one_is_used_to_it(name, shape, margin):
    """Whatever the heading does on the way, flips of casters and dry friction that changes its sign included."""
    robot = load_robot(name)
    for heading in ("tangent", "fixed", "spinning"):
        course, square = law({"shape": shape, "heading": heading}, robot, 1.5, margin=margin)
        assert 0.99 * margin < use_along(course, robot) < KEPT * margin
        assert square.max() <= 1.5**2


@pytest.mark.parametrize(
    ("robot", "margin"), [(with_friction("tidybot2", 8.0), 0.5), (with_friction("xr4000", 4.0), 1.0)]
)
@pytest.mark.parametrize(
    "path", [{"shape": "rounded_square", "rounding": 0.1}, {"shape": "lemniscate", "width": 0.6}, "random_paths"]
)
def test_strong_friction_and_sharp_turns_keep_the_margin_too(robot, margin, path):
    """A law that looks at four points between rows alone goes 3 to 9 % beyond the margin here."""
    if path == "random_paths":
        path = {"shape": path, "count": 6, "seed": 11, "reversing": 0.0, "min_radius": 0.12, "max_yaw_rate": 4.0}
    for course in build_courses(path, robot, 1.2, margin=margin):
        assert 0.95 * margin < use_along(course, robot) < KEPT * margin


def test_a_law_does_not_depend_on_the_lines_beside_it():
    """To rounding: NumPy's tanh and complex products differ in the last bit with the place in an array."""
    robot = load_robot("tidybot2")
    path = {"shape": "random_paths", "count": 5, "seed": 11, "reversing": 0.0, "min_radius": 0.12, "max_yaw_rate": 4.0}
    together = build_courses(path, robot, 1.2)
    for count in (1, 3):
        for one, other in zip(build_courses({**path, "count": count}, robot, 1.2), together, strict=False):
            assert_allclose(one.samples, other.samples, rtol=1e-12, atol=1e-14)


def test_a_smaller_margin_takes_longer():
    durations = [law("ellipse", ROBOT, margin=margin)[0].duration for margin in (0.3, 0.5, 0.8, 1.0)]
    assert durations == sorted(durations, reverse=True)
    assert law(LINE, margin=0.2)[0].duration == pytest.approx(2.0 * law(LINE, margin=0.8)[0].duration, rel=1e-6)


def test_a_lower_speed_limit_takes_longer_and_is_slower_everywhere():
    fast, slow = (law("ellipse", TIRELESS, limit) for limit in (1.0, 0.4))
    assert slow[0].duration > fast[0].duration
    assert (slow[1] <= fast[1] + 1e-12).all()


def test_half_the_spacing_gives_nearly_the_same_law():
    """The corners of the law move by less than a row."""
    coarse, fine = (law("rounded_square", ROBOT, 1.0, spacing=spacing)[0] for spacing in (0.02, 0.01))
    assert fine.duration == pytest.approx(coarse.duration, rel=0.01)


def test_a_viscous_robot_is_slowed_and_still_within_its_motors():
    viscous = robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "viscous": 0.004})
    course, _ = law("ellipse", viscous, 1.5)
    assert course.duration > law("ellipse", ROBOT, 1.5)[0].duration
    assert 0.95 * MARGIN < use_along(course, viscous) < KEPT * MARGIN


def test_joints_that_are_not_driven_set_no_limit():
    two = ROBOT.with_actuation(("roll_1", "steer_1", "roll_2", "steer_2"))
    course, _ = law("circle", two, 1.0)
    assert course.duration > law("circle", ROBOT, 1.0)[0].duration
    assert use_along(course, two) < KEPT * MARGIN


def test_friction_beyond_the_motors_is_refused_with_path_place_and_joint():
    stuck = robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "coulomb": 0.5})
    expected = "the robot cannot move along path 'spline' at s = 0 m, (x, y) = (0, 0) m: dry friction takes 2.5 of"
    with pytest.raises(ValueError, match=re.escape(expected)):
        law(LINE, stuck)
    assert law(LINE, robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "coulomb": 0.05}))[0].duration > 0.0
    assert law(LINE, robot_with(roll={"max_torque": 2.0, "max_speed": 100.0, "coulomb": 0.5}))[0].duration > 0.0


def test_friction_that_leaves_too_little_to_start_is_refused_and_less_of_it_or_more_torque_is_not():
    nearly_stuck = {"max_torque": 0.2, "max_speed": 100.0, "coulomb": 0.155}
    with pytest.raises(ValueError, match="friction changes its sign there; less friction or stronger motors may help"):
        law("circle", robot_with(roll=nearly_stuck))
    for helpful in ({"coulomb": 0.1}, {"max_torque": 0.4}):
        assert law("circle", robot_with(roll={**nearly_stuck, **helpful}))[0].duration > 0.0
