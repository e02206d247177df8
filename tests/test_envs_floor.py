"""Tasks on a floor of finite friction: what wheels do that may slip, alone, in batches and on tensors."""

import copy
import json
import pickle
import re
from pathlib import Path
from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.floor import Floor, Patch
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.track.parameters import TrackParameters
from caster_gym.wrappers import Friction, wrap

ICE = {"friction": 0.05}
ISLANDS = {
    "friction": 0.6,
    "patches": [
        {"x": 0.0, "y": 0.0, "radius": 0.45, "friction": 0.1},
        {"x": 0.5, "y": 0.0, "radius": 0.2, "friction": 0.02},
    ],
}
TASKS = {"track": "CasterTrack-v0", "follow": "CasterFollow-v0"}
PATHS = [{"shape": "circle", "radius": 0.5}, {"shape": "rounded_square"}]
OBSTACLES = {
    "beside": {"pillars": 3, "walls": 2, "gap": [0.01, 0.02]},
    "room": [[-2.0, -2.0], [2.0, 2.0]],
    "restitution": 0.6,
    "friction": 0.3,
}
STANDING = {"twist": [0.0, 0.0, 0.0], "steering": [0.0, 0.0, 0.0], "pose": [0.5, 0.0, 0.0]}
ROUNDING = 1e-12  # of shares and speeds of order 1


def alone(task="track", **how):
    return gym.make(f"caster_gym:{TASKS[task]}", **{"path": PATHS, "corridor": 50.0, **how}).unwrapped


def batch(count, task="track", mode=AutoresetMode.SAME_STEP, **how):
    made = {"path": PATHS, "corridor": 50.0, **how}
    return gym.make_vec(
        f"caster_gym:{TASKS[task]}", count, vectorization_mode="vector_entry_point", autoreset_mode=mode, **made
    ).unwrapped


def torques(shape, steps, seed=0, size=1.0):
    """Actions that last for some periods."""
    rng, kept = np.random.default_rng(seed), np.zeros(shape)
    for _ in range(steps):
        kept = np.where(rng.uniform(size=(*shape[:-1], 1)) < 0.2, rng.uniform(-size, size, shape), kept)
        yield kept.astype(np.float32)


def straight(env, share, steps):
    """Infos of a robot with wheels ahead whose rolling motors get a share of their torque; steering motors none."""
    env.reset(seed=0, options=STANDING)
    action = np.tile([share, 0.0], len(env.robot.casters)).astype(np.float32)
    return [env.step(action)[4] for _ in range(steps)]


@pytest.mark.parametrize("task", list(TASKS))
def test_a_batch_equals_single_environments(task):
    """To the last bit: observations, rewards, endings, infos and states, with episodes that end on the way."""
    assert_a_batch_equals_single_environments(task, 6, floor=ISLANDS, corridor=0.04, start_offset=0.02)


@pytest.mark.parametrize(("task", "floor"), [("track", "grip"), ("follow", ISLANDS)])
def test_a_batch_equals_single_environments_among_obstacles(task, floor):
    """Thrown at walls and pillars: impacts, in which wheels slip where friction is finite, and lasting contacts."""
    hits = assert_a_batch_equals_single_environments(task, 4, 20, 1.5, floor=floor, arena=OBSTACLES, corridor=0.6)
    assert hits >= 1


def assert_a_batch_equals_single_environments(task, count, steps=60, speed=0.0, **how):
    """Returns the number of impacts. speed: to the left and to the right, from robot to robot, at the start."""
    many = batch(count, task, **how)
    singles = [alone(task, **how) for _ in range(count)]
    seen, _ = many.reset(seed=4)
    for i, single in enumerate(singles):
        assert_array_equal(single.reset(seed=4 + i)[0], seen[i])
    states = many.engine.states
    states[:, 5] = speed * np.where(np.arange(count) % 2, 1.0, -1.0)
    many.engine.states = states
    for single, state in zip(singles, states, strict=True):
        single.engine.states = state[None]
    ended = hits = 0
    for actions in torques(many.action_space.shape, steps):
        seen, rewards, terminated, truncated, infos = many.step(actions)
        for i, single in enumerate(singles):
            shown, reward, failed, late, info = single.step(actions[i])
            final = infos["final_info"] if failed or late else infos
            assert (reward, failed, late) == (rewards[i], terminated[i], truncated[i])
            slip = () if how["floor"] == "grip" else ("wheel_slip",)
            for key in (*slip, "traction_use", "impact_traction", "torque", "power", "pose", "normal_impulse"):
                assert_array_equal(info[key], final[key][i], err_msg=key)
            hits += info["impacts"]
            if failed or late:
                ended += 1
                shown, _ = single.reset()
            assert_array_equal(shown, seen[i])
            assert_array_equal(single.engine.states[0], many.engine.states[i])
    assert ended >= 2 or speed  # who ends starts anew
    return hits


