"""Which driven sets can always push the robot, and where the others cannot."""

from itertools import combinations, product

import numpy as np
import pytest

from caster_gym import Model, Robot, load_robot
from caster_gym.analysis.actuation import SINGULAR, ActuationWarning, warn_if_singular, worst_conditioning
from caster_gym.shipped_files import names_of

CHUNG = load_robot("chung2008")
BOTH_JOINTS_OF_TWO = [("roll_1", "steer_1", "roll_2", "steer_2")] + [
    (f"roll_{i}", f"steer_{i}", "roll_3", "steer_3") for i in (1, 2)
]


def with_trail(robot: Robot, trail: float) -> Robot:
    casters = tuple(caster.model_copy(update={"trail": trail}) for caster in robot.casters)
    return robot.model_copy(update={"casters": casters})


def weakest_direction(robot: Robot, steering: tuple[float, ...]) -> float:
    """σ_min/σ_max of the driven joints' rows by numpy's SVD, each row at its joint's greatest torque, gear = 1."""
    rows = Model(robot).jacobian(steering, robot.driven)
    motors = {
        name: motor
        for i, c in enumerate(robot.casters, 1)
        for name, motor in ((f"roll_{i}", c.roll), (f"steer_{i}", c.steer))
    }
    length = np.sqrt(np.mean([c.x**2 + c.y**2 for c in robot.casters]))
    wrenches = rows * np.array([[motors[name].max_torque] for name in robot.driven]) / (1.0, 1.0, length)
    values = np.linalg.svd(wrenches, compute_uv=False)
    return float(values[-1] / values[0])


@pytest.mark.parametrize("joints", list(combinations(CHUNG.joints, 3)), ids="-".join)
def test_three_joints_are_singular_somewhere(joints):
    """kim2001, III: three lines can always be made to meet or to be parallel."""
    robot = CHUNG.with_actuation(joints)
    _, steering = worst_conditioning(robot)
    # the search stops within about 1e-7 rad of a zero that is approached linearly; 1e-5 leaves room
    assert weakest_direction(robot, steering) < 1e-5


def test_of_four_joints_only_both_of_each_of_two_wheels_are_never_singular():
    """kim2001, III: true of exactly three of the fifteen sets, as trail < half the pivots' distance here."""
    never = [
        joints
        for joints in combinations(CHUNG.joints, 4)
        if worst_conditioning(CHUNG.with_actuation(joints))[0] > SINGULAR
    ]
    assert never == BOTH_JOINTS_OF_TWO


@pytest.mark.parametrize("joints", BOTH_JOINTS_OF_TWO, ids="-".join)
def test_two_whole_wheels_are_singular_once_their_centres_can_coincide(joints):
    """(E10): with the trail beyond half the pivots' distance both wheels can stand on one point."""
    i, j = int(joints[0][-1]) - 1, int(joints[2][-1]) - 1
    a, b = (np.array([CHUNG.casters[k].x, CHUNG.casters[k].y]) for k in (i, j))
    half = 0.5 * float(np.hypot(*(a - b)))
    short, long = (with_trail(CHUNG, factor * half).with_actuation(joints) for factor in (0.8, 1.2))
    assert worst_conditioning(short)[0] > SINGULAR
    _, steering = worst_conditioning(long)
    assert weakest_direction(long, steering) < 1e-5  # as above
    centres = [
        p - long.casters[k].trail * np.array([np.cos(steering[k]), np.sin(steering[k])]) for p, k in ((a, i), (b, j))
    ]
    np.testing.assert_allclose(centres[0], centres[1], atol=1e-5)  # [m] as far as the search goes


@pytest.mark.parametrize("name", names_of("robots"))
def test_worst_is_below_every_point_of_a_grid_and_attained(name):
    robot = load_robot(name)
    value, steering = worst_conditioning(robot)
    model = Model(robot)
    grid = np.array(list(product(np.arange(-np.pi, np.pi, np.pi / 6.0), repeat=robot.caster_count)))
    assert value <= model.conditioning(grid).min()
    assert value == pytest.approx(float(model.conditioning(steering)), rel=1e-12)  # rounding of cos and sin in a batch
    assert all(-np.pi < angle <= np.pi for angle in steering)


@pytest.mark.parametrize("name", names_of("robots"))
def test_all_joints_driven_always_push(name, recwarn):
    robot = load_robot(name)
    assert robot.actuation == "all"
    warn_if_singular(robot)
    assert not recwarn


def test_worst_agrees_with_the_singular_values_of_the_jacobian():
    value, steering = worst_conditioning(CHUNG)
    assert value == pytest.approx(
        weakest_direction(CHUNG, steering), rel=1e-9
    )  # eigenvalues of JᵀJ: half the digits at worst


def test_same_robot_same_answer():
    assert worst_conditioning(CHUNG) == worst_conditioning(load_robot("chung2008"))


def test_singular_set_is_named_with_an_example():
    robot = CHUNG.with_actuation(("roll_1", "roll_2", "roll_3"))
    with pytest.warns(ActuationWarning, match=r"'chung2008' driven by roll_1, roll_2, roll_3 .*°, .*°, .*°\)"):
        warn_if_singular(robot)


@pytest.mark.parametrize("joints", [("roll_1",), ("roll_1", "steer_3")])
def test_fewer_than_three_joints_never_push_in_every_direction(joints):
    robot = CHUNG.with_actuation(joints)
    # eigenvalues that coincide at zero are found to the root of rounding, and conditioning is the root of them
    assert worst_conditioning(robot)[0] < 1e-3
    with pytest.warns(ActuationWarning, match=f"{', '.join(joints)} alone: fewer than three"):
        warn_if_singular(robot)
