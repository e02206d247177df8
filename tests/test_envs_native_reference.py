"""envs.native.reference: progress along a path, and the reference there, against the path's table by other means."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.interpolate import CubicHermiteSpline

from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.tasks.follow.environment import CasterFollowEnv

CIRCLE = {"shape": "circle", "radius": 0.5, "heading": "tangent"}
EXACT_START = {"start_offset": 0.0, "start_turn": 0.0}
WINDOW, STRIDE, CORRIDOR = 0.2, 0.02, 0.25  # [m] by default


class Course:
    """The table of a path, read by interpolation of another library."""

    def __init__(self, env, path=0):
        self.table, self.spacing = env.engine.plan.tables[path], float(env.engine.plan.source.spacings[path])
        self.s = self.spacing * np.arange(len(self.table))
        self.length = self.s[-1]
        self.point = CubicHermiteSpline(self.s, self.table[:, :2], self.table[:, 2:4])

    def at(self, s, column):
        return np.interp(s, self.s, self.table[:, column])

    def direction(self, s):
        tangent = self.point(s, 1)
        return tangent / np.hypot(*tangent)

    def beside(self, s, left):
        """Point at a distance to the left of the path."""
        tx, ty = self.direction(s)
        return self.point(s) + left * np.array([-ty, tx])


def made(path=CIRCLE, **task):
    env = CasterFollowEnv(path=path, **{**EXACT_START, **task})
    env.reset(seed=0)
    return env, Course(env)


def resting(env):
    return np.zeros(env.action_space.shape, dtype=np.float32)


def put(env, position, heading=None):
    """What a step tells of a robot that rests at a place: without torque it stays there."""
    states = env.engine.states
    states[0, :2] = position
    if heading is not None:
        states[0, 2:4] = np.cos(heading), np.sin(heading)
    states[0, 4:7] = 0.0
    env.engine.states = states
    return env.step(resting(env))


def progress(env, position):
    return put(env, position)[4]["progress"]


def walk(env, course, until, beside=0.0, step=0.1):
    """Bring the progress to an arc length, a little at a time."""
    for s in np.append(np.arange(step, until, step), until):
        info = put(env, course.beside(s, beside))[4]
    return info


@pytest.mark.parametrize("radius", [0.25, 0.5])
@pytest.mark.parametrize("left", [0.0, 0.1, -0.02, -0.1, -0.2])
def test_progress_on_a_circle_is_the_angle_times_the_radius(radius, left):
    """Also beside it, on either side: the nearest point has the same angle."""
    env, course = made({**CIRCLE, "radius": radius})
    for angle in np.arange(0.05, 2.0 * np.pi - 0.2, 0.037):
        info = put(env, (radius - left) * np.array([np.cos(angle), np.sin(angle)]))[4]
        # a cubic over 0.08 rad is turned by up to 0.08³/125 = 4e-6, which shifts the foot of 0.2 m by 0.8 µm
        assert_allclose(info["progress"], radius * angle, rtol=0.0, atol=2e-6)
        assert_allclose(info["position_error"], abs(left), rtol=0.0, atol=1e-7)
    assert course.length == pytest.approx(2.0 * np.pi * radius, abs=1e-6)


def test_progress_never_falls_and_never_jumps_beyond_the_window():
    """Wherever a robot is put, near the path or across the whole circle."""
    env, course = made()
    rng, before = np.random.default_rng(1), 0.0
    for _ in range(500):
        now = progress(env, course.beside(rng.uniform(0.0, course.length), rng.normal(0.0, 0.1)))
        assert before <= now <= before + WINDOW + 1e-12  # rounding of a sum
        before = now
    assert before > 0.9 * course.length


def test_progress_is_the_nearest_point_within_the_window():
    """On a wavy path, of which the robot sees now the next bend, now the one after it."""
    env, course = made({"shape": "random_paths", "count": 1, "seed": 4, "reversing": 0.0, "min_radius": 0.25})
    rng, before = np.random.default_rng(2), 0.0
    ahead = np.arange(0.0, WINDOW, 1e-5)
    for _ in range(100):
        position = course.beside(min(before + rng.uniform(-0.02, 0.1), course.length), rng.uniform(-0.05, 0.05))
        points = course.point(np.minimum(before + ahead, course.length))
        expected = np.minimum(before + ahead, course.length)[np.hypot(*(points - position).T).argmin()]
        before = progress(env, position)
        assert_allclose(before, expected, rtol=0.0, atol=1.1e-5)  # the step of the search


def test_the_crossing_of_a_figure_of_eight_cannot_be_cut():
    """There both branches are equally near. Who changes to the other one stays where the first one left off."""
    env, course = made("lemniscate")
    half = 0.5 * course.length
    walk(env, course, half - 0.05)
    for away in np.arange(0.01, 0.24, 0.02):  # along the branch that ends the path, which is at right angles
        _, reward, terminated, _, info = put(env, course.point(course.length - away))
        assert abs(info["progress"] - half) < 0.02
        assert not terminated
    assert 0.52 <= reward < 0.54  # hardly more than the term `alive`; the branches bend a little
    _, _, terminated, _, info = put(env, course.point(course.length - 0.3))
    assert terminated
    assert info["left_corridor"]
    assert abs(info["progress"] - half) < 0.02


def test_a_loop_backward_earns_nothing():
    """Neither the way back nor the same way forward again, until there is new ground."""
    env, course = made()
    reached = walk(env, course, 0.6)["progress"]
    for s in (*np.arange(0.58, 0.4, -0.02), *np.arange(0.4, 0.6, 0.02)):
        _, reward, terminated, _, info = put(env, course.point(s))
        assert info["progress"] == reached
        assert info["progress_share"] == 0.0
        assert reward == 0.52
        assert not terminated
    assert put(env, course.point(0.61))[4]["progress_share"] == pytest.approx(0.5, abs=1e-6)


def test_a_start_is_no_progress_wherever_it_lies():
    """A robot that starts displaced backward has none after its first step either."""
    env = CasterFollowEnv(path=CIRCLE, start_offset=0.05)
    behind = 0
    for seed in range(40):
        _, info = env.reset(seed=seed)
        assert (info["progress"], info["progress_share"]) == (0.0, 0.0)
        if info["pose"][1] < 0.0:  # the path starts towards +y
            behind += 1
            info = env.step(resting(env))[4]
            assert (info["progress"], info["progress_share"]) == (0.0, 0.0)
    assert behind >= 10


def test_the_share_is_the_way_over_that_at_the_speed_limit_and_at_most_one():
    env, course = made()
    walk(env, course, 0.5)
    assert put(env, course.point(0.5 + 0.25 * STRIDE))[4]["progress_share"] == pytest.approx(0.25, abs=1e-5)
    now = put(env, course.point(0.6))[4]["progress"]
    for factor in (1.0, 2.0, 5.0):
        info = put(env, course.point(now + factor * STRIDE))[4]
        now = info["progress"]
        assert info["progress_share"] == pytest.approx(1.0, abs=1e-5)
        assert info["progress_share"] <= 1.0
        assert info["reward_terms"]["progress"] == pytest.approx(0.2, abs=1e-5)


PATHS = [
    pytest.param("rounded_square", {}, id="rounded square"),
    pytest.param("ellipse", {"speed_limit": 0.6}, id="ellipse"),
    pytest.param({**CIRCLE, "heading": {"kind": "spinning", "turns": -0.7}}, {"margin": 0.3}, id="spinning"),
]


@pytest.mark.parametrize(("path", "task"), PATHS)
def test_the_reference_is_the_course_at_the_progress(path, task):
    """Point, heading, and the law's velocity and acceleration: ṡ t, ψ′ ṡ; s̈ t + κ ṡ² n, ψ′ s̈ + ψ″ ṡ²."""
    env, course = made(path, **task)
    layout, rng, s = env.engine.layout, np.random.default_rng(3), 0.0
    while s < course.length - 0.2:
        s += rng.uniform(0.02, 0.15)
        heading = rng.uniform(-np.pi, np.pi)
        observation, _, _, _, info = put(env, course.beside(s, rng.uniform(-0.01, 0.01)), heading)
        s = info["progress"]
        rotation = np.array([[np.cos(heading), np.sin(heading)], [-np.sin(heading), np.cos(heading)]])
        i = int(s / course.spacing)
        speed, along = np.sqrt(course.at(s, 9)), (course.table[i + 1, 9] - course.table[i, 9]) / (2.0 * course.spacing)
        t = course.direction(s)
        psi = np.arctan2(course.at(s, 6), course.at(s, 5))
        velocity, bend = speed * t, course.at(s, 7)
        acceleration = along * t + course.at(s, 4) * speed**2 * np.array([-t[1], t[0]])
        alpha = bend * along + course.at(s, 8) * speed**2
        assert_allclose(info["reference_pose"], [*course.point(s), np.cos(psi), np.sin(psi)], rtol=0.0, atol=1e-10)
        # observed to single precision
        twist = layout.physical(observation, "twist_error")
        assert_allclose(twist, [*rotation @ velocity, bend * speed], rtol=1e-6, atol=1e-6)
        given = layout.physical(observation, "reference_acceleration")
        assert_allclose(given, [*rotation @ acceleration, alpha], rtol=1e-6, atol=1e-6)
        for ahead in env.task.preview:
            u = min(s + ahead, course.length)
            speed, t = np.sqrt(course.at(u, 9)), course.direction(u)
            psi = np.arctan2(course.at(u, 6), course.at(u, 5)) - heading
            expected = [*rotation @ (course.point(u) - info["pose"][:2]), np.cos(psi), np.sin(psi)]
            expected += [*rotation @ (speed * t), course.at(u, 7) * speed]
            given = layout.physical(observation, f"preview_{ahead:g}m")
            assert_allclose(given, expected, rtol=1e-6, atol=1e-6)


