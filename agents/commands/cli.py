"""The command caster-gym: train, evaluate, benchmark, sweep, watch, design, identify, export, warm."""

from itertools import count
from pathlib import Path
from typing import Annotated

import typer

import caster_gym
from caster_gym.agents.commands.command_line import (
    DEFAULT_THREADS,
    NOTHING_WRITTEN,
    PARTS_BAR,
    Changes,
    Out,
    Overwrite,
    Resume,
    TaskName,
    Threads,
    TrainedTask,
    WhichWorkers,
    changes_of,
    files_among,
    plain_errors,
    progress,
)
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.registry import read_agent
from caster_gym.durable_files import write_file
from caster_gym.report.run_folder import begun, check_file
from caster_gym.shipped_files import read_settings

AGENTS_THERE = "Folder of a trained policy, name of a model-based agent, or YAML file of your own controller"
GO_ON = "what was finished is kept; --resume goes on from the last saved state"
MJCF_SUFFIXES = (".xml", ".mjcf")

app = typer.Typer(
    no_args_is_help=True,
    rich_markup_mode=None,  # it takes a unit such as [s] for markup, and leaves it out
    context_settings={"help_option_names": ["-h", "--help"], "max_content_width": 120},
    help="Train, evaluate and compare controllers of omnidirectional robots on powered casters.",
)


def _show_version(wanted: bool) -> None:
    if wanted:
        typer.echo(f"caster_gym {caster_gym.__version__}")
        raise typer.Exit


@app.callback()
def every_command(
    version: Annotated[
        bool, typer.Option("--version", callback=_show_version, is_eager=True, help="Show the version and exit.")
    ] = False,
) -> None:
    """Train, evaluate and compare controllers of omnidirectional robots on powered casters."""


@app.command()
def train(
    agent: Annotated[str, typer.Argument(help="Name of an agent in configs/agents, or path of a YAML file.")] = "ppo",
    task: TaskName = "track",
    seed: Annotated[int, typer.Option(help="Seed of networks, exploration and starts.", min=0, max=2**32 - 1)] = 0,
    out: Out = Path("runs/train"),
    overwrite: Overwrite = False,
    resume: Resume = False,
    change: Changes = None,
    threads: Threads = DEFAULT_THREADS,
) -> None:
    """Train a policy. Save the one that is best on the validation paths in OUT/best, for `evaluate` and `watch`."""
    with plain_errors(GO_ON):
        from caster_gym.agents.comparison.metrics import in_words
        from caster_gym.agents.learning.training import FILES, WORTH_KEEPING
        from caster_gym.agents.learning.training import train as run

        settings = read_agent(agent, changes_of(change))
        if not isinstance(settings, LearnerSettings):
            raise ValueError(f"agent {agent!r} does not learn; try it with `caster-gym evaluate {agent}`")
        tasks = read_settings(TaskSettings, "tasks", task)
        kept = files_among(agent, task, tasks.robot)
        bar = {
            "total": settings.n_timesteps,
            "desc": f"{Path(agent).stem} seed {seed}",
            "unit": "step",
            "unit_scale": True,
        }
        with begun(out, overwrite, WORTH_KEEPING, kept, FILES, resume), progress(**bar) as show:

            def report(steps: int, verdict: str) -> None:
                show(min(steps, settings.n_timesteps), verdict)

            best = run(tasks, settings, seed, out, report, threads, resume)
        typer.echo(
            f"Best on validation paths after {best.steps} steps and {best.seconds:.0f} s: {in_words(best.verdict)}. "
            f"It is in {out / 'best'}."
        )


@app.command()
def evaluate(
    policy: Annotated[str, typer.Argument(help=f"{AGENTS_THERE}.")],
    task: TrainedTask = None,
    starts: Annotated[int, typer.Option(help="Episodes on each test path.", min=1)] = 1,
    out: Out = Path("runs/evaluate"),
    overwrite: Overwrite = False,
    threads: Threads = DEFAULT_THREADS,
) -> None:
    """Evaluate an agent on the test paths of a task. Write a table, all episodes as CSV, and figures."""
    with plain_errors():
        from caster_gym.agents.commands.evaluate import evaluate as run

        text = run(policy, task, starts, out, overwrite, threads)
        typer.echo(text)
        typer.echo(f"Results and figures are in {out}.")


