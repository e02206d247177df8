"""caster_gym.wrappers.commands: corrections of another agent, twists and joint speeds instead of torques."""

import numpy as np
import pytest
from gymnasium.spaces import Box
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.configuration import ConfigurationError
from caster_gym.shipped_files import names_of
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import JointSpeeds, ResidualTorque, SensorNoise, TwistCommands, read_features, wrap
from tests.counting import Counting

PATH = {"shape": "circle", "radius": 0.5}
ROBOTS = names_of("robots")
PERIOD = 0.02  # [s] of the environment's control


class Follower:
    """An agent that pushes towards the reference."""

    def act(self, observations):
        return np.clip(0.2 * observations[:, :6], -1.0, 1.0)


def batch(*features, count=16, robot="chung2008", **task):
    return wrap(CasterTrackVectorEnv(count, robot=robot, path=PATH, corridor=1e3, **task), *features)


def shown_twist(env, observations):
    return env.unwrapped.engine.layout.physical(observations, "twist")


def sent(env, action):
    """What the environment inside is told for an action."""
    told, step = [], env.env.step

    def noted(given):
        told.append(given.copy())
        return step(given)

    env.env.step = noted
    env.step(action)
    env.env.step = step
    return told[0]


def without_friction(name):
    """The robot, with joints and contact patches that resist no motion."""
    robot = load_robot(name)
    free = {"viscous": 0.0, "coulomb": 0.0}
    casters = tuple(
        caster.model_copy(
            update={
                "scrub": 0.0,
                "roll": caster.roll.model_copy(update=free),
                "steer": caster.steer.model_copy(update=free),
            }
        )
        for caster in robot.casters
    )
    return robot.model_copy(update={"casters": casters})


def motors_of(robot):
    motors = [motor for caster in robot.casters for motor in (caster.roll, caster.steer)]
    return [motors[robot.joints.index(joint)] for joint in robot.driven]


def test_no_correction_leaves_the_agent_alone():
    """Bit for bit, over an episode of model-based control."""
    plain = CasterTrackVectorEnv(3, path=PATH)
    agent = ComputedTorque(plain.engine.layout, 10.0, PERIOD)
    corrected = batch(ResidualTorque(agent=agent), count=3, start_turn=0.2)
    seen, _ = plain.reset(seed=1)
    assert_array_equal(corrected.reset(seed=1)[0], seen)
    nothing = np.zeros((3, 6), np.float32)
    for _ in range(100):
        seen, rewards, *_ = plain.step(agent.act(seen))
        ours, our_rewards, *_ = corrected.step(nothing)
        assert_array_equal(ours, seen)
        assert_array_equal(our_rewards, rewards)


def test_an_inner_agent_may_have_memory():
    """It is told which robots begin an episode, alone as in a batch, and every environment has one of its own."""
    agent = Counting()
    residual = ResidualTorque(agent=agent)
    env, alone = batch(residual, count=2), batch(residual, count=1)
    env.reset(seed=1)
    alone.reset(seed=1)
    nothing = np.zeros((2, 6), np.float32)
    for count in (1, 2):
        assert_allclose(sent(env, nothing)[:, 0], [0.01 * count] * 2, rtol=1e-6)  # float32
        assert_allclose(sent(alone, nothing[:1])[:, 0], [0.01 * count], rtol=1e-6)
    env.reset(options={"reset_mask": np.array([False, True])})
    assert_allclose(sent(env, nothing)[:, 0], [0.03, 0.01], rtol=1e-6)
    assert not agent.given
    with pytest.raises(TypeError, match=r"the feature at work 'Residual' keeps an agent with memory, <.*Counting"):
        env.get_state()
    agent.reset = 3  # type: ignore[assignment, method-assign]
    with pytest.raises(ConfigurationError, match="its reset must be a method that takes a mask of robots, got 3"):
        read_features([{"kind": "residual_torque", "agent": agent}])


