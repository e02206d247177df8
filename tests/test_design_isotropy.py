"""The mean index over all steering angles agrees with one that takes no short cut, for many designs at once."""

from itertools import product

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Robot, load_robot
from caster_gym.design.isotropy import _entering, _grids, global_isotropies
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.shipped_files import names_of
from papers.analysis.isotropy import isotropy
from papers.notation import kim2001_robot
from tests.random_robots import random_robot

KIM = kim2001_robot(0.1, 0.1)
FOUR = ("roll_1", "steer_1", "roll_2", "steer_2")
TYPES = {
    1: ("roll_1", "roll_2", "roll_3"),
    2: ("roll_1", "roll_2", "steer_3"),
    3: ("roll_1", "steer_2", "steer_3"),
    4: ("roll_1", "steer_1", "roll_2"),
    5: ("roll_1", "steer_1", "steer_2"),
}
# a singular steering has an eigenvalue of zero, found to the rounding of the greatest; the index is its root
ROOT_OF_ROUNDING = 1e-8


def every_steering(robot: Robot, count: int) -> np.ndarray:
    angles = 2.0 * np.pi / count * np.arange(count)
    return np.array(list(product(angles, repeat=robot.caster_count)))


def brute_force(robot: Robot, joints, twist, rates, count: int) -> float:
    """(Q3) by singular values at every steering of every caster."""
    return float(isotropy(robot, every_steering(robot, count), joints, twist, rates).mean())


@pytest.mark.parametrize("count", [9, 12])  # 9 has neither a half circle nor the mirror lines of casters 1 and 2
@pytest.mark.parametrize("kind", TYPES)
def test_symmetries_of_the_triangle_are_exact(kind, count):
    """(Q5), (Q6): half the circle where only rolling is driven, half of the grid before a mirror."""
    robot, rates = kim2001_robot(0.7, 1.3), [{"roll": 1.0, "steer": 0.4}[joint[:-2]] for joint in TYPES[kind]]
    mean = global_isotropies(robot, TYPES[kind], (2.0, 2.0, 1.0), rates, interval=2.0 * np.pi / count)
    assert_allclose(mean, brute_force(robot, TYPES[kind], (2.0, 2.0, 1.0), rates, count), atol=ROOT_OF_ROUNDING)


@pytest.mark.parametrize("kind", [2, 3])
@pytest.mark.parametrize(
    ("twist", "rates", "offset"),
    [
        ((2.0, 1.0, 1.0), (1.0, 1.0, 1.0), 0.0),
        ((2.0, 2.0, 1.0), (1.0, 2.0, 3.0), 0.0),
        ((2.0, 2.0, 1.0), (1.0, 1.0, 1.0), 0.4),
    ],
    ids=["oblong", "uneven", "offset"],
)
def test_what_is_not_mirrored_is_not_taken_for_it(kind, twist, rates, offset):
    """(Q6): unlike top speeds along x and y, unlike rates, and offsets all to the left break the mirrors."""
    robot = kim2001_robot(0.7, 1.3)
    casters = tuple(caster.model_copy(update={"offset": offset}) for caster in robot.casters)
    robot = robot.model_copy(update={"casters": casters})
    mean = global_isotropies(robot, TYPES[kind], twist, rates, interval=np.radians(30.0))
    assert_allclose(mean, brute_force(robot, TYPES[kind], twist, rates, 12), atol=ROOT_OF_ROUNDING)


def test_mirrors_of_the_triangle_save_work():
    """Caster 3 stands before the mirror of casters 1 and 2: of its 12 angles 7 remain, of 6 of a half circle 4."""
    robot = robot_parameters(kim2001_robot(0.7, 1.3))
    counts = {}
    for kind in (1, 2, 3, 4):
        casters = _entering(robot, TYPES[kind], np.ones((1, 3)))
        counts[kind] = [len(angles) for angles, _ in _grids(casters, np.ones((1, 3)), 12)]
    assert counts == {1: [4, 6, 6], 2: [6, 6, 7], 3: [4, 12, 12], 4: [12, 6]}


