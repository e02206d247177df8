"""caster_gym.wrappers.environment and stack: one definition for one robot and for a batch."""

import copy
import pickle
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import RescaleAction, TimeLimit
from numpy.testing import assert_array_equal

from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import (
    ActionDelay,
    FeatureEnv,
    FeatureVectorEnv,
    JointSpeeds,
    Payload,
    Potential,
    ResidualTorque,
    SensorNoise,
    Smoothness,
    TwistCommands,
    read_features,
    wrap,
)

TASK: dict[str, Any] = {
    "corridor": 0.12,
    "path": {"shape": "circle", "radius": 0.5},
}  # random torques leave it, sooner or later
LONGEST = 40
SEED = 11


class Follower:
    """An agent that pushes towards the reference."""

    def act(self, observations):
        return np.clip(0.2 * observations[:, :6], -1.0, 1.0)


TORQUES = read_features(
    [
        {"kind": "payload", "mass": [0.0, 2.0], "x": [-0.05, 0.05]},
        {"kind": "friction", "added_viscous": [0.0, 1e-3], "floor_friction": [0.3, 0.9]},
        {"kind": "wheel_errors", "trail": [-0.002, 0.002], "radius": [-0.001, 0.001]},
        {"kind": "sensor_noise", "position": 0.01, "heading": 0.02, "speed": 0.05, "yaw_rate_bias": 0.1},
        {"kind": "sensor_noise", "steering": 0.02, "joint_rate": 1.0, "heading_bias": 0.01},
        "steering_offset",
        "odometry",
        {"kind": "dropped_packets", "probability": 0.3},
        {"kind": "motor_failure", "after": [0.0, 0.5]},
        {"kind": "pushes", "rate": 5.0},
        {"kind": "motor_lag", "time_constant": [0.0, 0.05]},
        {"kind": "action_delay", "periods": [0, 3]},
        {"kind": "potential", "quantity": "position_error", "margin": 0.5, "discount": 0.97, "weight": 3.0},
        {"kind": "tolerance", "quantity": "heading_error", "bounds": [-0.1, 0.1], "margin": 0.3},
        "effort",
        "smoothness",
        "traction_use",
        "impact",
    ]
)
STACKS = {
    "torques": TORQUES,
    "twists": (SensorNoise(position=0.01, speed=0.02), TwistCommands(), ActionDelay(periods=2)),
    "speeds": (JointSpeeds(), SensorNoise(position=0.01), Smoothness()),
    "residual": (ActionDelay(), SensorNoise(position=0.05), ResidualTorque(agent=Follower(), share=0.7), Smoothness()),
    "history": (*TORQUES[:6], *read_features([{"kind": "history", "observations": 2}, "smoothness"])),
    "nothing": (),
}


def batch(count, mode, features, **arguments):
    native = CasterTrackVectorEnv(count, autoreset_mode=mode, max_episode_steps=LONGEST, **{**TASK, **arguments})
    return wrap(native, *features)


def singles(count, mode, features):
    return SyncVectorEnv(
        [lambda: wrap(TimeLimit(CasterTrackEnv(**TASK), LONGEST), *features)] * count, autoreset_mode=mode
    )


def assert_same(ours, theirs, where=""):
    """Equal to the last bit, keys, types and masks included."""
    assert type(ours) is type(theirs), where
    if isinstance(ours, dict):
        assert set(ours) == set(theirs), where
        for key in ours:
            assert_same(ours[key], theirs[key], f"{where}[{key!r}]")
    elif isinstance(ours, tuple):
        for i, (mine, other) in enumerate(zip(ours, theirs, strict=True)):
            assert_same(mine, other, f"{where}[{i}]")
    elif ours.dtype == object:
        for mine, other in zip(ours, theirs, strict=True):
            assert type(mine) is type(other), where
            assert_array_equal(mine, other, where)
    else:
        assert ours.dtype == theirs.dtype, where
        assert_array_equal(ours, theirs, where)


def random_actions(space, seed):
    """Actions that last for a while, and differ in size from robot to robot: only some leave the corridor."""
    rng = np.random.default_rng(seed)
    size = rng.uniform(0.0, 1.3, (space.shape[0], 1))
    kept = np.zeros(space.shape)
    while True:
        new = rng.uniform(-1.0, 1.0, space.shape)
        kept = np.where(rng.uniform(size=(space.shape[0], 1)) < 0.2, new, kept)
        yield (size * kept).astype(np.float32)


