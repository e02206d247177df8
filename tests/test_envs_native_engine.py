"""envs.native.engine: obstacles on the way, what they do to robots and to rewards, and scenes of them."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.arena.arena import read_arena
from caster_gym.arena.clearance import distances
from caster_gym.tasks.follow.environment import CasterFollowEnv
from caster_gym.tasks.track.environment import CasterTrackEnv

CIRCLE = {"shape": "circle", "radius": 0.5}
ARENA = {
    "room": [[-1.2, -1.0], [1.1, 1.3]],
    "pillars": [{"centre": [0.0, 0.0], "radius": 0.2}, {"centre": [0.75, 0.6], "radius": 0.1}],
    "walls": [{"start": [-0.8, 0.3], "end": [-0.75, 0.9], "thickness": 0.05}],
    "polygons": [{"corners": [[0.0, -0.9], [0.4, -0.8], [0.0, -0.75]]}],
}
WALL = {"half_planes": [{"point": [0.8, 0.0], "normal": [-1.0, 0.0]}]}  # on the right, 0.15 m from the path's start
EXACT_START: dict[str, Any] = {"start_offset": 0.0, "start_turn": 0.0}


def made(arena=None, env=CasterFollowEnv, **task):
    made = env(path=CIRCLE, arena=arena, **{**EXACT_START, **task})
    made.reset(seed=0)
    return made


def resting(env):
    return np.zeros(env.action_space.shape, dtype=np.float32)


def put(env, position, twist=(0.0, 0.0, 0.0), heading=0.0):
    """Set the first robot somewhere, its casters as they are; its motion."""
    states = env.engine.states
    states[0, :7] = *position, np.cos(heading), np.sin(heading), *twist
    env.engine.states = states
    return states[0]


def steering(state):
    return np.arctan2(state[8::2], state[7::2])


def random_places(count):
    """Near the path, where the robot's disc of 0.15 m is free of everything."""
    rng = np.random.default_rng(1)
    places: list[Any] = []
    arena, robot = read_arena(ARENA), load_robot("chung2008")
    while len(places) < count:
        pose = np.array([*rng.uniform(-0.9, 0.9, 2), rng.uniform(-np.pi, np.pi)])
        if distances(arena, robot, pose)[0].min() > 1e-3:
            places.append(pose)
    return places


def test_clearance_is_the_least_gap():
    env = made(ARENA, corridor=3.0)
    for x, y, heading in random_places(30):
        put(env, (x, y), heading=heading)
        gaps, _ = distances(read_arena(ARENA), env.robot, [x, y, heading])
        assert env.step(resting(env))[4]["clearance"] == pytest.approx(gaps.min(), abs=1e-12)


def test_the_nearest_obstacles_are_seen_in_order():
    """Gaps rise; directions point from the obstacle to the robot, in B."""
    env = made(ARENA, corridor=3.0)
    for x, y, heading in random_places(30):
        put(env, (x, y), heading=heading)
        observation = env.step(resting(env))[0]
        gaps, normals = distances(read_arena(ARENA), env.robot, [x, y, heading])
        rotation = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        for k, nearest in enumerate(np.argsort(gaps)[:3], start=1):
            expected = [gaps[nearest], *rotation @ normals[nearest]] if gaps[nearest] < 1.0 else [1.0, 0.0, 0.0]
            seen = env.engine.layout.physical(observation, f"obstacle_{k}")
            assert_allclose(seen, expected, rtol=1e-6, atol=1e-6)  # single precision


def test_obstacles_that_are_not_there_look_far_away():
    """One of three slots is used here, none without an arena."""
    for arena, there in ((WALL, 1), (None, 0)):
        env = made(arena)
        observation, info = env.reset(seed=0)
        for k in range(1, 4):
            seen = env.engine.layout.physical(observation, f"obstacle_{k}")
            assert_allclose(seen, [0.15, 0.0, 1.0] if k <= there else [1.0, 0.0, 0.0], rtol=1e-6, atol=1e-6)
        assert info["clearance"] == (pytest.approx(0.15, abs=1e-12) if there else np.inf)


@pytest.mark.parametrize("env", [CasterFollowEnv, CasterTrackEnv])
def test_obstacles_out_of_reach_change_nothing(env):
    """To the last bit, whatever the robot does in the meantime."""
    far = {"pillars": [{"centre": [30.0, 0.0], "radius": 1.0}]}
    envs = [made(arena, env, corridor=3.0) for arena in (None, far)]
    rng = np.random.default_rng(4)
    for _ in range(60):
        action = rng.uniform(-1.0, 1.0, 6).astype(np.float32)
        (plain, *rest), (other, *rest_with) = (one.step(action) for one in envs)
        assert_array_equal(plain, other)
        assert rest[:3] == rest_with[:3]


