"""caster_gym.wrappers.plants: loads, friction and wheels that no agent is told of."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    CasterParameters,
    PlatformParameters,
    RobotParameters,
    pack_parameters,
    robot_parameters,
)
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import Friction, Payload, WheelErrors, read_features, wrap

PATH = {"shape": "circle", "radius": 0.5}
NOMINAL = np.array(pack_parameters(robot_parameters(load_robot("tidybot2"))))


def batch(*features, count=50, robot="tidybot2", **task):
    return wrap(CasterTrackVectorEnv(count, robot=robot, path=PATH, corridor=100.0, **task), *features)


def parameters(env):
    """Numbers of all robots as the mechanics reads them: arrays (robots,)."""
    rows = env.unwrapped.engine.parameters.T
    platform = PlatformParameters(*rows[:PLATFORM_FIELDS])
    casters = rows[PLATFORM_FIELDS:].reshape(-1, CASTER_FIELDS, rows.shape[1])
    return RobotParameters(platform, tuple(CasterParameters(*caster) for caster in casters))


def column(env, name):
    """A parameter of every caster (robots, casters)."""
    return np.stack([getattr(caster, name) for caster in parameters(env).casters], axis=-1)


def test_a_load_adds_its_inertia_by_hand():
    """M = M_0 + m [[1, 0, −y], [0, 1, x], [−y, x, x² + y²]] + I e_ω e_ωᵀ."""
    env = batch(Payload(mass=3.0, x=0.1, y=-0.2, inertia=0.05), count=3)
    env.reset(seed=0)
    robot = env.unwrapped.robot
    steering = np.random.default_rng(0).uniform(-3.0, 3.0, (3, 4))
    added = 3.0 * np.array([[1.0, 0.0, 0.2], [0.0, 1.0, 0.1], [0.2, 0.1, 0.05]])
    added[2, 2] += 0.05
    loaded = Model(robot, parameters=parameters(env)).inertia(steering)
    assert_allclose(loaded, Model(robot).inertia(steering) + added, rtol=1e-12, atol=1e-12)


def test_loads_are_drawn_within_their_limits():
    env = batch(Payload(mass=(0.0, 4.0), x=(-0.1, 0.1), y=(0.1, 0.3)), count=3000)
    env.reset(seed=0)
    platform, robot = parameters(env).platform, env.unwrapped.robot
    mass = platform.mass - robot.platform.mass
    assert mass.min() >= 0.0
    assert mass.max() <= 4.0
    assert abs(mass.mean() - 2.0) < 5.0 * 4.0 / np.sqrt(12.0 * 3000)  # five standard deviations of the mean
    x, y = robot.platform.com
    forward = (platform.com_x * platform.mass - robot.platform.mass * x) / mass
    left = (platform.com_y * platform.mass - robot.platform.mass * y) / mass
    assert np.abs(forward).max() <= 0.1 + 1e-9
    assert left.min() >= 0.1 - 1e-9
    assert left.max() <= 0.3 + 1e-9
    assert abs(np.corrcoef(mass, forward)[0, 1]) < 5.0 / np.sqrt(3000)


def test_the_height_of_a_load_moves_the_mass_centre_up():
    """Of two bodies at heights, which shift their common mass centre by their masses; drawn by episode."""
    robot = load_robot("chung2008")
    standing = robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 0.1})})
    column = PlatformParameters._fields.index("height")
    for height, expected in ((0.5, (5.0 * 0.1 + 3.0 * 0.5) / 8.0), (None, 0.1)):
        env: Any = wrap(gym.make("caster_gym:CasterTrack-v0", robot=standing), Payload(mass=3.0, height=height))
        env.reset(seed=0)
        assert_allclose(env.unwrapped.engine.parameters[0, column], expected, rtol=1e-14)
    env = wrap(gym.make("caster_gym:CasterTrack-v0", robot=standing), Payload(mass=3.0, height=(0.2, 0.6)))
    seen = []
    for _ in range(5):
        env.reset()
        seen.append(env.unwrapped.engine.parameters[0, column])
    assert len(set(seen)) == 5
    assert min(seen) > (5.0 * 0.1 + 3.0 * 0.2) / 8.0


def test_friction_of_every_joint_is_scaled_and_added_to():
    env = batch(Friction(viscous_scale=(0.5, 2.0), coulomb_scale=3.0, added_viscous=0.01, added_coulomb=(0.0, 0.2)))
    env.reset(seed=0)
    robot = env.unwrapped.robot
    for joint in ("roll", "steer"):
        own = [getattr(caster, joint) for caster in robot.casters]
        viscous, coulomb = column(env, f"{joint}_viscous"), column(env, f"{joint}_coulomb")
        assert min(motor.viscous for motor in own) > 0.0
        scales = (viscous - 0.01) / [motor.viscous for motor in own]
        assert scales.min() >= 0.5 - 1e-9
        assert scales.max() <= 2.0 + 1e-9
        added = coulomb - 3.0 * np.array([motor.coulomb for motor in own])
        assert added.min() >= -1e-12
        assert added.max() <= 0.2 + 1e-12
        assert len(np.unique(scales)) == scales.size  # each joint draws for itself
    assert_array_equal(parameters(env).platform.floor_friction, robot.floor_friction)


def test_a_slippery_floor_is_used_more():
    """Use of the floor's friction goes with one over it, all else equal."""
    uses = []
    for friction in (0.8, 0.2):
        env = batch(Friction(floor_friction=friction), count=5)
        env.reset(seed=0)
        action = np.full(env.action_space.shape, 0.1, np.float32)
        uses.append([env.step(action)[4]["traction_use"] for _ in range(5)])
    assert_allclose(uses[1], 4.0 * np.array(uses[0]), rtol=1e-12)


