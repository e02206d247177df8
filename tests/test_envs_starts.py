"""caster_gym.envs.starts: a start that is given is the one that is had, alone, in a batch and in Torch."""

import re
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.wrappers import TimeLimit
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.engines.numpy_model import Model
from caster_gym.envs.starts import check_motion
from caster_gym.robot import load_robot
from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import ActionDelay, Payload, SensorNoise, wrap

POOL: dict[str, Any] = {"path": [{"shape": "circle", "radius": 0.5}, "lemniscate"]}
CIRCLE: dict[str, Any] = {"path": {"shape": "circle", "radius": 0.5}}
SEED, COUNT = 5, 3
KINDS = {"time": (CasterTrackEnv, CasterTrackVectorEnv), "progress": (CasterFollowEnv, CasterFollowVectorEnv)}
PLACES = np.array([0.1, 0.44, 1.0])  # [s] or [m]
POSES = np.array([[0.5, 0.0, 1.5], [0.52, 0.05, 1.7], [0.45, -0.03, 1.6]])  # beside the circle's start
TWISTS = np.array([[0.3, 0.1, 0.5], [0.0, 0.0, 0.0], [-0.2, 0.2, -1.0]])
STEERINGS = np.array([[0.0, 0.5, 1.0], [3.0, -3.0, 9.0], [1.0, 1.0, 1.0]])


def every_option(place):
    """One start for each robot, of each option by itself and all together."""
    options = {place: PLACES, "pose": POSES, "twist": TWISTS, "steering": STEERINGS}
    alone = [{"path": 0, name: rows} for name, rows in options.items()]
    return [*alone, {"path": np.array([0, 1, 0]), place: PLACES}, {"path": 0, **options, place: np.full(COUNT, 0.0)}]


def of_robot(options, robot):
    return {name: value if np.ndim(value) == 0 else value[robot] for name, value in options.items()}


def states(env):
    return env.unwrapped.engine.states


def pose_of(state):
    return np.array([*state[:2], np.arctan2(state[3], state[2])])


@pytest.mark.parametrize("place", list(KINDS))
def test_what_is_given_is_had(place):
    """To the last bit where it is a number of the state; info and observation tell of it."""
    env = KINDS[place][0](**CIRCLE)
    options = {"pose": POSES[1], "twist": TWISTS[0], "steering": STEERINGS[1]}
    observation, info = env.reset(seed=SEED, options=options)
    (state,) = states(env)
    assert_array_equal(state[:2], POSES[1, :2])
    assert_allclose(pose_of(state)[2], POSES[1, 2], rtol=0.0, atol=1e-15)  # a cosine and a sine rounded
    assert_array_equal(state[4:7], TWISTS[0])
    assert_allclose(state[7::2] + 1j * state[8::2], np.exp(1j * STEERINGS[1]), rtol=0.0, atol=1e-15)
    assert_array_equal(info["pose"], state[:4])
    assert_allclose(env.engine.layout.physical(observation, "twist"), TWISTS[0], rtol=1e-6)  # of float32


@pytest.mark.parametrize("place", list(KINDS))
def test_without_options_and_later_the_same_is_drawn(place):
    """A start that is given draws as any other: what it leaves open, and all later episodes, stay the same."""
    env = KINDS[place][0](**POOL)
    drawn, later = (env.reset(seed=seed)[0] for seed in (SEED, None))
    drawn_state = None
    for options in (None, {}, {"steering": STEERINGS[0]}, {"twist": TWISTS[1]}, {place: 0.3}):
        env.reset(seed=SEED, options=options)
        drawn_state = states(env)[0] if drawn_state is None else drawn_state
        if options and "steering" in options:
            assert_array_equal(states(env)[0, :7], drawn_state[:7])
        if options and place in options:
            assert_array_equal(states(env)[0, 7:], drawn_state[7:])
            assert (states(env)[0, :2] != drawn_state[:2]).any()
        assert_array_equal(env.reset()[0], later)
    assert_array_equal(env.reset(seed=SEED, options={})[0], drawn)


