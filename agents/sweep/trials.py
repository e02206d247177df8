"""A trial of a search: the trainings of one point of the space, one seed after the other, in a process of its own."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

from caster_gym.agents.comparison.validation import Validation, read_history
from caster_gym.agents.learning.training import train
from caster_gym.agents.learning.training_run import DivergedError
from caster_gym.agents.sweep.outcome import Outcome, is_behind, scores_of, verdict_numbers
from caster_gym.agents.sweep.settings import Candidate
from caster_gym.tasks.registry import find_task


class Trial(NamedTuple):
    """What a trial trains, and what it must reach."""

    candidate: Candidate
    seeds: tuple[int, ...]
    folders: tuple[Path, ...]  # of the trainings
    least: tuple[float, ...]  # scores at each validation, below which it ends
    threads: int


def run_trial(trial: Trial, report: Callable[[tuple[float, str]], None]) -> Outcome:
    """Train each seed; what is completed in its folder is used as it is, what was stopped goes on.

    It reports which share of its steps are done, and the last verdict in words.
    """
    task, agent = trial.candidate
    verdict = find_task(task.environment).metrics.verdict
    scores: list[list[float]] = []
    verdicts: list[dict[str, float]] = []

    def enough(history: Sequence[Validation]) -> bool:
        return history[-1].steps < agent.n_timesteps and is_behind(scores_of(history), trial.least)

    for i, (seed, folder) in enumerate(zip(trial.seeds, trial.folders, strict=True)):

        def tell(steps: int, words: str, done: int = i) -> None:
            report(((done + min(steps / agent.n_timesteps, 1.0)) / len(trial.seeds), words))

        try:
            train(task, agent, seed, folder, tell, trial.threads, resume=True, enough=enough)
        except ValueError as error:
            if isinstance(error, DivergedError) or isinstance(error.__cause__, DivergedError):
                return Outcome("failed", reason=str(error))
            raise
        history = read_history(folder / "validation.csv", verdict)
        scores.append(scores_of(history))
        verdicts.append(verdict_numbers(max(history, key=lambda one: one.verdict.merit).verdict))
        if enough(history):
            return Outcome("pruned", scores, verdicts)
    return Outcome("completed", scores, verdicts)