def test_the_reference_starts_and_ends_at_rest():
    """And the preview rests at the end."""
    env, course = made()
    observation, _ = env.reset(seed=0)
    assert_allclose(env.engine.layout.physical(observation, "twist_error"), 0.0, atol=1e-12)
    walk(env, course, course.length - 0.05)
    observation, _, _, _, info = put(env, course.point(course.length) + 0.02 * course.direction(course.length))
    assert info["progress"] == pytest.approx(course.length, abs=1e-12)
    assert_allclose(env.engine.layout.physical(observation, "twist_error"), 0.0, atol=1e-12)
    assert_allclose(env.engine.layout.physical(observation, "reference_acceleration"), 0.0, atol=1e-12)
    assert_allclose(env.engine.layout.physical(observation, "preview_0.4m")[4:], 0.0, atol=1e-12)


def test_a_free_heading_is_no_error_and_asks_for_no_turn():
    """Whatever the robot's heading, now and ahead."""
    env, course = made("ellipse", free_heading=True)
    layout = env.engine.layout
    for s, heading in zip(np.arange(0.1, 2.0, 0.1), np.random.default_rng(5).uniform(-np.pi, np.pi, 19), strict=True):
        observation, _, _, _, info = put(env, course.point(s), heading)
        assert info["heading_error"] == pytest.approx(0.0, abs=1e-15)
        assert_allclose(info["reference_pose"][2:], info["pose"][2:], rtol=0.0, atol=0.0)
        assert_allclose(layout.physical(observation, "heading_error"), [1.0, 0.0], rtol=0.0, atol=1e-7)
        assert layout.physical(observation, "twist_error")[2] == 0.0
        assert layout.physical(observation, "reference_acceleration")[2] == 0.0
        for ahead in env.task.preview:
            seen = layout.physical(observation, f"preview_{ahead:g}m")
            assert_allclose(seen[[2, 3, 6]], [1.0, 0.0, 0.0], rtol=0.0, atol=1e-7)


