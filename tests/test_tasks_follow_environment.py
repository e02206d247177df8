"""caster_gym.tasks.follow.environment, .parameters: the following task as users meet it, alone and in a batch."""

import re
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode, SyncVectorEnv
from gymnasium.wrappers import TimeLimit
from numpy.testing import assert_array_equal
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3

from caster_gym.engines.native.lanes import LANES
from caster_gym.envs.observation import observation_size
from caster_gym.tasks.follow.environment import CasterFollowEnv, CasterFollowVectorEnv
from caster_gym.tasks.follow.parameters import FollowParameters
from tests.test_envs_caster_vector_env import assert_same, random_actions

ID = "caster_gym:CasterFollow-v0"
CIRCLE = {"shape": "circle", "radius": 0.4}
POOL = [CIRCLE, "lemniscate", {"shape": "rounded_square", "side": 0.8, "rounding": 0.4}]
NARROW: dict[str, Any] = {
    "path": POOL,
    "arena": {"beside": {"pillars": 3, "walls": 2, "gap": [0.03, 0.06], "pillar_radius": [0.03, 0.06]}},
    "start_offset": 0.01,
}
LONGEST, SEED = 40, 11


def resting(env):
    return np.zeros(env.action_space.shape, dtype=np.float32)


@pytest.mark.parametrize("arena", [None, NARROW["arena"]])
def test_gymnasium_and_sb3_find_nothing_to_complain_about(arena):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(ID, path=CIRCLE, arena=arena).unwrapped)
        check_env_for_sb3(CasterFollowEnv(path=CIRCLE, arena=arena), warn=True)


def test_spaces_are_those_of_the_docstring():
    """13 numbers, four per caster, seven per previewed point, three per obstacle; a torque per driven joint."""
    env = CasterFollowEnv()
    assert env.observation_space.shape == (observation_size(3, 3, 3),)
    assert (env.observation_space.low == -20.0).all() and (env.observation_space.high == 20.0).all()
    assert env.action_space == gym.spaces.Box(-1.0, 1.0, (6,), np.float32)
    names = [part.name for part in env.engine.layout.parts]
    assert names[-6:-3] == ["preview_0.05m", "preview_0.15m", "preview_0.4m"]
    assert names[-3:] == ["obstacle_1", "obstacle_2", "obstacle_3"]


def test_the_docstring_tells_the_numbers_of_the_task():
    """Weights and scales of the table, and the lengths of the text, are the defaults."""
    text, task = " ".join((CasterFollowEnv.__doc__ or "").split()), FollowParameters()
    number = r"(-?[\d.]+)"
    said = {
        rf"\| progress \| {number} σ \|": task.progress_weight,
        rf"\| cross_track \| {number} σ k": task.cross_track_weight,
        rf"k\(distance to the path, {number} m\)": task.cross_track_scale,
        rf"\| heading \| {number} σ k": task.heading_weight,
        rf"k\(chord of the heading error, {number}\)": task.heading_scale,
        rf"\| effort \| −{number} times": task.effort_weight,
        rf"\| impact \| −{number} J": task.impact_weight,
        rf"J/\(J \+ {number} N s\)": task.impact_scale,
        rf"\| alive \| {number}, so": task.effort_weight + task.impact_weight,
        rf"e²/\({number} ℓ\)²": task.coarse,
        rf"1/\(1 \+ e²/\({number} m\)²\)": task.arrival_scale,
        rf"from the progress so far to {number} m": task.window,
        rf"speed limit \({number} m/s\)": task.speed_limit,
        rf"margin \({number} %\)": 100.0 * task.margin,
        rf"left its corridor \({number} m": task.corridor,
        rf"`truncated`: {number} times": task.allowance,
        rf"by up to {number} m along": task.start_offset,
        rf"each axis and {number} rad": task.start_turn,
        rf"the {number} nearest obstacles": task.nearest,
    }
    for pattern, value in said.items():
        (found,) = re.findall(pattern, text)
        assert float(found) == pytest.approx(value, abs=1e-12), pattern
    (preview,) = re.findall(r"arc lengths ahead \(([\d., ]+?) m\)", text)
    assert tuple(map(float, preview.split(","))) == task.preview