@app.command()
def benchmark(
    config: Annotated[str, typer.Option(help="Name of a comparison in configs/benchmarks, or a YAML file.")] = "track",
    out: Out = Path("runs/benchmark"),
    overwrite: Overwrite = False,
    resume: Resume = False,
    change: Changes = None,
    threads: Threads = DEFAULT_THREADS,
    workers: WhichWorkers = "local",
) -> None:
    """Train the learned agents and compare all agents on the same held-out paths, in a table and in figures."""
    with plain_errors(GO_ON):
        from caster_gym.agents.commands.benchmark import (
            FILES,
            WORTH_KEEPING,
            BenchmarkSettings,
            read_comparison,
            run_benchmark,
        )
        from caster_gym.agents.workers.opening import open_workers

        settings = read_settings(BenchmarkSettings, "benchmarks", config)
        comparison = read_comparison(settings, changes_of(change))
        named = files_among(config, settings.task, comparison.task.robot, *(one.agent for one in settings.entrants))
        at_work = open_workers(workers, threads, comparison.jobs)
        with begun(out, overwrite, WORTH_KEEPING, named, FILES, resume):
            text = run_benchmark(comparison, out, threads, resume, at_work)
        typer.echo(text)
        typer.echo(f"Results, policies and figures are in {out}.")


@app.command()
def sweep(
    config: Annotated[str, typer.Argument(help="Name of a search in configs/sweeps, or path of a YAML file.")],
    out: Out = Path("runs/sweep"),
    overwrite: Overwrite = False,
    resume: Resume = False,
    change: Changes = None,
    threads: Threads = DEFAULT_THREADS,
    workers: WhichWorkers = "local",
) -> None:
    """Search settings of an agent or a task: many trainings, of which later ones learn from earlier ones.

    Writes a table of all trials, what mattered, and OUT/best.yaml, which `train` reads. Stopped at any time, it goes on
    by --resume.
    """
    with plain_errors("what was finished is kept; --resume goes on"):
        from caster_gym.agents.sweep.settings import SweepSettings, read_sweep
        from caster_gym.agents.sweep.sweeping import FILES, WORTH_KEEPING, run_sweep
        from caster_gym.agents.workers.opening import open_workers

        settings = read_settings(SweepSettings, "sweeps", config)
        searched = read_sweep(settings, changes_of(change))
        robot = searched.candidate({}).task.robot
        named = files_among(config, settings.task, settings.agent, robot)
        at_work = open_workers(workers, threads, min(settings.at_once, settings.trials))
        with begun(out, overwrite, WORTH_KEEPING, named, FILES, resume):
            text = run_sweep(searched, out, at_work, threads, resume)
        typer.echo(text)
        typer.echo(f"Results and policies are in {out}; `caster-gym train {out / 'best.yaml'}` trains the best again.")


@app.command()
def watch(
    agent: Annotated[
        str,
        typer.Argument(
            help=f"{AGENTS_THERE}, or `keyboard`: drive with W, A, S, D or the arrow keys, turn with Q and E."
        ),
    ] = "computed_torque",
    task: TrainedTask = None,
    path: Annotated[
        str, typer.Option(help="Name or index of a test path; with several robots, of the first robot's path.")
    ] = "0",
    robots: Annotated[int, typer.Option(help="Number of robots, each on its own test path.", min=1, max=16)] = 1,
    seed: Annotated[int, typer.Option(help="Seed of the starts.", min=0, max=2**32 - 1)] = 0,
    save: Annotated[
        Path | None,
        typer.Option(help="Write a video, such as run.mp4 or run.gif, instead of opening a window."),
    ] = None,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing video.")] = False,
    seconds: Annotated[float | None, typer.Option(help="Stop after this time [s].")] = None,
) -> None:
    """Show an agent on the test paths of a task, in a window or a video, or drive the robot yourself."""
    with plain_errors():
        from caster_gym.agents.commands.selection import choose_task
        from caster_gym.agents.commands.watch import watch as run
        from caster_gym.engines.tensor.threads import DEFAULT, limit_threads

        settings, words = choose_task(agent, task)
        with limit_threads(DEFAULT):
            frames = run(agent, settings, path, robots, seed, save, overwrite, seconds, begin=lambda: typer.echo(words))
        if save is not None:
            typer.echo(f"{frames} frames are in {save}.")