@pytest.mark.parametrize("place", list(KINDS))
def test_the_first_place_is_where_episodes_start_anyway(place):
    env = KINDS[place][0](**POOL)
    observation, info = env.reset(seed=SEED)
    again, told = env.reset(seed=SEED, options={place: 0.0})
    # the turn's cosine and sine are NumPy's here and the compiler's there
    assert_allclose(again, observation, rtol=0.0, atol=1e-6)
    assert_allclose(told["pose"], info["pose"], rtol=0.0, atol=1e-15)


def test_a_time_is_a_place_along_the_trajectory():
    """The reference is that of then, and the episode as much shorter."""
    env = CasterTrackEnv(**CIRCLE)
    table, last = env.engine.plan.tables[0], len(env.engine.plan.tables[0]) - 1
    _, info = env.reset(seed=SEED, options={"time": 0.44})
    assert_array_equal(info["reference_pose"], table[22, :4])
    assert np.hypot(*(info["pose"][:2] - table[22, :2])) < env.task.start_reach
    _, info = env.reset(seed=SEED, options={"time": 0.449})  # the nearest control period
    assert_array_equal(info["reference_pose"], table[22, :4])
    env.reset(seed=SEED, options={"time": (last - 3) * 0.02, "pose": [*table[-4, :2], 0.0]})
    ends = [env.step(np.zeros(6, dtype=np.float32))[3] for _ in range(3)]
    assert ends == [False, False, True]


def test_progress_is_a_place_along_the_path():
    """By its arc length, to which progress goes on from."""
    env = CasterFollowEnv(**CIRCLE)
    _, info = env.reset(seed=SEED, options={"progress": 1.0})
    assert info["progress"] == 1.0
    assert info["progress_share"] == 0.0
    # a metre along a circle of 0.5 m about the origin, whose points lie on chords of some millimetres
    assert_allclose(info["reference_pose"][:2], 0.5 * np.array([np.cos(2.0), np.sin(2.0)]), atol=1e-6)
    *_, info = env.step(np.zeros(6, dtype=np.float32))
    assert 1.0 <= info["progress"] < 1.1


@pytest.mark.parametrize("free", [False, True])
def test_a_pose_alone_starts_at_the_nearest_place_of_the_path(free):
    """Found by going over the path in steps of 0.1 mm."""
    env = CasterFollowEnv(path="lemniscate", free_heading=free)
    table = env.engine.plan.tables[0]
    spacing = float(env.engine.plan.source.spacings[0])
    arcs = np.arange(len(table)) * spacing
    fine = np.arange(0.0, arcs[-1], 1e-4)
    track = np.stack([np.interp(fine, arcs, table[:, i]) for i in (0, 1)], axis=1)
    for at in (700, 9000, 20000):
        point = track[at] + [0.03, -0.02]
        _, info = env.reset(seed=SEED, options={"pose": [*point, 0.3]})
        nearest = fine[np.hypot(*(track - point).T).argmin()]
        assert info["progress"] == pytest.approx(nearest, abs=3e-4)  # chords bend by some 1e-4 of this


@pytest.mark.parametrize("place", list(KINDS))
def test_a_batch_starts_as_its_single_environments(place):
    single, batch = (kind(*count, **POOL) for kind, count in zip(KINDS[place], ((), (COUNT,)), strict=True))
    action = np.full(6, 0.3, dtype=np.float32)
    for options in every_option(place):
        observations, infos = batch.reset(seed=SEED, options=options)
        steps = batch.step(np.tile(action, (COUNT, 1)))
        for robot in range(COUNT):
            observation, info = single.reset(seed=SEED + robot, options=of_robot(options, robot))
            assert_array_equal(observations[robot], observation)
            for name in ("pose", "reference_pose", "progress", "clearance", "traction_use", "conditioning"):
                assert_array_equal(infos[name][robot], info[name], name)
            assert_array_equal(steps[0][robot], single.step(action)[0])


