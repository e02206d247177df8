"""What the robot asks of the floor: traction, lifted wheels and drawn forces, whatever pushes it."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.parameters import GRAVITY
from caster_gym.shipped_files import names_of
from caster_gym.tasks.track.environment import CasterTrackEnv
from tests.kane import Kane
from tests.random_robots import random_robot

PATH = {"shape": "circle", "radius": 0.3, "heading": "tangent", "duration": 24.0}
WALL = {"half_planes": [{"point": [0.8, 0.0], "normal": [-1.0, 0.0]}]}


def standing_high(robot, height):
    return robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": height})})


def mass_of(robot):
    return robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)


def angles(state):
    return np.arctan2(state[8::2], state[7::2])


def asked(robot, state, action, wrench):
    """Traction use and joint torques at one moment, from Kane's contact forces and loads of least squares."""
    model = Model(robot)
    steering, twist = angles(state), state[4:7]
    _, theta, delta = model.rates(steering, twist)
    gear = np.array([caster.gear for caster in robot.casters])
    speed = np.einsum("nij,nj->ni", gear, np.stack((theta, delta), -1))
    most = np.array([[c.roll.max_torque, c.steer.max_torque] for c in robot.casters])
    top = np.array([[c.roll.max_speed, c.steer.max_speed] for c in robot.casters])
    torque = np.clip(
        action.reshape(-1, 2) * most,
        -most * np.clip(1.0 + speed / top, 0.0, 1.0),
        most * np.clip(1.0 - speed / top, 0.0, 1.0),
    )
    joints = np.einsum("nij,ni->nj", gear, torque).ravel()
    force = np.linalg.norm(Kane(robot).contact_forces(steering, twist, joints, wrench), axis=-1)
    loads = model.wheel_loads(steering, twist, joints, wrench)
    return (force / (robot.floor_friction * loads)).max(), joints


@pytest.mark.slow
def test_traction_use_is_the_greatest_within_the_period_under_whatever_pushes():
    robot = standing_high(random_robot(301, 3), 0.04)
    env = CasterTrackEnv(robot, PATH, corridor=50.0)
    env.reset(seed=1)
    rng, model, h = np.random.default_rng(2), Model(robot), env.task.time_step
    beyond = 0
    for _ in range(12):
        state, wrench = env.engine.states[0], rng.uniform(-1.0, 1.0, 3) * [40.0, 40.0, 5.0]
        env.engine.wrenches = wrench[None]
        action = rng.uniform(-0.3, 0.3, env.action_space.shape).astype(np.float32)
        info = env.step(action)[4]
        uses = []
        for _ in range(env.task.substeps):
            use, joints = asked(robot, state, action.astype(float), wrench)
            uses.append(use)
            rate = model.forward_dynamics(angles(state), state[4:7], joints, wrench)
            assert np.isfinite(rate).all()
            state = stepped(robot, state, joints, wrench, h)
        # Kane's forces agree to 1e-9 of the greatest; the time steps are the same RK4
        assert_allclose(info["traction_use"], max(uses), rtol=1e-7)
        beyond += max(uses) > 1.001 * uses[-1]
    assert beyond > 3  # periods in which the last moment is not the hardest


def stepped(robot, state, joints, wrench, h):
    """One RK4 step of a packed state under a wrench, written out with `Model`."""
    model = Model(robot)

    def rate(y):
        turned = angles(y)
        _, _, delta = model.rates(turned, y[4:7])
        (c, s), omega = y[2:4], y[6]
        body = [c * y[4] - s * y[5], s * y[4] + c * y[5], -s * omega, c * omega]
        twist = model.forward_dynamics(turned, y[4:7], joints, wrench)
        turns = np.stack((-y[8::2] * delta, y[7::2] * delta), -1).ravel()
        return np.concatenate((body, twist, turns))

    k1 = rate(state)
    k2 = rate(state + 0.5 * h * k1)
    k3 = rate(state + 0.5 * h * k2)
    k4 = rate(state + h * k3)
    return state + h / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)


@pytest.mark.parametrize("name", names_of("robots"))
def test_a_push_on_a_robot_at_rest_is_held_by_the_floor(name):
    """A push of 0.6 of the weight and no torque: the floor gives what the accelerated bodies do not take."""
    robot = load_robot(name)
    env = CasterTrackEnv(robot, "circle")
    start = {"twist": [0.0, 0.0, 0.0], "steering": [0.3] * robot.caster_count}
    env.reset(seed=0, options=start)
    state, push = env.engine.states[0], np.array([0.0, 0.6 * mass_of(robot) * GRAVITY, 0.0])
    expected, _ = asked(robot, state, np.zeros(2 * robot.caster_count), push)
    env.engine.wrenches = push[None]
    info = env.step(np.zeros(env.action_space.shape, dtype=np.float32))[4]
    assert info["traction_use"] >= expected * (1.0 - 1e-9)
    assert expected > 0.05  # it is felt at all


def test_drawn_forces_of_the_floor_hold_a_robot_that_leans_on_a_wall():
    """At rest against a wall, the forces on the wheels balance the wall's, within the creep of dry friction."""
    robot = standing_high(load_robot("chung2008"), 0.0)  # loads as at rest
    env = CasterTrackEnv(robot, {"shape": "circle", "radius": 0.5}, arena=WALL, corridor=5.0)
    env.reset(seed=0, options={"pose": [0.6, 0.0, 0.0], "steering": [0.0] * 3})
    action = np.tile([0.4, 0.0], 3).astype(np.float32)  # rolls towards the wall
    for _ in range(150):
        *_, info = env.step(action)
    assert info["normal_impulse"] > 0.0
    scene = env.engine.scene(0)
    f = scene.directions
    left = np.stack((-f[:, 1], f[:, 0]), -1)
    floor = (scene.ground_forces[:, :1] * f + scene.ground_forces[:, 1:] * left).sum(axis=0)
    c, s = scene.pose[2:]
    in_world = np.array([c * floor[0] - s * floor[1], s * floor[0] + c * floor[1]])
    wall = info["impulse"] / env.task.control_period
    assert_allclose(in_world, -wall, atol=0.02 * float(np.linalg.norm(wall)))  # it still creeps and turns a little
    pull = np.linalg.norm(scene.ground_forces, axis=1) / (
        robot.floor_friction * Model(robot).wheel_loads(angles(env.engine.states[0]))
    )
    assert_allclose(info["traction_use"], pull.max(), rtol=0.05)  # the loads shift by the push on the wall


def test_lifted_wheels_are_counted_alone_and_in_a_batch():
    """A push at the height of the mass centre lifts two of three wheels' loads away where they cannot balance it."""
    robot = standing_high(load_robot("xr4000"), 0.3)
    mass = mass_of(robot)
    alone = CasterTrackEnv(robot, "circle")
    batch: Any = gym.make_vec("caster_gym:CasterTrack-v0", num_envs=3, robot=robot, path="circle").unwrapped
    alone.reset(seed=0)
    batch.reset(seed=0)
    for share, lifted in ((0.0, 0), (2.0, 1)):
        push = np.array([share * mass * GRAVITY, 0.0, 0.0])
        alone.engine.wrenches = push[None]
        batch.engine.wrenches = np.tile(push, (3, 1))
        told = alone.step(np.zeros(8, dtype=np.float32))[4]["wheels_lifted"]
        assert_allclose(batch.step(np.zeros((3, 8), dtype=np.float32))[4]["wheels_lifted"][0], told)
        assert (told >= lifted) and (told == 0) == (lifted == 0)