@app.command()
def design(
    robot: Annotated[
        str | None,
        typer.Option(help="Name of a robot in configs/robots, or path of a YAML file. Default: the target's robot."),
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
    """Find the wheel radius and the trail that suit a target best, and the motors that it needs."""
    with plain_errors(NOTHING_WRITTEN):
        from caster_gym.design import design as run
        from caster_gym.design import read_design

        settings = read_design(target, robot, changes_of(change))
        with progress(total=100, desc=f"design of {Path(settings.robot).stem}", unit="%") as show:
            words = run(settings, out, overwrite, lambda share: show(round(100.0 * share)))
        typer.echo(f"{words} The page, the picture, the table of motors and the robot file are in {out}.")


@app.command()
def identify(
    recording: Annotated[
        Path | None, typer.Argument(help="CSV file with a recording; --example writes one that shows the format.")
    ] = None,
    robot: Annotated[
        str, typer.Option(help="The robot as described so far: a name, or path of a YAML file.")
    ] = "chung2008",
    unknown: Annotated[
        list[str] | None,
        typer.Option(
            help="Quantity to identify; may be repeated: payload_mass, payload_x, payload_y, payload_inertia, "
            "roll_viscous, roll_coulomb, steer_viscous, steer_coulomb, scrub, trail, radius, steering_zero, "
            "roll_strength, steer_strength (for all casters; radius_2 for one; radii, trails, steering_zeros for "
            "each), torque_delay, motor_lag, heading_zero, vx_bias, vy_bias, yaw_rate_bias. Default: mass and "
            "position of a payload."
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
    """Estimate payload, friction, wheels, motors and sensor zeros of a robot from a recording, with intervals."""
    with plain_errors(NOTHING_WRITTEN):
        from caster_gym.identification import PAYLOAD, identify_file, read_identify, write_example

        if example is not None and recording is None:
            typer.echo(write_example(example, robot, seed, overwrite))
            return
        if recording is None or example is not None:
            raise ValueError("give either a recording, or --example with the file to write one to")
        settings = read_identify(robot, unknown or PAYLOAD, changes_of(change))
        step = count(1)
        with progress(desc="identify", unit="step") as show:
            words = identify_file(recording, settings, out, overwrite, lambda: show(next(step)))
        typer.echo(words)
        typer.echo(f"The page, the figure and robot.yaml are in {out}.")


@app.command()
def export(
    robot: Annotated[str, typer.Argument(help="Name of a robot, or path of its YAML file.")],
    mjcf: Annotated[Path, typer.Option(help="File for the robot as a MuJoCo model, such as robot.xml.")],
    time_step: Annotated[
        float, typer.Option(help="Time step of the model [s]; the slip of its wheels is proportional to it.")
    ] = 2e-3,
    friction: Annotated[
        float,
        typer.Option(help="Coefficient of friction between wheels and floor [-]; high values come closest to rolling."),
    ] = 5.0,
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace an existing file.")] = False,
) -> None:
    """Write a robot as a MuJoCo model (MJCF): bodies, joints, gears, motors, and wheels that roll by friction."""
    with plain_errors():
        from caster_gym.export.mjcf import mjcf as model
        from caster_gym.robot import load_robot

        if mjcf.suffix.lower() not in MJCF_SUFFIXES:
            better = f"{mjcf.stem.strip('.') or 'robot'}.xml"
            raise ValueError(f"what is written is MJCF, for MuJoCo, got the name {mjcf.name!r}; call it {better!r}")
        text = model(load_robot(robot), time_step, friction)
        check_file(mjcf, overwrite, "--mjcf")
        write_file(mjcf, text)
        typer.echo(f"The model is in {mjcf}.")


@app.command()
def warm(
    robot: Annotated[
        list[str] | None, typer.Option(help="Name of a robot, or path of a YAML file; may be repeated.")
    ] = None,
    task: Annotated[
        list[str] | None, typer.Option(help="Name of a task, or path of a YAML file; may be repeated.")
    ] = None,
    casters: Annotated[
        list[int] | None, typer.Option(help="Number of casters of another robot; may be repeated.")
    ] = None,
) -> None:
    """Compile the code for robots and tasks ahead of time; by default for all that come with the package."""
    with plain_errors("what was compiled is kept; the same command goes on from there"):
        from caster_gym.agents.commands.warm import read_pieces
        from caster_gym.agents.commands.warm import warm as run

        pieces = read_pieces(robot or [], task or [], casters or [])
        with progress(total=len(pieces), desc="warm", bar_format=PARTS_BAR) as show:
            result = run(pieces, show)
        there = result.pieces - result.compiled
        typer.echo(f"{result.compiled} parts were compiled, {there} were there already; all are in {result.folder}.")


if __name__ == "__main__":
    app(prog_name="caster-gym")
