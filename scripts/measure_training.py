"""Speed of training: python -m scripts.measure_training --out docs/training.md

First, what simulation costs PPO: control periods per second of training on our robots and on robots that cost nothing,
which answer with arrays of the same shapes drawn beforehand; turn by turn, so that a busy moment hits both. Then, how
long each learner takes until its policy follows validation paths as well as asked; and what a second thread does
beside other busy processes, all in the same run. The command writes a page, and a figure and a table in a folder beside
it.
"""

import argparse
import os
import resource
import tempfile
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from stable_baselines3.common.base_class import BaseAlgorithm
from stable_baselines3.common.vec_env import VecEnv
from stable_baselines3.common.vec_env.base_vec_env import VecEnvIndices, VecEnvObs, VecEnvStepReturn
from tqdm import tqdm

from caster_gym.agents.comparison.evaluation import bare, evaluation_batch, roll_out, training_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.control.protocol import Agent
from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.sb3_learning import make_learner
from caster_gym.agents.learning.settings import LearnerSettings, PPOSettings, RslPPOSettings, SHACSettings
from caster_gym.agents.learning.shac import ShortHorizon, make_task
from caster_gym.agents.learning.training_run import Run
from caster_gym.agents.registry import read_agent
from caster_gym.engines.native.threads import set_threads
from caster_gym.envs.plan import SPAN
from caster_gym.report.provenance import command_line
from caster_gym.report.run_folder import check_can_be_made
from caster_gym.shipped_files import read_settings
from scripts.speed_timing import RATE, Row, middle, run
from scripts.training_busy import Beside, train_beside
from scripts.training_page import FREE, OURS, write_page
from scripts.training_results import Course, Occasion, Point, Results, Trial, WindowCosts

BANK = 64  # steps drawn beforehand
GOAL = 5e-3  # [m] position RMSE on validation paths
STARTS = 4  # of a trained policy on each test path
TEST_SEED = 1000  # of these starts; the benchmark's own
VALIDATIONS = 50  # of each run, evenly spread, so that times to the goal can be told apart
WINDOWS = 30  # of which the medians are taken
ROUNDS = 3  # likewise


class FreeVecEnv(VecEnv):
    """Robots of the same shapes as a batch's that cost nothing: what they answer was drawn beforehand."""

    def __init__(self, like: SB3VecEnv, longest: int) -> None:
        self.render_mode = None
        super().__init__(like.num_envs, like.observation_space, like.action_space)
        rng = np.random.default_rng(0)
        drawn = rng.normal(size=(BANK, like.num_envs, *(like.observation_space.shape or ())))
        self.observations: NDArray[np.float32] = drawn.astype(np.float32)
        self.rewards = rng.uniform(size=(BANK, like.num_envs)).astype(np.float32)
        self.longest, self.made = longest, 0

    def reset(self) -> VecEnvObs:
        """The first observations."""
        first: NDArray[np.float32] = self.observations[0]
        return first

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


class TimedRun(Run):
    """A training run that counts seconds of the processor, those of validations left out."""

    def __init__(
        self, folder: Path, task: TaskSettings, settings: LearnerSettings, seed: int, bar: "tqdm[Any]"
    ) -> None:
        super().__init__(folder, task, settings, seed, lambda steps, verdict: _show(bar, steps, verdict))
        self.points: list[Point] = []
        self._begun, self._aside = processor_seconds(), 0.0

    def validate(self, actor: Actor) -> None:
        """As always, with the clock stopped."""
        now = processor_seconds()
        super().validate(actor)
        self.points.append(Point(self.steps, now - self._begun - self._aside, self.history[-1].verdict))
        self._aside += processor_seconds() - now


def _show(bar: "tqdm[Any]", steps: int, verdict: str) -> None:
    bar.update(min(steps, bar.total) - bar.n)
    bar.set_postfix_str(verdict)


def processor_seconds() -> float:
    """Seconds of the processor for this process, all its threads, and the compilers that it has run."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)


@contextmanager
def empty_cache() -> Iterator[None]:
    """Torch finds nothing that it has compiled before, and compiles in this process, where its time is counted."""
    from torch._inductor import config

    kept = os.environ.get("TORCHINDUCTOR_CACHE_DIR")
    with tempfile.TemporaryDirectory() as folder, config.patch(compile_threads=1):
        os.environ["TORCHINDUCTOR_CACHE_DIR"] = folder
        try:
            yield
        finally:
            del os.environ["TORCHINDUCTOR_CACHE_DIR"]
            if kept is not None:
                os.environ["TORCHINDUCTOR_CACHE_DIR"] = kept


def share_rows(task: TaskSettings, settings: PPOSettings) -> list[Row]:
    """PPO on our robots and on free ones, with the same settings."""
    ours = SB3VecEnv(training_batch(task, settings.n_envs))
    longest = round(float(np.mean(bare(ours.batch).engine.plan.source.spans[:, SPAN.periods])))
    free, round_ = FreeVecEnv(ours, longest), settings.n_envs * settings.n_steps
    return [
        Row(key, key, RATE, learning(make_learner(settings, environment, seed=0), round_))
        for key, environment in ((OURS, ours), (FREE, free))
    ]


def beside_others(task: TaskSettings, settings: PPOSettings) -> Beside:
    """PPO on our robots with one thread and with two, beside busy processes."""
    environment = SB3VecEnv(training_batch(task, settings.n_envs))
    return train_beside(make_learner(settings, environment, seed=0), settings.n_envs * settings.n_steps)


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


def train_timed(name: str, task: TaskSettings, settings: LearnerSettings, seed: int) -> Course:
    """Train to the end of the settings, as in a process of its own: what Torch has compiled it gets from the disk."""
    torch.compiler.reset()
    with (
        tempfile.TemporaryDirectory() as folder,
        tqdm(total=settings.n_timesteps, desc=f"{name}, seed {seed}", disable=None) as bar,
    ):
        timed = TimedRun(Path(folder), task, settings, seed, bar)
        settings.learn(timed)
        timed.logger.close()
        return Course(name, seed, tuple(timed.points), trials(task, load_policy(Path(folder) / "best").agent))


def trials(task: TaskSettings, agent: Agent) -> tuple[Trial, ...]:
    """Episodes of an agent on all test paths, from the benchmark's starts and some more."""
    batch = evaluation_batch(task, task.test, STARTS)
    how = bare(batch).definition.metrics
    episodes = roll_out(agent, batch, TEST_SEED)
    metrics = how.measure(episodes, how.settling)
    told = zip(episodes.names, metrics.position_rmse.tolist(), metrics.failed.tolist(), strict=True)
    return tuple(Trial(path, error, failed > 0.0) for path, error, failed in told)


