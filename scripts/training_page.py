"""The page of `scripts.measure_training`: tables, a figure, and what they say."""

import os
from collections.abc import Sequence
from pathlib import Path

from caster_gym.agents.learning.settings import OnPolicy
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import versions
from caster_gym.report.tables import markdown_table, write_csv
from scripts.speed_page import processor
from scripts.speed_timing import RATE, Ratio, at_least, middle, shown, spread
from scripts.training_busy import section
from scripts.training_results import Course, Occasion, Point, Results, WindowCosts

OURS, FREE = "PPO on our robots", "PPO on robots that cost nothing"
SHARE = Ratio("share of a zero-cost environment's speed", OURS, FREE, 100.0, at_least(95.0))
HEADS = ("learner", "seed", "control periods", "processor time", "best of the run")
LINES = (COLOURS[0], COLOURS[3], COLOURS[4], COLOURS[5])  # one for each learner


def write_page(path: Path, results: Results, occasion: Occasion) -> None:
    """The page, and a folder of its name with figure and table."""
    folder = path.with_suffix("")
    folder.mkdir(parents=True, exist_ok=True)
    write_points(folder / "validations.csv", results.courses)
    if results.courses:
        draw(folder / "learning.png", results.courses, occasion.goal)
    path.write_text(page(results, occasion, folder.name), encoding="utf-8")


def page(results: Results, occasion: Occasion, folder: str) -> str:
    """Everything as Markdown."""
    goal = f"{1e3 * occasion.goal:g} mm"
    parts = ["# Training speed", paragraph(_compared(results, goal))]
    if results.courses:
        parts += [
            f"## Time to {goal}",
            paragraph(_verdict(results, occasion.goal)),
            f"![Validation error over processor time and over control periods]({folder}/learning.png)",
            paragraph(
                """*Each line is a seed. A circle marks the first validation that meets the goal without a failure. If a
                robot leaves its corridor, its error until then counts; errors of about 0.1 m are those of policies that
                still fail.*"""
            ),
            markdown_table(HEADS, _rows(results, occasion.goal)),
            *(_compilation(name, one, results, occasion.goal) for name, one in results.costs.items()),
        ]
    if any(one.trials for one in results.courses):
        parts += [
            "## On test paths",
            paragraph(
                """The table shows the best policy of each seed on the test paths of the benchmark: random paths that it
                has never seen, and shapes unlike any that it was trained on. Validation uses random paths only and says
                nothing about such shapes."""
            ),
            markdown_table(
                ("learner", "paths", "failed episodes", "position RMSE of the others, median"), _trials(results)
            ),
        ]
    parts += ["## What limits each learner", _limits(results)]
    parts += [section(results.beside)] if results.beside else []
    parts += ["## How it was measured", _origin(results, occasion, folder)]
    return join_parts(parts)


def _compared(results: Results, goal: str) -> str:
    """What the page is about."""
    text = f"""This page says how long a learner trains until its policy follows the validation paths with a position
        RMSE of {goal} and without a failure. These are 64 random paths that are never used for training, always from
        the same starts. All runs took place in one command, one after the other, on one core, with the default settings
        of `caster-gym train`."""
    if "ppo" in results.agents:
        text += " `ppo` is Stable-Baselines3's PPO on the native batch; it learns from rewards alone."
    if "shac" in results.agents:
        text += """ `shac` differentiates the rewards through the simulator, over short windows, on robots that are
            Torch tensors."""
    return text


def _rows(results: Results, goal: float) -> list[tuple[str, ...]]:
    """A line for each run, then for each learner."""
    lines: list[tuple[str, ...]] = []
    for name in results.agents:
        own = [one for one in results.courses if one.learner == name]
        for one in own:
            first = one.first(goal)
            told = (f"{first.steps:,}", f"{first.seconds:.1f} s") if first else ("not reached", "")
            lines.append((name, str(one.seed), *told, _best(one)))
        firsts = [first for one in own if (first := one.first(goal))]
        bests = [1e3 * one.best.verdict.position_rmse for one in own]
        steps, seconds = [one.steps for one in firsts], [one.seconds for one in firsts]
        reached = f"{len(firsts)} of {len(own)} seeds"
        ends = f"**{middle(bests):.2f}** ({min(bests):.2f} – {max(bests):.2f}) mm"
        if firsts:
            periods = f"**{shown(middle(steps))}** ({min(steps):,} – {max(steps):,})"
            lines.append((f"**{name}**", reached, periods, f"**{middle(seconds):.1f}** ({_range(seconds)}) s", ends))
        else:
            lines.append((f"**{name}**", reached, "", "", ends))
    return lines