@pytest.mark.parametrize("place", list(KINDS))
def test_some_robots_of_a_batch_start_where_it_is_said(place):
    """Entries of the others are not looked at, and these go on as they are."""
    env = KINDS[place][1](COUNT, autoreset_mode="Disabled", **CIRCLE)
    env.reset(seed=SEED)
    observations = env.step(np.full((COUNT, 6), 0.2, dtype=np.float32))[0].copy()
    before = states(env)
    mask = np.array([False, True, False])
    poses = np.full((COUNT, 3), np.nan)
    poses[1] = POSES[1]
    shown, infos = env.reset(options={"reset_mask": mask, "pose": poses})
    assert_array_equal(states(env)[~mask], before[~mask])
    assert_array_equal(shown[~mask], observations[~mask])
    assert_array_equal(infos["pose"][1, :2], POSES[1, :2])


def test_time_limits_count_from_the_reset():
    """A batch as Gymnasium's wrapper, wherever along its trajectory an episode has begun; the next one as usual."""
    batch = CasterTrackVectorEnv(2, max_episode_steps=4, autoreset_mode="SameStep", **CIRCLE)
    alone = CasterTrackEnv(**CIRCLE)
    single = TimeLimit(alone, 4)
    duration = (len(alone.engine.plan.tables[0]) - 1) * 0.02
    times = np.array([1.0, duration - 0.04])  # which ends with the trajectory, two control periods later
    batch.reset(seed=SEED, options={"time": times})
    still = np.zeros((2, 6), dtype=np.float32)
    ends = np.array([batch.step(still)[3] for _ in range(8)])
    for robot, time in enumerate(times):
        single.reset(seed=SEED + robot, options={"time": time})
        expected = []
        for _ in range(8):
            expected.append(single.step(still[0])[3])
            if expected[-1]:
                single.reset()
        assert ends[:, robot].tolist() == expected


def test_wrapped_robots_start_where_it_is_said():
    features = [Payload(mass=(0.0, 2.0)), ActionDelay(periods=(0, 2)), SensorNoise(position=0.01)]
    single = wrap(gym.make("caster_gym:CasterTrack-v0", **CIRCLE), *features)
    batch = wrap(gym.make_vec("caster_gym:CasterTrack-v0", num_envs=COUNT, **CIRCLE), *features)
    observations, infos = batch.reset(seed=SEED, options={"pose": POSES, "twist": TWISTS})
    assert_array_equal(infos["pose"][:, :2], POSES[:, :2])
    for robot in range(COUNT):
        options = {"pose": POSES[robot], "twist": TWISTS[robot]}
        assert_array_equal(single.reset(seed=SEED + robot, options=options)[0], observations[robot])


def test_gymnasiums_own_batches_pass_options_on():
    env = gym.make_vec("caster_gym:CasterFollow-v0", num_envs=2, vectorization_mode="sync", **CIRCLE)
    _, infos = env.reset(seed=0, options={"progress": 0.7})
    assert infos["progress"].tolist() == [0.7, 0.7]


# 0.1 m inside the robot's outline of 0.15 m when that stands at x = 0.85 m
WALL = {"walls": [{"start": [0.9, -1.0], "end": [0.9, 1.0]}]}