def window_costs(task: TaskSettings, settings: SHACSettings) -> WindowCosts:
    """What a window of SHAC costs, and what it costs to compile its step, from nothing and from the disk."""
    learner, compiling = _first_window(task, settings)
    spent = []
    for _ in range(WINDOWS):
        times = [time.process_time()]
        gain, window = learner.gain()
        times.append(time.process_time())
        torch.autograd.backward(-gain)
        times.append(time.process_time())
        learner.teach_critic(window)
        times.append(time.process_time())
        spent.append(np.diff(times))
    forward, backward, critic = np.median(spent, axis=0).tolist()
    torch.compiler.reset()
    _, fetching = _first_window(task, settings)
    periods = settings.n_envs * settings.n_steps
    return WindowCosts(periods, learner.task.task.substeps, forward, backward, critic, compiling, fetching)


def _first_window(task: TaskSettings, settings: SHACSettings) -> tuple[ShortHorizon, float]:
    """A learner that has learned from one window, and the processor's seconds for it."""
    begun = processor_seconds()
    learner = ShortHorizon(make_task(task, settings), settings, seed=0)
    learner.improve(0.0)
    return learner, processor_seconds() - begun


def rate_on_tensors(task: TaskSettings, settings: LearnerSettings) -> float:
    """Control periods of training per second of the processor; the first round, which compiles, is not counted."""
    if not isinstance(settings, RslPPOSettings):
        raise ValueError(f"only PPO on tensors is measured without its error, got algorithm {settings.algorithm!r}")
    round_ = settings.n_envs * settings.n_steps
    settings = settings.model_copy(update={"n_timesteps": (ROUNDS + 2) * round_, "validations": 1, "device": "cpu"})
    starts: list[float] = []
    torch.compiler.reset()
    with tempfile.TemporaryDirectory() as folder:
        counted = Run(Path(folder), task, settings, 0, lambda _steps, _verdict: starts.append(processor_seconds()))
        settings.learn(counted)
        counted.logger.close()
    return round_ / middle(np.diff(starts)[1:])


def read_learner(name: str, changes: Mapping[str, Any]) -> LearnerSettings:
    """Settings of an agent that learns."""
    settings = read_agent(name)
    if not isinstance(settings, LearnerSettings):
        raise ValueError(f"agent {name!r} does not learn, so that there is no time to measure")
    settings = read_agent(name, changes)
    assert isinstance(settings, LearnerSettings)  # changes leave the algorithm as it is
    return settings


def main(arguments: list[str] | None = None) -> None:
    """Measure, and write the page or print it."""
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--task", default="track", help="name of a tracking task or path of its file")
    parser.add_argument("--agents", nargs="*", default=["ppo", "shac"], help="learners that are timed to the goal")
    parser.add_argument("--tensors", nargs="*", default=["ppo_gpu"], help="learners on tensors whose rate is measured")
    parser.add_argument("--seeds", nargs="+", type=int, default=[0, 1, 2, 3, 4])
    parser.add_argument("--steps", type=int, help="control periods of each training run instead of the agent's own")
    parser.add_argument("--turns", type=int, default=15, help="how often the share is measured")
    parser.add_argument("--goal", type=float, default=GOAL, help="position RMSE [m] on validation paths")
    parser.add_argument("--out", type=Path, default=Path("runs/training.md"), help="file for the page")
    chosen = parser.parse_args(arguments)
    check_can_be_made(chosen.out.with_suffix(""))
    task = read_settings(TaskSettings, "tasks", chosen.task)
    if task.environment != "track":
        raise ValueError(f"the goal is one of tracking, got a task of environment {task.environment!r}")
    changes = {"validations": VALIDATIONS} | ({} if chosen.steps is None else {"n_timesteps": chosen.steps})
    agents = {name: read_learner(name, changes) for name in chosen.agents}
    on_tensors = {name: read_learner(name, {}) for name in chosen.tensors}
    ppo = read_learner("ppo", {})
    assert isinstance(ppo, PPOSettings)
    load = os.getloadavg()[0]
    torch.set_num_threads(1)
    set_threads(1)
    with empty_cache():
        measured = run(share_rows(task, ppo), chosen.turns)
        costs = {name: window_costs(task, one) for name, one in agents.items() if isinstance(one, SHACSettings)}
        courses = [train_timed(name, task, one, seed) for seed in chosen.seeds for name, one in agents.items()]
        rates = {name: (one, rate_on_tensors(task, one)) for name, one in on_tensors.items()}
        beside = beside_others(task, ppo)
    command = command_line("scripts.measure_training", arguments)
    occasion = Occasion(command, chosen.turns, chosen.goal, (load, os.getloadavg()[0]))
    write_page(chosen.out, Results(agents, measured, courses, costs, rates, beside), occasion)
    print(chosen.out)


if __name__ == "__main__":
    main()