@pytest.mark.parametrize("share", [0.2, 1.5])
def test_corrections_are_shares_of_the_greatest_torques(share):
    env = batch(ResidualTorque(agent=Follower(), share=share), count=50)
    observations, _ = env.reset(seed=0)
    given = np.random.default_rng(0).uniform(-1.5, 1.5, (50, 6)).astype(np.float32)
    given[0] = 1.0
    alone = Follower().act(observations)
    expected = np.clip(alone + share * np.clip(given, -1.0, 1.0), -1.0, 1.0)
    assert_allclose(sent(env, given), expected, atol=1e-6)  # float32


def test_an_inner_agent_sees_what_reaches_its_place():
    """Noise before it in the list is seen by it, noise after it only by the outside."""
    noise, residual = SensorNoise(position=0.05), ResidualTorque(agent=Follower())
    nothing = np.zeros((8, 6), np.float32)
    before, after, clean = batch(noise, residual, count=8), batch(residual, noise, count=8), batch(residual, count=8)
    for env in (before, after, clean):
        env.reset(seed=2)
    told = [sent(env, nothing) for env in (before, after, clean)]
    assert_array_equal(told[1], told[2])
    assert np.abs(told[0] - told[2]).max() > 0.01


@pytest.mark.parametrize("robot", ROBOTS)
def test_a_twist_error_falls_exponentially(robot):
    """exp(−bandwidth · t) at every control period, for commands so small that the casters hardly turn meanwhile.

    Without friction: what grows within a period is met in the next one only.
    """
    env = batch(TwistCommands(max_speed=1.0, max_yaw_rate=1.0, bandwidth=10.0), robot=without_friction(robot))
    env.reset(seed=0)
    given = (2e-4 * np.random.default_rng(0).uniform(-1.0, 1.0, (16, 3))).astype(np.float32)
    for k in range(1, 16):
        observations, *_ = env.step(given)
        left = np.exp(-10.0 * PERIOD * k)
        # casters turn by speed / trail · t = 2e-4 / 0.014 · 0.3 = 4e-3, which the loop corrects from period to period
        assert_allclose(shown_twist(env, observations), (1.0 - left) * given, atol=4e-3 * 2e-4)


@pytest.mark.parametrize("robot", ROBOTS)
def test_twist_commands_are_reached(robot):
    """From any steering angles, with casters that flip on the way; half a second is five time constants and a flip."""
    env = batch(TwistCommands(max_speed=0.5, max_yaw_rate=1.0, bandwidth=10.0), robot=robot, count=64)
    env.reset(seed=0)
    given = np.random.default_rng(1).uniform(-1.0, 1.0, (64, 3)).astype(np.float32)
    for _ in range(60):
        observations, *_ = env.step(given)
    wanted = given * [0.5, 0.5, 1.0]
    assert_allclose(shown_twist(env, observations), wanted, atol=2e-3)


@pytest.mark.parametrize("robot", ROBOTS)
@pytest.mark.parametrize("bandwidth", [5.0, 50.0, 5000.0])
def test_joint_speed_loops_are_stable_however_fast(robot, bandwidth):
    """Held for a period T, ν becomes (I − T M⁻¹ Σ k_i w_i w_iᵀ) ν: its eigenvalues lie in exp(−bandwidth T) … 1."""
    env = batch(JointSpeeds(bandwidth=bandwidth), robot=robot, count=100)
    observations, _ = env.reset(seed=0)  # at rest, at random steering angles
    chosen = env.unwrapped.engine.robot
    motors = motors_of(chosen)
    torques, speeds = (np.array([getattr(motor, name) for motor in motors]) for name in ("max_torque", "max_speed"))
    share = 1e-5  # so small that no motor is at its limit
    gains = sent(env, np.full(env.action_space.shape, share, np.float32)) * torques / (share * speeds)
    directions = env.unwrapped.engine.layout.physical(observations, "directions").reshape(100, -1, 2)
    steering = np.arctan2(directions[..., 1], directions[..., 0])
    model = Model(chosen)
    w = model.motor_wrenches(steering) / torques
    closing = PERIOD * np.linalg.solve(model.inertia(steering), w * gains[:, None] @ w.mT)
    kept = 1.0 - np.linalg.eigvals(closing).real
    assert kept.min() >= np.exp(-bandwidth * PERIOD) - 1e-5  # float32
    assert kept.max() < 1.0
    slowest_mean = 1.0 - (1.0 - np.exp(-bandwidth * PERIOD)) * np.sqrt(3.0) / len(motors)
    assert kept.mean(axis=-1).max() < slowest_mean + 1e-5  # trace of S is the number of motors, ‖S‖ at most that


