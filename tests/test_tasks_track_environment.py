"""caster_gym.tasks.track.environment, .parameters: the single one as its users meet it."""

import re
import warnings
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from numpy.testing import assert_allclose, assert_array_equal
from stable_baselines3.common.env_checker import check_env as check_env_for_sb3

from caster_gym import Model, load_robot
from caster_gym.analysis.actuation import ActuationWarning
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.observation import observation_size
from caster_gym.shipped_files import names_of
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.track import TASK
from caster_gym.tasks.track.environment import CasterTrackEnv

ID = "caster_gym:CasterTrack-v0"
CIRCLE = {"shape": "circle", "radius": 0.3, "duration": 6.0}  # 300 steps; a robot at rest stays within 0.65 m of it
WIDE: dict[str, Any] = {"path": CIRCLE, "corridor": 5.0}


def rest(env):
    return np.zeros(env.action_space.shape, dtype=np.float32)


def episode(env, seed, steps=60):
    """Everything that an episode under random actions returns."""
    rng = np.random.default_rng(seed)
    actions = rng.uniform(-1.0, 1.0, (steps, *env.action_space.shape)).astype(np.float32)
    return [env.reset(seed=seed), *(env.step(action) for action in actions)]


def flat(value):
    """All numbers of a nested result, in one row."""
    if isinstance(value, dict):
        return np.concatenate([flat(value[key]) for key in sorted(value)])
    if isinstance(value, list | tuple):
        return np.concatenate([flat(item) for item in value])
    return np.atleast_1d(np.asarray(value, dtype=np.float64)).ravel()


@pytest.mark.parametrize("robot", names_of("robots"))
def test_gymnasium_and_sb3_find_nothing_to_complain_about(robot):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        check_env(gym.make(ID, robot=robot).unwrapped)
        check_env_for_sb3(CasterTrackEnv(robot), warn=True)


def test_an_underactuated_robot_is_announced_and_works():
    """Four joints that are singular at some steering angles can still follow a gentle circle."""
    with pytest.warns(ActuationWarning, match="conditioning falls to"):
        env = gym.make(
            ID, actuation=["roll_1", "steer_1", "roll_2", "steer_3"], path={**CIRCLE, "duration": 12.0}
        ).unwrapped
    assert env.action_space.shape == (4,)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        warnings.simplefilter("ignore", ActuationWarning)  # the check makes the environment once more
        check_env(env, skip_render_check=True)


def test_joints_that_cannot_follow_the_path_are_refused():
    with (
        pytest.warns(ActuationWarning, match="fewer than three joints"),
        pytest.raises(ValueError, match=r"the driven joints, roll_1, steer_1, cannot push"),
    ):
        CasterTrackEnv(actuation=["roll_1", "steer_1"])


def test_passive_joints_get_no_torque():
    """The named joints are driven in the order of the joints, not in the order of their naming."""
    robot = load_robot("chung2008")
    with pytest.warns(ActuationWarning):  # no matter here
        env = CasterTrackEnv(actuation=["steer_3", "roll_1", "roll_2", "steer_2"], **WIDE)
    assert env.robot.driven == ("roll_1", "roll_2", "steer_2", "steer_3")
    env.reset(seed=0)
    small = np.array([0.01, 0.02, 0.03, 0.04], dtype=np.float32)  # slow: no motor is near its top speed
    torque = env.step(small)[4]["torque"]
    roll, steer = robot.casters[0].roll.max_torque, robot.casters[0].steer.max_torque
    small = small.astype(np.float64)
    expected = [small[0] * roll, 0.0, small[1] * roll, small[2] * steer, 0.0, small[3] * steer]
    np.testing.assert_allclose(torque, expected, rtol=1e-12)  # a mean of four equal numbers


def test_torque_respects_the_motors_limits_at_their_speed():
    """Pushed on at full torque a motor speeds up until it has nothing left to give: it never drives beyond that."""
    env = CasterTrackEnv(path=CIRCLE, corridor=100.0)
    env.reset(seed=3)
    most = np.array([size for c in env.robot.casters for size in (c.roll.max_torque, c.steer.max_torque)])
    uses = []
    for _ in range(200):
        torque = env.step(np.ones(6, dtype=np.float32))[4]["torque"]
        uses.append(np.abs(torque) / most)
    assert np.max(uses) <= 1.0 + 1e-12  # rounding of a mean
    assert np.min(uses) < 0.9  # the limit was felt


