"""(N1) to (N8): the natural orthogonal complement, against the operational-space model and the laws of mechanics."""

from itertools import combinations

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from papers.analysis.joint_kinematics import forward_jacobian
from papers.analysis.orthogonal_complement import OrthogonalComplement
from tests.kane import Kane
from tests.random_robots import CASTER_COUNTS, frictionless, random_motion, random_robot

CHUNG = load_robot("chung2008")
PAPER_SET = ("roll_1", "roll_2", "steer_3")
SOUND = 1e3  # condition number of J_p up to which its square times 1e-16 of rounding stays below 1e-9
ROBOTS = [load_robot(name) for name in ("chung2008", "tidybot2", "xr4000")] + [
    random_robot(3, n) for n in CASTER_COUNTS
]


def relative(ours, reference):
    """Largest error of a vector, relative to its largest component."""
    return np.abs(ours - reference).max(-1) / np.abs(reference).max(-1)


def well_conditioned(robot, seed, count=1, number=100.0):
    """Three joints, steering angles, twists and torques with a J_p whose condition number is below a number."""
    rng = np.random.default_rng(seed)
    while True:
        joints = tuple(rng.choice(robot.joints, 3, replace=False))
        complement = OrthogonalComplement(robot, joints)
        steering, twist, torque, _ = random_motion(int(rng.integers(1 << 30)), robot, 50 * count)
        good = complement.condition_number(steering) < number
        if good.sum() >= count:
            return complement, steering[good][:count], twist[good][:count], torque[good][:count]


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: f"{robot.name}-{robot.caster_count}")
def test_every_three_joints_give_the_dynamics_of_the_operational_space(robot):
    """(N3), (N4), (N5), (N6), (N7), (N8): friction, gears' rotors and torques at dependent joints included."""
    steering, twist, torque, _ = random_motion(31, robot, 20)
    expected = Model(robot).forward_dynamics(steering, twist, torque)
    compared = 0
    for joints in combinations(robot.joints, 3):
        complement = OrthogonalComplement(robot, joints)
        sound = complement.condition_number(steering) < SOUND
        error = relative(complement.forward_dynamics(steering, twist, torque), expected)
        assert (error[sound] < 1e-9).all(), joints  # see SOUND
        compared += int(np.count_nonzero(sound))
    assert compared > 2 * len(list(combinations(robot.joints, 3)))  # most cases are far from singular


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: f"{robot.name}-{robot.caster_count}")
def test_true_twists_contain_the_off_axis_term(robot):
    """(D1), (E3): the paper's complement agrees with the exact model and not with the one that the paper prints."""
    complement, steering, twist, torque = well_conditioned(robot, 32, count=20)
    ours = complement.forward_dynamics(steering, twist, torque)
    exact, printed = (
        relative(ours, Model(robot, dynamics=dynamics).forward_dynamics(steering, twist, torque))
        for dynamics in ("exact", "chung2008")
    )
    assert exact.max() < 1e-9  # as above
    assert np.median(printed) > 1e-4  # no rounding: xr4000's and tidybot2's links are light, the others' are not


