"""Lines of action against the Jacobian that the mechanics give, and their meeting against its rank."""

import numpy as np
import pytest

from caster_gym import Model, load_robot
from papers.analysis.action_lines import MEETS, action_lines, meeting, smallest_singular_value
from tests.random_robots import CASTER_COUNTS, random_robot

CHUNG = load_robot("chung2008")
EXACT = 1e-12  # rounding of lengths of 0.1 m and of a few hundred products


def random_steering(rng, robot, count):
    return rng.uniform(-np.pi, np.pi, (count, robot.caster_count))


def lines_through(rng, point, count):
    """Unit lines through a point, in random directions."""
    angles = rng.uniform(-np.pi, np.pi, count)
    u = np.stack([np.cos(angles), np.sin(angles)], axis=-1)
    return np.column_stack([u, point[0] * u[:, 1] - point[1] * u[:, 0]])


@pytest.mark.parametrize("count", CASTER_COUNTS)
def test_a_row_of_the_jacobian_is_its_line_times_a_positive_number(count):
    """(L1), (L2): √(d² + s²)/(d r) for rolling, 1/d for steering, whatever the angles."""
    robot = random_robot(1, count)
    steering = random_steering(np.random.default_rng(0), robot, 50)
    sizes = [(np.hypot(c.trail, c.offset) / (c.trail * c.radius), 1.0 / c.trail) for c in robot.casters]
    scaled = action_lines(robot, steering) * np.reshape(sizes, (-1, 1))
    np.testing.assert_allclose(scaled, Model(robot).jacobian(steering), rtol=EXACT, atol=EXACT)


def test_both_lines_of_a_caster_pass_through_its_wheel_and_the_rolling_one_through_its_pivot():
    """(L1), (L2): moments about O and A vanish; the axle is square to the rolling direction."""
    robot = random_robot(2, 3)
    steering = random_steering(np.random.default_rng(0), robot, 50)
    lines = action_lines(robot, steering)
    for i, c in enumerate(robot.casters):
        f = np.stack([np.cos(steering[:, i]), np.sin(steering[:, i])], axis=-1)
        left = np.stack([-f[:, 1], f[:, 0]], axis=-1)
        wheel = np.array([c.x, c.y]) - c.trail * f + c.offset * left
        roll, steer = lines[:, 2 * i], lines[:, 2 * i + 1]
        for line, point in ((roll, wheel), (roll, np.array([[c.x, c.y]])), (steer, wheel)):
            about_point = line[:, 2] - (point[:, 0] * line[:, 1] - point[:, 1] * line[:, 0])
            np.testing.assert_allclose(about_point, 0.0, atol=EXACT)
        np.testing.assert_allclose((steer[:, :2] * f).sum(axis=-1), 0.0, atol=EXACT)


@pytest.mark.parametrize("distance", [0.0, 1e-3, 1.0, 1e3, 1e6])
@pytest.mark.parametrize("count", [2, 3, 8])
def test_lines_through_a_point_leave_the_turn_about_it(distance, count):
    """(L3): from under the robot to a thousand kilometres away."""
    rng = np.random.default_rng(count)
    point = distance * np.array([0.6, -0.8])
    lines = lines_through(rng, point, count)
    met = meeting(lines, length=0.2)
    assert met.singular and not met.parallel
    # crossing lines at a distance D finds D to 1e-16 (D/L)² relative to L, 1e-16 of a moment seen from L away
    np.testing.assert_allclose(met.point, point, atol=1e-14 * (0.2 + 10.0 * distance**2 / 0.2))
    vx, vy, omega = met.twist
    np.testing.assert_allclose(vx**2 + vy**2 + (0.2 * omega) ** 2, 1.0, rtol=EXACT)
    np.testing.assert_allclose(lines @ met.twist, 0.0, atol=max(EXACT, 1e-15 * distance / 0.2))


def test_parallel_lines_leave_the_translation_across_them():
    """(L3): no rate, and a direction along the lines."""
    u = np.array([np.cos(0.7), np.sin(0.7)])
    lines = np.array([[*u, -0.4], [*(-u), 0.1], [*u, 2.0]])  # the way along a line does not matter
    met = meeting(lines, length=0.2)
    assert met.singular and met.parallel and np.isnan(met.point).all()
    assert abs(met.direction @ u) == pytest.approx(1.0, abs=EXACT)
    np.testing.assert_allclose(lines @ met.twist, 0.0, atol=EXACT)
    assert abs(met.twist[2]) < EXACT


def test_the_gap_bounds_the_smallest_singular_value_from_both_sides():
    """(L4): gap/√3 ≤ σ ≤ √(J − 2) gap, at 100,000 configurations of 200 robots and sets of joints."""
    rng = np.random.default_rng(0)
    for seed in range(200):
        robot = random_robot(seed, int(rng.choice(CASTER_COUNTS)))
        joints = rng.permutation(robot.joints)[: rng.integers(3, 2 * robot.caster_count + 1)].tolist()
        steering = random_steering(rng, robot, 500)
        sigma = smallest_singular_value(robot, steering, joints)
        gap = meeting(action_lines(robot, steering, joints), Model(robot).characteristic_length).gap
        assert (gap <= np.sqrt(3.0) * sigma + EXACT).all()
        assert (sigma <= np.sqrt(len(joints) - 2.0) * gap + EXACT).all()


