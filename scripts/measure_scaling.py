"""What a search costs on few and on many cores: python -m scripts.measure_scaling --out docs/scaling

Overheads, bytes and the steps of a training are measured on this machine; what 1,000 trainings cost on more cores than
it has is computed from that.
"""

import argparse
import pickle
import tempfile
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from caster_gym.agents.learning.training import train
from caster_gym.agents.sweep.outcome import Outcome
from caster_gym.agents.sweep.search import Search
from caster_gym.agents.sweep.settings import Candidate, SweepSettings, read_sweep
from caster_gym.agents.sweep.trials import Trial
from caster_gym.agents.workers.calls import Call, Finished
from caster_gym.agents.workers.opening import open_workers
from caster_gym.durable_files import write_file
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table
from caster_gym.shipped_files import read_settings

CORES = (2, 64, 1000)
RUNS = 1000
CALLS = 20  # that do nothing


class Measured(NamedTuple):
    """What was measured; times in seconds, sizes in bytes."""

    begin: dict[str, float]  # until the first call has ended, which imports what trainings need, by kind of workers
    call: dict[str, float]  # of a call that does nothing, mean of later ones, by kind of workers
    choose: float  # of one trial among RUNS earlier ones, with keeping its outcome
    sent: int  # to the process of a trial
    returned: int  # by it
    left: int  # in its folder
    steps: float  # of a training, 1/s
    wanted: int  # steps of a training


def nothing(trial: Trial, report: Callable[[Any], None]) -> Outcome:
    """What a trial gives, without any training."""
    report((1.0, ""))
    return Outcome("completed", [[0.0] * trial.candidate.agent.validations], [{"failures": 0.0}])


def overhead(kind: Any, trial: Trial) -> tuple[float, float]:
    """Seconds until the first call has ended, and seconds for each later one, in one process."""
    begun = time.perf_counter()
    with open_workers(kind, 1, 1) as workers:
        for i in range(1 + CALLS):
            workers.submit(Call(str(i), nothing, (trial,)))
        ends = [time.perf_counter() for event in workers.events() if isinstance(event, Finished)]
    return ends[0] - begun, (ends[-1] - ends[0]) / CALLS


def choosing(settings: SweepSettings, trials: int) -> float:
    """Seconds to choose one point more after so many trials, and to keep its outcome."""
    with tempfile.TemporaryDirectory() as folder:
        search = Search(settings.model_copy(update={"trials": trials + 1}), Path(folder), resume=False)
        outcome = Outcome("completed", [[0.0] * 10], [{"failures": 0.0}])
        point = search.points[search.choose()]
        search.tell(0, outcome)
        search.points = [point] * trials  # in memory alone: what is chosen next looks at all of them
        search.outcomes = {i: outcome._replace(scores=[[float(i)] * 10]) for i in range(trials)}
        begun = time.perf_counter()
        search.choose()
        chosen = time.perf_counter()
        search.points = search.points[:2]
        search.tell(1, outcome)
        return chosen - begun + (time.perf_counter() - chosen)


def training(candidate: Candidate, share: float) -> tuple[float, int]:
    """Steps per second of the first share of a training, and the bytes that it leaves."""
    with tempfile.TemporaryDirectory() as place:
        folder = Path(place) / "run"
        agent = candidate.agent.model_copy(update={"n_timesteps": max(1, int(share * candidate.agent.n_timesteps))})
        begun = time.perf_counter()
        train(candidate.task, agent, 0, folder, lambda steps, words: None, 1)
        seconds = time.perf_counter() - begun
        return agent.n_timesteps / seconds, sum(one.stat().st_size for one in folder.rglob("*") if one.is_file())