def batch(count, mode, **arguments):
    return CasterFollowVectorEnv(count, autoreset_mode=mode, max_episode_steps=LONGEST, **{**NARROW, **arguments})


def singles(count, mode, **arguments):
    made = {**NARROW, **arguments}
    return SyncVectorEnv([lambda: TimeLimit(CasterFollowEnv(**made), LONGEST)] * count, autoreset_mode=mode)


@pytest.mark.slow
@pytest.mark.parametrize("mode", list(AutoresetMode))
@pytest.mark.parametrize("touching", ["allowed", "ends"])
def test_a_batch_equals_single_environments(mode, touching):
    """To the last bit, infos included, while robots leave corridors, run out of time and touch obstacles."""
    count = LANES + 3
    task = {"corridor": 0.15, "touching": touching}
    ours, theirs = batch(count, mode, **task), singles(count, mode, **task)
    assert ours.observation_space == theirs.observation_space
    assert ours.action_space == theirs.action_space
    assert_same(ours.reset(seed=SEED), theirs.reset(seed=SEED))
    failures, ends, touches = 0, 0, 0
    for _, actions in zip(range(100), random_actions(ours.action_space, 1), strict=False):
        mine, other = ours.step(actions), theirs.step(actions)
        assert_same(mine, other)
        _, _, terminated, truncated, info = mine
        failures, ends = failures + terminated.sum(), ends + truncated.sum()
        touches += (info.get("final_info", info)["normal_impulse"] > 0.0).sum()
        done = terminated | truncated
        if mode is AutoresetMode.DISABLED and done.any():
            assert_same(*(env.reset(options={"reset_mask": done.copy()}) for env in (ours, theirs)))
    assert min(failures, ends, touches) >= 3


def test_robots_of_a_large_batch_are_those_of_single_environments():
    """1,003 robots, which is no multiple of the lanes, on several threads; 20 of them alone."""
    ours = CasterFollowVectorEnv(1003, **NARROW)
    observations, infos = ours.reset(seed=SEED)
    chosen = np.linspace(0, 1002, 20).astype(int)
    alone = [CasterFollowEnv(**NARROW) for _ in chosen]
    for robot, env in zip(chosen, alone, strict=True):
        assert_array_equal(env.reset(seed=SEED + int(robot))[0], observations[robot])
    for _, actions in zip(range(5), random_actions(ours.action_space, 2), strict=False):
        observations, rewards, _, _, infos = ours.step(actions)
        for robot, env in zip(chosen, alone, strict=True):
            observation, reward, _, _, info = env.step(actions[robot])
            assert_array_equal(observation, observations[robot])
            assert reward == rewards[robot]
            assert info["progress"] == infos["progress"][robot]
            assert info["clearance"] == infos["clearance"][robot]


def test_the_same_seed_gives_the_same_episode():
    """To the last bit, in another environment and in one that has been used; another seed another one."""

    def episode(env, seed):
        rng = np.random.default_rng(0)
        rows = [env.reset(seed=seed)[0]]
        rows += [env.step(rng.uniform(-1.0, 1.0, 6).astype(np.float32))[0] for _ in range(30)]
        return np.array(rows)

    first, second = CasterFollowEnv(**NARROW), CasterFollowEnv(**NARROW)
    expected = episode(first, 7)
    assert_array_equal(episode(second, 7), expected)
    assert_array_equal(episode(first, 7), expected)
    assert (episode(second, 8) != expected).any()


def test_obstacles_beside_a_path_are_those_of_their_seed():
    arenas = [{"beside": {"pillars": 2, "walls": 0, "seed": seed}} for seed in (1, 1, 2)]
    first, same, other = (
        CasterFollowEnv(path=CIRCLE, arena=arena).engine.plan.around.obstacles.corners for arena in arenas
    )
    assert_array_equal(first, same)
    assert (first != other).any()