def test_actions_beyond_the_space_are_clipped_even_infinite_ones():
    given = np.array([3.0, -np.inf, np.inf, -1.5, 0.5, -0.5], dtype=np.float32)
    results = []
    for action in (given, np.clip(given, -1.0, 1.0)):
        env = CasterTrackEnv(**WIDE)
        env.reset(seed=5)
        results.append(flat([env.step(action) for _ in range(10)]))
    assert_array_equal(*results)


def test_the_same_seed_gives_the_same_episode():
    """To the last bit, in another environment and in one that has been used."""
    first, second = CasterTrackEnv(**WIDE), CasterTrackEnv(**WIDE)
    expected = flat(episode(first, 7))
    assert_array_equal(flat(episode(second, 7)), expected)
    assert_array_equal(flat(episode(first, 7)), expected)
    assert (flat(episode(second, 8)) != expected).any()


def test_resets_without_a_seed_continue_a_reproducible_sequence():
    envs = CasterTrackEnv(**WIDE), CasterTrackEnv(**WIDE)
    sequences = []
    for env in envs:
        starts = [env.reset(seed=9)[0]]
        starts += [env.reset()[0] for _ in range(5)]
        sequences.append(np.array(starts))
    first, second = sequences
    assert_array_equal(first, second)
    assert len(np.unique(first, axis=0)) == 6


def test_environments_without_a_seed_start_differently():
    assert (CasterTrackEnv(**WIDE).reset()[0] != CasterTrackEnv(**WIDE).reset()[0]).any()


def test_what_was_returned_belongs_to_the_caller():
    """Spoiling it changes nothing later, and later steps do not change it."""
    spoiled, clean = CasterTrackEnv(**WIDE), CasterTrackEnv(**WIDE)
    results: list[tuple[Any, ...]] = [env.reset(seed=1) for env in (spoiled, clean)]
    for _ in range(5):
        assert_array_equal(flat(results[0]), flat(results[1]))
        kept = flat(results[1]).copy()
        observation, info = results[0][0], results[0][-1]
        observation[:] = 9.0
        info["reward_terms"]["position"] = 9.0
        for key in ("torque", "pose", "reference_pose", "impulse"):
            info[key][:] = 9.0
        before = results[1]
        results = [env.step(np.full(6, 0.5, dtype=np.float32)) for env in (spoiled, clean)]
        assert_array_equal(flat(before), kept)


def test_info_has_the_same_keys_and_types_at_reset_and_step():
    env = CasterTrackEnv(**WIDE)
    _, first = env.reset(seed=0)
    later = env.step(rest(env))[4]
    described = [
        {key: (type(value), getattr(value, "shape", None)) for key, value in {**info, **info["reward_terms"]}.items()}
        for info in (first, later)
    ]
    assert described[0] == described[1]
    assert list(first) == list(later)
    assert (first["power"], first["left_corridor"], first["not_finite"]) == (0.0, False, False)
    assert_array_equal(first["torque"], np.zeros(6))


def test_an_episode_ends_with_its_trajectory():
    env = CasterTrackEnv(**WIDE)
    for _ in range(2):
        env.reset(seed=2)
        flags = [env.step(rest(env))[2:4] for _ in range(300)]
        assert flags == [(False, False)] * 299 + [(False, True)]


def test_leaving_the_corridor_is_failure_and_not_time():
    """Terminated at the first step outside, never truncated before the end, and worth nothing."""
    env = CasterTrackEnv(corridor=0.3, path="circle")
    env.reset(seed=0)
    for _ in range(600):
        observation, reward, terminated, truncated, info = env.step(np.ones(6, dtype=np.float32))
        distance = np.hypot(*(info["reference_pose"] - info["pose"])[:2])
        assert terminated == info["left_corridor"] == (distance > 0.3)
        assert not truncated
        if terminated:
            break
        assert reward > 0.0
    assert terminated
    assert reward == 0.0
    assert set(info["reward_terms"].values()) == {0.0}
    assert not info["not_finite"]
    assert env.observation_space.contains(observation)


@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
@pytest.mark.parametrize("place", [0, 4, 7])
def test_a_state_that_is_not_finite_is_failure(place, bad):
    """From the position, a speed or a direction on; the observation is still one of the space."""
    env = CasterTrackEnv(**WIDE)
    env.reset(seed=0)
    states = env.engine.states
    states[0, place] = bad
    env.engine.states = states
    observation, reward, terminated, truncated, info = env.step(rest(env))
    assert terminated
    assert not truncated
    assert info["not_finite"] or (place == 0 and bad == 1e200 and info["left_corridor"])  # far away is finite
    assert reward == 0.0
    assert env.observation_space.contains(observation)
    observation, info = env.reset()
    assert env.observation_space.contains(observation)
    assert info.pop("clearance") == np.inf  # there is no obstacle
    assert np.isfinite(flat(info)).all()