@pytest.mark.parametrize("name", names_of("robots"))
def test_shipped_robots_agree_with_brute_force(name):
    """Offsets, four casters, and a triangle that is nearly equilateral."""
    robot = load_robot(name)
    for joints in (robot.joints, ("roll_1", "steer_1", "roll_2", "steer_2"), ("roll_1", "roll_2", "steer_3")):
        rates = np.linspace(1.0, 2.0, len(joints))
        mean = global_isotropies(robot, joints, (0.3, 0.3, 1.0), rates, interval=np.radians(45.0))
        assert_allclose(mean, brute_force(robot, joints, (0.3, 0.3, 1.0), rates, 8), atol=ROOT_OF_ROUNDING)


@pytest.mark.parametrize("casters", [2, 3, 4])
def test_any_robot_agrees_with_brute_force(casters):
    robot = random_robot(5, casters)
    joints = robot.joints[1:]
    rates = np.linspace(1.0, 2.0, len(joints))
    mean = global_isotropies(robot, joints, (1.0, 0.5, 2.0), rates, interval=np.radians(60.0))
    assert_allclose(mean, brute_force(robot, joints, (1.0, 0.5, 2.0), rates, 6), atol=ROOT_OF_ROUNDING)


@pytest.mark.parametrize("kind", TYPES)
def test_designs_of_the_same_quotient_share_their_index(kind):
    """(Q4): the wheel's radius counts only as r θ̇_max : d δ̇_max, and with rolling joints alone nothing does."""
    rng = np.random.default_rng(2)
    trail, radius = np.repeat(rng.uniform(0.1, 2.0, 2), 3), rng.uniform(0.1, 2.0, 6)  # few trails, unlike radii
    steer = rng.uniform(0.1, 10.0, 6)
    rates = np.stack([np.ones(6) if joint.startswith("roll") else steer for joint in TYPES[kind]], axis=1)
    twice = [np.concatenate(pair) for pair in ((radius, 3.0 * radius), (trail, trail), (rates, rates))]
    twice[2][6:, [joint.startswith("steer") for joint in TYPES[kind]]] *= 3.0
    means = global_isotropies(
        kim2001_robot(1.0, 1.0), TYPES[kind], (2.0, 2.0, 1.0), twice[2], twice[0], twice[1], np.radians(30.0)
    )
    np.testing.assert_array_equal(means[:6], means[6:])
    for i in range(6):  # and the shared one is right
        expected = brute_force(kim2001_robot(radius[i], trail[i]), TYPES[kind], (2.0, 2.0, 1.0), rates[i], 12)
        assert_allclose(means[i], expected, atol=ROOT_OF_ROUNDING)
    assert len(np.unique(means)) == (1 if kind == 1 else 6)


def test_with_an_offset_the_trail_counts_for_rolling_too():
    """(Q4): the wheel's offset over the trail enters its row."""
    robot = load_robot("tidybot2")
    joints, trail = ("roll_1", "roll_2", "roll_3"), np.array([0.01, 0.02])
    means = global_isotropies(robot, joints, (0.3, 0.3, 1.0), np.ones(3), 0.05, trail, np.radians(45.0))
    for i in range(2):
        casters = tuple(caster.model_copy(update={"trail": trail[i]}) for caster in robot.casters)
        expected = brute_force(robot.model_copy(update={"casters": casters}), joints, (0.3, 0.3, 1.0), np.ones(3), 8)
        assert_allclose(means[i], expected, atol=ROOT_OF_ROUNDING)
    assert means[0] != means[1]