@pytest.mark.parametrize(
    "mode",
    [
        AutoresetMode.NEXT_STEP,
        *(pytest.param(one, marks=pytest.mark.slow) for one in (AutoresetMode.SAME_STEP, AutoresetMode.DISABLED)),
    ],
)
@pytest.mark.parametrize(
    ("stack", "count", "steps"),
    [("torques", 3, 150), ("torques", 35, 45), *((name, 5, 90) for name in STACKS if name != "torques")],
)
def test_a_batch_equals_single_environments(mode, stack, count, steps):
    ours, theirs = batch(count, mode, STACKS[stack]), singles(count, mode, STACKS[stack])
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert ours.single_action_space == theirs.single_action_space
    assert ours.metadata["autoreset_mode"] is mode is theirs.metadata["autoreset_mode"]
    assert_same(ours.reset(seed=SEED), theirs.reset(seed=SEED))
    failures, ends = 0, 0
    for _, actions in zip(range(steps), random_actions(ours.action_space, 1), strict=False):
        mine, other = ours.step(actions), theirs.step(actions)
        assert_same(mine, other)
        terminated, truncated = mine[2:4]
        failures, ends = failures + terminated.sum(), ends + truncated.sum()
        done = terminated | truncated
        if mode is AutoresetMode.DISABLED and done.any():
            assert_same(*(env.reset(options={"reset_mask": done.copy()}) for env in (ours, theirs)))
    assert failures >= 1  # both kinds of ends were seen
    assert ends >= 1


@pytest.mark.parametrize("stack", ["torques", "residual"])
def test_the_last_observation_of_an_episode_is_the_same_whoever_resets(stack):
    """What final_obs and final_info hold is what an environment without automatic resets shows."""
    same, without = (batch(4, mode, STACKS[stack]) for mode in ("SameStep", "Disabled"))
    for env in (same, without):
        env.reset(seed=SEED)
    for _, actions in zip(range(LONGEST), random_actions(same.action_space, 3), strict=False):
        ours, theirs = same.step(actions), without.step(actions)
        done = theirs[2] | theirs[3]
        assert_array_equal(ours[1], theirs[1])
        if done.any():
            break
    final, last = ours[4]["final_info"], theirs[4]
    assert_array_equal(np.stack(ours[4]["final_obs"][done]), theirs[0][done])
    for key in ("task_reward", "position_error"):
        assert_array_equal(final[key][done], last[key][done])
    for name in (*same.unwrapped.engine.plan.terms, "smoothness"):
        assert_array_equal(final["reward_terms"][name][done], last["reward_terms"][name][done])


def test_the_task_sees_the_same_robot_with_rewards_shaped():
    """Reward features change no motion, no observation and no ending."""
    shaped, plain = (
        batch(5, "SameStep", [one for one in TORQUES if "weight" in type(one).model_fields]),
        batch(5, "SameStep", ()),
    )
    shaped.reset(seed=SEED)
    plain.reset(seed=SEED)
    for _, actions in zip(range(80), random_actions(plain.action_space, 5), strict=False):
        ours, theirs = shaped.step(actions), plain.step(actions)
        for mine, other in zip((ours[0], *ours[2:4]), (theirs[0], *theirs[2:4]), strict=True):
            assert_array_equal(mine, other)
        assert_array_equal(ours[4]["task_reward"], theirs[4]["task_reward"])
        ended = ours[2] | ours[3]
        unshaped = np.where(ended, ours[4].get("final_info", {}).get("task_reward", 0.0), ours[4]["task_reward"])
        assert_array_equal(unshaped, theirs[1])


def test_what_was_returned_is_never_changed_later_and_may_be_changed():
    env, clean = batch(3, "SameStep", TORQUES), batch(3, "SameStep", TORQUES)
    seen, copies = [], []
    for step, actions in zip(range(60), random_actions(clean.action_space, 4), strict=False):
        results = env.reset(seed=SEED) if step == 0 else env.step(actions)
        expected = clean.reset(seed=SEED) if step == 0 else clean.step(actions)
        assert_same(results, expected)
        seen.append(expected)
        copies.append(copy.deepcopy(expected))
        spoil(results)
    assert_same(tuple(seen), tuple(copies))


def test_actions_given_are_left_alone():
    env = batch(3, "NextStep", TORQUES)
    env.reset(seed=0)
    given = np.full((3, 6), 2.0, np.float32)
    env.step(given)
    assert (given == 2.0).all()


@pytest.mark.filterwarnings("ignore:.*different from the unwrapped version")  # as it should be
@pytest.mark.parametrize("features", [TORQUES, STACKS["twists"]])
def test_gymnasiums_checks_pass(features):
    """And the specification of a wrapped environment makes another one."""
    env = wrap(gym.make("caster_gym:CasterTrack-v0", **TASK, disable_env_checker=True).unwrapped, *features)
    check_env(env, skip_render_check=True)
    assert env.spec is not None
    again = gym.make(env.spec)
    assert_array_equal(again.reset(seed=3)[0], env.reset(seed=3)[0])