def _trials(results: Results) -> list[tuple[str, ...]]:
    """A line for each learner and kind of path."""
    lines: list[tuple[str, ...]] = []
    for name in results.agents:
        trials = [one for course in results.courses if course.learner == name for one in course.trials]
        for kind in dict.fromkeys(one.path.split()[0] for one in trials):
            own = [one for one in trials if one.path.split()[0] == kind]
            errors = [1e3 * one.position_rmse for one in own if not one.failed]
            told = f"{middle(errors):.2f} mm" if errors else ""
            lines.append((name, kind.replace("_", " "), f"{len(own) - len(errors)} of {len(own)}", told))
    return lines


def _best(course: Course) -> str:
    best, last = course.best, course.points[-1]
    failures = f", {best.verdict.failures} failures" if best.verdict.failures else ""
    return f"{1e3 * best.verdict.position_rmse:.2f} mm{failures}, after {best.seconds:.0f} s of {last.seconds:.0f} s"


def _range(values: Sequence[float]) -> str:
    return f"{min(values):.1f} – {max(values):.1f}"


def _firsts(results: Results, goal: float) -> dict[str, list[Point]]:
    """Of each learner whose seeds have all met the goal, where they did."""
    met: dict[str, list[Point]] = {}
    for name in results.agents:
        firsts = [one.first(goal) for one in results.courses if one.learner == name]
        if all(firsts):
            met[name] = [one for one in firsts if one]
    return met


def _verdict(results: Results, goal: float) -> str:
    """Who is faster, in words."""
    met = _firsts(results, goal)
    text = [f"`{name}` does not reach the goal with every seed." for name in results.agents if name not in met]
    first, *others = met or ("",)
    for name in others:
        periods = _ratio(met[name], met[first], "steps", ("fewer", "more"))
        seconds = _ratio(met[name], met[first], "seconds", ("less", "more"))
        text.append(f"`{name}` needs {periods} control periods than `{first}` and {seconds} processor time.")
    text.append("These are ratios of medians over the seeds.")
    text.append("The table shows the medians in bold, with minimum and maximum in brackets.")
    return " ".join(text)


def _ratio(ours: Sequence[Point], theirs: Sequence[Point], what: str, words: tuple[str, str]) -> str:
    share = middle(getattr(one, what) for one in ours) / middle(getattr(one, what) for one in theirs)
    return f"{shown(1.0 / share)} times {words[0]}" if share < 1.0 else f"{shown(share)} times {words[1]}"


def _compilation(name: str, costs: WindowCosts, results: Results, goal: float) -> str:
    """What compiling adds for whoever trains for the first time."""
    text = f"""`{name}` has to be compiled. On a machine that has never done so, Torch takes {costs.compiling:.0f} s of
        processor time until the first window is over. Later runs find the code on disk and take {costs.fetching:.1f} s
        for the same, which the times above include."""
    firsts = _firsts(results, goal).get(name)
    if firsts:
        whole = middle(one.seconds for one in firsts) + costs.compiling - costs.fetching
        text += f" The very first run therefore reaches the goal after {whole:.0f} s."
    return paragraph(text)


def _limits(results: Results) -> str:
    """Where the time of each learner goes."""
    share = SHARE.values(results.share)
    rows = [(name, f"{shown(middle(values))} {RATE}", spread(values)) for name, values in results.share.items()]
    rows.append((SHARE.name, f"{shown(middle(share))} %", spread(share)))
    reached = "reached" if SHARE.goal and SHARE.goal.reached(middle(share)) else "**missed**"
    parts = [
        paragraph(
            f"""PPO is limited by its own update. Robots that cost nothing, which only return arrays drawn beforehand,
            would hardly make it faster; the goal, {SHARE.goal} % of that speed, is {reached}."""
        ),
        markdown_table(("training with PPO", "median", "middle half"), rows),
    ]
    for name, costs in results.costs.items():
        whole = costs.forward + costs.backward + costs.critic
        pieces = {
            "forward: policy, motion, rewards": costs.forward,
            "backward: the gradient through all of these": costs.backward,
            "critic": costs.critic,
            "whole": whole,
        }
        parts += [
            paragraph(
                f"""`{name}` is limited by the number of kernels that it launches: batches this small hardly keep a
                kernel busy. A window of {costs.periods:,} control periods takes, in milliseconds of processor time:"""
            ),
            markdown_table(
                (name, "ms", "share"),
                [(what, f"{1e3 * one:.1f}", f"{100.0 * one / whole:.0f} %") for what, one in pieces.items()],
            ),
            paragraph(
                f"""That is {1e6 * whole / costs.periods:.0f} µs per control period. Each period is {costs.substeps} RK4
                steps, as few as the robot's casters allow; validation uses the task's own number. The gradient makes up
                for the cost of a period: PPO only learns whether an action was better than another, whereas SHAC learns
                in which direction to change it. Before each window, SHAC starts some robots anew, so that it often sees
                starts, which are hardest. PPO starts robots anew when their episodes end."""
            ),
        ]
    for name, (settings, rate) in results.rates.items():
        assert isinstance(settings, OnPolicy)  # no others are measured
        parts.append(
            paragraph(
                f"""On tensors and on the same core, `{name}` (rsl-rl-lib, with {settings.n_envs:,} robots whose step is
                compiled) trains at {shown(rate)} {RATE}; it is meant for a GPU."""
            )
        )
    return "\n\n".join(parts)