def test_a_link_with_its_mass_centre_over_the_axle_has_no_such_term():
    """(D1) is zero for l = d: then both of the paper's models are one."""
    casters = [c.model_copy(update={"link": c.link.model_copy(update={"com": (c.trail, 0.0)})}) for c in CHUNG.casters]
    robot = CHUNG.model_copy(update={"casters": tuple(casters)})
    complement, steering, twist, torque = well_conditioned(robot, 33, count=20)
    printed = Model(robot, dynamics="chung2008").forward_dynamics(steering, twist, torque)
    assert relative(complement.forward_dynamics(steering, twist, torque), printed).max() < 1e-9  # as above


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_each_casters_rates_give_the_same_twist(caster_count):
    """(N1), (N3): rates from Kane's equations close every loop, and their independent ones imply them all."""
    robot = random_robot(5, caster_count)
    complement, steering, twist, _ = (part if i == 0 else part[0] for i, part in enumerate(well_conditioned(robot, 34)))
    eta, theta, delta = Kane(robot).rates(steering, twist)
    rates = np.stack((eta, theta, delta), -1)
    twists = np.einsum("nij,nj->ni", forward_jacobian(robot, steering), rates)
    assert_allclose(twists, np.tile(twist, (caster_count, 1)), atol=1e-12)  # rounding of rates up to 100 rad/s
    names = [f"{kind}_{i}" for i in range(1, caster_count + 1) for kind in ("yaw", "roll", "steer")]
    named = dict(zip(names, rates.ravel(), strict=True))
    j_p, j_a = complement.loops(steering)
    dependent, independent = ([named[j] for j in joints] for joints in (complement.dependent, complement.independent))
    assert_allclose(j_p @ dependent, j_a @ independent, atol=1e-12)  # as above
    assert_allclose(
        complement.all_rates(steering, independent), rates.ravel(), rtol=0.0, atol=1e-9 * np.abs(rates).max()
    )
    assert_allclose(complement.independent_rates(steering, twist), independent, rtol=1e-9)
    moving = complement.motion(steering, independent, np.zeros(2 * caster_count))
    for found in (complement.twist(steering, independent), moving.twist):
        assert_allclose(found, twist, atol=1e-10)  # rounding times the condition number
    assert_allclose(moving.rates, complement.all_rates(steering, independent), rtol=1e-12)  # the same sums


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_loops_are_singular_where_the_rows_of_the_independent_joints_are(caster_count):
    """(N2): |det J_p| = Π d r · |det g_a|."""
    robot = random_robot(6, caster_count)
    steering, *_ = random_motion(35, robot, 10)
    product = np.prod([caster.trail * caster.radius for caster in robot.casters])
    for joints in combinations(robot.joints, 3):
        complement = OrthogonalComplement(robot, joints)
        expected = product * np.abs(np.linalg.det(Model(robot).jacobian(steering, joints)))
        found = np.abs(np.linalg.det(complement.loops(steering)[0]))
        assert_allclose(found, expected, rtol=0.0, atol=1e-10 * expected.max())  # both cancel near zero


def test_the_loops_of_any_robot_are_square():
    """(N1): as many equations as dependent rates, for every number of casters."""
    for count in CASTER_COUNTS:
        j_p, j_a = OrthogonalComplement(random_robot(7, count), ("roll_1", "steer_1", "roll_2")).loops(
            np.ones((4, count))
        )
        assert j_p.shape == (4, 3 * count - 3, 3 * count - 3)
        assert j_a.shape == (4, 3 * count - 3, 3)


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_inertia_and_coriolis_matrix_hang_together(caster_count):
    """(N4), (N5), (N6): dI/dt = C + Cᵀ, so that C does no work of its own; dI/dt by differences along the motion."""
    robot = random_robot(8, caster_count)
    complement, steering, twist, _ = (
        part if i == 0 else part[0] for i, part in enumerate(well_conditioned(robot, 36, number=50.0))
    )
    rates = complement.independent_rates(steering, twist)
    turning = Model(robot).rates(steering, twist)[2]
    step = 1e-5 / np.abs(turning).max()
    before, after = (complement.equations(steering + sign * step * turning, rates)[0] for sign in (-1.0, 1.0))
    slope = (after - before) / (2.0 * step)
    _, c = complement.equations(steering, rates)
    assert_allclose(c + c.T, slope, rtol=0.0, atol=1e-5 * np.abs(c).max())  # 1e-10 of the step, 1e-16/1e-5 of rounding


def test_inertia_is_the_kinetic_energy():
    """(N6): ½ q̇_aᵀ I q̇_a = ½ νᵀ M ν."""
    for robot in ROBOTS:
        complement, steering, twist, _ = well_conditioned(robot, 37, count=5)
        rates = complement.independent_rates(steering, twist)
        inertia, _ = complement.equations(steering, rates)
        energy = 0.5 * np.einsum("ni,nij,nj->n", rates, inertia, rates)
        assert_allclose(energy, Model(robot).kinetic_energy(steering, twist), rtol=1e-9)  # rounding, see SOUND


def test_accelerations_are_those_of_the_joints():
    """(N7): q̈_a by differences of the joint rates along a simulated motion."""
    robot = frictionless(random_robot(9, 3))
    complement, steering, twist, torque = (
        part if i == 0 else part[0] for i, part in enumerate(well_conditioned(robot, 38))
    )
    step = 1e-4
    state = np.concatenate((np.zeros(3), twist, steering))
    states = Model(robot).simulate(state, torque, step, 2)
    before, now, after = (complement.independent_rates(s[6:], s[3:6]) for s in states)
    middle = complement.motion(states[1, 6:], now, torque).accelerations
    scale = np.abs(middle).max()
    assert_allclose(
        (after - before) / (2.0 * step), middle, rtol=0.0, atol=1e-3 * scale
    )  # (1e-4 s · 100 rad/s)² and room