@pytest.mark.parametrize("away", [1e-12, 1e-9, 1e-6, 1e-3])
def test_the_gap_tells_how_far_from_meeting_lines_are(away):
    """(L4) holds where singular configurations are left: a line shifted by e has a gap of the order of e/L."""
    rng = np.random.default_rng(3)
    lines = lines_through(rng, np.array([0.3, 0.2]), 5)
    lines[2, 2] += 0.2 * away
    gap = float(meeting(lines, length=0.2).gap)
    sigma = np.linalg.svd(lines / (1.0, 1.0, 0.2), compute_uv=False)[-1]
    assert 0.1 * away < gap < away
    assert gap / np.sqrt(3.0) - 1e-15 <= sigma <= np.sqrt(3.0) * gap + 1e-15  # rounding of the singular values


def test_the_gap_does_not_know_the_unit_of_length_nor_the_order_of_the_lines():
    rng = np.random.default_rng(4)
    steering = random_steering(rng, CHUNG, 20)
    length = Model(CHUNG).characteristic_length
    lines = action_lines(CHUNG, steering)
    gap = meeting(lines, length).gap
    np.testing.assert_allclose(meeting(lines * (1.0, 1.0, 1e3), length * 1e3).gap, gap, rtol=EXACT)
    np.testing.assert_allclose(meeting(lines[:, rng.permutation(6)], length).gap, gap, rtol=EXACT)


def test_one_line_taken_thrice_counts_as_parallel():
    """Rolling joints of pivots on one line can have one line between them: there is no pair that crosses."""
    met = meeting(np.tile([0.6, 0.8, 0.3], (3, 1)), length=0.5)
    assert met.singular and met.parallel
    np.testing.assert_allclose(met.twist, np.sign(met.twist[0]) * np.array([0.8, -0.6, 0.0]), atol=EXACT)
    assert abs(met.direction @ [0.6, 0.8]) == pytest.approx(1.0, abs=EXACT)


@pytest.mark.parametrize("joints", ["roll_1", ["roll_1", "steer_2"]])
def test_fewer_than_three_lines_always_meet(joints):
    steering = random_steering(np.random.default_rng(5), CHUNG, 10)
    assert meeting(action_lines(CHUNG, steering, joints), 0.1).singular.all()
    assert not smallest_singular_value(CHUNG, steering, joints).any()


def test_random_configurations_of_three_joints_are_not_singular():
    steering = random_steering(np.random.default_rng(6), CHUNG, 1000)
    met = meeting(action_lines(CHUNG, steering, ["roll_1", "roll_2", "steer_3"]), Model(CHUNG).characteristic_length)
    assert met.gap.min() > 1e3 * MEETS


@pytest.mark.parametrize(
    ("steering", "joints", "message"),
    [
        ([0.0, 0.0], "all", r"steering must have a last axis of 3, got shape \(2,\)"),
        (0.0, "all", "steering must have a last axis of 3"),
        ([0.0, np.nan, 0.0], "all", "steering must be finite, got nan"),
        ([0.0, 0.0, 0.0], ["roll_4"], "unknown joint 'roll_4'; the joints are roll_1"),
        ([0.0, 0.0, 0.0], "wheel", "unknown joint 'wheel'"),
        ([0.0, 0.0, 0.0], ["roll_1", "roll_1"], "named twice"),
    ],
)
def test_wrong_input_is_named(steering, joints, message):
    with pytest.raises(ValueError, match=message):
        action_lines(CHUNG, steering, joints)


@pytest.mark.parametrize(("lines", "length"), [([1.0, 0.0, 0.0], 1.0), ([[1.0, 0.0]], 1.0), (np.zeros((0, 3)), 1.0)])
def test_lines_of_another_shape_are_refused(lines, length):
    with pytest.raises(ValueError, match=r"lines must have shape \(\.\.\., J, 3\)"):
        meeting(lines, length)


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ([np.nan, 0.0, 0.1], "lines must be finite, got nan"),
        ([0.6, 0.8, np.inf], "lines must be finite, got inf"),
        ([0.0, 0.0, 0.1], "lines must begin with unit vectors, got one of length 0"),
        ([3.0, 4.0, 0.1], "lines must begin with unit vectors, got one of length 5"),
    ],
)
def test_a_line_that_is_none_is_named(line, message):
    with pytest.raises(ValueError, match=message):
        meeting([[1.0, 0.0, 0.0], line, [0.0, 1.0, 0.0]], 0.2)


@pytest.mark.parametrize("length", [0.0, -1.0, np.nan])
def test_a_length_that_is_none_is_refused(length):
    with pytest.raises(ValueError, match="length must be positive and finite"):
        meeting([[1.0, 0.0, 0.0]], length)
