"""caster_gym.wrappers.odometry: pose and twist counted from encoders, with the described sizes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.engines.numpy_model import Model
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import Odometry, SteeringOffset, WheelErrors, wrap

PATH = {"shape": "ellipse", "duration": 20.0, "heading": {"kind": "spinning", "turns": 2.0}}
ROBOTS = ("chung2008", "tidybot2", "xr4000")
COUNT, SECONDS = 20, 2.0
SINGLE = 2e-5  # of numbers of order 1 to 10 in float32, in units of 0.1 m


def batch(robot, *features, period=0.02, count=COUNT):
    return wrap(CasterTrackVectorEnv(count, robot, PATH, corridor=100.0, control_period=period), *features)


def drive(env, period=0.02):
    """Observations (steps + 1, robots, size) and poses (steps + 1, robots, 4) of robots that are driven about."""
    observations, infos = env.reset(seed=3)
    rng = np.random.default_rng(0)
    seen, poses = [observations], [infos["pose"]]
    for _ in range(round(SECONDS / 0.1)):
        action = rng.uniform(-0.5, 0.5, env.action_space.shape).astype(np.float32)
        for _ in range(round(0.1 / period)):
            observations, _, _, _, infos = env.step(action)
            seen.append(observations)
            poses.append(infos["pose"])
    return np.array(seen), np.array(poses)


def errors(shown, true, layout):
    """Counted minus true place and heading in B (steps, robots, 3), and twist (steps, robots, 3), read off."""
    angle = [np.arctan2(*np.moveaxis(layout.physical(one, "heading_error"), -1, 0)[::-1]) for one in (true, shown)]
    turned = np.angle(np.exp(1j * (angle[0] - angle[1])))
    ahead = layout.physical(shown, "position_error") @ [1.0, 1j] * np.exp(1j * turned)
    away = layout.physical(true, "position_error") @ [1.0, 1j] - ahead
    twist = layout.physical(shown, "twist") - layout.physical(true, "twist")
    return np.stack((away.real, away.imag, turned), axis=-1), twist


@pytest.mark.parametrize("robot", ROBOTS)
def test_exact_encoders_give_the_twist_and_a_pose_that_drifts_by_the_period_alone(robot):
    """The trapezoidal rule errs by T³ a step and by T² on the way: a quarter where the period is halved."""
    drift = []
    for period in (0.02, 0.01):
        env = batch(robot, Odometry(), period=period)
        shown, _ = drive(env, period)
        true, _ = drive(batch(robot, period=period), period)
        pose, twist = errors(shown, true, env.unwrapped.engine.layout)
        assert_allclose(twist, 0.0, atol=SINGLE)
        assert_allclose(pose[0], 0.0, atol=SINGLE)
        drift.append(np.sqrt(np.mean(np.square(pose[-1]))))
    assert drift[0] < 0.01
    assert 2.5 < drift[0] / drift[1] < 6.0


@pytest.mark.parametrize("robot", ROBOTS)
def test_wrong_wheels_and_zeros_make_it_drift_as_counting_by_hand_does(robot):
    """Robot by robot, with NumPy's least squares, from what encoders show."""
    features = WheelErrors(trail=(-0.001, 0.001), radius=(-0.002, 0.002)), SteeringOffset(angle=(-0.05, 0.05))
    env = batch(robot, *features, Odometry())
    layout, description = env.unwrapped.engine.layout, load_robot(robot)
    shown, poses = drive(env)
    encoders, same = drive(batch(robot, *features))
    assert_array_equal(poses, same)
    true, _ = drive(batch(robot, WheelErrors(trail=(-0.001, 0.001), radius=(-0.002, 0.002))))
    pose, twist = errors(shown, true, layout)
    model = Model(description)
    levers = np.array([lever for caster in description.casters for lever in (caster.radius, caster.trail)])
    for k in range(3):
        x, y, beta = poses[0, k, 0], poses[0, k, 1], np.arctan2(poses[0, k, 3], poses[0, k, 2])
        last = None
        for step, observation in enumerate(encoders[:, k]):
            directions = layout.physical(observation, "directions").reshape(-1, 2)
            matrix = levers[:, None] * model.jacobian(np.arctan2(directions[:, 1], directions[:, 0]))
            rates = levers * layout.physical(observation, "joint_rates")
            counted = np.linalg.lstsq(matrix, rates, rcond=None)[0]
            if last is not None:
                vx, vy, omega = 0.02 * (last + counted) / 2.0
                middle = beta + omega / 2.0
                x, y = x + vx * np.cos(middle) - vy * np.sin(middle), y + vx * np.sin(middle) + vy * np.cos(middle)
                beta += omega
            last = counted
            seen = layout.physical(true[step, k], "twist") + twist[step, k]
            assert_allclose(seen, counted, atol=10.0 * SINGLE)
        away = (x - poses[-1, k, 0] + 1j * (y - poses[-1, k, 1])) * (poses[-1, k, 2] - 1j * poses[-1, k, 3])
        assert_allclose(pose[-1, k, :2], (away.real, away.imag), atol=10.0 * SINGLE)
        assert abs(away) > 0.001  # [m]


def test_every_episode_begins_at_the_true_pose():
    """Also where one ends and the next begins in one step, and where only some are started anew."""
    env, bare = batch("chung2008", WheelErrors(radius=0.003), Odometry()), batch("chung2008", WheelErrors(radius=0.003))
    shown, _ = drive(env)
    true, _ = drive(bare)
    layout = env.unwrapped.engine.layout
    before, _ = errors(shown[-1], true[-1], layout)
    mask = np.arange(COUNT) % 2 == 0
    again, *_ = env.reset(options={"reset_mask": mask})
    as_is, *_ = bare.reset(options={"reset_mask": mask})
    after, _ = errors(again, as_is, layout)
    assert np.abs(before[:, :2]).max(axis=1).min() > 1e-3
    assert_allclose(after[mask], 0.0, atol=SINGLE)
    assert_array_equal(again[~mask], shown[-1][~mask])