def test_the_floor_gives_no_more_than_its_friction():
    """Full torque on ice: every wheel that slips uses all of it, and no wheel more."""
    env = alone(floor=ICE)
    env.reset(seed=1)
    uses, slips = [], []
    for action in torques(env.action_space.shape, 50):
        info = env.step(action)[4]
        uses.append(info["traction_use"])
        slips.append(info["wheel_slip"].max())
    used, slipped = np.array(uses), np.array(slips)
    assert used.max() <= 1.0 + ROUNDING
    assert (slipped >= 0.0).all() and slipped.max() > 0.1
    assert_allclose(used[slipped > 1e-6], 1.0, rtol=1e-9)  # a sliding wheel takes what the floor can give


def test_no_wheel_slips_below_the_floors_limit():
    """At a torque whose greatest use of the floor is 0.5 with wheels that roll; twice as much and more slips."""
    grip = straight(alone(), 0.1, 5)
    use = max(info["traction_use"] for info in grip)
    enough, scarce = ({"friction": 0.7 * use / limit} for limit in (0.5, 2.0))
    assert max(info["wheel_slip"].max() for info in straight(alone(floor=enough), 0.1, 5)) < 1e-9
    assert max(info["wheel_slip"].max() for info in straight(alone(floor=scarce), 0.1, 5)) > 1e-3


def test_where_nothing_slips_the_motion_is_that_without_slip():
    """A high friction: states differ from RK4's by the error of the time step, of second order, and fall with it."""
    offs = []
    for substeps in (4, 8, 16):
        grip, floor = alone(substeps=substeps), alone(substeps=substeps, floor={"friction": 100.0})
        for env in (grip, floor):
            env.reset(seed=2)
        for action in torques(grip.action_space.shape, 25, size=0.5):
            grip.step(action), floor.step(action)
        rows = grip.engine.states.shape[1]
        offs.append(np.abs(grip.engine.states - floor.engine.states[:, :rows]).max())
    assert offs[0] < 0.02
    assert offs[1] < 0.6 * offs[0] and offs[2] < 0.6 * offs[1]  # at least of first order


def test_a_wheel_on_a_patch_slips_and_the_others_do_not():
    robot = load_robot("chung2008")
    caster = robot.casters[0]
    place = 0.5 + caster.x - caster.trail, caster.y + caster.offset  # of the contact of the first wheel, straight ahead
    ice = {"x": place[0], "y": place[1], "radius": 0.02, "friction": 0.01}
    env = alone(floor={"friction": 0.7, "patches": [ice]})
    slip = straight(env, 0.25, 1)[0]["wheel_slip"]
    assert slip[0] > 0.01
    assert slip[1:].max() < 1e-9
    beside = {**ice, "x": place[0] + 0.05}
    assert straight(alone(floor={"friction": 0.7, "patches": [beside]}), 0.25, 1)[0]["wheel_slip"].max() < 1e-9


def test_of_patches_that_overlap_the_last_one_counts():
    wide = {"x": 0.5, "y": 0.0, "radius": 3.0}
    grippy, icy = {**wide, "friction": 0.7}, {**wide, "friction": 0.01}
    slips = [
        straight(alone(floor={"friction": 0.7, "patches": patches}), 0.25, 2)[-1]["wheel_slip"].min()
        for patches in ([grippy, icy], [icy, grippy])
    ]
    assert slips[0] > 0.01 and slips[1] < 1e-9


def test_less_friction_pushes_less():
    """Spinning wheels at a standstill push with friction · weight: v = μ g t, a hand calculation."""
    for friction in (0.02, 0.04):
        env = alone(floor={"friction": friction})
        straight(env, 1.0, 5)  # 0.1 s
        assert env.engine.states[0, 4] == pytest.approx(friction * 9.81 * 0.1, rel=0.05)


def test_encoders_show_the_wheels_and_not_the_platform():
    """Spinning on ice: the observed rim speeds run ahead of the robot by the slip; the platform hardly moves."""
    env = alone(floor={"friction": 0.01})
    env.reset(seed=0, options=STANDING)
    action = np.tile([1.0, 0.0], 3).astype(np.float32)
    for _ in range(3):
        observation, *_, info = env.step(action)
    layout = env.engine.layout
    rolling = layout.physical(observation, "joint_rates")[::2]
    radii = np.array([caster.radius for caster in env.robot.casters])
    twist = layout.physical(observation, "twist")
    assert np.abs(twist).max() < 0.02
    assert_allclose(rolling * radii - twist[0], info["wheel_slip"], rtol=0.02)  # wheels stay nearly straight ahead
    assert info["wheel_slip"].min() > 0.1