def test_joint_speeds_that_agree_are_reached():
    """All wheels ahead at one speed, no caster turning: no wheel is asked for what the others forbid."""
    env = batch(JointSpeeds(bandwidth=50.0), count=4)
    env.reset(seed=0)
    engine = env.unwrapped.engine
    states = engine.states
    states[:, 7::2], states[:, 8::2] = 1.0, 0.0  # straight ahead
    engine.states = states
    still, ahead = np.zeros((4, 6), np.float32), np.zeros((4, 6), np.float32)
    ahead[:, ::2] = 0.1  # of 100 rad/s
    env.step(still)
    for _ in range(100):
        observations, *_ = env.step(ahead)
    rates = engine.layout.physical(observations, "joint_rates")
    assert_allclose(rates, [[10.0, 0.0] * 3] * 4, atol=0.02)  # what is left after 2 s, of 10 rad/s


def test_geared_motors_count_with_their_own_speeds():
    """The motor that turns with its caster's steering is at its wanted speed when both joints are at theirs."""
    env = batch(JointSpeeds(), robot="tidybot2", count=4)
    env.reset(seed=0)
    engine = env.unwrapped.engine
    states = engine.states
    states[:, 7::2], states[:, 8::2] = 1.0, 0.0
    states[:, 4:7] = [0.3, 0.1, 0.0]
    engine.states = states
    drift = np.zeros(env.action_space.shape, np.float32)
    env.step(drift)
    twist, directions = engine.states[:, 4:7], engine.states[:, 7:].reshape(4, -1, 2)
    _, rolling, turning = Model(engine.robot).rates(np.arctan2(directions[..., 1], directions[..., 0]), twist)
    gears = np.array([caster.gear for caster in engine.robot.casters])
    speeds = np.einsum("cij,rcj->rci", gears, np.stack([rolling, turning], axis=-1)).reshape(4, -1)
    share = speeds / [motor.max_speed for motor in motors_of(engine.robot)]
    assert np.abs(share).min() > 1e-3
    assert_allclose(sent(env, share.astype(np.float32)), 0.0, atol=1e-4)  # float32 of observation and action


@pytest.mark.parametrize(("feature", "size"), [(TwistCommands(), 3), (JointSpeeds(), 4), (None, 4)])
def test_action_spaces_of_both_faces(feature, size):
    features = [] if feature is None else [feature]
    driven = ("roll_1", "steer_1", "roll_2", "steer_2")
    env = wrap(CasterTrackVectorEnv(5, path=PATH, actuation=driven), *features)
    assert env.single_action_space == Box(-1.0, 1.0, (size,), np.float32)
    assert env.action_space == Box(-1.0, 1.0, (5, size), np.float32)
    env.reset(seed=0)
    env.step(env.action_space.sample())
    single = wrap(CasterTrackEnv(path=PATH, actuation=driven), *features)
    assert single.action_space == env.single_action_space
    single.reset(seed=0)
    single.step(single.action_space.sample())


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ("residual_torque", "'agent' is missing"),
        ({"kind": "residual_torque", "agent": "computed_torque"}, r"'agent' must be an object with a method act"),
        ({"kind": "residual_torque", "agent": Follower(), "share": 0}, "'share' should be greater than 0"),
        ({"kind": "twist_commands", "bandwidth": 0}, "'bandwidth' should be greater than 0"),
        ({"kind": "twist_commands", "max_sped": 1}, "unknown key 'max_sped'; did you mean 'max_speed'"),
        ({"kind": "joint_speeds", "bandwidth": "high"}, "'bandwidth' should be a number"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])