@pytest.mark.parametrize(
    ("place", "options", "message"),
    [
        ("time", {"pose": [1.2, 0.0, 0.0]}, r"at \(1.200, 0.000\) m lies 0.7 m from .* outside the corridor of 0.5 m"),
        ("progress", {"pose": [0.9, 0.0, 0.0]}, r"lies 0.4 m from its reference, outside the corridor of 0.25 m"),
        ("time", {"pose": [0.85, 0.0, 0.0]}, r"at \(0.850, 0.000\) m overlaps an obstacle by 0.1 m"),
        (
            "time",
            {"pose": [0.5, 0.0]},
            r"options\['pose'\] must be x, y \[m\] and heading \[rad\] in the world fra",
        ),
        ("time", {"pose": [0.5, np.nan, 0.0]}, "'pose'.* finite numbers, got"),
        ("time", {"pose": "here"}, "'pose'.* 3 real numbers; got 'here'"),
        ("time", {"pose": [0.5, 0.0, 1j]}, "'pose'.* 3 real numbers; got"),
        ("time", {"pose": [[0.5], [0.0, 1.0]]}, "'pose'.* 3 real numbers; got"),
        ("time", {"time": -0.1}, r"options\['time'\] must lie in 0 … 9.98 s on path 'circle', got -0.1 s"),
        ("time", {"time": 10.0}, r"options\['time'\] must lie in 0 … 9.98 s on path 'circle', got 10 s"),
        ("time", {"time": [1.0, 2.0]}, r"options\['time'\] must be seconds along the trajectory: a real number; got"),
        ("progress", {"progress": 3.2}, r"options\['progress'\] must lie in 0 … 3.14.* m on path 'circle', got 3.2 m"),
        ("progress", {"progress": True}, r"options\['progress'\] must be metres along the path: a real number; got"),
        ("time", {"steering": [0.0, 0.0]}, "'steering'.* the steering angle .* of each caster: 3 real numbers"),
        ("time", {"twist": [3.0, 0.0, 0.0]}, r"axis of caster 1 at 3 m/s, and the wheels of .* reach 2.5 m/s at most"),
    ],
)
def test_what_can_be_no_start_is_refused_and_changes_nothing(place, options, message):
    env = KINDS[place][0](arena=WALL, **CIRCLE)
    env.reset(seed=SEED)
    env.step(np.full(6, 0.2, dtype=np.float32))
    before, episodes = states(env), env.engine.episodes(np.zeros(1, dtype=np.int64))
    with pytest.raises(ValueError, match=message):
        env.reset(options=options)
    assert_array_equal(states(env), before)
    assert env.engine.episodes(np.zeros(1, dtype=np.int64)) == episodes
    env.step(np.full(6, 0.2, dtype=np.float32))


@pytest.mark.parametrize(("place", "path"), [("progress", {"radius": 0.51234567}), ("time", {"duration": 9.87})])
def test_the_farthest_place_that_a_message_names_is_taken(place, path):
    env = KINDS[place][0](path={"shape": "circle", **path})
    with pytest.raises(ValueError, match="must lie in 0") as error:
        env.reset(seed=SEED, options={place: 99.0})
    env.reset(seed=SEED, options={place: float(re.findall(r"0 … ([\d.]+) ", str(error.value))[0])})


def test_which_robot_of_a_batch_starts_outside_is_told():
    env = CasterFollowVectorEnv(COUNT, **CIRCLE)
    poses = POSES.copy()
    poses[2, 0] = 2.0
    with pytest.raises(ValueError, match="the start of robot 2 at"):
        env.reset(seed=0, options={"pose": poses})


def test_motors_must_reach_the_speed_of_a_start():
    """A caster across the motion turns at speed / trail; one that trails it does not turn at all, as is advised."""
    robot = load_robot("tidybot2")
    speed = 0.8
    across, trailing = np.full((1, robot.caster_count), np.pi / 2), np.zeros((1, robot.caster_count))
    twist = np.array([[speed, 0.0, 0.0]])
    turning = Model(robot).rates(across, twist)[2][0, 0]
    assert abs(turning) == pytest.approx(speed / robot.casters[0].trail)
    with pytest.raises(ValueError, match=r"turns motor .* these steering angles, .* give a slower twist or 'steer"):
        check_motion(robot, across, twist)
    check_motion(robot, trailing, twist)
    check_motion(robot, across, 0.01 * twist)