def measure(name: str, kinds: Sequence[str], share: float) -> Measured:
    """Measure what a search of that name costs."""
    settings = read_settings(SweepSettings, "sweeps", name)
    candidate = read_sweep(settings).candidate({})
    trial = Trial(candidate, (0,), (Path("trials/0000"),), (), 1)
    times = {kind: overhead(kind, trial) for kind in kinds}
    steps, left = training(candidate, share)
    return Measured(
        {kind: one[0] for kind, one in times.items()},
        {kind: one[1] for kind, one in times.items()},
        choosing(settings, RUNS),
        len(pickle.dumps(Call("", nothing, (trial,)).work(1))),
        len(pickle.dumps(nothing(trial, lambda content: None))),
        left,
        steps,
        candidate.agent.n_timesteps,
    )


def computed(found: Measured, kind: str, cores: int) -> tuple[float, float, float]:
    """Hours of RUNS trainings on so many cores; the share of overheads; how many cores one chooser keeps busy.

    Trainings run in rounds of as many as there are cores. Choosing goes on meanwhile, one after the other.
    """
    seconds = found.wanted / found.steps
    rounds = -(-RUNS // cores)
    busy = found.begin[kind] + rounds * (seconds + found.call[kind])
    total = max(busy, RUNS * found.choose) if cores > 1 else busy + RUNS * found.choose
    return total / 3600.0, 1.0 - rounds * seconds / total, seconds / found.choose


def page(found: Measured, name: str, command: str) -> str:
    """What was measured, and what was computed from it, as Markdown."""
    kinds = list(found.begin)
    rows = [
        *((f"first call of a process, {kind} [s]", found.begin[kind]) for kind in kinds),
        *((f"each later call, {kind} [ms]", 1e3 * found.call[kind]) for kind in kinds),
        (f"choosing a trial after {RUNS} others, keeping its outcome [ms]", 1e3 * found.choose),
        ("sent to a trial's process [kB]", found.sent / 1e3),
        ("returned by it [kB]", found.returned / 1e3),
        ("left in its folder [MB]", found.left / 1e6),
        ("steps of a training [1/s]", found.steps),
        (f"a training of {found.wanted} steps [s]", found.wanted / found.steps),
    ]
    costs = [
        (kind, cores, *(f"{one:.3g}" for one in (hours, 100.0 * share)), f"{RUNS * found.left / 1e9:.3g}")
        for kind in kinds
        for cores in CORES
        for hours, share, _ in [computed(found, kind, cores)]
    ]
    busy = computed(found, kinds[0], CORES[-1])[2]
    return "\n\n".join(
        [
            "# What a search costs on few and on many cores",
            f"Measured on one core of one machine, for the search `{name}`. The calls do nothing: what they take is "
            "overhead.",
            markdown_table(("measured", ""), rows),
            f"Computed from these numbers, not measured: {RUNS} trainings without pruning, as many at a time as there "
            "are cores, all of one kind, with storage that keeps up. Overheads are the share of the time in which no "
            "core trains.",
            markdown_table(("workers", "cores", "time [h]", "overheads [%]", "written [GB]"), costs),
            f"One process chooses all trials. That takes no core's time until about {busy:.0f} of them train such runs "
            "at once. Trials that run at once know nothing of one another: with `at_once` as large as the search, "
            "all are chosen at random.",
            f"Made by `{command}` with {versions_in_words('optuna', 'ray', 'torch', 'stable-baselines3')}.\n",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Measure what searches cost beside their trainings.")
    parser.add_argument("--sweep", default="ppo_track", help="name of a search in configs/sweeps, or a YAML file")
    parser.add_argument("--workers", nargs="+", choices=("local", "ray"), default=("local", "ray"))
    parser.add_argument("--share", type=float, default=0.1, help="of a training that is measured")
    parser.add_argument("--out", type=Path, help="folder for cost.md")
    options = parser.parse_args(arguments)
    found = measure(options.sweep, options.workers, options.share)
    text = page(found, Path(options.sweep).stem, command_line("scripts.measure_scaling", arguments))
    print(text)
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_file(options.out / "cost.md", text)


if __name__ == "__main__":
    main()
