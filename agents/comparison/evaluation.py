"""Batches of robots for training and for evaluation, and episodes of an agent on given paths and starts."""

from typing import Any, NamedTuple, TypeAlias, cast

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from caster_gym.agents.comparison.task_settings import Paths, TaskSettings
from caster_gym.agents.control.protocol import Agent
from caster_gym.arrays import Array
from caster_gym.envs.caster_follow import CasterFollowVectorEnv
from caster_gym.envs.caster_track import CasterTrackVectorEnv
from caster_gym.envs.caster_vector_env import CasterVectorEnv
from caster_gym.envs.native.reference import Courses
from caster_gym.envs.plan import Plan
from caster_gym.paths.time_law import row_times
from caster_gym.wrappers import Feature, FeatureVectorEnv, wrap

Batch: TypeAlias = CasterVectorEnv | FeatureVectorEnv

_BATCHES: dict[str, type[CasterTrackVectorEnv | CasterFollowVectorEnv]] = {
    "track": CasterTrackVectorEnv,
    "follow": CasterFollowVectorEnv,
}


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


class Episodes(NamedTuple):
    """Time series of episodes (steps, episodes, …), NaN after an episode has ended; and facts of each (episodes,)."""

    names: tuple[str, ...]  # of the path of each episode
    period: float  # [s]
    position_error: Array  # [m]
    heading_error: Array  # [rad]
    torque: Array  # (steps, episodes, 2 N) of the motors [N m]
    share: Array  # the same as shares of their greatest torques
    command: Array  # (steps, episodes, driven motors) shares asked for, in −1 … 1; of wrapped robots, those given
    pose: Array  # (steps, episodes, 4): x, y, cos β, sin β in W
    reference: Array  # the same of the reference
    reward: Array  # of the task alone
    progress: Array  # [m]
    impacts: Array  # in each control period
    normal_impulse: Array  # [N s] likewise
    clearance: Array  # [m] inf where there is no obstacle
    driven: list[int]  # indices of the driven motors
    failed: NDArray[np.bool_]  # (episodes,)
    allowed: NDArray[np.int64]  # (episodes,) control periods of an episode that does not fail
    goal: Array  # (episodes,) [m] progress with which the path is done; NaN where a clock leads
    law: Array  # (episodes,) [s] that the time law takes; NaN likewise


def bare(batch: Batch) -> CasterVectorEnv:
    """The batch without its features: it has the engine, the task and the robot."""
    return cast(CasterVectorEnv, batch.unwrapped)


def make_batch(
    settings: TaskSettings, paths: Paths, count: int, mode: AutoresetMode, features: tuple[Feature, ...] = ()
) -> Batch:
    """So many robots on these paths, with these features."""
    batch = _BATCHES[settings.environment](
        count,
        settings.robot,
        paths,
        settings.actuation,
        settings.arena,
        autoreset_mode=mode,
        **settings.task.model_dump(),
    )
    return wrap(batch, *features) if features else batch


def test_batch(settings: TaskSettings, paths: Paths, starts: int) -> Batch:
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
    running = np.ones(batch.num_envs, dtype=np.bool_)
    failed = np.zeros(batch.num_envs, dtype=np.bool_)
    limits = robot.max_torques
    driven = robot.driven_indices
    rows: list[dict[str, Array]] = []
    while running.any():
        actions = agent.act(observations)
        observations, rewards, terminated, truncated, info = batch.step(actions)
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
        running &= ~(terminated | truncated)
    goals, laws = _goals(plan)
    return Episodes(
        tuple(plan.names[i] for i in path),
        plain.task.control_period,
        **{name: np.stack([row[name] for row in rows]) for name in rows[0]},
        driven=driven,
        failed=failed,
        allowed=plan.guide.spans[path, 2],
        goal=goals[path],
        law=laws[path],
    )


def _beside(running: NDArray[np.bool_], values: Array) -> NDArray[np.bool_]:
    """Flags (robots,) in a shape that goes with values (robots, …)."""
    return running.reshape(-1, *[1] * (values.ndim - 1))


def _goals(plan: Plan) -> tuple[Array, Array]:
    """Of each path, progress with which it is done [m] and time of its law [s]; NaN where a clock leads."""
    guide: Any = plan.guide
    if not isinstance(guide, Courses):
        return np.full(len(plan.names), np.nan), np.full(len(plan.names), np.nan)
    lengths = (guide.spans[:, 1] - guide.spans[:, 0]) * guide.spacings
    laws = [row_times(table[:, -1], spacing)[-1] for table, spacing in zip(plan.tables, guide.spacings, strict=True)]
    return lengths - guide.arrival, np.array(laws)
