"""Where joint sets are singular: the geometry against blind searches of the singular values."""

from collections import Counter
from itertools import combinations
from math import comb
from typing import Any

import numpy as np
import pytest

from caster_gym import Model, Robot, load_robot
from caster_gym.design.joint_sets import classify, turned_parallel, turned_towards
from caster_gym.shipped_files import names_of
from papers.analysis.action_lines import action_lines, meeting, smallest_singular_value
from papers.analysis.joint_sets import (
    classify_all,
    least_singular_value,
)
from papers.notation import kim2001_robot
from tests.random_robots import random_robot

CHUNG = load_robot("chung2008")
SINGULAR = 1e-12  # [-] rounding of lines of order 1
BOTH_OF_TWO = ("roll_1", "steer_1", "roll_2", "steer_2")


def with_casters(robot: Robot, *changes: dict[str, Any]) -> Robot:
    """The robot with fields of its casters changed, caster by caster."""
    casters = tuple(c.model_copy(update=change) for c, change in zip(robot.casters, changes, strict=True))
    return robot.model_copy(update={"casters": casters})


def long_legged(seed: int, count: int = 3) -> Robot:
    """A random robot with trails and offsets up to its own size, where every verdict occurs."""
    rng = np.random.default_rng((seed, 11))
    changes = [{"trail": rng.uniform(0.03, 0.8), "offset": rng.uniform(-0.2, 0.2)} for _ in range(count)]
    return with_casters(random_robot(seed, count), *changes)


def whole_casters(joints) -> int:
    return sum(count == 2 for count in Counter(joint[-1] for joint in joints).values())


def searched(robot: Robot, joints, seed: int) -> float:
    """The smallest singular value that a blind search finds: samples, then ever closer around the best."""
    rng = np.random.default_rng(seed)
    length = Model(robot).characteristic_length

    def values(steering):
        return np.linalg.svd(action_lines(robot, steering, joints) / (1.0, 1.0, length), compute_uv=False)[:, -1]

    steering = rng.uniform(-np.pi, np.pi, (20000, robot.caster_count))
    best = steering[values(steering).argsort()[:8]]
    for size in 0.3 * 0.75 ** np.arange(68):  # down to 1e-9
        around = best[:, None] + size * rng.uniform(-1.0, 1.0, (len(best), 40, robot.caster_count))
        around[:, 0] = best
        found = values(around.reshape(-1, robot.caster_count)).reshape(len(best), -1)
        best = around[np.arange(len(best)), found.argmin(axis=1)]
    return float(values(best).min())


@pytest.mark.parametrize("name", names_of("robots"))
def test_with_short_trails_two_casters_with_both_joints_decide(name):
    """kim2001, III, for every set and for four casters as well: three joints and more, never singular or somewhere."""
    sets = classify_all(load_robot(name))
    count = load_robot(name).caster_count
    assert len({one.joints for one in sets}) == len(sets) == 4**count - 1
    for one in sets:
        expected = "always" if len(one.joints) < 3 else "never" if whole_casters(one.joints) >= 2 else "somewhere"
        assert one.singular == expected, one.joints


def test_the_sets_that_the_paper_finds():
    """kim2001, III: no set of three, and three of the fifteen of four, are never singular."""
    sets = classify_all(CHUNG)
    counts = Counter((len(one.joints), one.singular) for one in sets)
    assert counts[3, "somewhere"] == comb(6, 3)
    assert [one.joints for one in sets if len(one.joints) == 4 and one.singular == "never"] == [
        BOTH_OF_TWO,
        ("roll_1", "steer_1", "roll_3", "steer_3"),
        ("roll_2", "steer_2", "roll_3", "steer_3"),
    ]
    assert counts[5, "never"] == 6 and counts[6, "never"] == 1


