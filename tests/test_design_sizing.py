"""caster_gym.design.sizing: requirements that are proportional, enough and no more than enough."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.design.envelope import Loads, envelope_loads, motor_uses, sampled_motions
from caster_gym.design.sizing import (
    harder_motions,
    motor_shares,
    require,
    sized,
    smallest_motor,
    trajectories_of,
)
from caster_gym.design.target import Target
from caster_gym.paths.feasibility import motor_use
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, RoundedSquare

ROBOT = load_robot("chung2008")
LIMITS: dict[str, Any] = {"speed": 1.0, "yaw_rate": 2.0, "acceleration": 1.0, "yaw_acceleration": 3.0}
GENTLE: dict[str, Any] = {"speed": 0.05, "yaw_rate": 0.1, "acceleration": 0.02, "yaw_acceleration": 0.05}
PATHS = (Circle(duration=6.0), RoundedSquare(), RandomPaths(count=4))
FEW = sampled_motions(3, 64)


def test_the_use_of_a_motor_by_hand():
    """(S5): 0.1 N m at 50 of 100 rad/s is all that a motor of 0.2 N m has left; braking it has all of it."""
    loads = Loads(np.full((6, 1), 0.05), np.full((6, 1), 0.04), np.full((6, 1), 50.0))
    roll, steer = motor_uses(loads, ROBOT, 1.0)[:2, 0]
    assert roll == pytest.approx(0.05 / 0.1)
    assert steer == pytest.approx(0.05 / 0.05)
    assert motor_uses(loads, ROBOT, 1.5)[0, 0] == pytest.approx(0.075 / 0.05)  # 75 rad/s leave a quarter
    assert np.isinf(motor_uses(loads, ROBOT, 2.0)).all()
    braking = loads._replace(along=np.zeros((6, 1)))
    assert motor_uses(braking, ROBOT, 1.0)[0, 0] == pytest.approx(0.04 / 0.2)


def test_the_share_of_a_motor_by_hand():
    """(S9): whatever its speed, 0.06 N m are three tenths of 0.2 N m, and 1.5 times that with a margin of 1.5."""
    loads = Loads(np.full((6, 1), 0.05), np.full((6, 1), 0.06), np.full((6, 1), 500.0))
    assert_allclose(motor_shares(loads, ROBOT, 1.0)[:, 0], [0.3, 0.6] * 3, rtol=1e-12)  # round-off
    assert_allclose(motor_shares(loads, ROBOT, 1.5)[:, 0], [0.45, 0.9] * 3, rtol=1e-12)


def test_the_smallest_motor_for_one_load_turns_twice_as_fast_without_load():
    """(S6): T0 ω0 with T0 (1 − ω/ω0) = τ is τ ω0²/(ω0 − ω), least at ω0 = 2 ω, where T0 = 2 τ."""
    torque, top = smallest_motor(np.array([3.0]), np.array([0.0]), np.array([40.0]))
    assert torque == pytest.approx(6.0, rel=1e-4)  # the search stops at 1e-5 of the ratio of speeds
    assert top == pytest.approx(80.0, rel=1e-4)


def test_the_smallest_motor_has_its_line_above_all_loads_and_on_one_of_them():
    rng = np.random.default_rng(4)
    along, against, speed = rng.uniform(0.0, 1.0, 50), rng.uniform(0.0, 1.0, 50), rng.uniform(0.0, 30.0, 50)
    torque, top = smallest_motor(along, against, speed)
    left = torque * (1.0 - speed / top) - along
    assert left.min() == pytest.approx(0.0, abs=1e-12)
    assert torque >= against.max()
    for other in np.linspace(speed.max() * 1.001, 200.0, 500):  # no top speed makes a smaller motor
        assert max(against.max(), (along / (1.0 - speed / other)).max()) * other >= torque * top * (1.0 - 1e-6)


def test_a_motor_that_never_turns_needs_its_torque_alone():
    assert smallest_motor(np.array([2.0]), np.array([3.0]), np.array([0.0])) == (3.0, 0.0)


def test_requirements_grow_in_proportion_to_the_margin():
    """The search finds the same motions but for those that are worst by their use: 1 % is its spread."""
    one, two = (require(ROBOT, Target(**LIMITS, margin=margin), FEW) for margin in (1.0, 1.5))
    for a, b in zip(one.motors, two.motors, strict=True):
        for name in ("torque", "speed", "power", "standstill_torque"):
            assert getattr(b, name) == pytest.approx(1.5 * getattr(a, name), rel=1e-2), name
    assert two.share == pytest.approx(one.share, rel=1e-2)


def test_motors_of_exactly_the_required_size_drive_the_paths_and_smaller_ones_do_not():
    """The envelope is gentle, so that the paths decide: their hardest moment uses all that a motor has."""
    target = Target(**GENTLE, paths=PATHS, margin=1.0)
    robot = sized(ROBOT, require(ROBOT, target, FEW))
    uses = motor_use(trajectories_of(target), robot).use
    assert uses.max() == pytest.approx(1.0, abs=1e-6)  # round-off, and the damping of the least effort
    weaker = [
        caster.model_copy(
            update={
                kind: getattr(caster, kind).model_copy(update={"max_torque": 0.99 * getattr(caster, kind).max_torque})
                for kind in ("roll", "steer")
            }
        )
        for caster in robot.casters
    ]
    assert motor_use(trajectories_of(target), robot.model_copy(update={"casters": tuple(weaker)})).use.max() > 1.005


@pytest.mark.parametrize("name", ["chung2008", "tidybot2"])
def test_motors_of_the_required_size_do_the_whole_envelope(name):
    """Motions that the search has not seen may ask a little more: 5 % for four casters."""
    robot = load_robot(name)
    target = Target(speed=0.5, yaw_rate=0.8, acceleration=0.5, yaw_acceleration=1.0, margin=1.0)
    strong = sized(robot, require(robot, target))
    fresh = sampled_motions(robot.caster_count, 4096)
    assert motor_uses(envelope_loads(fresh, strong, target), strong, 1.0).max() < 1.05


def test_the_search_finds_motions_that_are_harder_than_all_samples():
    target = Target(**LIMITS)
    known, found = (envelope_loads(motions, ROBOT, target) for motions in (FEW, harder_motions(FEW, ROBOT, target)))
    assert (found.speed.max(axis=1) >= known.speed.max(axis=1)).all()
    assert (found.along.max(axis=1) > 1.01 * known.along.max(axis=1)).any()


def test_no_way_of_sharing_beats_the_least_possible_share():
    requirement = require(ROBOT, Target(**LIMITS), FEW)
    assert 0.0 < requirement.least_share <= requirement.share


def test_enough_is_what_the_files_motors_do_with_the_margin():
    gentle, harsh = require(ROBOT, Target(**GENTLE), FEW), require(ROBOT, Target(**{**LIMITS, "speed": 3.0}), FEW)
    assert all(motor.enough for motor in gentle.motors)
    assert not any(motor.enough for motor in harsh.motors if motor.joint.startswith("roll"))
    assert np.isinf(harsh.use)  # 3 m/s are 120 rad/s of 100
    assert [motor.has_power for motor in gentle.motors] == [5.0, 2.5] * 3  # T0 ω0 / 4


def test_only_driven_motors_are_sized():
    joints = ("roll_1", "steer_1", "roll_2", "steer_2")
    requirement = require(ROBOT, Target(**GENTLE, actuation=joints), FEW)
    assert tuple(motor.joint for motor in requirement.motors) == joints
    robot = sized(ROBOT.with_actuation(joints), requirement)
    assert robot.casters[2].roll.max_speed == ROBOT.casters[2].roll.max_speed
    assert_allclose(robot.max_torques[robot.driven_indices], requirement.factor * np.array([0.2, 0.1, 0.2, 0.1]))


def test_singular_driven_joints_are_refused():
    with pytest.raises(ValueError, match="cannot push itself in every direction"):
        require(ROBOT, Target(**LIMITS, actuation=("roll_1", "roll_2", "roll_3")), FEW)