def test_a_robot_with_a_free_heading_starts_turned_from_that_of_the_path():
    env = CasterFollowEnv(path=CIRCLE, free_heading=True, start_turn=0.1)
    turns = []
    for seed in range(30):
        cos, sin = env.reset(seed=seed)[1]["pose"][2:]
        turns.append(np.arctan2(sin, cos) - 0.5 * np.pi)  # the circle starts towards +y
    assert 0.05 < np.abs(turns).max() <= 0.1
    assert np.std(turns) > 0.02


def test_arriving_and_staying_there_earns_the_full_reward():
    """On the last point, and half of the progress at 2 cm from it."""
    env, course = made()
    walk(env, course, course.length)
    for _ in range(5):
        _, reward, terminated, _, info = put(env, course.point(course.length), np.arctan2(*course.table[-1, [6, 5]]))
        assert info["progress_share"] == pytest.approx(1.0, abs=1e-9)
        assert reward == pytest.approx(1.52, abs=1e-9)
        assert not terminated
    for side in (0.02, -0.02):
        info = put(env, course.beside(course.length, side))[4]
        assert info["progress_share"] == pytest.approx(0.5, abs=1e-9)


def test_computed_torque_reaches_the_end_and_stays_in_the_task():
    env = CasterFollowEnv(path=CIRCLE)
    agent = ComputedTorque(env.engine.layout, 10.0, env.task.control_period)
    observation, info = env.reset(seed=3)
    truncated, rewards = False, []
    while not truncated:
        before = info["progress"]
        observation, reward, terminated, truncated, info = env.step(agent.act(observation[None])[0])
        rewards.append(reward)
        assert not terminated
        assert info["progress"] >= before
    assert info["progress"] == pytest.approx(np.pi, abs=0.01)
    assert np.mean(rewards[-20:]) > 1.4  # of 1.52, while it rests


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf, 1e200, -1e200])
@pytest.mark.parametrize("column", [0, 1, 2, 4, 6, 7])
def test_a_state_that_is_not_finite_is_failure_and_no_progress(column, bad):
    env, course = made()
    reached = walk(env, course, 0.5)["progress"]
    states = env.engine.states
    states[0, column] = bad
    env.engine.states = states
    observation, reward, terminated, _, info = env.step(resting(env))
    assert terminated
    assert reward == 0.0
    assert reached <= info["progress"] <= reached + WINDOW
    assert env.observation_space.contains(observation)
    assert env.observation_space.contains(env.reset()[0])
