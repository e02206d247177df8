"""Peers: MuJoCo with the same robot, Gymnasium's own environments, loops over environments."""

from collections.abc import Callable
from typing import Any

import gymnasium as gym
import mujoco
import numpy as np
from gymnasium.vector import SyncVectorEnv
from mujoco.rollout import Rollout
from stable_baselines3.common.vec_env import DummyVecEnv

from caster_gym import Robot
from caster_gym.export.mjcf import mjcf
from scripts.mujoco_robot import joint_indices
from scripts.speed_robots import ACTION, BANK, SMALL_BATCH, TRACK, WIDE, cycled, drawn_actions, each, limits, on, one
from scripts.speed_timing import RATE, Row, Work

MUJOCO_STEP = 0.002  # [s] its default
EXCERPT = 1000  # steps of a motion
ROLLOUTS = 32  # motions in one call of rollout
NATIVE = 4096  # of Gymnasium's own batch


def mujoco_steps(robot: Robot) -> Work:
    """mj_step of the same robot as rigid bodies on the floor, under random torques, from rest."""
    model: Any = mujoco.MjModel.from_xml_string(mjcf(robot, MUJOCO_STEP))
    data: Any = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    _, joints = joint_indices(robot, model)

    def prepare() -> None:
        mujoco.mj_resetData(model, data)
        data.qpos[joints[1::2]] = rng.uniform(-np.pi, np.pi, robot.caster_count)
        data.ctrl[:] = ACTION * rng.uniform(-1.0, 1.0, len(robot.joints)) * limits(robot)

    def call() -> int:
        mujoco.mj_step(model, data, EXCERPT)
        return EXCERPT

    return Work(call, prepare)


def mujoco_rollouts(robot: Robot, threads: int) -> Work:
    """Many motions at once by MuJoCo's own pool of threads; it writes down every state."""
    model: Any = mujoco.MjModel.from_xml_string(mjcf(robot, MUJOCO_STEP))
    workers: Any = [mujoco.MjData(model) for _ in range(threads)]
    rng = np.random.default_rng(0)
    _, joints = joint_indices(robot, model)
    full = mujoco.mjtState.mjSTATE_FULLPHYSICS
    starts = np.zeros((ROLLOUTS, mujoco.mj_stateSize(model, full)))
    for start in starts:
        workers[0].qpos[joints[1::2]] = rng.uniform(-np.pi, np.pi, robot.caster_count)
        mujoco.mj_getState(model, workers[0], start, full)
    torques = ACTION * rng.uniform(-1.0, 1.0, (ROLLOUTS, 1, len(robot.joints))) * limits(robot)
    controls = np.repeat(torques, EXCERPT, axis=1)
    states = np.zeros((ROLLOUTS, EXCERPT, starts.shape[1]))
    pool: Any = Rollout(nthread=threads)

    def call() -> int:
        pool.rollout(model, workers, starts, controls, state=states)
        return ROLLOUTS * EXCERPT

    return Work(call)


def sampled(name: str) -> Work:
    """One of Gymnasium's own environments under sampled actions."""
    environment = gym.make(name)
    environment.reset(seed=0)
    environment.action_space.seed(0)
    actions = [environment.action_space.sample() for _ in range(BANK)]
    return one(environment.step, environment.reset, actions)


def native_cartpoles() -> Work:
    """Gymnasium's own vectorised CartPole."""
    environment = gym.make_vec("CartPole-v1", num_envs=NATIVE, vectorization_mode="vector_entry_point")
    environment.reset(seed=0)
    environment.action_space.seed(0)
    return cycled(environment.step, [environment.action_space.sample() for _ in range(BANK)], NATIVE)


def looped(loop: Callable[[list[Callable[[], Any]]], Any], name: str, **options: Any) -> Work:
    """So many single environments in a loop of Gymnasium's or SB3's."""
    environment = loop([lambda: gym.make(name, **options)] * SMALL_BATCH)
    environment.reset()
    space = gym.make(name, **options).action_space
    actions = drawn_actions(gym.vector.utils.batch_space(space, SMALL_BATCH))
    return cycled(environment.step, actions, SMALL_BATCH)


def peer_rows(robot: Robot, name: str, cores: int, seconds: float) -> list[Row]:
    """All peers; those with threads of their own say how many."""
    ours = {"robot": name, "corridor": WIDE}
    loops: list[Row] = []
    for key, called, loop in (("sync", "SyncVectorEnv", SyncVectorEnv), ("dummy", "DummyVecEnv", DummyVecEnv)):
        for whose, title, work in (
            ("ours", "our single environments", looped(loop, TRACK, **ours)),
            ("pendulum", "Pendulum-v1", looped(loop, "Pendulum-v1")),
        ):
            loops.append(Row(f"{key}_{whose}", f"{called} of {SMALL_BATCH}, {title}", RATE, on(1, work, seconds)))
    return [
        Row("mujoco", "MuJoCo `mj_step` of the same robot, 1 core", RATE, on(1, mujoco_steps(robot), seconds)),
        Row(
            "mujoco_threads",
            f"MuJoCo `rollout` of the same robot, {cores} threads",
            RATE,
            on(1, mujoco_rollouts(robot, cores), seconds),
        ),
        *loops,
        Row(
            "cartpoles",
            "Gymnasium's native batch of 4,096 CartPole-v1, 1 core",
            RATE,
            on(1, native_cartpoles(), seconds),
        ),
        Row("cartpole", "Gymnasium CartPole-v1", "µs", each(sampled("CartPole-v1"), seconds)),
        Row("pendulum", "Gymnasium Pendulum-v1", "µs", each(sampled("Pendulum-v1"), seconds)),
        Row("inverted", "Gymnasium InvertedPendulum-v5 (MuJoCo)", "µs", each(sampled("InvertedPendulum-v5"), seconds)),
        Row("cheetah", "Gymnasium HalfCheetah-v5 (MuJoCo)", "µs", each(sampled("HalfCheetah-v5"), seconds)),
    ]