def _origin(results: Results, occasion: Occasion, folder: str) -> str:
    """Command, machine, versions, and what counts."""
    often = {name: f"every {max(1, one.n_timesteps // one.validations):,}" for name, one in results.agents.items()}
    told = " and ".join(f"{name} {every}" for name, every in often.items())
    lines = [
        f"- Command: `{occasion.command}`",
        "- Times are processor time unless the page says otherwise, so that other work on the machine hardly counts; "
        "one thread",
        "- A run's time begins before its robots and networks are made and ends with the first validation that meets "
        "the goal; validations themselves do not count",
    ]
    if results.agents:
        lines.append(f"- Policies are validated often ({told} control periods); times are rounded up to the next one")
    lines += [
        f"- PPO's speed: {occasion.turns} turns of one round each, collecting and updating, on both kinds of robots in "
        "a new random order",
        f"- All validations: [validations.csv]({folder}/validations.csv)",
        f"- Machine: {processor()}, {os.cpu_count()} cores, of which one is used",
        f"- Load of the machine: {occasion.loads[0]:.1f} at the start, {occasion.loads[1]:.1f} at the end",
        f"- Versions: {', '.join(f'{name} {number}' for name, number in versions().items())}",
    ]
    return "\n".join(lines)


def write_points(path: Path, courses: Sequence[Course]) -> None:
    """All validations."""
    rows = [
        (one.learner, one.seed, steps, f"{seconds:.2f}", f"{verdict.position_rmse:.6g}", verdict.failures)
        for one in courses
        for steps, seconds, verdict in one.points
    ]
    write_csv(path, ("learner", "seed", "steps", "processor_seconds", "position_rmse", "failures"), rows)


def draw(path: Path, courses: Sequence[Course], goal: float) -> None:
    """Validation errors over processor time and over control periods, a line for each run."""
    from matplotlib.ticker import LogLocator, NullFormatter

    figure = new_figure(1, 2, (5.6, 4.2), sharey=True)
    colours = dict(zip(dict.fromkeys(one.learner for one in courses), LINES, strict=False))
    labels = "processor time [s]", "control periods of all robots together [thousands]"
    for axis, field, unit, label in zip(figure.axes, ("seconds", "steps"), (1.0, 1e-3), labels, strict=True):
        for learner, colour in colours.items():
            for i, one in enumerate(run for run in courses if run.learner == learner):
                places = [unit * getattr(point, field) for point in one.points]
                errors = [1e3 * point.verdict.position_rmse for point in one.points]
                name = None if i else learner
                axis.plot(places, errors, color=colour, linewidth=1.1, alpha=0.65, label=name)
                if first := one.first(goal):
                    place = unit * getattr(first, field), 1e3 * first.verdict.position_rmse
                    axis.plot(*place, "o", color=colour, markersize=6, markeredgecolor="white", zorder=3)
        axis.axhline(1e3 * goal, color="0.25", linestyle="--", linewidth=1.0)
        axis.set(xscale="log", yscale="log", xlabel=label)
        for one_axis in (axis.xaxis, axis.yaxis):
            one_axis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            one_axis.set_major_formatter(lambda value, _: f"{value:,g}")
            one_axis.set_minor_formatter(NullFormatter())
    left, right = figure.axes
    left.set_ylabel("position RMSE on validation paths [mm]")
    left.legend(loc="lower left", frameon=False)
    place = (0.02, 1e3 * goal * 1.06)
    right.text(
        *place, f"goal: {1e3 * goal:g} mm", transform=right.get_yaxis_transform(), color="0.25", fontsize="small"
    )
    figure.savefig(path)
