"""What a wall gives to a robot, by the direction in which it hits it."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, Robot, load_robot
from papers.analysis.impulse_shape import (
    anisotropy,
    caster_weights,
    contact_mobility,
    effective_mass,
    ellipse_gap,
    elongation,
    extremes,
    impulse,
    loss_share,
)
from tests.kane import Kane
from tests.random_robots import CASTER_COUNTS, random_motion, random_robot

ALL_ROUND = np.linspace(0.0, 2.0 * np.pi, 360, endpoint=False)
POINT = (0.21, -0.13)
E = 0.6


def unit(angle: np.ndarray) -> np.ndarray:
    return np.stack((np.cos(angle), np.sin(angle)), -1)


def with_mass_centre_at(robot: Robot, com: tuple[float, float]) -> Robot:
    return robot.model_copy(update={"platform": robot.platform.model_copy(update={"com": com})})


def regular_robot(caster_count: int) -> Robot:
    """Equal casters, with lateral offset and armatures, on a regular polygon about the platform's mass centre."""
    robot = random_robot(3, caster_count)
    angles = 0.4 + 2.0 * np.pi * np.arange(caster_count) / caster_count
    casters = tuple(
        robot.casters[0].model_copy(update={"x": 0.3 * float(np.cos(a)), "y": 0.3 * float(np.sin(a))}) for a in angles
    )
    return with_mass_centre_at(robot.model_copy(update={"casters": casters}), (0.0, 0.0))


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_impulse_solves_the_equations_of_momentum(caster_count):
    """(U1), (U2): M by Kane's equations; unknown are the twist after and the impulse, and the rebound is e."""
    robot = random_robot(1, caster_count)
    model, kane = Model(robot), Kane(robot)
    steering, *_ = random_motion(2, robot, 5)
    for delta, angle in zip(steering, (0.1, 1.3, 2.9, 4.0, 5.5), strict=True):
        n = -unit(np.array(angle))
        row = np.array([*n, POINT[0] * n[1] - POINT[1] * n[0]])
        before = np.array([*(-0.7 * n), 0.0])
        system = np.block([[kane.inertia(delta), -row[:, None]], [row[None, :], np.zeros((1, 1))]])
        *_, expected = np.linalg.solve(system, [*(kane.inertia(delta) @ before), -E * float(row @ before)])
        # the two derivations of M agree to about 1e-13
        assert impulse(model, delta, angle, E, 0.7, POINT) == pytest.approx(expected, rel=1e-10)


def test_impulse_agrees_with_the_collision_of_the_model():
    """(U2) against (C1), all round at once."""
    robot = random_robot(5, 4)
    model = Model(robot)
    steering = random_motion(5, robot)[0]
    n = -unit(ALL_ROUND)
    twist = np.concatenate((-n, np.zeros((len(n), 1))), -1)
    jump, _ = model.collide(np.tile(steering, (len(n), 1)), twist, np.tile(POINT, (len(n), 1)), n, E)
    # one solves by cofactors and one by LAPACK: a few digits of rounding
    assert_allclose(impulse(model, steering, ALL_ROUND, E, point=POINT), jump[:, 0], rtol=1e-11)


def test_mobility_at_the_centre_is_the_inverse_of_the_schur_complement():
    """(U1): yaw that is free to follow takes the coupling's share from the inertia."""
    robot = random_robot(6, 3)
    model = Model(robot)
    m = model.inertia(random_motion(6, robot, 20)[0])
    schur = m[:, :2, :2] - m[:, :2, 2:] * m[:, 2:, :2] / m[:, 2:, 2:]
    # entries of the product are of order 1, rounding times the conditioning of M
    assert_allclose(
        contact_mobility(model, random_motion(6, robot, 20)[0]) @ schur, np.tile(np.eye(2), (20, 1, 1)), atol=1e-11
    )


