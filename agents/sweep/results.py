"""Results of a search: a table of trials, all of them as CSV, a picture of what mattered, and the best settings."""

import math
import warnings
from pathlib import Path

import numpy as np
import optuna
import yaml

from caster_gym.agents.sweep.outcome import Outcome
from caster_gym.agents.sweep.search import Search
from caster_gym.agents.sweep.settings import Sweep, run_folders
from caster_gym.configuration import ConfigurationError
from caster_gym.durable_files import write_file
from caster_gym.report.figures import COLOURS, new_figure, save_figure
from caster_gym.report.tables import markdown_table, write_csv
from caster_gym.tasks.measuring import Printed, shown
from caster_gym.tasks.registry import find_task

RESULTS = ("table.md", "trials.csv", "search.png", "best.yaml", "best_task.yaml")
SHOWN = 20  # best trials in the table
MEANT = 2  # completed trials at least for importances


def best_trial(sweep: Sweep, search: Search) -> int:
    """Number of the completed trial with the greatest score, the first of several."""
    completed = [number for number, one in sorted(search.outcomes.items()) if one.kind == "completed"]
    if not completed:
        reasons = sorted({one.reason for one in search.outcomes.values() if one.reason})
        raise ConfigurationError(f"no trial was completed: {'; '.join(reasons[:3])}; the space may be too wide")
    return max(completed, key=lambda number: search.outcomes[number].score(sweep.settings.score))


def write_results(folder: Path, sweep: Sweep, search: Search) -> str:
    """Write table.md, trials.csv, search.png and best.yaml; returns the table with words around it."""
    best = best_trial(sweep, search)
    score = sweep.settings.score
    ranks = {"completed": 0, "pruned": 1, "failed": 2}
    order = sorted(search.outcomes, key=lambda n: (ranks[search.outcomes[n].kind], -search.outcomes[n].score(score), n))
    keys = list(sweep.settings.space)
    quantities = _quantities(sweep)
    columns = [
        *("trial", "", *(key.removeprefix("agent.") for key in keys)),
        *(how.label for _, how in quantities),
        "failures",
    ]
    lines = [_line(number, sweep, search, quantities) for number in order[:SHOWN]]
    places = ", ".join(str(one.relative_to(folder.absolute())) for one in run_folders(sweep.settings, folder, best))
    text = "\n\n".join(
        [
            markdown_table(columns, lines, padded=True),
            *([f"The best {SHOWN} of {len(order)} trials; all are in trials.csv."] if len(order) > SHOWN else []),
            f"Best is trial {best}, whose policies are in {places}. {_in_words(search, sweep)}.",
        ]
    )
    write_file(folder / "table.md", text + "\n")
    _write_trials(folder / "trials.csv", sweep, search)
    _draw(folder / "search.png", sweep, search)
    _write_best(folder, sweep, search, best)
    return text


def importances(search: Search, sweep: Sweep) -> dict[str, float]:
    """How much each setting mattered for which trials are the best, with a sum of 1, by PED-ANOVA.

    Empty while too few trials are completed, or all are equally good.
    """
    completed = [one for one in search.study.get_trials(deepcopy=False) if one.state.name == "COMPLETE"]
    values = {one.value for one in completed if one.value is not None and math.isfinite(one.value)}
    if len(values) < MEANT or len(completed) < MEANT:
        return {}
    past = optuna.create_study(direction="maximize")
    past.add_trials([one for one in completed if one.value is not None and math.isfinite(one.value)])
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # experimental
        found = optuna.importance.get_param_importances(past, evaluator=optuna.importance.PedAnovaImportanceEvaluator())
    return {key: float(found.get(key, 0.0)) for key in sweep.settings.space}


def _in_words(search: Search, sweep: Sweep) -> str:
    found = sorted(importances(search, sweep).items(), key=lambda one: -one[1])
    shares = ", ".join(f"{key} {100.0 * share:.0f} %" for key, share in found)
    return f"What mattered: {shares}" if shares else "There are too few trials to say what mattered"