def test_a_path_of_the_pool_can_be_chosen():
    env = CasterFollowEnv(**NARROW)
    for path in range(3):
        env.reset(seed=path, options={"path": path})
        assert env.engine.paths.tolist() == [path]
    for wrong in (3, -2, 0.5):
        with pytest.raises(ValueError, match=rf"path must be a whole number in 0 … 2, got {wrong}"):
            env.reset(options={"path": wrong})


def test_info_has_the_same_keys_and_types_at_reset_and_step():
    env = CasterFollowEnv(**NARROW)
    _, first = env.reset(seed=0)
    later = env.step(resting(env))[4]
    described = [
        {key: (type(value), getattr(value, "shape", None)) for key, value in {**info, **info["reward_terms"]}.items()}
        for info in (first, later)
    ]
    assert described[0] == described[1]
    assert list(first) == list(later)


def test_an_episode_lasts_as_long_as_the_law_takes_and_half_of_that():
    """Not a step less or more, whatever the robot has reached by then."""
    env = CasterFollowEnv(path=CIRCLE)
    table, spacing = env.engine.plan.tables[0], env.engine.plan.source.spacings[0]
    speeds = np.sqrt(table[:, 9])
    duration = np.sum(2.0 * spacing / (speeds[1:] + speeds[:-1]))  # constant accelerations between rows
    steps = int(np.ceil(1.5 * duration / 0.02))
    for _ in range(2):
        env.reset(seed=2)
        flags = [env.step(resting(env))[2:4] for _ in range(steps)]
        assert flags == [(False, False)] * (steps - 1) + [(False, True)]


def test_max_episode_steps_truncates():
    env = gym.make(ID, max_episode_steps=5, path=CIRCLE)
    env.reset(seed=0)
    assert [env.step(resting(env))[3] for _ in range(5)] == [False] * 4 + [True]
    native = CasterFollowVectorEnv(2, path=CIRCLE, max_episode_steps=5)
    native.reset(seed=0)
    assert [native.step(np.zeros((2, 6)))[3].tolist() for _ in range(5)] == [[False] * 2] * 4 + [[True] * 2]


def test_leaving_the_corridor_is_failure():
    """At the first step outside 0.25 m, worth nothing."""
    env = CasterFollowEnv(path=CIRCLE)
    env.reset(seed=0)
    states = env.engine.states
    states[0, 4:6] = 1.0, 0.0  # sets out along the tangent
    env.engine.states = states
    for _ in range(100):
        _, reward, terminated, truncated, info = env.step(resting(env))
        assert terminated == info["left_corridor"] == (info["position_error"] > 0.25)
        assert not truncated
        if terminated:
            break
        assert reward > 0.0
    assert terminated
    assert reward == 0.0
    assert set(info["reward_terms"].values()) == {0.0}


def test_make_vec_gives_the_native_batch():
    env = gym.make_vec(ID, num_envs=3, path=CIRCLE)
    assert isinstance(env.unwrapped, CasterFollowVectorEnv)
    assert_same(env.reset(seed=3), gym.make_vec(ID, num_envs=3, path=CIRCLE, vectorization_mode="sync").reset(seed=3))


