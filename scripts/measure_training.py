"""How fast policies are trained, in one table: python -m scripts.measure_training

First, what simulation costs PPO: control periods per second of training on our robots and on robots that cost nothing,
which answer with arrays of the same shapes drawn beforehand; turn by turn, so that a busy moment hits both. Then, how
long each learner takes until its policy follows validation paths as well as asked, all in the same run.
"""

import argparse
import os
import platform
import shlex
import sys
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
from tqdm import tqdm

from caster_gym.agents.benchmark import read_history
from caster_gym.agents.evaluation import bare, training_batch
from caster_gym.agents.metrics import in_words
from caster_gym.agents.provenance import versions
from caster_gym.agents.sb3_environment import CasterVecEnv
from caster_gym.agents.settings import (
    ComputedTorqueSettings,
    LearnedSettings,
    PPOSettings,
    TaskSettings,
    read_agent,
    read_settings,
)
from caster_gym.agents.track_metrics import TrackVerdict
from caster_gym.agents.training import Validation, make_learner, train
from caster_gym.engines.threads import set_threads
from scripts.speed_timing import RATE, Ratio, Row, Values, at_least, middle, run, shown, spread

BANK = 64  # steps drawn beforehand
GOAL = 5e-3  # [m] position RMSE on validation paths
OURS, FREE = "PPO on our robots", "PPO on robots that cost nothing"
SHARE = Ratio("share of a zero-cost environment's speed", OURS, FREE, 100.0, at_least(95.0))
NOTES = """\
A turn is one round of PPO, collecting and updating, with the settings of `ppo`, on one core, in seconds of the
processor, so that other work on the machine does not count. Robots that cost nothing
have the same number, shapes and lengths of episodes; what they answer was drawn beforehand. Times to the goal are those
of training on one core, from the first step to the validation that first meets it without a failure, compilation
included and validations left out; policies are validated as often as their settings say, so that times are rounded up
to the next validation.
"""


class FreeVecEnv(VecEnv):
    """Robots of the same shapes as a batch's that cost nothing: what they answer was drawn beforehand."""

    def __init__(self, like: CasterVecEnv, longest: int) -> None:
        self.render_mode = None
        super().__init__(like.num_envs, like.observation_space, like.action_space)
        rng = np.random.default_rng(0)
        self.observations = rng.normal(size=(BANK, like.num_envs, *(like.observation_space.shape or ())))
        self.observations = self.observations.astype(np.float32)
        self.rewards = rng.uniform(size=(BANK, like.num_envs)).astype(np.float32)
        self.longest, self.made = longest, 0

    def reset(self) -> VecEnvObs:
        """The first observations."""
        return self.observations[0]

    def step_async(self, actions: np.ndarray) -> None:
        """Nothing needs the actions."""

    def step_wait(self) -> VecEnvStepReturn:
        """What was drawn; all episodes end by time after `longest` steps."""
        self.made += 1
        i = self.made % BANK
        done = np.full(self.num_envs, self.made % self.longest == 0)
        infos: list[dict[str, Any]] = [{} for _ in range(self.num_envs)]
        if done[0]:
            for robot, info in enumerate(infos):
                info["terminal_observation"], info["TimeLimit.truncated"] = self.observations[i, robot], True
        return self.observations[i], self.rewards[i], done, infos

    def close(self) -> None:
        """Nothing to release."""

    def get_attr(self, attr_name: str, indices: VecEnvIndices = None) -> list[Any]:
        """An attribute, once for each robot asked for."""
        return [getattr(self, attr_name)] * len(list(self._get_indices(indices)))

    def set_attr(self, attr_name: str, value: Any, indices: VecEnvIndices = None) -> None:
        """Nobody sets any."""
        raise NotImplementedError

    def env_method(self, method_name: str, *args: Any, indices: VecEnvIndices = None, **kwargs: Any) -> list[Any]:
        """There are no methods."""
        raise NotImplementedError

    def env_is_wrapped(self, wrapper_class: Any, indices: VecEnvIndices = None) -> list[bool]:
        """None is wrapped."""
        return [False] * len(list(self._get_indices(indices)))

    def _get_indices(self, indices: VecEnvIndices) -> Iterable[int]:
        return super()._get_indices(indices)


class Success(NamedTuple):
    """When a training run first met the goal; None if it never did."""

    learner: str
    seed: int
    first: Validation | None
    best: Validation


def learning(learner: BaseAlgorithm, periods: int) -> Callable[[], float]:
    """Control periods of training per second of the processor, over one round of collecting and updating.

    The first round is not counted, and other people's use of the machine is not either.
    """
    learner.learn(periods)

    def measure() -> float:
        start = time.process_time()
        learner.learn(periods, reset_num_timesteps=False)
        return periods / (time.process_time() - start)

    return measure