def test_made_environments_can_be_wrapped():
    single = wrap(gym.make("caster_gym:CasterTrack-v0", max_episode_steps=9, **TASK), *TORQUES)
    native = wrap(gym.make_vec("caster_gym:CasterTrack-v0", num_envs=2, **TASK), *TORQUES)
    assert isinstance(single, FeatureEnv)
    assert isinstance(native, FeatureVectorEnv)
    for env in (single, native):
        assert env.features == TORQUES
        env.reset(seed=0)
        observations, *_ = env.step(env.action_space.sample())
        assert env.observation_space.contains(observations)


def test_course_following_can_be_wrapped():
    made: dict[str, Any] = {"max_episode_steps": 30, "path": "circle"}
    ours = wrap(gym.make_vec("caster_gym:CasterFollow-v0", num_envs=3, **made), *TORQUES)
    theirs = SyncVectorEnv([lambda: wrap(gym.make("caster_gym:CasterFollow-v0", **made), *TORQUES)] * 3)
    assert_same(ours.reset(seed=SEED), theirs.reset(seed=SEED))
    for _, actions in zip(range(40), random_actions(ours.action_space, 1), strict=False):
        assert_same(ours.step(actions), theirs.step(actions))


@pytest.mark.parametrize(
    ("make", "features", "message"),
    [
        (lambda: gym.make("CartPole-v1"), (), "features need an environment of caster_gym such as CasterTrack-v0, got"),
        (lambda: gym.make_vec("CartPole-v1", num_envs=2), (), "features need an environment of caster_gym"),
        (lambda: singles(2, "NextStep", ()), (), "wrap each environment inside instead, or make a native batch"),
        (lambda: "CasterTrack-v0", (), "only Gymnasium environments can have features, got 'CasterTrack-v0'"),
        (lambda: wrap(CasterTrackEnv(), Payload()), (), "has been wrapped before: give all features to one call"),
        (lambda: batch(2, "NextStep", ()), (Payload(),), "has been wrapped before: give all features to one call"),
        (lambda: wrap(CasterTrackEnv(), Payload()).unwrapped, (), "has been wrapped before"),
        (
            lambda: RescaleAction(CasterTrackEnv(), np.float32(-2), np.float32(2)),
            (),
            "RescaleAction must stand outside of the features, not inside",
        ),
        (
            CasterTrackEnv,
            (TwistCommands(), ResidualTorque(agent=Follower())),
            "only one feature can say what actions mean, got TwistCommands and ResidualTorque",
        ),
        (CasterTrackEnv, (JointSpeeds(), ActionDelay(), JointSpeeds()), "got JointSpeeds and JointSpeeds"),
        (CasterTrackEnv, ("payload",), "a feature is one of caster_gym.wrappers, or read by read_features, got"),
    ],
)
def test_what_does_not_fit_is_refused(make, features, message):
    with pytest.raises(ValueError, match=message):
        wrap(make(), *features)


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.zeros((3, 6)), r"actions must have shape \(3, 3\), got \(3, 6\)"),
        (np.full((3, 3), np.nan), "actions must hold numbers, got"),
    ],
)
def test_wrong_actions_are_refused_at_once(actions, message):
    """Even if a delay would hide them for a while."""
    env = batch(3, "NextStep", (TwistCommands(), ActionDelay(periods=5)))
    env.reset(seed=0)
    with pytest.raises(ValueError, match=message):
        env.step(actions)


def test_robots_must_be_reset_before_their_first_step():
    envs: list[Any] = [batch(3, "NextStep", TORQUES), wrap(CasterTrackEnv(), *TORQUES)]
    for env in envs:
        with pytest.raises(RuntimeError, match="before its first step"):
            env.step(np.zeros(env.action_space.shape))


def test_potentials_need_no_plant():
    """Rewards alone draw nothing and leave the engine's robots as they are."""
    env = batch(3, "NextStep", (Potential(quantity="position_error", margin=0.5, discount=0.97),))
    before = env.unwrapped.engine.parameters
    env.reset(seed=0)
    assert_array_equal(env.unwrapped.engine.parameters, before)


def spoil(value):
    """Overwrite every array inside."""
    if isinstance(value, dict | tuple):
        for item in value.values() if isinstance(value, dict) else value:
            spoil(item)
    else:
        value[...] = None if value.dtype == object else 7


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))], ids=["copy", "pickle"])
def test_a_copy_draws_what_the_original_draws(copied):
    """Seeds given after copying count, episode by episode."""
    original = wrap(CasterTrackVectorEnv(3, **TASK), SensorNoise(position_bias=0.05))
    other = copied(original)
    seen = []
    for seed in (1, 2):
        seen.append(original.reset(seed=seed)[0])
        assert_array_equal(other.reset(seed=seed)[0], seen[-1])
        assert_array_equal(other.reset()[0], original.reset()[0])
    first, second = seen
    assert not np.array_equal(first, second)