def test_an_agent_with_other_actions_is_refused():
    class Wrong:
        def act(self, observations):
            return np.zeros((len(observations), 3))

    env = batch(ResidualTorque(agent=Wrong()), count=2)
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"the agent's actions must have shape \(2, 6\), got \(2, 3\)"):
        env.step(np.zeros((2, 6), np.float32))


def track(env, actions, steps):
    """Poses (steps, robots, 4) under actions that may depend on the heading, a unit complex number; last twists."""
    info, poses = env.reset(seed=1)[1], []
    for _ in range(steps):
        heading = info["pose"][:, 2] + 1j * info["pose"][:, 3]
        observations, *_, info = env.step(actions(heading).astype(np.float32))
        poses.append(info["pose"])
    return np.array(poses), shown_twist(env, observations)


@pytest.mark.parametrize(
    "robot", ["chung2008", *(pytest.param(one, marks=pytest.mark.slow) for one in ("tidybot2", "xr4000"))]
)
@pytest.mark.parametrize("bandwidth", [20.0, *(pytest.param(one, marks=pytest.mark.slow) for one in (2.0, 1000.0))])
@pytest.mark.parametrize("frame", ["world", "body"])
def test_a_turning_robot_goes_where_commands_point(robot, bandwidth, frame):
    """A direction of the world, given as such or turned into B before every action, at 2 rad/s to either side.

    Without feed-forward it went atan(2 (T/2 + 1/bandwidth)) beside it: 7 degrees at 20/s.
    """
    env = batch(TwistCommands(frame=frame, max_speed=1.0, max_yaw_rate=4.0, bandwidth=bandwidth), robot=robot, count=2)
    wanted = 0.4 * np.exp([0.7j, -2.0j])

    def actions(heading):
        v = wanted if frame == "world" else wanted / heading
        return np.stack([v.real, v.imag, [0.5, -0.5]], axis=1)

    poses, _ = track(env, actions, 300)
    way = poses[-1] - poses[150]
    mean = (way[:, 0] + 1j * way[:, 1]) / (149 * PERIOD)
    assert np.degrees(np.abs(np.angle(mean / wanted))).max() < 0.5
    assert_allclose(np.abs(mean), 0.4, rtol=0.02)


@pytest.mark.parametrize("robot", ROBOTS)
def test_constant_commands_in_the_body_stay_there(robot):
    """A circle, whose velocity in B is the command at every observation."""
    env = batch(TwistCommands(max_yaw_rate=4.0), robot=robot, count=2)
    given = np.array([[0.3, 0.2, 0.5], [-0.2, 0.4, -0.5]])
    _, twists = track(env, lambda heading: given, 150)
    assert_allclose(twists, given * [1.0, 1.0, 4.0], atol=2e-3)


@pytest.mark.parametrize(
    ("robot", "speed", "rate"),
    [
        ("chung2008", 1.0, 4.0),
        pytest.param("tidybot2", 1.5, 6.0, marks=pytest.mark.slow),
        pytest.param("xr4000", 2.0, 6.0, marks=pytest.mark.slow),
    ],
)
def test_a_twist_beyond_the_motors_is_reduced_as_one(robot, speed, rate):
    """It settles at a multiple of the command, to a few percent: hardly any torque is left to correct errors."""
    env = batch(TwistCommands(max_speed=speed, max_yaw_rate=rate), robot=robot, count=3)
    given = np.array([[1.0, 0.3, 1.0], [0.2, 1.0, -1.0], [1.0, 1.0, 1.0]])
    _, twists = track(env, lambda heading: given, 250)
    multiples = twists / (given * [speed, speed, rate])
    assert multiples.max() < 1.0
    assert (np.ptp(multiples, axis=1) < 0.05 * multiples.mean(axis=1)).all()