@pytest.mark.parametrize("quotient", [1.5, 4.0])
def test_without_trail_rolling_and_steering_change_places(quotient):
    """(Q9): a quarter turn of every wheel, so that r θ̇_max / d δ̇_max and its inverse give the same mean."""
    trail = 1e-7  # [a] what is left of it changes the index by about as much
    tops = (2.0, 2.0, 1.0), np.ones(6)
    means = [
        global_isotropies(kim2001_robot(factor * trail, trail), KIM.joints, *tops, interval=np.radians(30.0))[0]
        for factor in (quotient, 1.0 / quotient, 1.0)
    ]
    assert_allclose(means[0], means[1], atol=1e-6)
    assert means[0] < means[2] - 0.01  # far more than that: even casters are better


def test_means_of_many_designs_are_those_of_each():
    radius, trail = np.array([0.1, 0.5, 0.2]), np.array([0.1, 0.1, 1.6])
    twist, rates = [[2.0, 2.0, 1.0], [1.0, 1.0, 1.0], [0.2, 0.2, 1.0]], [[1.0, 5.0, 1.0, 5.0]] * 3
    single = [
        global_isotropies(kim2001_robot(*sizes), FOUR, v, w)[0]
        for *sizes, v, w in zip(radius, trail, twist, rates, strict=True)
    ]
    assert_allclose(global_isotropies(KIM, FOUR, twist, rates, radius, trail), single, rtol=1e-10)


def test_what_is_given_once_holds_for_all():
    trail = [0.1, 0.5, 1.0]
    many = global_isotropies(KIM, FOUR, (2.0, 2.0, 1.0), np.ones(4), 0.1, trail)
    assert_allclose(
        many, [global_isotropies(kim2001_robot(0.1, d), FOUR, (2.0, 2.0, 1.0), np.ones(4))[0] for d in trail]
    )


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"joints": ("roll_1", "roll_2", "spin_3")}, r"unknown joint 'spin_3'; the joints are roll_1, .*steer_3"),
        ({"joints": ("roll_1", "steer_1")}, "three degrees of freedom: name three joints or more, got roll_1, steer_1"),
        ({"top_twist": (1.0, 0.0, 1.0)}, "top_twist must be positive and finite, got 0"),
        ({"top_twist": (1.0, 1.0)}, r"top_twist must have 3 numbers, vx, vy and ω, got shape \(2,\)"),
        ({"top_rates": (1.0, -2.0, 1.0)}, "top_rates must be positive and finite, got -2"),
        ({"top_rates": (1.0, float("nan"), 1.0)}, "top_rates must be positive and finite, got nan"),
        ({"top_rates": (1.0, 1.0)}, r"top_rates must have 3 numbers, one for each joint, got shape \(2,\)"),
        ({"interval": np.radians(7.0)}, r"the interval must divide the circle into whole parts, .* got 0.122173 rad"),
        ({"interval": 0.0}, "the interval must divide the circle into whole parts, .* got 0 rad"),
        ({"interval": float("nan")}, "the interval must divide the circle into whole parts, .* got nan rad"),
    ],
    ids=lambda value: next(iter(value)) if isinstance(value, dict) else "",
)
def test_bad_input_is_named(changed, message):
    good = {"joints": KIM.joints[:3], "top_twist": (1.0, 1.0, 1.0), "top_rates": np.ones(3)}
    with pytest.raises(ValueError, match=message):
        global_isotropies(KIM, **{**good, **changed})


@pytest.mark.parametrize(
    ("radius", "trail", "message"),
    [
        (
            [0.1, 0.2],
            [0.1, 0.2, 0.3],
            r"given once or be equally many along their first axis, got shapes \(2,\), \(3,\)",
        ),
        (np.ones((2, 2)), 0.1, r"got shapes \(2, 2\), \(1,\)"),
        (0.0, 0.1, "radius must be positive and finite, got 0"),
        (0.1, [0.1, float("inf")], "trail must be positive and finite, got inf"),
    ],
)
def test_bad_designs_are_told_apart(radius, trail, message):
    with pytest.raises(ValueError, match=message):
        global_isotropies(KIM, FOUR, (1.0, 1.0, 1.0), np.ones(4), radius, trail)