def share_rows(task: TaskSettings, settings: PPOSettings) -> list[Row]:
    """PPO on our robots and on free ones, with the same settings."""
    ours = CasterVecEnv(training_batch(task, settings.robots))
    longest = round(float(np.mean(bare(ours.batch).engine.plan.guide.spans[:, 2])))
    free, round_ = FreeVecEnv(ours, longest), settings.robots * settings.horizon
    return [
        Row(key, key, RATE, learning(make_learner(settings, environment, seed=0), round_))
        for key, environment in ((OURS, ours), (FREE, free))
    ]


def time_to_goal(name: str, task: TaskSettings, settings: LearnedSettings, seed: int, goal: float) -> Success:
    """Train to the end of the settings; a second is one of training, compilation included, validations left out."""
    with tempfile.TemporaryDirectory() as folder, tqdm(total=settings.steps, desc=name, file=sys.stderr) as bar:

        def report(steps: int, verdict: str) -> None:
            bar.update(min(steps, settings.steps) - bar.n)
            bar.set_postfix_str(verdict)

        best = train(task, settings, seed, Path(folder), report, threads=1)
        history = read_history(Path(folder), TrackVerdict)
    reached = (one for one in history if not one.verdict.failures and one.verdict.position_rmse < goal)
    return Success(name, seed, next(reached, None), best)


def share_lines(rows: Sequence[Row], measured: Values) -> list[str]:
    """The table of training speeds, and the share."""
    lines = ["| what | median | middle half |", "|---|---|---|"]
    for row in rows:
        values = measured[row.key]
        lines.append(f"| {row.name} | {shown(middle(values))} {row.unit} | {spread(values)} |")
    shares = SHARE.values(measured)
    verdict = "reached" if SHARE.goal and SHARE.goal.reached(middle(shares)) else "missed"
    lines.append(f"| {SHARE.name} (goal {SHARE.goal}: {verdict}) | {shown(middle(shares))} % | {spread(shares)} |")
    return lines


def success_lines(successes: Sequence[Success], goal: float) -> list[str]:
    """The table of times to the goal."""
    lines = [f"| learner | seed | time to {1e3 * goal:g} mm | steps to it | best of the run |", "|---|---|---|---|---|"]
    for name, seed, first, best in successes:
        told = f"{shown(first.seconds)} s | {first.steps:,}" if first else "not reached | "
        lines.append(f"| {name} | {seed} | {told} | {in_words(best.verdict)} after {shown(best.seconds)} s |")
    return lines


def main(arguments: list[str] | None = None) -> None:
    """Measure, print the page and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--task", default="track", help="name of a tracking task or path of its file")
    parser.add_argument("--agents", nargs="*", default=["ppo", "shac"], help="learners that are timed to the goal")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2])
    parser.add_argument("--steps", type=int, help="control periods of each training run instead of the agent's own")
    parser.add_argument("--turns", type=int, default=15, help="how often the share is measured")
    parser.add_argument("--goal", type=float, default=GOAL, help="position RMSE [m] on validation paths")
    parser.add_argument("--out", type=Path, help="file for the page")
    chosen = parser.parse_args(arguments)
    task = read_settings(TaskSettings, "tasks", chosen.task)
    if task.environment != "track":
        raise ValueError(f"the goal is one of tracking, got a task of environment {task.environment!r}")
    changes = {} if chosen.steps is None else {"steps": chosen.steps}
    agents = {name: read_learner(name, changes) for name in chosen.agents}
    load = os.getloadavg()[0]
    torch.set_num_threads(1)
    set_threads(1)
    ppo = read_learner("ppo", {})
    assert isinstance(ppo, PPOSettings)
    rows = share_rows(task, ppo)
    measured = run(rows, chosen.turns)
    successes = [
        time_to_goal(name, task, settings, seed, chosen.goal)
        for seed in chosen.seeds
        for name, settings in agents.items()
    ]
    given = sys.argv[1:] if arguments is None else arguments
    text = page(
        [*share_lines(rows, measured), "", *success_lines(successes, chosen.goal)],
        shlex.join(["python", "-m", "scripts.measure_training", *given]),
        (load, os.getloadavg()[0]),
    )
    print(text)
    if chosen.out is not None:
        chosen.out.write_text(text, encoding="utf-8")


def read_learner(name: str, changes: dict[str, int]) -> LearnedSettings:
    """Settings of an agent that learns."""
    settings = read_agent(name, changes)
    if isinstance(settings, ComputedTorqueSettings):
        raise ValueError(f"agent {name!r} does not learn, so that there is no time to measure")
    return settings


def page(tables: Sequence[str], command: str, loads: tuple[float, float]) -> str:
    """The results as Markdown."""
    told = ", ".join(f"{name} {number}" for name, number in versions().items())
    return "\n".join(
        [
            "# Speed of training",
            "",
            "Written by the command below.",
            "",
            *tables,
            "",
            NOTES,
            f"- Command: `{command}`",
            f"- Machine: {platform.processor() or platform.machine()}, {os.cpu_count()} cores",
            f"- Load of the machine: {loads[0]:.1f} at the start, {loads[1]:.1f} at the end",
            f"- Versions: {told}",
            "",
        ]
    )


if __name__ == "__main__":
    main()