def test_the_layout_of_observations_and_actions_is_the_same_on_every_floor():
    grip, ice = alone(), alone(floor=ICE)
    assert grip.observation_space == ice.observation_space
    assert grip.action_space == ice.action_space
    assert_array_equal(grip.reset(seed=3)[0], ice.reset(seed=3)[0])
    assert "wheel_slip" not in grip.reset(seed=3)[1]


def test_a_start_in_motion_rolls():
    """The observed rates of a given twist and steering are those of wheels that roll without slip."""
    env, steering, twist = alone(floor=ICE), [0.2, 0.1, 0.15], [0.3, 0.05, 0.1]
    observation, info = env.reset(seed=0, options={"steering": steering, "twist": twist})
    _, rolling, turning = Model(env.robot).rates(np.array(steering), np.array(twist))
    seen = env.engine.layout.physical(observation, "joint_rates")
    assert_allclose(seen, np.stack([rolling, turning], -1).ravel(), rtol=1e-6)  # in single precision
    assert_array_equal(info["wheel_slip"], 0.0)
    assert env.step(np.zeros(6, dtype=np.float32))[4]["wheel_slip"].max() < 1e-9  # it rolls on


@pytest.mark.parametrize("actuation", [None, ["roll_1", "steer_1", "roll_2", "steer_2", "roll_3"]])
def test_a_floor_without_friction_moves_no_robot(actuation):
    """Whatever the motors do, nothing pushes a platform that stands: wheels spin below it."""
    env = alone(floor={"friction": 0}, actuation=actuation)
    env.reset(seed=0, options=STANDING)
    for _ in range(10):
        info = env.step(np.resize([1.0, 0.0], env.action_space.shape).astype(np.float32))[4]
    assert np.hypot(*(info["pose"][:2] - STANDING["pose"][:2])) < 1e-4  # [m]
    assert info["wheel_slip"][0] > 0.1
    assert info["traction_use"] <= 1.0 + ROUNDING


def test_features_make_the_floor_slippery():
    """The friction of the floor is the robot's number `floor_friction`, which features draw anew in each episode."""
    env = wrap(batch(2, floor={"friction": 0.7}), Friction(floor_friction=0.02))
    env.reset(seed=0, options=STANDING)
    action = np.tile([0.5, 0.0], (2, 3)).astype(np.float32)
    assert env.step(action)[4]["wheel_slip"].min() > 0.01
    plain = batch(2, floor={"friction": 0.7})
    plain.reset(seed=0, options=STANDING)
    assert plain.step(action)[4]["wheel_slip"].max() < 1e-9


@pytest.mark.parametrize("duplicate", [copy.copy, copy.deepcopy, lambda env: pickle.loads(pickle.dumps(env))])
def test_copies_go_on_as_the_original(duplicate):
    env = alone(floor=ISLANDS)
    env.reset(seed=5)
    actions = list(torques(env.action_space.shape, 20))
    for action in actions[:10]:
        env.step(action)
    other = duplicate(env)
    for action in actions[10:]:
        ours, theirs = env.step(action), other.step(action)
        assert_array_equal(ours[0], theirs[0])
        assert_array_equal(ours[4]["wheel_slip"], theirs[4]["wheel_slip"])


def test_states_can_be_put_back():
    """A state holds the wheels' own rates: an engine that gets it back goes on to the last bit."""
    env = alone(floor=ICE)
    env.reset(seed=6)
    actions = list(torques(env.action_space.shape, 20))
    for action in actions[:10]:
        env.step(action)
    state = env.engine.states
    assert state.shape == (1, 9 + 4 * 3)
    seen = [env.step(action)[4]["pose"] for action in actions[10:]]
    env.engine.states = state
    assert_array_equal([env.step(action)[4]["pose"] for action in actions[10:]], seen)


def test_the_floor_stands_in_the_specification():
    env: Any = gym.make("caster_gym:CasterTrack-v0", path=PATHS, floor=ISLANDS)
    told = json.loads(env.spec.to_json())["kwargs"]["floor"]
    assert told == ISLANDS
    again: Any = gym.make(gym.envs.registration.EnvSpec.from_json(env.spec.to_json()))
    assert again.unwrapped.task == env.unwrapped.task


@pytest.mark.parametrize("kind", [TrackParameters, FollowParameters])
def test_a_task_comes_back_from_what_is_written_of_it(kind):
    for floor in ("grip", ICE, ISLANDS, {}):
        task = kind(floor=floor)
        assert kind(**task.model_dump(mode="json")) == task
    assert kind().floor == "grip"


