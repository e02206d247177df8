"""caster_gym.design.envelope: loads by closed forms against brute force, linear programmes and hand calculations."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.optimize import linprog

from caster_gym import Model, load_robot
from caster_gym.design.envelope import (
    FLIP,
    FULL,
    REST,
    TOP,
    Motions,
    envelope_loads,
    flip_speed,
    least_possible_share,
    motor_uses,
    path_loads,
    placed,
    sampled_motions,
)
from caster_gym.design.target import Target
from caster_gym.paths.feasibility import motor_use
from caster_gym.paths.specification import read_paths
from tests.random_robots import random_robot

LIMITS: dict[str, Any] = {"speed": 1.0, "yaw_rate": 2.0, "acceleration": 1.0, "yaw_acceleration": 3.0}
ROBOT = load_robot("chung2008")


def one_motion(stage, caster_count=3, **coordinates):
    """A motion of a stage, straight ahead at the greatest pace unless coordinates say otherwise."""
    numbers = {"course": 0.0, "push": 0.0, "pace": 1.0, "spin": 0.0, "yawing": 0.0, **coordinates}
    share = np.zeros((caster_count, 1))
    return Motions(share=share, **{name: np.array([x]) for name, x in numbers.items()}, stage=np.array([float(stage)]))


def angles(directions):
    return np.stack([np.arctan2(s, c) for c, s in directions], axis=-1)


def wrenches_and_force(motions, robot, target, k, acceleration):
    """Wrenches (3, J) of the driven motors and the force (3,) that motion k needs for accelerations over ground."""
    (vx, vy, omega), directions, _, _ = placed(motions, robot, target)
    steering = angles(directions)[k]
    model, twist = Model(robot), np.array([vx[k], vy[k], omega[k]])
    ax, ay, alpha = acceleration
    rate = np.array([ax + omega[k] * vy[k], ay - omega[k] * vx[k], alpha])
    return model.motor_wrenches(steering), model.inverse_dynamics(steering, twist, rate)


def test_casters_on_a_steady_circle_no_longer_turn_on_the_platform():
    """(S1): with the acceleration towards the centre alone, δ̇ = 0 where lags are exact; round-off of 1 m/s over d."""
    robot = random_robot(3, 4)
    target = Target(speed=1.0, yaw_rate=1.5, acceleration=1.5, yaw_acceleration=1.0)
    circle = one_motion(FULL, 4, course=0.4, push=0.4 + 0.5 * np.pi, spin=1.0)
    v, directions, _, _ = placed(circle, robot, target)
    _, rolling, steering = Model(robot).rates(angles(directions), np.stack(v, axis=-1))
    assert_allclose(steering, 0.0, atol=1e-10)
    assert (rolling > 0.0).all()  # trailing, not leading


def test_trailing_casters_of_a_straight_line_lie_along_it():
    """(S1) without bend: at the top speed without spin the robot cruises straight ahead."""
    _, directions, held, spread = placed(one_motion(TOP, course=0.7), ROBOT, Target(**LIMITS))
    assert_allclose(angles(directions), 0.7, atol=1e-15)
    assert_allclose(np.stack(held), 0.0)
    assert_allclose(np.stack(spread), 0.0)


def test_a_start_reaches_the_flip_speed_on_a_way_of_one_trail():
    """(S2): constant acceleration from rest over the trail, integrated step by step; its error is half a step."""
    target, step, way, speed = Target(**LIMITS), 1e-5, 0.0, 0.0
    while way < ROBOT.casters[0].trail:
        speed += step * target.acceleration
        way += step * speed
    assert flip_speed(ROBOT, target) == pytest.approx(speed, abs=2e-5)
    assert flip_speed(ROBOT, Target(**LIMITS, flip_speed=0.07)) == 0.07
    assert flip_speed(ROBOT, Target(**{**LIMITS, "acceleration": 100.0})) == 1.0  # never above the top speed


@pytest.mark.slow
def test_no_acceleration_within_the_limits_asks_more_and_one_asks_as_much():
    """(S3): torques by the pseudo-inverse of the wrenches for accelerations all around.

    The damping of the least effort takes 1e-6 of the push, and some 1e-4 where wrenches are ill-conditioned; 720
    directions miss the worst by cos(0.25°).
    """
    target = Target(**LIMITS)
    motions = sampled_motions(3, 4)
    loads = envelope_loads(motions, ROBOT, target)
    sizes = np.array([m.max_torque for c in ROBOT.casters for m in (c.roll, c.steer)])
    way = np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False)
    length = np.diag([1.0, 1.0, 1.0 / Model(ROBOT).characteristic_length])  # the torques do not depend on it
    for k in np.flatnonzero(np.isin(motions.stage, (REST, FLIP))):
        torques = []
        for alpha in (-3.0, 3.0):
            for angle in way:
                wrenches, force = wrenches_and_force(motions, ROBOT, target, k, (np.cos(angle), np.sin(angle), alpha))
                torques.append(sizes * (np.linalg.pinv(length @ wrenches) @ (length @ force)))
        hardest = np.abs(torques).max(axis=0)
        assert_allclose(np.maximum(loads.along, loads.against)[:, k], hardest, rtol=1e-3)


@pytest.mark.slow
def test_the_best_way_of_sharing_is_that_of_a_linear_programme():
    """(S4): minimise t with −t <= u <= t and W u = F, at the worst of accelerations all around (1° apart)."""
    target = Target(**LIMITS)
    motions = sampled_motions(3, 2)
    worst = 0.0
    for k in range(len(motions.stage)):
        if motions.stage[k] in (FULL, TOP):
            _, _, held, _ = placed(motions, ROBOT, target)
            tried = [tuple(part[k] for part in held)]
        else:
            way = np.radians(np.arange(0.0, 360.0, 3.0))
            tried = [(np.cos(angle), np.sin(angle), alpha) for alpha in (-3.0, 3.0) for angle in way]
        for acceleration in tried:
            wrenches, force = wrenches_and_force(motions, ROBOT, target, k, acceleration)
            count = wrenches.shape[1]
            cost = np.append(np.zeros(count), 1.0)
            sides = np.block([[np.eye(count), -np.ones((count, 1))], [-np.eye(count), -np.ones((count, 1))]])
            answer = linprog(
                cost, sides, np.zeros(2 * count), np.column_stack([wrenches, np.zeros(3)]), force,
                bounds=[(None, None)] * count + [(0.0, None)],
            )  # fmt: skip
            worst = max(worst, answer.fun)
    ours = least_possible_share(motions, ROBOT, target)
    assert worst <= ours * (1.0 + 1e-7)  # the programme's tolerance
    assert worst == pytest.approx(ours, rel=1e-3)  # cos 1.5° is 3e-4 below 1


@pytest.mark.parametrize("radius", [0.02, 0.04])
def test_massless_casters_share_mass_times_acceleration_times_radius(radius):
    """Straight ahead the steering motors have no part in it: each rolling motor of three gives m a r / 3."""
    casters = [caster.model_copy(update={"radius": radius}) for caster in ROBOT.without_wheels().casters]
    robot = ROBOT.model_copy(update={"casters": tuple(casters)})
    loads = envelope_loads(one_motion(FULL), robot, Target(**LIMITS))
    expected = [5.0 * 1.0 * radius / 3.0, 0.0] * 3
    assert_allclose(loads.along[:, 0], expected, rtol=1e-5, atol=1e-12)  # the damping of the least effort: 1e-6
    assert_allclose(loads.speed[:, 0], [1.0 / radius, 0.0] * 3, atol=1e-12)


def test_paths_ask_what_the_feasibility_of_paths_says():
    paths = read_paths(["circle", "lemniscate", {"shape": "random_paths", "count": 3}])
    trajectories = [one for path in paths for one in path.trajectories(0.02)]
    for trajectory in trajectories:
        ours = motor_uses(path_loads([trajectory], ROBOT), ROBOT, 1.0).max()
        assert ours == pytest.approx(motor_use([trajectory], ROBOT).use[0], rel=1e-4)  # by which either may miss a peak
    together = motor_uses(path_loads(trajectories, ROBOT), ROBOT, 1.0).max()
    assert together == pytest.approx(motor_use(trajectories, ROBOT).use.max(), rel=1e-4)