def test_the_printed_matrix_loses_more_than_vectors_do():
    """(N7): near the singularity of straight driving, C as a matrix costs the error a further 1/distance."""
    steering, twist, torque, _ = random_motion(39, CHUNG, 200)
    steering = 1e-4 * steering
    exact = Model(CHUNG).forward_dynamics(steering, twist, torque)
    vectors, matrix = (
        np.median(relative(OrthogonalComplement(CHUNG, PAPER_SET, p).forward_dynamics(steering, twist, torque), exact))
        for p in (False, True)
    )
    assert vectors < 0.1 * matrix  # the distance, 1e-4, but for a constant
    steering, twist, torque, _ = random_motion(40, CHUNG, 50)
    far = OrthogonalComplement(CHUNG, PAPER_SET).condition_number(steering) < 100.0
    ours, as_printed = (
        OrthogonalComplement(CHUNG, PAPER_SET, printed).forward_dynamics(steering, twist, torque)[far]
        for printed in (False, True)
    )
    far_off = 1e-9 * np.abs(ours).max()  # away from it they are the same
    assert_allclose(ours, as_printed, rtol=0.0, atol=far_off)


def test_the_papers_own_set_is_singular_when_the_robot_drives_straight():
    """(N2): wheels 1 and 2 roll on one line along x, while the operational space has nothing to invert."""
    complement = OrthogonalComplement(CHUNG, PAPER_SET)
    assert complement.condition_number(np.zeros(3)) > 1e15  # infinite but for rounding
    assert complement.condition_number(np.full(3, 0.5 * np.pi)) < 100.0
    assert np.isfinite(Model(CHUNG).forward_dynamics(np.zeros(3), np.ones(3), np.ones(6))).all()


def test_steering_and_rates_are_broadcast():
    steering, twist, torque, _ = random_motion(41, CHUNG, 6)
    complement = OrthogonalComplement(CHUNG, PAPER_SET)
    rates = complement.independent_rates(steering[0], twist)
    together = complement.motion(steering[0], rates, torque).accelerations
    one_by_one = [complement.motion(steering[0], r, t).accelerations for r, t in zip(rates, torque, strict=True)]
    assert_allclose(together, one_by_one, rtol=1e-9)  # BLAS may add in another order; the condition number is moderate


@pytest.mark.parametrize(
    ("joints", "message"),
    [
        (("roll_1", "roll_2"), r"must name 3 joints, got \('roll_1', 'roll_2'\)"),
        ("roll_1", "must name 3 joints, got 'roll_1'"),
        (("roll_1", "roll_2", "yaw_1"), "unknown joint 'yaw_1'"),
        (("roll_1", "roll_2", "roll_2"), "named twice"),
    ],
)
def test_other_than_three_known_joints_are_refused(joints, message):
    with pytest.raises(ValueError, match=message):
        OrthogonalComplement(CHUNG, joints)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((np.zeros(2), np.zeros(3), np.zeros(6)), r"steering must have a last axis of 3, got shape \(2,\)"),
        ((np.ones(3), np.zeros(4), np.zeros(6)), r"rates must have a last axis of 3, got shape \(4,\)"),
        ((np.ones(3), np.zeros(3), np.zeros(3)), r"torque must have a last axis of 6, got shape \(3,\)"),
        ((np.ones(3), np.full(3, np.nan), np.zeros(6)), "rates must be finite, got nan"),
    ],
)
def test_wrong_arrays_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        OrthogonalComplement(CHUNG, PAPER_SET).motion(*arguments)


def test_a_singular_set_is_named():
    """Pivots on a line through round numbers: J_p is singular to the last digit."""
    places = ((-0.25, 0.0), (0.25, 0.0), (0.0, 0.5))
    casters = tuple(c.model_copy(update={"x": x, "y": y}) for c, (x, y) in zip(CHUNG.casters, places, strict=True))
    robot = CHUNG.model_copy(update={"casters": casters})
    with pytest.raises(ValueError, match="the joints roll_1, roll_2, steer_3 do not tell here how the robot moves"):
        OrthogonalComplement(robot, PAPER_SET).motion(np.zeros(3), np.ones(3), np.zeros(6))