def pillar(x, y, radius=0.1):
    return {"pillars": [{"centre": [x, y], "radius": radius}]}


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"windw": 1.0}, "'windw'.*did you mean 'window'"),
        ({"window": 0.03}, r"window of 0\.03 m must be at least 0\.04 m, twice"),
        ({"speed_limit": 6.0}, r"window of 0\.2 m must be at least 0\.24 m, twice"),
        ({"preview": (0.3, 0.1)}, r"preview distances must rise from one to the next, got \[0\.3, 0\.1\]"),
        ({"preview": (0.1, 0.1)}, "preview distances must rise"),
        ({"preview": (0.0,)}, "greater than 0"),
        ({"allowance": 0.9}, "'allowance'.*greater than or equal to 1.*0.9"),
        ({"margin": 1.1}, r"'margin'.*less than or equal to 1.*1\.1"),
        ({"start_offset": 0.2}, r"start_offset of 0\.2 m along both axes leaves the corridor of 0\.25 m"),
        ({"touching": "forbidden"}, "'touching'.*'allowed' or 'ends'.*forbidden"),
        ({"nearest": -1}, "'nearest'.*-1"),
        ({"arena": {"pilars": []}}, "'pilars'.*did you mean 'pillars'"),
        ({"arena": pillar(0.0, 0.4)}, r"path 'circle' runs into pillar 1 at \(0, 0\.4\) m: after 0\.\d\d m, at \("),
        (
            {"arena": {"room": [[-0.5, -1.0], [1.0, 1.0]]}},
            r"path 'circle' leaves the arena through the room's side x_min: after 1\.26 m, at \(-0\.400, 0\.000\) m",
        ),
        (
            {"arena": pillar(0.66, 0.0)},
            r"path 'circle' starts too near to pillar 1 at \(0\.66, 0\) m: the gap is 0\.01 m, and 0\.0283 m are",
        ),
        (
            {"arena": {"polygons": [{"corners": [[2, 0], [3, 1], [3, 0], [2, 1]]}]}},
            r"must not cross itself, but its edges from corner 1 and from corner 3 cross at \(2\.5, 0\.5\) m",
        ),
        (
            {"path": {"shape": "random_paths", "count": 3, "seed": 1, "reversing": 1.0}},
            r"path 'random_paths.*' makes no course: it turns back on the spot at s = .* m, \(x, y\) = \(",
        ),
        ({"path": {"shape": "circle", "radius": 1e-4}}, "path 'circle' makes no course: it is 0.000628 m long"),
        ({"path": "circel"}, "'circel'; did you mean 'circle'"),
        ({"control_period": 0.1}, r"time step of 0\.025 s cannot follow"),
    ],
)
def test_a_wrong_argument_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        CasterFollowEnv(**{"path": CIRCLE, **arguments})


def test_the_path_that_an_obstacle_blocks_is_named():
    """Of two, the one that goes there, although obstacles do not belong to paths."""
    pool = [CIRCLE, {**CIRCLE, "centre": [3.0, 0.0]}]
    with pytest.raises(ValueError, match=r"path 'circle \(2\)' runs into pillar 1 at \(3, 0\.4\) m: after "):
        CasterFollowEnv(path=pool, arena=pillar(3.0, 0.4))


@pytest.mark.parametrize(
    ("call", "error", "message"),
    [
        (lambda: CasterFollowVectorEnv(0), ValueError, "num_envs must be 1 or more, got 0"),
        (lambda: CasterFollowVectorEnv(2, max_episode_steps=0), ValueError, "max_episode_steps must be 1 or more"),
        (lambda: CasterFollowEnv(path=CIRCLE).step(np.zeros(6)), RuntimeError, "before its first step"),
        (lambda: _started().step(np.zeros(5)), ValueError, r"action must have shape \(6,\), got \(5,\)"),
        (lambda: _started().step(np.full(6, np.nan)), ValueError, "action must hold numbers, got"),
    ],
)
def test_wrong_use_is_refused(call, error, message):
    with pytest.raises(error, match=message):
        call()


def _started():
    env = CasterFollowEnv(path=CIRCLE)
    env.reset(seed=0)
    return env


@pytest.mark.parametrize("fields", [{"window": 0.03}, {"speed_limit": 1 / 3, "control_period": 0.013, "window": 1e-3}])
def test_the_window_that_a_message_names_is_wide_enough(fields):
    with pytest.raises(ValueError, match="must be at least") as error:
        FollowParameters(**fields)
    least = float(re.findall(r"at least ([\d.]+) m", str(error.value))[0])
    assert FollowParameters(**{**fields, "window": least})


def test_a_start_too_near_to_an_obstacle_is_free_once_it_is_displaced_less_as_is_advised():
    near = {"path": CIRCLE, "arena": pillar(0.66, 0.0)}
    with pytest.raises(ValueError, match="move the obstacle, or lower start_offset and start_turn"):
        CasterFollowEnv(**near)
    assert CasterFollowEnv(**near, start_offset=0.002, start_turn=0.01)
    assert CasterFollowEnv(**{**near, "arena": pillar(0.69, 0.0)})
