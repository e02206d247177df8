"""A search: trials on workers, each chosen from the outcomes of earlier ones, and its folder of results."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from tqdm import tqdm

from caster_gym.agents.learning import resuming, training
from caster_gym.agents.learning.resuming import is_completed
from caster_gym.agents.sweep.outcome import Outcome, least_scores
from caster_gym.agents.sweep.results import RESULTS, best_trial, write_results
from caster_gym.agents.sweep.search import STORAGE_FILES, Search
from caster_gym.agents.sweep.settings import Sweep, run_folders
from caster_gym.agents.sweep.trials import Trial, run_trial
from caster_gym.agents.workers.calls import Call, Finished, Workers
from caster_gym.configuration import ConfigurationError
from caster_gym.engines.tensor.threads import DEFAULT
from caster_gym.report.provenance import write_provenance

FILES = (*RESULTS, *STORAGE_FILES, "run.yaml", *(f"trials/*/{name}" for name in training.FILES))
WORTH_KEEPING = tuple(f"trials/*/{name}" for name in training.WORTH_KEEPING)
FREE = (*resuming.FREE, "sweep.trials")  # settings that may change where a search goes on
BAR = "{desc}: {n:.1f}/{total_fmt} trials |{bar:24}| {elapsed}{postfix}"


def run_sweep(sweep: Sweep, folder: Path, workers: Workers, threads: int = DEFAULT, resume: bool = False) -> str:
    """Run all trials and write the results into the folder; returns the table.

    threads: of each training. resume: go on with the search in this folder; more trials may be asked for, but no other
    settings. Raises ConfigurationError where these differ, and if no trial is completed.
    """
    facts = _facts(sweep, threads)
    if resume:
        is_completed(folder, facts, "search", FREE)  # refuses other settings
    write_provenance(folder, **facts, completed=False)
    search = Search(sweep.settings, folder, resume)
    with workers, _bar(sweep.settings.trials) as show:
        _run_trials(sweep, search, folder, workers, threads, show)
    text = write_results(folder, sweep, search)
    write_provenance(folder, **facts, completed=True, best=best_trial(sweep, search))
    return text


def _run_trials(
    sweep: Sweep, search: Search, folder: Path, workers: Workers, threads: int, show: Callable[..., None]
) -> None:
    """Submit trials as soon as they may be chosen, those first that were running when the search was stopped."""
    numbers: dict[int, int] = {}  # of trials, by those of calls

    def submit(number: int) -> None:
        try:
            candidate = sweep.candidate(search.settings_of(number))
        except ConfigurationError as error:  # settings that do not go together
            search.tell(number, Outcome("failed", reason=str(error)))
            show(number, 1.0)
            return
        folders = run_folders(sweep.settings, folder, number)
        how = sweep.settings.pruning
        least = least_scores(search.known(number), **how.model_dump()) if how else ()
        trial = Trial(candidate, sweep.settings.seeds, tuple(folders), tuple(least), threads)
        numbers[workers.submit(Call(f"trial {number}", run_trial, (trial,)))] = number

    def submit_chosen() -> None:
        while search.may_choose():
            submit(search.choose())

    for number in range(len(search.points)):
        if number in search.outcomes:
            show(number, 1.0)
        else:
            submit(number)
    submit_chosen()
    for event in workers.events():
        number = numbers[event.number]
        if isinstance(event, Finished):
            search.tell(number, event.result)
            show(number, 1.0)
            submit_chosen()
        else:
            show(number, *event.content)


def _facts(sweep: Sweep, threads: int) -> dict[str, Any]:
    """What results follow from."""
    task, agent = sweep.candidate({})
    return {
        "sweep": sweep.settings.model_dump(mode="json"),
        "task": task.model_dump(mode="json"),
        "agent": agent.model_dump(mode="json"),
        "source": agent.source,
        "threads": threads,
    }


@contextmanager
def _bar(trials: int) -> Iterator[Callable[..., None]]:
    """show(trial, share, words) for a bar over all trials."""
    shares: dict[int, float] = {}
    with tqdm(total=trials, desc="searching", bar_format=BAR, disable=None) as bar:

        def show(trial: int, share: float, words: str = "") -> None:
            shares[trial] = share
            bar.n = sum(shares.values())
            if words:
                bar.set_postfix_str(f"trial {trial}: {words}", refresh=False)
            bar.refresh()

        yield show