def test_wheels_differ_by_their_errors():
    env = batch(WheelErrors(trail=(-0.001, 0.002), radius=(-0.003, 0.0)), count=500)
    env.reset(seed=0)
    casters = env.unwrapped.robot.casters
    trail = column(env, "trail") - [caster.trail for caster in casters]
    radius = column(env, "radius") - [caster.radius for caster in casters]
    assert trail.min() >= -0.001 - 1e-12
    assert trail.max() <= 0.002 + 1e-12
    assert radius.min() >= -0.003 - 1e-12
    assert radius.max() <= 1e-12
    assert abs(trail.mean() - 0.0005) < 5.0 * 0.003 / np.sqrt(12.0 * trail.size)
    assert abs(np.corrcoef(trail[:, 0], radius[:, 0])[0, 1]) < 5.0 / np.sqrt(500)


def test_encoders_show_joint_rates_of_wheels_of_any_size():
    env = batch(WheelErrors(trail=(-0.002, 0.002), radius=(-0.005, 0.005)), count=20)
    env.reset(seed=0)
    for _ in range(10):
        observations, *_ = env.step(np.full(env.action_space.shape, 0.3, np.float32))
    engine = env.unwrapped.engine
    states = engine.states
    steering = np.arctan2(states[:, 8::2], states[:, 7::2])
    _, rolling, turning = Model(engine.robot, parameters=parameters(env)).rates(steering, states[:, 4:7])
    shown = engine.layout.physical(observations, "joint_rates")
    assert np.abs(shown).max() > 1.0
    assert_allclose(shown[:, ::2], rolling, rtol=1e-5, atol=1e-5)  # float32
    assert_allclose(shown[:, 1::2], turning, rtol=1e-5, atol=1e-5)


FEATURES = (
    Payload(mass=(0.5, 2.0), x=(-0.1, 0.1)),
    Friction(added_coulomb=(0.0, 0.1), floor_friction=(0.3, 0.9)),
    WheelErrors(radius=(-0.002, 0.002)),
)


def test_every_episode_starts_from_the_nominal_robot():
    """Draws do not add up, and two features change one robot together."""
    env = batch(*FEATURES, count=20)
    rows: list[Any] = []
    for _ in range(30):
        env.reset(seed=None if rows else 0)
        rows.append(env.unwrapped.engine.parameters)
    changed = np.array(rows) - NOMINAL
    mass = PlatformParameters._fields.index("mass")
    assert changed[..., mass].min() >= 0.5
    assert changed[..., mass].max() <= 2.0
    radius = column(env, "radius") - [caster.radius for caster in env.unwrapped.robot.casters]
    assert np.abs(radius).max() <= 0.002 + 1e-12
    moving = np.ptp(rows, axis=(0, 1)) > 0.0
    assert moving.sum() == 3 + 1 + 4 * 2 + 4  # mass, inertia and com_x, the floor, joints, wheels; nothing else
    assert len(np.unique(changed[..., mass])) == 600


def test_seeds_reproduce_plants_and_motions():
    """And the plant does move otherwise than the nominal one."""
    poses = []
    for features in (FEATURES, FEATURES, ()):
        env = batch(*features, count=4)
        env.reset(seed=9)
        for _ in range(20):
            info = env.step(np.full(env.action_space.shape, 0.2, np.float32))[4]
        poses.append(info["pose"])
    assert_array_equal(poses[0], poses[1])
    assert (np.abs(poses[0] - poses[2]).max(axis=1) > 1e-3).all()


def test_agents_know_the_nominal_robot():
    env = batch(*FEATURES)
    env.reset(seed=0)
    assert env.unwrapped.robot == env.unwrapped.engine.robot == load_robot("tidybot2")


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ({"kind": "payload", "mass": -1}, "'mass' must not be negative, got -1"),
        ({"kind": "payload", "mass": [2, 1]}, "'mass' must rise from its first to its second number"),
        ({"kind": "payload", "inertia": -1}, "'inertia' should be greater than or equal to 0"),
        ({"kind": "friction", "floor_friction": -0.1}, "'floor_friction' must lie in 0 … 1000, .* got -0.1"),
        ({"kind": "friction", "floor_friction": [0, 1001]}, "'floor_friction' must lie in 0 … 1000"),
        ({"kind": "wheel_errors", "trial": 0.1}, "unknown key 'trial'; did you mean 'trail'"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])


def test_a_floor_without_friction_is_one_on_which_wheels_slip():
    with pytest.raises(
        ValueError, match=r"floor_friction must be greater than 0 where the floor grips, got 0.*'floor'"
    ):
        batch(Friction(floor_friction=0))
    env = batch(Friction(floor_friction=(0, 1000)), robot="chung2008", floor={"friction": 0.3})  # as the message says
    env.reset(seed=0)
    assert np.isfinite(env.step(env.action_space.sample())[4]["traction_use"]).all()


def test_wheels_that_time_steps_cannot_follow_are_refused():
    with pytest.raises(ValueError, match=r"must leave trails and radii of robot 'tidybot2' positive"):
        batch(WheelErrors(trail=-0.02))
    with pytest.raises(
        ValueError, match=r"features may make them: with a trail of .* at most .* 'substeps' of 41 would suffice"
    ):
        batch(WheelErrors(trail=(-0.013, 0.0)))
    batch(WheelErrors(trail=(-0.013, 0.0)), substeps=41)
    batch(WheelErrors(trail=(-0.007, 0.0)), substeps=20)
    with pytest.raises(ValueError, match="wheel_errors may stand once"):
        batch(WheelErrors(), WheelErrors())