@pytest.mark.parametrize("point", [(0.0, 0.0), POINT])
def test_extremes_bound_all_directions_and_are_attained(point):
    """(U3) against the curve itself."""
    robot = random_robot(7, 3)
    model = Model(robot)
    steering = random_motion(7, robot, 10)[0]
    found = extremes(model, steering, point)
    masses = effective_mass(model, steering, ALL_ROUND, point)
    assert (masses <= found.greatest[:, None] * (1.0 + 1e-12)).all()  # rounding
    assert (masses >= found.least[:, None] * (1.0 - 1e-12)).all()
    for delta, least, greatest, low, high in zip(steering, *found, strict=True):
        assert effective_mass(model, delta, low, point) == pytest.approx(least, rel=1e-12)
        assert effective_mass(model, delta, high, point) == pytest.approx(greatest, rel=1e-12)
    epsilon = elongation(model, steering, point)
    assert_allclose((1.0 + np.abs(epsilon)) / (1.0 - np.abs(epsilon)), found.ratio, rtol=1e-12)
    assert_allclose(np.exp(1j * np.angle(epsilon)), np.exp(2j * found.along_greatest), atol=1e-12)


@pytest.mark.parametrize("name", ["chung2008", "xr4000", "tidybot2"])
def test_curve_bulges_over_its_ellipse_as_far_as_the_ratio_says(name):
    """(U4): measured direction by direction; 1/√(nᵀ W n) would be an ellipse, which the same measure confirms."""
    model = Model(load_robot(name))
    parallel = np.zeros(model.robot.caster_count)
    shape = extremes(model, parallel)
    angle = np.linspace(0.0, np.pi, 20001)
    masses = effective_mass(model, parallel, angle)

    def excess(radius, greatest, least):
        from_axis = angle - shape.along_greatest
        return (radius * np.hypot(np.cos(from_axis) / greatest, np.sin(from_axis) / least)).max() - 1.0

    # a maximum over steps of 1.6e-4 rad misses less than (1.6e-4)² of it, times a curvature of order 10
    assert excess(masses, shape.greatest, shape.least) == pytest.approx(float(ellipse_gap(shape.ratio)), abs=1e-6)
    assert excess(np.sqrt(masses), np.sqrt(shape.greatest), np.sqrt(shape.least)) < 1e-12


def test_curve_is_dented_where_the_ratio_exceeds_two():
    """(U4): curvature of r = 1/g(angle) has the sign of g + g''."""
    for name, dented in (("chung2008", False), ("xr4000", False), ("tidybot2", True)):
        model = Model(load_robot(name))
        parallel = np.zeros(model.robot.caster_count)
        points = effective_mass(model, parallel, ALL_ROUND)[:, None] * unit(ALL_ROUND)
        edges = np.roll(points, -1, 0) - points
        after = np.roll(edges, -1, 0)
        turns = edges[:, 0] * after[:, 1] - edges[:, 1] * after[:, 0]
        assert bool((turns < 0.0).any()) is dented
        assert bool(extremes(model, parallel).ratio > 2.0) is dented


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_direct_part_and_coupling_make_the_elongation(caster_count):
    """(U5): both parts, divided by the mean of the inertia that is left to the translations."""
    robot = random_robot(8, caster_count)
    model = Model(robot)
    steering = random_motion(8, robot, 50)[0]
    direct, coupling = anisotropy(model, steering)
    mean = 0.5 * np.trace(np.linalg.inv(contact_mobility(model, steering)), axis1=-2, axis2=-1)
    assert_allclose(elongation(model, steering), (direct + coupling) / mean, atol=1e-11)  # rounding of two inverses


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_casters_add_their_weights_at_twice_their_angles(caster_count):
    """(U6): against the inertia by Kane's equations."""
    robot = random_robot(9, caster_count)
    steering = random_motion(9, robot)[0]
    m = Kane(robot).inertia(steering)
    assert complex(0.5 * (m[0, 0] - m[1, 1]), m[0, 1]) == pytest.approx(
        complex((caster_weights(robot) * np.exp(2j * steering)).sum()), abs=1e-10
    )  # both derivations to about 1e-13 of masses of the order of 100 kg


def test_weight_of_a_caster_of_the_paper_by_hand():
    """(U6): along its wheel a caster carries its masses and spins up, across it turns about its contact."""
    along = 0.5 + 0.1 + 1.5625e-4 / 0.025**2
    across = (7.813e-5 + 2.604e-6 + 0.1 * (0.025 / 3.0) ** 2) / 0.025**2
    assert_allclose(caster_weights(load_robot("chung2008")), 0.5 * (along - across), rtol=1e-9)  # 12 digits of l