def _quantities(sweep: Sweep) -> list[tuple[str, Printed]]:
    """The main numbers of verdicts, with how they are shown."""
    verdict = find_task(sweep.candidate({}).task.environment).metrics.verdict
    return [(name, how) for name, how in shown(verdict) if isinstance(how, Printed)]


def _mean(outcome: Outcome, name: str) -> float:
    """A number of verdicts over the seeds that were trained, or not a number."""
    values = [one[name] for one in outcome.verdicts]
    return float(np.mean(values)) if values else math.nan


def _line(number: int, sweep: Sweep, search: Search, quantities: list[tuple[str, Printed]]) -> list[object]:
    outcome, point = search.outcomes[number], search.settings_of(number)
    there = bool(outcome.verdicts)
    return [
        number,
        outcome.kind,
        *(point[key] for key in sweep.settings.space),
        *(f"{how.factor * _mean(outcome, name):.3g}" if there else "–" for name, how in quantities),
        int(sum(one["failures"] for one in outcome.verdicts)) if there else "–",
    ]


def _write_trials(path: Path, sweep: Sweep, search: Search) -> None:
    """Every trial: its settings, and the verdicts of its best policies, mean over seeds, in SI units."""
    verdict = find_task(sweep.candidate({}).task.environment).metrics.verdict
    rows = (
        (
            *(number, outcome.kind, outcome.score(sweep.settings.score)),
            *search.settings_of(number).values(),
            *(_mean(outcome, name) for name in verdict._fields),
            outcome.reason,
        )
        for number, outcome in sorted(search.outcomes.items())
    )
    write_csv(path, ("trial", "outcome", "score", *sweep.settings.space, *verdict._fields, "reason"), rows)


def _write_best(folder: Path, sweep: Sweep, search: Search, best: int) -> None:
    """best.yaml, which `train` reads, and best_task.yaml if settings of the task were searched or fixed."""
    settings = sweep.settings
    task, agent = sweep.candidate(search.settings_of(best))
    content = agent.model_dump(mode="json", exclude_unset=True)
    own = " It names code: copy it to the folder of that." if agent.is_own else ""
    head = f"# Trial {best}, the best of {len(search.outcomes)} of a search of {Path(settings.agent).stem}.{own}\n"
    write_file(folder / "best.yaml", head + yaml.safe_dump(content, sort_keys=False, allow_unicode=True))
    if any(key.startswith("task.") for key in (*settings.space, *settings.fixed)):
        text = yaml.safe_dump(task.model_dump(mode="json"), sort_keys=False, allow_unicode=True)
        write_file(folder / "best_task.yaml", f"# The task of trial {best}.\n{text}")


def _draw(path: Path, sweep: Sweep, search: Search) -> None:
    """Left what trials reached, right how much each setting mattered."""
    (name, how), *_ = _quantities(sweep)
    found = importances(search, sweep)
    figure = new_figure(1, 2, (5.4, 3.6))
    history, bars = figure.axes
    for kind, colour, marker in (("completed", COLOURS[0], "o"), ("pruned", COLOURS[2], "x")):
        numbers = [n for n, one in sorted(search.outcomes.items()) if one.kind == kind]
        values = [how.factor * _mean(search.outcomes[n], name) for n in numbers]
        history.plot(numbers, values, marker, color=colour, label=kind)
    best = best_trial(sweep, search)
    history.plot([best], [how.factor * _mean(search.outcomes[best], name)], "*", color=COLOURS[3], ms=14, label="best")
    history.set(xlabel="trial", ylabel=how.label, yscale=how.scale)
    history.legend()
    names = sorted(found, key=lambda key: found[key])
    bars.barh([one.removeprefix("agent.") for one in names], [100.0 * found[one] for one in names], color=COLOURS[0])
    bars.set(xlabel="importance [%]")
    save_figure(figure, path)
