"""caster_gym.wrappers.sensors: what is measured, and what follows from it."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.observation import OBSERVATION_LIMIT, View, observe
from caster_gym.envs.tracking import Point, Reference, tracking_errors
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.paths import build_trajectories
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import SensorNoise, SteeringOffset, read_features, wrap

PATH = {"shape": "ellipse", "duration": 20.0, "heading": {"kind": "spinning", "turns": 2.0}}
ROBOT = load_robot("chung2008")
PERIOD, PREVIEW = 0.02, (0.1, 0.2, 0.4)
COUNT = 4000
FAR = 5.0 / np.sqrt(COUNT)  # five standard deviations of a mean, in units of σ
SPREAD = 5.0 / np.sqrt(2.0 * COUNT)  # and of a standard deviation


def batch(*features, count=COUNT):
    return wrap(CasterTrackVectorEnv(count, path=PATH, corridor=100.0), *features)


def moving(env):
    """The same motion in every environment: observations of resting robots tell nothing of speeds."""
    env.reset(seed=5)
    given = np.random.default_rng(1).uniform(-0.5, 0.5, (30, *env.action_space.shape)).astype(np.float32)
    for action in given:
        observations, *_ = env.step(action)
    return observations


def difference(feature, name, part):
    """What a feature adds to a column of a part, in physical units, in all robots."""
    noisy, clean = batch(feature), batch()
    layout = clean.unwrapped.engine.layout
    shown, true = (layout.physical(moving(env), name)[:, part] for env in (noisy, clean))
    return shown - true


@pytest.mark.parametrize(
    ("field", "name", "part"),
    [
        ("position", "position_error", 1),
        ("speed", "twist", 0),
        ("yaw_rate", "twist", 2),
        ("joint_rate", "joint_rates", 3),
        ("position_bias", "position_error", 0),
        ("speed_bias", "twist", 1),
        ("yaw_rate_bias", "twist", 2),
    ],
)
def test_noise_has_its_mean_and_standard_deviation(field, name, part):
    errors = difference(SensorNoise.model_validate({field: 0.03}), name, part)
    assert abs(errors.mean()) < 0.03 * FAR
    assert abs(errors.std() / 0.03 - 1.0) < SPREAD


@pytest.mark.parametrize(("field", "name"), [("heading", "heading_error"), ("heading_bias", "heading_error")])
def test_heading_noise_turns_the_heading_error(field, name):
    noisy, clean = batch(SensorNoise.model_validate({field: 0.05})), batch()
    shown, true = (clean.unwrapped.engine.layout.physical(moving(env), name) for env in (noisy, clean))
    turned = np.arctan2(
        true[:, 0] * shown[:, 1] - true[:, 1] * shown[:, 0], true[:, 0] * shown[:, 0] + true[:, 1] * shown[:, 1]
    )
    assert abs(turned.mean()) < 0.05 * FAR
    assert abs(turned.std() / 0.05 - 1.0) < SPREAD


def test_noise_of_one_step_tells_nothing_of_the_next_and_a_bias_everything():
    noisy, biased, clean = batch(SensorNoise(position=0.02)), batch(SensorNoise(position_bias=0.02)), batch()
    errors = {}
    for env in (noisy, biased, clean):
        env.reset(seed=0)
        still = np.zeros(env.action_space.shape, np.float32)
        errors[env] = np.array([env.step(still)[0][:, :2] for _ in range(3)])
    noise, bias = errors[noisy] - errors[clean], errors[biased] - errors[clean]
    assert abs(np.corrcoef(noise[0].ravel(), noise[1].ravel())[0, 1]) < FAR
    assert abs(np.corrcoef(noise[0, :, 0], noise[0, :, 1])[0, 1]) < FAR
    assert_allclose(bias[0], bias[2], atol=1e-5)  # float32 of observations of order 1
    env = biased
    again = env.reset()[0][:, :2] - clean.reset()[0][:, :2]
    assert abs(np.corrcoef(bias[0].ravel(), again.ravel())[0, 1]) < FAR


def test_noise_is_reproduced_by_its_seed():
    feature = SensorNoise(position=0.02, heading=0.02, speed_bias=0.1)
    first, second = (moving(batch(feature, count=20)) for _ in range(2))
    assert_array_equal(first, second)
    other = batch(feature, count=20)
    assert (other.reset(seed=6)[0] != batch(feature, count=20).reset(seed=5)[0]).any()


def test_an_observation_is_what_a_robot_at_the_measured_state_would_see():
    """Errors of pose and twist are read off the observation; the task's equations at that state give all the rest."""
    feature = SensorNoise(position=0.05, heading=0.2, speed=0.1, yaw_rate=0.2)
    noisy, clean = batch(feature, count=50), batch(count=50)
    layout = clean.unwrapped.engine.layout
    shown = moving(noisy)
    moving(clean)
    samples = build_trajectories(PATH, ROBOT, PERIOD)[0].samples
    reference = Reference(*samples[30])
    points = tuple(Point(*samples[30 + round(h / PERIOD), : len(Point._fields)]) for h in PREVIEW)
    heading, away = layout.physical(shown, "heading_error"), layout.physical(shown, "position_error")
    for robot, flat in enumerate(clean.unwrapped.engine.states):
        beta = np.arctan2(reference.sin, reference.cos) - np.arctan2(heading[robot, 1], heading[robot, 0])
        c, s = np.cos(beta), np.sin(beta)
        ahead, left = away[robot]
        place = (reference.x - c * ahead + s * left, reference.y - s * ahead - c * left)
        measured = np.concatenate((place, (c, s), layout.physical(shown, "twist")[robot], flat[7:]))
        state = unpack_state(tuple(measured.tolist()))
        errors = tracking_errors(state, reference)
        parameters = robot_parameters(ROBOT)
        turning = all_joint_rates(state, parameters, None)
        expected = np.array(observe(View(state, reference, errors, points, (), turning, parameters)))
        rates = next(part.place for part in layout.parts if part.name == "joint_rates")
        seen = np.ones(layout.size, dtype=np.bool_)
        seen[rates] = False  # measured on their own
        # float32 of what was read off, over units of 0.1 m
        assert_allclose(shown[robot, seen], expected[seen], atol=2e-5)