def test_starts_fill_the_bounds_and_all_paths_are_drawn():
    """400 starts, of which each bound below fails by chance less than once in 10,000 times."""
    offset, turn = 0.04, 0.3
    env = CasterTrackEnv(path=[CIRCLE, "lemniscate", {"shape": "ellipse"}], start_offset=offset, start_turn=turn)
    env.reset(seed=0)
    places, turns, steering, paths = [], [], [], []
    for _ in range(400):
        _, info = env.reset()
        x, y, cos, sin = info["reference_pose"]
        apart = complex(*info["pose"][:2]) - complex(x, y)
        beside = apart / complex(cos, sin)  # in the frame of the reference
        places.append([beside.real, beside.imag])
        turns.append(-info["heading_error"])
        state = env.engine.states[0]
        assert_array_equal(state[4:7], np.zeros(3))
        steering.append(np.arctan2(state[8::2], state[7::2]))
        paths.append(env.engine.paths[0])
    for values, bound in ((np.array(places), offset), (np.array(turns)[:, None], turn), (np.array(steering), np.pi)):
        assert np.abs(values).max() <= bound * (1.0 + 1e-12)  # rounding of the frames
        assert (values.max(axis=0) > 0.95 * bound).all()  # (1 − 0.025)⁴⁰⁰ = 4e-5
        assert (values.min(axis=0) < -0.95 * bound).all()
        deviation = bound / np.sqrt(3.0 * 400)
        assert (np.abs(values.mean(axis=0)) < 4.0 * deviation).all()
    assert np.abs(np.corrcoef(np.hstack((places, steering)).T) - np.eye(5)).max() < 4.0 / np.sqrt(400)
    assert (np.bincount(paths, minlength=3) > 100 - 4 * 10).all()  # 133 expected, standard deviation 9.4


def test_a_path_of_the_pool_can_be_chosen():
    """And the rest of the start stays as it would have been drawn."""
    pool = [CIRCLE, "lemniscate", {"shape": "ellipse"}]
    chosen, drawn = CasterTrackEnv(path=pool), CasterTrackEnv(path=pool)
    for seed in range(6):
        chosen.reset(seed=seed, options={"path": 1})
        drawn.reset(seed=seed)
        assert chosen.engine.paths.tolist() == [1]
        assert_array_equal(chosen.engine.states[0, 7:], drawn.engine.states[0, 7:])
    for wrong in (3, -2):
        with pytest.raises(ValueError, match=rf"path must be a whole number in 0 … 2, got {wrong}"):
            chosen.reset(options={"path": wrong})


def test_a_task_without_spread_starts_on_the_trajectory():
    _, info = CasterTrackEnv(start_offset=0.0, start_turn=0.0, **WIDE).reset(seed=0)
    assert_array_equal(info["pose"], info["reference_pose"])


@pytest.mark.parametrize(
    "preview", [(1e9,), (1e300,), (float("inf"),), (0.0,), tuple(0.02 * i for i in range(1, 1002))]
)
def test_absurd_horizons_are_refused_before_anything_is_compiled(preview):
    with pytest.raises(ConfigurationError, match=r"^the task 'track': .*'preview'.* (should be|at most 1000 are read)"):
        CasterTrackEnv(preview=preview)


def test_a_task_without_preview_works():
    env = CasterTrackEnv(preview=(), **WIDE)
    assert env.observation_space.shape == (observation_size(3, 0, 0),)
    full = CasterTrackEnv(**WIDE)
    shared = [part.place for part in full.engine.layout.parts if not part.name.startswith("preview")]
    for alone, seen in (
        (env.reset(seed=4)[0], full.reset(seed=4)[0]),
        (env.step(rest(env))[0], full.step(rest(env))[0]),
    ):
        assert_array_equal(alone, np.concatenate([seen[place] for place in shared]))


def test_a_pool_of_random_paths_is_drawn_from():
    env = CasterTrackEnv()
    env.reset(seed=0)
    drawn = {int((env.reset(), env.engine.paths[0])[1]) for _ in range(300)}
    assert drawn == set(range(len(env.engine.plan.names)))  # each of 16 is missed with probability 4e-9