@pytest.mark.parametrize("seed", range(12))
def test_every_somewhere_is_shown(seed):
    """(L5), (L6): at the angles given the Jacobian loses rank, and the lines meet at the point given."""
    robot = long_legged(seed, 3 if seed % 2 else 4)
    length = Model(robot).characteristic_length
    shown = [one for one in classify_all(robot) if one.singular == "somewhere"]
    assert len(shown) > 20
    for one in shown:
        assert one.steering is not None
        assert smallest_singular_value(robot, one.steering, one.joints) < SINGULAR
        met = meeting(action_lines(robot, one.steering, one.joints), length)
        assert met.parallel == (one.point is None)
        if one.point is not None:
            np.testing.assert_allclose(met.point, one.point, atol=1e-9)  # lines may cross at small angles


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(16))
def test_a_blind_search_agrees(seed):
    """(L6): it reaches zero where the geometry says somewhere, and does not where it says never."""
    robot = long_legged(seed)
    rng = np.random.default_rng((seed, 5))
    sets = [one for one in classify_all(robot) if whole_casters(one.joints) > 0 and len(one.joints) >= 3]
    never = [one for one in sets if one.singular == "never"]
    somewhere = [one for one in sets if one.singular == "somewhere"]
    for one in (never[rng.integers(len(never))], somewhere[rng.integers(len(somewhere))]):
        found = searched(robot, one.joints, seed)
        # the search ends 1e-9 rad from a zero; lines of these robots that never meet pass farther than that
        assert (found < 1e-7) == (one.singular == "somewhere"), (one, found)


@pytest.mark.parametrize("seed", range(8))
def test_more_joints_never_make_a_set_singular(seed):
    """More lines cannot meet where fewer do not."""
    verdicts = {frozenset(one.joints): one.singular for one in classify_all(long_legged(seed))}
    order = {"always": 0, "somewhere": 1, "never": 2}
    for joints, verdict in verdicts.items():
        for joint in joints:
            fewer = joints - {joint}
            assert not fewer or order[verdicts[fewer]] <= order[verdict]


@pytest.mark.parametrize(("reach_1", "reach_2"), [(0.05, 0.4), (0.3, 0.3), (0.5, 0.2)])
def test_two_whole_casters_are_singular_while_their_wheels_can_meet(reach_1, reach_2):
    """(E10) for any trails and offsets: |ρ_1 − ρ_2| ≤ distance of the pivots ≤ ρ_1 + ρ_2, with ρ² = d² + s²."""
    ends = (abs(reach_1 - reach_2), reach_1 + reach_2)
    changes = [
        {"trail": 0.8 * reach_1, "offset": 0.6 * reach_1},
        {"trail": 0.6 * reach_2, "offset": -0.8 * reach_2},
        {},
    ]
    for distance, verdict in (
        (0.999 * ends[0], "never"),
        (1.001 * ends[0] + 1e-3, "somewhere"),
        (0.999 * ends[1], "somewhere"),
        (1.001 * ends[1], "never"),
    ):
        if distance > 0.0:
            x_2 = CHUNG.casters[0].x + distance
            robot = with_casters(CHUNG, changes[0], {**changes[1], "x": x_2}, changes[2])
            assert classify(robot, BOTH_OF_TWO).singular == verdict, distance


@pytest.mark.parametrize(
    ("trail", "verdict"), [(6.3, "somewhere"), (10.0, "somewhere"), (1.0, "never"), (0.1, "never")]
)
def test_optima_of_the_papers_table_2(trail, verdict):
    """(E10): l/2 = √3, so that d = 6.3 and 10 are singular somewhere."""
    robot = kim2001_robot(radius=0.1, trail=trail)
    assert classify(robot, BOTH_OF_TWO).singular == verdict
    assert (least_singular_value(robot, BOTH_OF_TWO).lower > 0.0) == (verdict == "never")


def test_six_joints_are_singular_only_if_all_wheels_reach_one_point():
    """Three equal circles around the corners of an equilateral triangle share a point at one trail alone, d = b."""
    for trail, verdict in ((1.99, "never"), (2.0, "somewhere"), (2.01, "never")):
        robot = kim2001_robot(radius=0.1, trail=trail)
        one = classify(robot, robot.joints)
        assert one.singular == verdict
        if one.point is not None:
            np.testing.assert_allclose(one.point, (0.0, 0.0), atol=1e-9)  # as far as the circles may miss each other