def test_steering_encoders_are_askew_by_a_constant():
    feature = SteeringOffset(angle=(-0.1, 0.3))
    offsets = []
    for steps in (1, 40):
        askew, clean = batch(feature, count=500), batch(count=500)
        angles = []
        for env in (askew, clean):
            env.reset(seed=3)
            given = np.random.default_rng(1).uniform(-0.5, 0.5, (steps, *env.action_space.shape)).astype(np.float32)
            for action in given:
                observations, _, _, _, info = env.step(action)
            part = env.unwrapped.engine.layout.physical(observations, "directions")
            angles.append(part[:, ::2] + 1j * part[:, 1::2])
            poses = info["pose"]
        assert_allclose(np.abs(angles[0]), 1.0, atol=1e-6)
        offsets.append(np.angle(angles[0] / angles[1]))
        assert_array_equal(poses, askew.unwrapped.engine.states[:, :4])  # the plant is the same
    assert_allclose(offsets[0], offsets[1], atol=1e-6)  # float32
    assert offsets[0].min() >= -0.1 - 1e-6
    assert offsets[0].max() <= 0.3 + 1e-6
    assert abs(offsets[0].mean() - 0.1) < 5.0 * 0.4 / np.sqrt(12.0 * offsets[0].size)
    assert abs(np.corrcoef(offsets[0].T)[0, 1]) < 5.0 / np.sqrt(500)  # each caster has its own


def test_steering_noise_turns_every_direction():
    noisy, clean = batch(SensorNoise(steering=0.04), count=2000), batch(count=2000)
    shown, true = (
        clean.unwrapped.engine.layout.physical(moving(env), "directions").reshape(2000, -1, 2) @ [1.0, 1j]
        for env in (noisy, clean)
    )
    errors = np.angle(shown / true)
    assert abs(errors.mean()) < 0.04 * 5.0 / np.sqrt(errors.size)
    assert abs(errors.std() / 0.04 - 1.0) < 5.0 / np.sqrt(2.0 * errors.size)


def test_obstacles_are_seen_from_where_the_robot_is():
    task: dict[str, Any] = {
        "path": PATH,
        "corridor": 100.0,
        "arena": {"pillars": [{"centre": [1.0, 0.0]}]},
        "nearest": 3,
    }
    made = CasterTrackVectorEnv(5, **task)
    noisy, clean = wrap(CasterTrackVectorEnv(5, **task), SensorNoise(position=0.1, heading=0.3)), wrap(made)
    layout = made.engine.layout
    shown, true = moving(noisy), moving(clean)
    assert (layout.physical(true, "obstacle_1")[:, 0] < 1.0).any()  # at 1 m it is the end of what is seen
    for name in ("obstacle_1", "directions", "joint_rates", "twist"):
        assert_array_equal(layout.physical(shown, name), layout.physical(true, name))
    for name in ("position_error", "heading_error", "twist_error", "preview_0.1s"):
        assert (layout.physical(shown, name)[:, :2] != layout.physical(true, name)[:, :2]).all()


def test_observations_stay_in_their_space():
    env = batch(SensorNoise(position=1e3, joint_rate=1e5), count=20)
    shown, _ = env.reset(seed=0)
    assert np.abs(shown).max() == OBSERVATION_LIMIT
    assert env.observation_space.contains(shown)


def test_no_noise_is_no_change():
    quiet, clean = batch(SensorNoise(), SteeringOffset(angle=0.0), count=10), batch(count=10)
    assert_array_equal(quiet.reset(seed=1)[0], clean.reset(seed=1)[0])


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ({"kind": "sensor_noise", "position": -0.1}, "'position' should be greater than or equal to 0"),
        ({"kind": "sensor_noise", "postion": 0.1}, "unknown key 'postion'; did you mean 'position'"),
        ({"kind": "steering_offset", "angle": [0.1, -0.1]}, "'angle' must rise from its first to its second number"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])


def test_known_zeros_turn_the_shown_angles_of_their_casters():
    zeros, angles = (0.02, -0.03, 0.1), []
    for features in ([SteeringOffset(angle=0.0, zeros=zeros)], []):
        env = batch(*features, count=3)
        part = env.unwrapped.engine.layout.physical(moving(env), "directions")
        angles.append(part[:, ::2] + 1j * part[:, 1::2])
    assert_allclose(np.angle(angles[0] / angles[1]), np.tile(zeros, (3, 1)), atol=1e-6)  # float32
    with pytest.raises(ValueError, match="as many zeros as robot 'chung2008' has casters, 3, or none, got 2"):
        batch(SteeringOffset(zeros=(0.1, 0.2)), count=1)