def test_max_episode_steps_of_make_truncates():
    env = gym.make(ID, max_episode_steps=5, **WIDE)
    env.reset(seed=0)
    assert [env.step(rest(env))[3] for _ in range(5)] == [False] * 4 + [True]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"coridor": 1.0}, "'coridor'.*did you mean 'corridor'"),
        ({"robot": "chung2009"}, "unknown robot 'chung2009'; known are "),
        ({"path": "circel"}, "'circel'; did you mean 'circle'"),
        ({"actuation": ["roll_9"]}, "unknown joint 'roll_9'; the joints are roll_1"),
        ({"actuation": []}, "at least one joint must be named"),
        ({"preview": (0.03, 0.1)}, r"multiples of the control period 0\.02 s, got 0\.03 s"),
        ({"preview": (0.0,)}, "greater than 0"),
        ({"control_period": 0.1}, r"time step of 0\.025 s cannot follow .* at most 0\.01 s"),
        ({"substeps": 0}, "'substeps'.* greater than 0.* 0"),
        ({"corridor": -1.0}, "'corridor'.* greater than 0.* -1"),
        ({"start_offset": 0.5}, "start_offset of 0.5 m along both axes leaves the corridor of 0.5 m"),
        ({"coarse": 1.0}, "'coarse'.* greater than 1.* 1"),
        ({"position_weight": float("nan")}, "'position_weight'.*nan"),
    ],
)
def test_a_wrong_argument_is_named(arguments, message):
    with pytest.raises(ValueError, match=message):
        CasterTrackEnv(**arguments)


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (np.zeros(5), r"action must have shape \(6,\), got \(5,\)"),
        (np.zeros((1, 6)), r"action must have shape \(6,\), got \(1, 6\)"),
        (np.array([0, 0, np.nan, 0, 0, 0]), r"action must hold numbers, got \[ 0\.  0\. nan"),
    ],
)
def test_a_wrong_action_is_refused_and_changes_nothing(action, message):
    env = CasterTrackEnv(**WIDE)
    env.reset(seed=0)
    before = env.engine.states
    with pytest.raises(ValueError, match=message):
        env.step(action)
    assert_array_equal(env.engine.states, before)


def test_a_step_before_the_first_reset_is_refused():
    env = CasterTrackEnv(**WIDE)
    with pytest.raises(RuntimeError, match="reset the environment before its first step"):
        env.step(rest(env))


def test_a_coarse_step_is_refused_for_the_robot_that_it_is_too_coarse_for():
    """The promised longest step does."""
    with pytest.raises(ValueError, match=r"at most 0\.01 s"):
        CasterTrackEnv(control_period=0.044, preview=(), path={**CIRCLE, "duration": 8.8})
    assert CasterTrackEnv(control_period=0.04, preview=(), path={**CIRCLE, "duration": 8.0}).task.time_step == 0.01


def test_trajectories_are_built_once_for_all_environments_of_a_process():
    """Thousand single environments do not hold thousand tables."""
    (first, _), (second, _) = (build_engine(TASK, "chung2008", None, None, None, {}, count) for count in (1, 2))
    assert first.plan is second.plan


def test_the_layout_in_the_docstring_is_the_layout_of_the_engine():
    """Its table counts in casters N and previewed points K."""
    parts = {part.name: part.place for part in CasterTrackEnv(**WIDE, nearest=1).engine.layout.parts}
    own = [place for name, place in parts.items() if place.stop <= parts["directions"].start]
    first = own[-1].stop
    expected = [f"{place.start}–{place.stop - 1}" for place in own]
    expected += [f"{first} … {first - 1}+2N", f"{first}+2N … {first - 1}+4N"]
    widths = [parts[name].stop - parts[name].start for name in ("preview_0.1s", "obstacle_1")]
    expected += [f"then {widths[0]} for each K", f"then {widths[1]} for each of `nearest` (0)"]
    table = (CasterTrackEnv.__doc__ or "").split("**Observation**")[1].split("**Reward**")[0]
    indices = re.findall(r"^ *\| ([^|]+?) \|.*±", table, re.M)
    assert indices == expected


def test_work_of_the_motors_is_the_gain_of_energy():
    """Without friction. The trapezoidal rule over 5 ms errs by 1e-3 of it; the rate before each step alone, by 2e-2."""
    env = CasterTrackEnv(path="circle", corridor=50.0)
    model, random = Model(env.robot), np.random.default_rng(3)
    env.reset(seed=3)
    work = 0.0
    for _ in range(60):
        _, _, _, _, info = env.step(random.uniform(-1.0, 1.0, 6).astype(np.float32))
        work += info["power"] * env.task.control_period
    state = env.engine.states[0]
    steering = np.arctan2(state[8::2], state[7::2])
    assert_allclose(work, model.kinetic_energy(steering, state[4:7]), rtol=4e-3)


@pytest.mark.parametrize("preview", [(0.1, 0.1), (0.4, 0.1)])
def test_preview_horizons_rise(preview):
    with pytest.raises(ValueError, match="preview horizons must rise"):
        CasterTrackEnv(preview=preview)