@pytest.mark.parametrize("place", [0, 5, 8, 13, 18, 20])  # of pose, twist, direction, yaw and roll rate, tilt
@pytest.mark.parametrize("bad", [np.nan, np.inf, 1e200])
def test_a_state_that_is_not_finite_is_failure(place, bad):
    env = alone(floor=ICE)
    env.reset(seed=0)
    states = env.engine.states
    states[0, place] = bad
    env.engine.states = states
    observation, reward, terminated, _, info = env.step(np.full(6, 0.1, dtype=np.float32))
    if (place, bad) == (20, 1e200):  # a tilt is forgotten within a step, however great
        assert not terminated and np.isfinite(env.engine.states).all()
        return
    assert terminated and reward == 0.0
    assert info["not_finite"] or (bad == 1e200 and info["left_corridor"])
    assert env.observation_space.contains(observation)
    observation, info = env.reset()
    assert env.observation_space.contains(observation)
    assert np.isfinite(env.engine.states).all() and np.isfinite(info["wheel_slip"]).all()


def test_the_code_of_the_page_runs(capsys):
    page = Path("docs/floor.md").read_text(encoding="utf-8")
    (code,) = re.findall(r"^```python\n(.*?)^```", page, re.M | re.S)
    exec(compile(code, "docs/floor.md", "exec"), {})
    assert capsys.readouterr().out.count("[") == 1


def test_the_keys_of_the_page_are_those_that_are_read():
    """Each field of a floor and of a patch has a row, and defaults are those told."""
    page = Path("docs/floor.md").read_text(encoding="utf-8")
    keys = re.findall(r"^\| (`.*?) \|", page, re.M)
    told = {name for key in keys for name in re.findall(r"`(\w+)`", key)}
    assert told == set(Floor.model_fields) | set(Patch.model_fields)
    assert f"| {Floor().contact_time:g} | s |" in page


def test_the_scene_shows_how_wheels_slip_and_what_the_floor_gives():
    """Full torque at a standstill on ice: treads run backwards, forces point ahead, of friction times load each."""
    env = alone(floor={"friction": 0.05, "patches": [{"x": 3.0, "y": 0.0, "radius": 0.1, "friction": 0.5}]})
    info = straight(env, 1.0, 3)[-1]
    scene = env.engine.scene(0)
    assert scene.floor == env.task.floor
    assert (scene.slip[:, 0] < -0.1).all()
    assert_allclose(np.hypot(*scene.slip.T), info["wheel_slip"], rtol=0.2)  # now, and the greatest within the period
    weight = Model(env.robot).wheel_loads(np.zeros(3)).sum()
    assert_allclose(np.hypot(*scene.ground_forces.T).sum(), 0.05 * weight, rtol=1e-9)  # whichever wheels carry it
    assert (scene.ground_forces[:, 0] > 0.0).all()


@pytest.mark.parametrize(
    ("floor", "message"),
    [
        ("ice", "'floor'.*'grip'.*got 'ice'"),
        ({"friction": -0.1}, "'floor.friction'.*greater than or equal to 0.*-0.1"),
        ({"mu": 0.3}, "'floor.mu'; it is called 'friction' here"),
        ({"patches": [{"friction": 0.1, "centre": [1.0, 0.0], "radius": 0.2}]}, "centre'.*'x' and 'y'"),
        ({"patches": [{"friction": -0.1, "x": 1.0, "y": 0.0, "radius": 0.2}]}, "'friction' should be .* 0, got -0.1"),
        ({"patches": [{"x": 0.0, "y": 0.0, "radius": 0.0, "friction": 0.1}]}, "patches.*'radius'.*greater than 0"),
        ({"friction": 0.3, "contact_time": 0.0}, "contact_time.*greater than 0"),
        ({"friction": float("nan")}, "friction.*finite"),
    ],
)
def test_what_is_wrong_with_a_floor_is_named(floor, message):
    with pytest.raises(ConfigurationError, match=message):
        alone(floor=floor)


def test_a_floors_friction_among_the_keywords_is_told_where_it_stands():
    with pytest.raises(TypeError, match=r"wheels slip on a 'floor' of finite friction, such as \{friction: 0\.3\}"):
        alone(friction=0.3)
    assert alone(floor={"friction": 0.3}).robot.floor_friction == 0.3  # as the message says


def test_wheels_without_inertia_cannot_slip():
    with pytest.raises(ValueError, match=r"needs casters with inertia of their own.*let the floor grip"):
        alone(robot=load_robot("chung2008").without_wheels(), floor=ICE)