def test_three_motors_are_enough_if_one_trail_is_long():
    """The axle of caster 2 stays its trail away from pivot 2, farther than wheel 1 ever is."""
    joints = ("roll_1", "steer_1", "steer_2")
    robot = kim2001_robot(radius=0.1, trail=0.5)
    border = 2.0 * np.sqrt(3.0) + 0.5
    for factor, verdict in ((0.999, "somewhere"), (1.001, "never"), (1.3, "never")):
        longer = with_casters(robot, {}, {"trail": factor * border}, {})
        assert classify(longer, joints).singular == verdict
    assert least_singular_value(longer, joints).lower > 0.1


def test_axles_that_leave_a_gap_are_found():
    """(L6): four casters, where the discs of two axles cover the circle of wheel 1 only together."""
    robot = random_robot(0, 4)
    joints = ("roll_1", "steer_1", "steer_2", "steer_3")
    places = [{"x": 0.0, "y": 0.0, "trail": 1.0, "offset": 0.0}, {"x": 0.6, "y": 0.0}, {"x": -0.6, "y": 0.0}, {}]
    for trail, verdict in ((1.1, "somewhere"), (1.16, "somewhere"), (1.17, "never")):
        changed = [places[0], {**places[1], "trail": trail}, {**places[2], "trail": trail}, places[3]]
        one = classify(with_casters(robot, *changed), joints)
        assert one.singular == verdict  # the circles meet over the pivots at √(1 + 0.6²) = 1.166
    assert classify(with_casters(robot, *changed), joints[:3]).singular == "somewhere"


def test_rolling_joints_on_one_pivot_are_always_singular():
    """Their lines all pass through it."""
    place = {"x": 0.1, "y": 0.1}
    robot = with_casters(random_robot(0, 4), place, place, place, {})
    assert classify(robot, ("roll_1", "roll_2", "roll_3")).singular == "always"
    assert classify(robot, ("roll_1", "roll_2", "steer_3")).singular == "somewhere"
    assert classify(robot, ("roll_1", "roll_2", "roll_4")).singular == "somewhere"
    steering = np.random.default_rng(0).uniform(-np.pi, np.pi, (100, 4))
    assert smallest_singular_value(robot, steering, ("roll_1", "roll_2", "roll_3")).max() < SINGULAR
    assert smallest_singular_value(robot, steering, ("roll_1", "roll_2", "steer_3")).max() > 0.01


@pytest.mark.parametrize("way", np.linspace(-3.0, 3.0, 5))
def test_lines_turn_where_they_are_told(way):
    """(L5): through a point, and in a direction, with lateral offsets."""
    robot = random_robot(3, 3)
    joints = ("roll_1", "steer_2", "steer_3")
    point = 1.5 * np.array([np.cos(way), np.sin(way)])
    met = meeting(action_lines(robot, turned_towards(robot, joints, point), joints), 0.2)
    np.testing.assert_allclose(met.point, point, atol=1e-9)  # lines from 0.3 m around cross at 0.2 rad and more
    assert met.singular
    met = meeting(action_lines(robot, turned_parallel(robot, joints, way), joints), 0.2)
    assert met.parallel and met.singular
    assert abs(met.direction @ [np.cos(way), np.sin(way)]) == pytest.approx(1.0, abs=SINGULAR)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: classify(CHUNG, ("roll_1", "roll_9")), "unknown joint 'roll_9'"),
        (lambda: classify(CHUNG, ()), "at least one joint"),
        (lambda: turned_towards(CHUNG, ("steer_3",), (0.0, 0.1)), r"0 m from the pivot of caster 3.* at least 0.025 m"),
        (lambda: turned_towards(CHUNG, BOTH_OF_TWO, (0.0, 0.0)), r"the pivot of caster 1.* exactly 0.025 m"),
        (lambda: turned_towards(CHUNG, ("roll_1",), (0.0, np.inf)), "point must be two finite coordinates"),
        (lambda: turned_towards(CHUNG, ("roll_1",), (0.0,)), "point must be two finite coordinates"),
        (lambda: turned_parallel(CHUNG, BOTH_OF_TWO, 0.0), "both joints of caster 1 are named"),
        (lambda: turned_parallel(CHUNG, ("roll_1",), np.nan), "angle must be finite, got nan"),
    ],
)
def test_wrong_input_is_named(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_pairs_of_joints_are_always_singular():
    assert all(classify(CHUNG, joints).singular == "always" for joints in combinations(CHUNG.joints, 2))