def test_an_impact_changes_the_momentum_by_its_impulse():
    """M Δv = (J, r × J), over a control period of 0.1 ms, against a twin that flies on through the wall."""
    period = {"control_period": 1e-4, "substeps": 1}
    env, free = made(WALL, **period), made(**period)
    rng = np.random.default_rng(2)
    for _ in range(20):
        heading, twist = rng.uniform(-np.pi, np.pi), rng.normal(0.0, 0.5, 3)
        speed = rng.uniform(0.3, 1.0)
        twist[:2] = speed * np.cos(heading), -speed * np.sin(heading)  # towards +x in W
        for one in (env, free):
            one.reset(seed=3)
            state = put(one, (0.65 - 2e-5, 0.1), twist, heading)
        info = env.step(resting(env))[4]
        other = free.step(resting(free))[4]
        assert info["impacts"] == 1.0
        assert other["impacts"] == 0.0
        gained = env.engine.states[0, 4:7] - free.engine.states[0, 4:7]
        jx, jy = info["impulse"]
        body = np.array([np.cos(heading) * jx + np.sin(heading) * jy, np.cos(heading) * jy - np.sin(heading) * jx])
        # the disc touches at 0.15 m in the direction +x of W
        moment = 0.15 * jy
        expected = Model(env.robot).inertia(steering(state)) @ gained
        # what the twin's motion differs by in 0.1 ms: accelerations of 10 m/s² times masses, 1e-3 of the impulse
        assert_allclose([*body, moment], expected, rtol=0.0, atol=2e-3 * info["normal_impulse"])
        assert info["normal_impulse"] == pytest.approx(-jx, rel=1e-9)
        assert info["normal_impulse"] > 0.5
        assert abs(jy) <= 0.2 * -jx * (1.0 + 1e-9)  # Coulomb's cone


def test_power_is_what_the_motors_do_before_and_after_an_impact():
    """Nothing but the motors changes the energy of a robot without friction between smooth walls that give all back."""
    env = made({**WALL, "restitution": 1.0, "friction": 0.0})
    model, rng, struck = Model(env.robot), np.random.default_rng(4), 0
    for _ in range(30):
        env.reset(seed=int(rng.integers(100)))
        state = put(env, (rng.uniform(0.63, 0.649), 0.0), (*rng.uniform(0.3, 0.8, 1), *rng.uniform(-0.3, 0.3, 2)))
        info = env.step(rng.uniform(-1.0, 1.0, 6).astype(np.float32))[4]
        after = env.engine.states[0]
        gained = model.kinetic_energy(steering(after), after[4:7]) - model.kinetic_energy(steering(state), state[4:7])
        struck += info["impacts"] > 0.0
        # J; means over time steps of 5 ms are off by a share of how motor speeds bend, the motors do 0.1 J
        assert info["power"] * env.task.control_period == pytest.approx(gained, rel=0.02, abs=5e-4)
    assert struck > 15


def test_impacts_ask_of_the_floor_in_proportion_to_their_speed():
    """And nothing is asked where there is none."""
    asked = []
    for speed in (0.4, 0.8):
        env = made(WALL)
        state = put(env, (0.65 - 2e-5, 0.0), (speed, 0.0, 0.0))
        env.engine.states = np.concatenate((state[:7], np.tile([1.0, 0.0], 3)))[None]
        asked.append(env.step(resting(env))[4]["impact_traction"])
        assert env.step(resting(env))[4]["impact_traction"] == 0.0
    assert asked[0] > 0.1
    assert asked[1] == pytest.approx(2.0 * asked[0], rel=1e-3)  # casters turn a little before they touch


def test_touching_costs_what_the_documentation_says():
    env = made(WALL)
    put(env, (0.64, 0.0), (0.8, 0.0, 0.0))
    _, reward, terminated, _, info = env.step(resting(env))
    pressing = info["normal_impulse"]
    assert pressing > 0.5
    assert not terminated
    assert not info["touched"]
    assert info["reward_terms"]["impact"] == pytest.approx(-0.5 * pressing / (pressing + 0.5), abs=1e-12)
    assert reward == pytest.approx(sum(info["reward_terms"].values()), abs=1e-15)