@pytest.mark.parametrize("caster_count", [3, 4, 5])
@pytest.mark.parametrize("turn", [0.0, 0.7, 2.0])
def test_symmetry_about_the_centre_makes_a_circle(caster_count, turn):
    """(U7): equal casters at equal angles to the radii of a regular polygon, whatever it is; turning one ends it."""
    robot = regular_robot(caster_count)
    model = Model(robot)
    steering = np.array([np.arctan2(c.y, c.x) for c in robot.casters]) + turn
    assert abs(elongation(model, steering)) < 1e-13  # rounding
    assert_allclose(np.abs(anisotropy(model, steering)), 0.0, atol=1e-12)  # kg, of a few tens
    steering[0] += 0.3
    assert abs(elongation(model, steering)) > 1e-3


def test_two_casters_are_too_few_for_symmetry_to_make_a_circle():
    """(U7) needs three: half a turn leaves an ellipse as it is."""
    robot = regular_robot(2)
    steering = np.array([np.arctan2(c.y, c.x) for c in robot.casters]) + 0.5
    assert abs(elongation(Model(robot), steering)) > 1e-3


def test_without_wheels_only_a_mass_centre_off_c_elongates_the_curve():
    """(U5): nothing else is left to do so; by hand, a rigid body met beside its mass centre."""
    robot = load_robot("chung2008").without_wheels()
    steering = np.random.default_rng(1).uniform(-np.pi, np.pi, (50, 3))
    assert_allclose(effective_mass(Model(robot), steering, ALL_ROUND), robot.platform.mass, rtol=1e-14)
    off = Model(with_mass_centre_at(robot, (0.03, 0.0)))
    m, i = robot.platform.mass, robot.platform.inertia
    across = 1.0 / (1.0 / m + 0.03**2 / i)
    assert_allclose(effective_mass(off, steering[0], np.array([0.0, 0.5 * np.pi])), [m, across], rtol=1e-12)


def test_wall_takes_the_share_of_energy_that_the_model_loses():
    """(U8) against the kinetic energy before and after."""
    robot = random_robot(11, 3)
    model = Model(robot)
    steering = np.tile(random_motion(11, robot)[0], (len(ALL_ROUND), 1))
    n = -unit(ALL_ROUND)
    twist = np.concatenate((-n, np.zeros((len(n), 1))), -1)
    _, after = model.collide(steering, twist, np.zeros_like(n), n, E)
    before = model.kinetic_energy(steering, twist)
    share = loss_share(model, steering[0], ALL_ROUND, E)
    assert_allclose(share, (before - model.kinetic_energy(steering, after)) / before, rtol=1e-10)  # a difference
    assert (share <= 1.0 - E * E).all()
    assert loss_share(model, steering[0], float(ALL_ROUND[7]), E) == pytest.approx(share[7], rel=1e-14)


def test_impulse_grows_with_speed_and_restitution():
    """(U2)"""
    model = Model(load_robot("chung2008"))
    hit = impulse(model, [0.1, 0.2, 0.3], 0.5, 0.0, 2.0)
    assert impulse(model, [0.1, 0.2, 0.3], 0.5, 1.0, 3.0) == pytest.approx(3.0 * hit, rel=1e-14)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda m: contact_mobility(m, [0, 0, 0], (0.1, 0.2, 0.3)), r"point must be two finite coordinates .*0\.3"),
        (lambda m: contact_mobility(m, [0, 0, 0], (0.1, np.nan)), "point must be two finite coordinates .*nan"),
        (lambda m: contact_mobility(m, [0, 0]), "steering must have a last axis of 3"),
        (lambda m: effective_mass(m, [0, 0, 0], np.inf), "direction must be a finite angle .*inf"),
        (lambda m: effective_mass(m, [0, 0, 0], [[0.0]]), "direction must be a finite angle in rad or a list"),
        (lambda m: impulse(m, [0, 0, 0], 0.0, 1.2), r"restitution must lie in 0 … 1, got 1\.2"),
        (lambda m: impulse(m, [0, 0, 0], 0.0, 0.5, -1.0), r"speed must be finite and not negative, got -1\.0"),
        (lambda m: loss_share(m, [0, 0, 0], 0.0, float("nan")), "restitution must lie in 0 … 1, got nan"),
        (lambda m: ellipse_gap(-1.0), r"ratio must be positive, got -1\.0"),
    ],
)
def test_bad_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call(Model(load_robot("chung2008")))
