"""The same work on Torch tensors, compiled: the equations and whole environments, on the processor and on a GPU."""

from collections.abc import Callable
from typing import Any

import numpy as np
import torch

from caster_gym import Robot
from caster_gym.engines.tensor.fleet import TorchFleet
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from scripts.speed_robots import ACTION, BANK, CIRCLES, RK4_STEP, SCATTERING, SPEED, WIDE, limits
from scripts.speed_timing import RATE, Goal, Row, Work, at_least, rate

EXCERPT = 400  # RK4 steps of a motion
STEPS_A_CALL = 20  # of an environment, so that a GPU is waited for seldom
ON_GPU = 65536  # robots; a GPU idles with fewer


def bare_tensors(robot: Robot, count: int, device: str) -> Work:
    """RK4 steps of a batch in float32, as `scripts.speed_robots.bare_equations`."""
    fleet = TorchFleet(robot, count, device=device, compile=True)
    rng = np.random.default_rng(0)
    start = fleet.state.clone()
    start[:, 4:7] = torch.as_tensor(SPEED * rng.normal(size=(count, 3)), dtype=fleet.dtype, device=device)
    drawn = ACTION * rng.uniform(-1.0, 1.0, (count, len(robot.joints))) * limits(robot)
    torques = torch.as_tensor(drawn, dtype=fleet.dtype, device=device)

    def prepare() -> None:
        fleet.state = start
        finish(device)

    def call() -> int:
        fleet.step(torques, RK4_STEP, EXCERPT)
        finish(device)
        return count * EXCERPT

    return Work(call, prepare)


def environment_tensors(robot: str, count: int, device: str) -> Work:
    """Steps of a whole batch in float32, with observations, rewards, infos (but for diagnostics) and resets."""
    environment = TorchVectorEnv(
        "track", count, robot, CIRCLES, device=device, compile=True, diagnostics=False, corridor=WIDE
    )
    environment.reset(seed=0)
    times = max(2, min(BANK, 2**18 // count))
    shape = (times, count, *(environment.single_action_space.shape or ()))
    drawn = np.random.default_rng(0).uniform(-ACTION, ACTION, shape)
    actions = torch.as_tensor(drawn, dtype=torch.float32, device=device)

    def call() -> int:
        for made in range(STEPS_A_CALL):
            environment.step(actions[made % times])
        finish(device)
        return STEPS_A_CALL * count

    for _ in range(SCATTERING // STEPS_A_CALL):
        call()
    return Work(call)


def finish(device: str) -> None:
    """Wait until a GPU has done what it was given."""
    if device == "cuda":
        torch.cuda.synchronize()


def on(threads: int, work: Work, seconds: float) -> Callable[[], float]:
    """Steps per second with so many of Torch's threads."""

    def measure() -> float:
        torch.set_num_threads(threads)
        return rate(work, seconds)

    return measure


def torch_rows(robot: Robot, name: str, cores: int, seconds: float) -> list[Row]:
    """Rows of the processor, and of a GPU where there is one."""

    def row(key: str, title: str, threads: int, work: Any, goal: Goal | None = None) -> Row:
        return Row(key, title, RATE, on(threads, work, seconds), goal)

    environment = environment_tensors(name, 4096, "cpu")
    bare = bare_tensors(robot, 4096, "cpu")
    rows = [
        row("torch", "Torch, bare, float32, batch of 4,096, 1 core", 1, bare, at_least(1e7)),
        row("torch_env_core", "Torch, environment, float32, batch of 4,096, 1 core", 1, environment),
        row(
            "torch_env",
            f"Torch, environment, float32, batch of 4,096, {cores} cores",
            cores,
            environment,
            at_least(2e6),
        ),
    ]
    if torch.cuda.is_available():
        gpu = torch.cuda.get_device_name()
        rows += [
            row("cuda", f"Torch, bare, float32, batch of {ON_GPU:,}, {gpu}", 1, bare_tensors(robot, ON_GPU, "cuda")),
            row(
                "cuda_env",
                f"Torch, environment, float32, batch of {ON_GPU:,}, {gpu}",
                1,
                environment_tensors(name, ON_GPU, "cuda"),
            ),
        ]
    return rows