def test_impulses_of_a_period_are_those_of_that_period():
    """A robot that is let go rebounds, and feels nothing more."""
    env = made(WALL)
    put(env, (0.645, 0.0), (0.8, 0.0, 0.0))
    assert env.step(resting(env))[4]["impacts"] >= 1.0
    info = env.step(resting(env))[4]
    assert (info["impacts"], info["normal_impulse"]) == (0.0, 0.0)
    assert_array_equal(info["impulse"], [0.0, 0.0])
    assert env.engine.states[0, 4] < 0.0


def test_pressing_against_a_wall_costs_as_well():
    """Without a single impact: a push of 20 N against a wall presses 0.4 N s in a period of 20 ms."""
    env = made(WALL)
    put(env, (0.65, 0.0))
    env.engine.wrenches = np.array([[20.0, 0.0, 0.0]])
    for _ in range(5):
        info = env.step(resting(env))[4]
        # turning casters take some of the push or add to it
        assert info["normal_impulse"] == pytest.approx(0.4, rel=0.1)
        assert info["impulse"][0] == pytest.approx(-info["normal_impulse"], rel=1e-9)
        assert info["clearance"] > -1e-4


def test_a_robot_never_enters_an_obstacle():
    """Under pushes of up to 28 N that change every 0.8 s, and full torques, in a room where it touches all the time."""
    env = made(ARENA, corridor=5.0)
    rng, touches = np.random.default_rng(6), 0
    for k in range(600):
        if k % 40 == 0:
            action = rng.choice([-1.0, 1.0], 6).astype(np.float32)
            env.engine.wrenches = rng.choice([-20.0, 20.0], (1, 3)) * [1.0, 1.0, 0.05]
        *_, info = env.step(action)
        touches += info["normal_impulse"] > 0.0
        assert info["clearance"] > -1e-4  # depth that contacts may have
    assert touches > 20


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200])
@pytest.mark.parametrize("column", [0, 2, 4, 6, 7])
def test_a_state_that_is_not_finite_is_failure_among_obstacles(column, bad):
    """The search for contacts ends as well, and the next episode is a sound one."""
    env = made(ARENA, corridor=3.0)
    states = env.engine.states
    states[0, column] = bad
    env.engine.states = states
    observation, reward, terminated, *_ = env.step(resting(env))
    assert terminated
    assert reward == 0.0
    assert env.observation_space.contains(observation)
    observation, info = env.reset()
    assert env.observation_space.contains(observation)
    assert np.isfinite(info["clearance"])


@pytest.mark.parametrize("env", [CasterFollowEnv, CasterTrackEnv])
def test_touching_ends_an_episode_where_the_task_says_so(env):
    """At the first touch, worth nothing, and info tells why."""
    env = made(WALL, env, touching="ends")
    put(env, (0.55, 0.0), (0.8, 0.0, 0.0))
    for _ in range(20):
        _, reward, terminated, truncated, info = env.step(resting(env))
        assert terminated == info["touched"] == (info["normal_impulse"] > 0.0)
        assert not truncated
        if terminated:
            break
        assert reward > 0.0
    assert terminated
    assert not info["left_corridor"]
    assert reward == 0.0
    assert set(info["reward_terms"].values()) == {0.0}


def test_robots_on_different_paths_meet_their_own_obstacles_only():
    """The same robot rests where one path has a pillar beside it and the other none."""
    pool = [CIRCLE, {**CIRCLE, "centre": [5.0, 0.0]}]
    arena = {"beside": {"pillars": 2, "walls": 1, "gap": [0.02, 0.05]}}
    env = CasterFollowEnv(path=pool, arena=arena, **EXACT_START)
    gaps = []
    for path in (0, 1):
        _, info = env.reset(seed=0, options={"path": path})
        gaps.append(info["clearance"])
        assert len(env.engine.scene(0).obstacles.radii) == 3
    assert gaps[0] != gaps[1]
    assert len(env.engine.plan.around.obstacles.radii) == 6


def test_a_scene_shows_what_info_tells():
    env = made(WALL)
    put(env, (0.64, 0.02), (0.8, 0.1, 0.3))
    *_, info = env.step(resting(env))
    scene = env.engine.scene(0)
    assert scene.time == pytest.approx(0.02, abs=1e-15)
    assert_array_equal(scene.pose, info["pose"])
    assert_array_equal(scene.reference, info["reference_pose"])
    assert_array_equal(scene.impulse, info["impulse"])
    assert_array_equal(scene.torque, info["torque"])
    assert scene.impact_point[0] == pytest.approx(0.8, abs=1e-4)
    assert scene.corridor == env.task.corridor
    assert not scene.failed
