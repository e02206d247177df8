"""The command caster-gym: train, evaluate, benchmark, watch, reproduce, design, identify, export."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from gymnasium.error import DependencyNotInstalled
from tqdm import tqdm

from caster_gym.configuration import parse_yaml

from .run_folder import prepare
from .settings import (
    BenchmarkSettings,
    ComputedTorqueSettings,
    TaskSettings,
    read_agent,
    read_settings,
)

app = typer.Typer(
    no_args_is_help=True,
    add_completion=False,
    help="Train, evaluate and compare controllers of omnidirectional robots on powered casters.",
)

NOTHING_WRITTEN = "nothing was written"
PARTS_BAR = "{desc}: {n_fmt}/{total_fmt} parts |{bar:24}| {elapsed}{postfix}"

Out = Annotated[Path, typer.Option(help="Folder for the results; it must be empty or not there.")]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Delete what is in that folder first.")]
Changes = Annotated[
    list[str] | None,
    typer.Option("--set", help="Change a setting of the learned agents, e.g. --set steps=100000. May be repeated."),
]
TaskName = Annotated[str, typer.Option(help="Name of a task in configs/tasks, or path of a YAML file.")]


@app.command()
def train(
    agent: Annotated[str, typer.Argument(help="Name of an agent in configs/agents, or path of a YAML file.")] = "ppo",
    task: TaskName = "track",
    seed: Annotated[int, typer.Option(help="Seed of networks, exploration and starts.", min=0, max=2**32 - 1)] = 0,
    out: Out = Path("runs/train"),
    overwrite: Overwrite = False,
    change: Changes = None,
) -> None:
    """Train a policy; the best one on validation paths is OUT/best, a folder that `evaluate` reads."""
    with _plain_errors():
        from .metrics import in_words
        from .training import train as run

        settings = read_agent(agent, _parsed(change))
        if isinstance(settings, ComputedTorqueSettings):
            raise ValueError(f"agent {agent!r} does not learn; compare it with `caster-gym benchmark`")
        tasks = read_settings(TaskSettings, "tasks", task)
        prepare(out, overwrite)
        with tqdm(total=settings.steps, desc=f"{agent} seed {seed}", unit="step", unit_scale=True) as bar:

            def report(steps: int, verdict: str) -> None:
                bar.n = min(steps, settings.steps)
                bar.set_postfix_str(verdict, refresh=False)
                bar.refresh()

            best = run(tasks, settings, seed, out, report)
        typer.echo(
            f"Best on validation paths after {best.steps} steps and {best.seconds:.0f} s: {in_words(best.verdict)}. "
            f"It is in {out / 'best'}."
        )


@app.command()
def evaluate(
    policy: Annotated[str, typer.Argument(help="Folder of a trained policy, or name of a model-based agent.")],
    task: TaskName = "track",
    starts: Annotated[int, typer.Option(help="Episodes on each test path.", min=1)] = 1,
    out: Out = Path("runs/evaluate"),
    overwrite: Overwrite = False,
) -> None:
    """Try an agent on the test paths of a task: a table, every episode as CSV, and figures."""
    with _plain_errors():
        from .benchmark import Contender, compare, ready_agent
        from .evaluation import bare, test_batch
        from .figures import write_figures
        from .provenance import write_provenance
        from .summary import table, write_episodes, write_summary

        tasks = read_settings(TaskSettings, "tasks", task)
        settings = BenchmarkSettings(task=task, agents=(policy,), starts=starts)
        test = test_batch(tasks, tasks.test, starts)
        agent = ready_agent(policy, tasks, test)
        contender = Contender(agent.name, agent, None)
        prepare(out, overwrite, kept=Path(policy))
        results, episodes = compare([contender], test, settings)
        text = table(results, settings.confidence)
        write_episodes(out / "episodes.csv", results)
        write_summary(out / "summary.csv", results, settings.confidence)
        (out / "table.md").write_text(text + "\n", encoding="utf-8")
        write_figures(out, episodes, {}, bare(test).engine.plan)
        write_provenance(out, policy=policy, task=tasks.model_dump(mode="json"), starts=starts)
        typer.echo(text)
        typer.echo(f"Results and figures are in {out}.")


@app.command()
def benchmark(
    config: Annotated[str, typer.Option(help="Name of a comparison in configs/benchmarks, or a YAML file.")] = "track",
    out: Out = Path("runs/benchmark"),
    overwrite: Overwrite = False,
    change: Changes = None,
) -> None:
    """Train the learned agents, evaluate all agents on the same held-out paths, print the table, draw the figures."""
    with _plain_errors():
        from .benchmark import read_comparison, run_benchmark

        settings = read_settings(BenchmarkSettings, "benchmarks", config)
        comparison = read_comparison(settings, _parsed(change))
        prepare(out, overwrite)
        typer.echo(run_benchmark(comparison, out))
        typer.echo(f"Results, policies and figures are in {out}.")


@app.command()
def watch(
    agent: Annotated[
        str,
        typer.Argument(
            help="Folder of a trained policy, name of a model-based agent, or keyboard: W, A, S, D or arrows drive, "
            "Q and E turn."
        ),
    ] = "computed_torque",
    task: TaskName = "track",
    path: Annotated[str, typer.Option(help="Name or index of a test path; the first robot's, of several.")] = "0",
    robots: Annotated[int, typer.Option(help="How many, each on a test path of its own.", min=1, max=16)] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the starts.", min=0, max=2**32 - 1)] = 0,
    save: Annotated[Path | None, typer.Option(help="Film to write instead of a window: run.mp4 or run.gif.")] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a film that is there.")] = False,
    seconds: Annotated[float | None, typer.Option(help="Stop after that time.")] = None,
) -> None:
    """Show an agent on the test paths of a task, or drive yourself: in a window, or as a film."""
    with _plain_errors():
        from .watch import watch as run

        frames = run(agent, task, path, robots, seed, save, overwrite, seconds)
        if save is not None:
            typer.echo(f"{frames} frames are in {save}.")


@app.command()
def reproduce(
    paper: Annotated[str, typer.Argument(help="chung2008 or kim2001.")],
    out: Annotated[Path, typer.Option(help="Folder for the page PAPER.md and its folder PAPER.")] = Path("runs/papers"),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace that page and its folder.")] = False,
) -> None:
    """Compute everything that a paper computes: figures, tables, and a page with each printed number beside ours."""
    with _plain_errors(NOTHING_WRITTEN):
        from .reproduction import find_paper
        from .reproduction import reproduce as run

        with tqdm(total=len(find_paper(paper).parts), desc=paper, bar_format=PARTS_BAR) as bar:

            def report(work: str, done: int) -> None:
                bar.n = done
                bar.set_postfix_str(work)

            verdict = run(paper, out, overwrite, report)
        share = f"{verdict.agreeing} of {verdict.compared}"
        typer.echo(f"{share} printed numbers and statements agree; {out / paper}.md shows all.")
        if verdict.unexplained:
            raise ValueError(f"no reason is known why these differ: {'; '.join(verdict.unexplained)}")


@app.command()
def design(
    robot: Annotated[
        str | None, typer.Option(help="Name of a robot in configs/robots, or path of a YAML file; else the target's.")
    ] = None,
    target: Annotated[
        str, typer.Option(help="Name of a target in configs/designs, or path of a YAML file.")
    ] = "indoor",
    out: Out = Path("runs/design"),
    overwrite: Overwrite = False,
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="Change a setting of the target, e.g. --set speed=1.5. May be repeated."),
    ] = None,
) -> None:
    """Find the wheel radius and the trail that suit a target best, and how strong the motors must be."""
    with _plain_errors(NOTHING_WRITTEN):
        from .design import design as run
        from .design import read_design

        settings = read_design(target, robot, _parsed(change))
        with tqdm(total=100, desc=f"design of {settings.robot}", unit="%") as bar:

            def report(share: float) -> None:
                bar.update(round(100.0 * share) - bar.n)

            words = run(settings, out, overwrite, report)
        typer.echo(f"{words} The page, the picture, the table of motors and the robot file are in {out}.")


@app.command()
def identify(
    recording: Annotated[
        Path | None, typer.Argument(help="CSV file of a recording; --example shows the format.")
    ] = None,
    robot: Annotated[
        str, typer.Option(help="The robot as it is thought to be: its name, or path of a YAML file.")
    ] = "chung2008",
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            help="What to identify; may be repeated: payload_mass, payload_x, payload_y, payload_inertia, "
            "roll_viscous, roll_coulomb, steer_viscous, steer_coulomb, scrub, trail, radius, steering_zero, "
            "roll_strength, steer_strength (of all casters, or as radius_2 of one; radii, trails, steering_zeros of "
            "each), torque_delay, motor_lag, heading_zero, vx_bias, vy_bias, yaw_rate_bias. Without it: mass and place "
            "of a payload."
        ),
    ] = None,
    example: Annotated[Path | None, typer.Option(help="Write an example recording to this CSV file instead.")] = None,
    seed: Annotated[int, typer.Option(help="Seed of the example.", min=0, max=2**32 - 1)] = 0,
    out: Out = Path("runs/identify"),
    overwrite: Overwrite = False,
    change: Annotated[
        list[str] | None,
        typer.Option("--set", help="Change a setting, e.g. --set window=0.5 or --set 'noise={position: 0.001}'."),
    ] = None,
) -> None:
    """Payload, friction, wheels, motors and zeros of a robot from a recording, with intervals, and a robot file."""
    with _plain_errors(NOTHING_WRITTEN):
        from .identify import PAYLOAD, read_identify, write_example
        from .identify import identify as run

        if example is not None and recording is None:
            typer.echo(write_example(example, robot, seed, overwrite))
            return
        if recording is None or example is not None:
            raise ValueError("give either a recording, or --example with the file to write one to")
        settings = read_identify(robot, unknown or PAYLOAD, _parsed(change))
        with tqdm(desc="identify", unit="step") as bar:
            words = run(recording, settings, out, overwrite, bar.update)
        typer.echo(words)
        typer.echo(f"The page, the figure and robot.yaml are in {out}.")


@app.command()
def export(
    robot: Annotated[str, typer.Argument(help="Name of a robot, or path of its YAML file.")],
    mjcf: Annotated[Path, typer.Option(help="File for the robot as a MuJoCo model, such as robot.xml.")],
    time_step: Annotated[float, typer.Option(help="Of the model [s]; MuJoCo's slip falls in proportion to it.")] = 2e-3,
    friction: Annotated[
        float, typer.Option(help="Between wheels and floor; a great one comes nearest to rolling.")
    ] = 5.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace a file that is there.")] = False,
) -> None:
    """Write a robot as a model for MuJoCo (MJCF): bodies, joints, gears and motors, wheels that roll by friction."""
    with _plain_errors():
        from caster_gym.export.mjcf import mjcf as model
        from caster_gym.robot import load_robot

        text = model(load_robot(robot), time_step, friction)
        if mjcf.exists() and not overwrite:
            raise ValueError(f"{mjcf} is there already; choose another --mjcf, or --overwrite it")
        mjcf.write_text(text, encoding="utf-8")
        typer.echo(f"The model is in {mjcf}.")


def _parsed(changes: list[str] | None) -> dict[str, Any]:
    """Settings from KEY=VALUE, values read as YAML."""
    parsed = {}
    for change in changes or []:
        key, equals, value = change.partition("=")
        if not equals or not key:
            raise ValueError(f"--set needs KEY=VALUE, got {change!r}")
        parsed[key] = parse_yaml(value, f"--set {change}")
    return parsed


@contextmanager
def _plain_errors(interrupted: str = "what was finished is kept") -> Iterator[None]:
    """Errors of the user's making as one sentence, and a quiet end on Ctrl-C that says what is left."""
    try:
        yield
    except (ValueError, OSError, DependencyNotInstalled) as error:
        typer.echo(f"caster-gym: {error}", err=True)
        raise typer.Exit(2) from error
    except KeyboardInterrupt:
        typer.echo(f"caster-gym: interrupted; {interrupted}", err=True)
        raise typer.Exit(130) from None


if __name__ == "__main__":
    app()
