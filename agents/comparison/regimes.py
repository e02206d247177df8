"""Who is best where: agents over scenarios as a table, as words, as a picture and as CSV."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from caster_gym.agents.comparison.summary import Estimate, Result, by_agent, estimate, values_of
from caster_gym.arrays import Array
from caster_gym.durable_files import write_file
from caster_gym.report.figures import new_figure, save_figure
from caster_gym.report.tables import markdown_table, write_csv
from caster_gym.tasks.measuring import Metrics, Printed, shown
from caster_gym.tasks.verdicts import verdict_of

FILES = ("table.md", "scenarios.csv", "regimes.png")
FARTHEST = 100.0  # times the best error, from which on the picture has one colour
DARK = 1.2  # decades above the best, from which on colours need white numbers


class Standing(NamedTuple):
    """How an agent did on a scenario."""

    agent: str
    merit: tuple[float, ...]  # of the task's verdict, mean over seeds; the greatest is the best
    failed: float  # share of the episodes of all seeds
    error: Estimate  # of what is compared, as it is printed


def compared_by(metrics: type[Any], how: Metrics) -> tuple[str, Printed]:
    """The number by which agents of a task are compared: the error that chooses policies, where there is one."""
    printed = {name: one for name, one in shown(metrics) if isinstance(one, Printed)}
    errors = [name for name, one in shown(how.verdict) if isinstance(one, Printed) and one.scale == "log"]
    name = next((one for one in reversed(errors) if one in printed), next(iter(printed)))
    return name, printed[name]


def standings(results: Sequence[Result], how: Metrics, confidence: float) -> list[Standing]:
    """How all agents did on a scenario, the best one first."""
    name, printed = compared_by(type(results[0].metrics), how)
    found = []
    for agent, group in by_agent(results).items():
        verdicts = [verdict_of(how, one.metrics) for one in group]
        merits = np.array([one.merit for one in verdicts], dtype=np.float64)
        failed = sum(one.failures for one in verdicts) / sum(len(one.paths) for one in group)
        error = estimate(printed.factor * values_of(group, name), confidence)
        found.append(Standing(agent, tuple(merits.mean(axis=0).tolist()), failed, error))
    return sorted(found, key=lambda one: one.merit, reverse=True)


def in_words(scenario: str, ranked: Sequence[Standing], unit: str) -> str:
    """A sentence on who is best on a scenario, and by how much."""
    best, *others = ranked
    text = f"**{scenario}**: {best.agent} is best, {_told(best, unit)}"
    if not others:
        return f"{text}."
    second = others[0]
    apart = best.error.high < second.error.low
    ratio = second.error.mean / best.error.mean if best.error.mean > 0.0 else np.inf
    more = f", {ratio:.3g} times as much" if np.isfinite(ratio) and ratio > 1.0 else ""
    intervals = "intervals are apart" if apart else "intervals overlap"
    return f"{text}; next is {second.agent}, {_told(second, unit)}{more}; {intervals}."


def _told(one: Standing, unit: str) -> str:
    error = "no settled episode" if np.isnan(one.error.mean) else f"{one.error.mean:.3g} {unit}"
    return f"{error}, {100.0 * one.failed:.3g} % failed" if one.failed else error


def write_regimes(folder: Path, results: Mapping[str, Sequence[Result]], how: Metrics, confidence: float) -> str:
    """Write table.md, scenarios.csv and regimes.png of the results of each scenario; returns the table and words."""
    _, printed = compared_by(type(next(iter(results.values()))[0].metrics), how)
    ranked = {scenario: standings(of, how, confidence) for scenario, of in results.items()}
    agents = list(dict.fromkeys(one.agent for of in results.values() for one in of))
    found = {(scenario, one.agent): one for scenario, of in ranked.items() for one in of}
    lines = [
        [scenario, *(_cell(found.get((scenario, agent)), ranked[scenario][0].agent) for agent in agents)]
        for scenario in ranked
    ]
    text = "\n".join(
        [
            f"{printed.label}: mean with interval, and how many episodes failed; the best of each row is bold.",
            "",
            markdown_table([printed.title, *agents], lines, padded=True),
            "",
            *(f"- {in_words(scenario, of, printed.unit)}" for scenario, of in ranked.items()),
        ]
    )
    write_csv(
        folder / "scenarios.csv",
        ("scenario", "agent", "seeds", "episodes", "metric", *Estimate._fields),
        (
            (scenario, agent, len(group), len(group[0].paths), metric, *estimate(values_of(group, metric), confidence))
            for scenario, of in results.items()
            for agent, group in by_agent(of).items()
            for metric in group[0].metrics._fields
        ),
    )
    _draw(folder / "regimes.png", list(ranked), agents, found, printed)
    write_file(folder / "table.md", text + "\n")
    return text


def _cell(one: Standing | None, best: str) -> str:
    """What the table says of an agent on a scenario."""
    if one is None or np.isnan(one.error.mean):
        return "–"
    failed = f" ({100.0 * one.failed:.3g} %)" if one.failed else ""
    mean = f"**{one.error.mean:.3g}**" if one.agent == best else f"{one.error.mean:.3g}"
    return f"{mean} [{one.error.low:.3g}, {one.error.high:.3g}]{failed}"


def _draw(
    path: Path, scenarios: Sequence[str], agents: Sequence[str], found: Mapping[Any, Standing], how: Printed
) -> None:
    """Agents over scenarios: each error, and in colour how many times that of the best it is."""
    errors: Array = np.array(
        [
            [found[scenario, agent].error.mean if (scenario, agent) in found else np.nan for scenario in scenarios]
            for agent in agents
        ]
    )
    with np.errstate(divide="ignore", invalid="ignore"):
        times = np.log10(errors / np.nanmin(np.where(errors > 0.0, errors, np.inf), axis=0))
    figure = new_figure(1, 1, (2.2 + 1.1 * len(scenarios), 1.6 + 0.45 * len(agents)))
    axis = figure.axes[0]
    axis.grid(False)
    shades = axis.imshow(
        np.clip(times, 0.0, np.log10(FARTHEST)), cmap="YlOrRd", vmin=0.0, vmax=np.log10(FARTHEST), aspect="auto"
    )
    for i, agent in enumerate(agents):
        for j, scenario in enumerate(scenarios):
            one = found.get((scenario, agent))
            if one is not None:
                failed = f"\n{100.0 * one.failed:.2g} % failed" if one.failed else ""
                dark = "white" if times[i, j] > DARK else "black"
                number = "–" if np.isnan(errors[i, j]) else f"{errors[i, j]:.3g}"
                axis.text(j, i, f"{number}{failed}", ha="center", va="center", fontsize="small", color=dark)
    axis.set_xticks(range(len(scenarios)), scenarios, rotation=30, ha="right")
    axis.set_yticks(range(len(agents)), agents)
    axis.set_title(f"{how.label}; colour: times the best of its column", fontsize="medium")
    bar = figure.colorbar(shades, ax=axis, ticks=[0.0, 1.0, 2.0])
    bar.ax.set_yticklabels(["1", "10", "≥ 100"])
    save_figure(figure, path)
