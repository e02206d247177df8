"""Batches of robots for training and for evaluation, and episodes of an agent on given paths and starts."""

from typing import TypeAlias, cast

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from caster_gym.agents.comparison.finite_rewards import check_rewards
from caster_gym.agents.comparison.task_settings import Paths, TaskSettings
from caster_gym.agents.control.protocol import Agent
from caster_gym.arrays import Array
from caster_gym.control.episodes import reset_of
from caster_gym.envs.plan import SPAN
from caster_gym.tasks.environment import TaskVectorEnv
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.registry import find_task
from caster_gym.wrappers import Feature, FeatureVectorEnv, wrap

Batch: TypeAlias = TaskVectorEnv | FeatureVectorEnv

_AS_TOLD = (
    "position_error",
    "heading_error",
    "torque",
    "pose",
    "progress",
    "impacts",
    "normal_impulse",
    "clearance",
)  # by info, under the same names


def bare(batch: Batch) -> TaskVectorEnv:
    """The batch without its features: it has the engine, the task and the robot."""
    return cast(TaskVectorEnv, batch.unwrapped)


def make_batch(
    settings: TaskSettings, paths: Paths, count: int, mode: AutoresetMode, features: tuple[Feature, ...] = ()
) -> Batch:
    """So many robots on these paths, with these features."""
    batch = find_task(settings.environment).batch(
        count,
        settings.robot,
        paths,
        settings.actuation,
        settings.arena,
        autoreset_mode=mode,
        **settings.task.model_dump(),
    )
    return wrap(batch, *features) if features else batch


def evaluation_batch(settings: TaskSettings, paths: Paths, starts: int) -> Batch:
    """A batch with one robot for every start on every path; robots 0, 1, … follow path 0, 1, …, then again."""
    single = make_batch(settings, paths, 1, AutoresetMode.NEXT_STEP)
    count = len(bare(single).engine.plan.names) * starts
    return make_batch(settings, paths, count, AutoresetMode.NEXT_STEP, settings.wrappers)


def training_batch(settings: TaskSettings, robots: int) -> Batch:
    """A batch on training paths, with shaped rewards, as SB3 wants it."""
    features = (*settings.wrappers, *settings.shaping)
    return make_batch(settings, settings.train, robots, AutoresetMode.SAME_STEP, features)


def roll_out(agent: Agent, batch: Batch, seed: int) -> Episodes:
    """One episode of every robot of a test batch, from starts that depend on the seed alone."""
    plain = bare(batch)
    plan, robot = plain.engine.plan, plain.robot
    path = np.arange(batch.num_envs) % len(plan.names)
    observations, _ = batch.reset(seed=seed, options={"path": path})
    reset, ended = reset_of(agent), np.zeros(batch.num_envs, dtype=np.bool_)
    running = np.ones(batch.num_envs, dtype=np.bool_)
    reset(running.copy())
    failed = np.zeros(batch.num_envs, dtype=np.bool_)
    limits = robot.max_torques
    driven = robot.driven_indices
    rows: list[dict[str, Array]] = []
    while running.any():
        actions = agent.act(observations)
        observations, rewards, terminated, truncated, info = batch.step(actions)
        check_rewards(plain.definition, np.where(running, rewards, 0.0), lambda told=info: told)  # type: ignore[misc]
        if ended.any():  # this step was the reset of these robots
            reset(ended)
        ended = terminated | truncated
        share = info["torque"] / limits
        row = {
            "share": share,
            "command": actions if batch is plain else share[:, driven],
            "reference": info["reference_pose"],
            "reward": info.get("task_reward", rewards),
            **{name: info[name] for name in _AS_TOLD},
        }
        rows.append({name: np.where(_beside(running, one), one, np.nan) for name, one in row.items()})
        failed |= running & terminated
        running &= ~ended
    return Episodes(
        tuple(plan.names[i] for i in path),
        plain.task.control_period,
        **{name: np.stack([row[name] for row in rows]) for name in rows[0]},
        driven=driven,
        failed=failed,
        allowed=plan.source.spans[path, SPAN.periods],
        facts={name: values[path] for name, values in plain.definition.facts(plan).items()},
    )


def _beside(running: NDArray[np.bool_], values: Array) -> NDArray[np.bool_]:
    """Flags (robots,) in a shape that goes with values (robots, …)."""
    return running.reshape(-1, *[1] * (values.ndim - 1))
