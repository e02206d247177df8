"""Episodes of an agent on given paths and starts, and what they measure."""

from typing import Any, NamedTuple

import numpy as np
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray

from caster_gym.envs.caster_track_vector import CasterTrackVectorEnv

from .protocol import Agent
from .settings import Paths, TaskSettings

Array = NDArray[np.float64]
SATURATED = 0.999  # commands from here on count as saturated, and torques that differ from theirs by the rest


class Episodes(NamedTuple):
    """Time series of episodes (steps, episodes, …); NaN after an episode has ended."""

    names: tuple[str, ...]  # of the path of each episode
    period: float  # [s]
    position_error: Array  # [m]
    heading_error: Array  # [rad]
    torque: Array  # (steps, episodes, 2 N) of the motors [N m]
    share: Array  # the same as shares of their greatest torques
    command: Array  # (steps, episodes, driven motors) actions, in −1 … 1
    pose: Array  # (steps, episodes, 4): x, y, cos β, sin β in W
    reference: Array  # the same of the reference
    reward: Array
    failed: NDArray[np.bool_]  # (episodes,)


class Metrics(NamedTuple):
    """One number per episode (episodes,)."""

    position_rmse: Array  # [m] after settling
    heading_rmse: Array  # [rad] after settling
    worst_position: Array  # [m] after settling
    position_rmse_transient: Array  # [m] before
    heading_rmse_transient: Array  # [rad] before
    effort: Array  # mean square torque as a share of the limits
    peak_torque: Array  # [N m]
    torque_variation: Array  # [1/s] total variation of the torque shares per second, mean over driven motors
    saturation: Array  # share of torques that a motor's limit cut, or that were asked at the limit
    reward: Array  # mean per step
    failed: Array  # 1 or 0


def test_batch(settings: TaskSettings, paths: Paths, starts: int) -> CasterTrackVectorEnv:
    """A batch with one robot for every start on every path; robots 0, 1, … follow path 0, 1, …, then again."""
    single = CasterTrackVectorEnv(1, settings.robot, paths, settings.actuation, **_fields(settings))
    count = len(single.engine.trajectories) * starts
    return CasterTrackVectorEnv(
        count, settings.robot, paths, settings.actuation, AutoresetMode.NEXT_STEP, **_fields(settings)
    )


def training_batch(settings: TaskSettings, robots: int) -> CasterTrackVectorEnv:
    """A batch on training paths, as SB3 wants it."""
    return CasterTrackVectorEnv(
        robots, settings.robot, settings.train, settings.actuation, AutoresetMode.SAME_STEP, **_fields(settings)
    )


def _fields(settings: TaskSettings) -> dict[str, Any]:
    return settings.task.model_dump()


def roll_out(agent: Agent, batch: CasterTrackVectorEnv, seed: int) -> Episodes:
    """One episode of every robot of a test batch, from starts that depend on the seed alone."""
    trajectories = batch.engine.trajectories
    index = np.arange(batch.num_envs) % len(trajectories)
    observations, _ = batch.reset(seed=seed, options={"path": index})
    running = np.ones(batch.num_envs, dtype=np.bool_)
    failed = np.zeros(batch.num_envs, dtype=np.bool_)
    rows: list[tuple[Array, ...]] = []
    limits = np.array([motor.max_torque for caster in batch.robot.casters for motor in (caster.roll, caster.steer)])
    while running.any():
        actions = agent.act(observations)
        observations, rewards, terminated, truncated, info = batch.step(actions)
        row = (
            info["position_error"],
            info["heading_error"],
            info["torque"],
            info["torque"] / limits,
            actions,
            info["pose"],
            info["reference_pose"],
            rewards,
        )
        rows.append(tuple(np.where(running.reshape(-1, *[1] * (x.ndim - 1)), x, np.nan) for x in row))
        failed |= running & terminated
        running &= ~(terminated | truncated)
    position, heading, torque, share, command, pose, reference, reward = (
        np.stack(column) for column in zip(*rows, strict=True)
    )
    names = tuple(trajectories[i].name for i in index)
    period = batch.task.control_period
    return Episodes(names, period, position, heading, torque, share, command, pose, reference, reward, failed)


def measure(episodes: Episodes, settling: float, driven: list[int]) -> Metrics:
    """Metrics of episodes, transient (before `settling` seconds) and steady apart; driven: indices of driven motors.

    An episode that failed counts with what it did before; one that failed before settling has no steady values (NaN).
    """
    first = round(settling / episodes.period)
    share = episodes.share[..., driven]
    limited = np.abs(share - episodes.command) > 1.0 - SATURATED
    at_limit = limited | (np.abs(episodes.command) >= SATURATED)
    steps = np.isfinite(episodes.reward).sum(axis=0)
    change = np.nansum(np.abs(np.diff(share, axis=0)), axis=0) / (steps * episodes.period)[:, None]
    return Metrics(
        position_rmse=_rms(episodes.position_error[first:]),
        heading_rmse=_rms(episodes.heading_error[first:]),
        worst_position=_greatest(episodes.position_error[first:]),
        position_rmse_transient=_rms(episodes.position_error[:first]),
        heading_rmse_transient=_rms(episodes.heading_error[:first]),
        effort=_mean(np.square(share).mean(axis=-1)),
        peak_torque=_greatest(np.abs(episodes.torque).max(axis=-1)),
        torque_variation=change.mean(axis=-1),
        saturation=at_limit.sum(axis=(0, 2)) / (steps * at_limit.shape[2]),
        reward=_mean(episodes.reward),
        failed=episodes.failed.astype(np.float64),
    )


def _mean(series: Array) -> Array:
    """Mean over time of what is there; NaN where nothing is."""
    there = np.isfinite(series)
    count = there.sum(axis=0)
    total = np.where(there, series, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def _rms(series: Array) -> Array:
    return np.sqrt(_mean(np.square(series)))


def _greatest(series: Array) -> Array:
    there = np.isfinite(series)
    greatest = np.where(there, series, -np.inf).max(axis=0)
    return np.where(there.any(axis=0), greatest, np.nan)
