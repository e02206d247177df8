"""Options that the commands share, settings of the form KEY=VALUE, and errors as one sentence."""

import os
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, Literal, NoReturn

import typer
from gymnasium.error import DependencyNotInstalled
from tqdm import tqdm

from caster_gym.brief import brief, cut
from caster_gym.configuration import parse_yaml
from caster_gym.engines.native.cores import learning_threads
from caster_gym.processes import exit_code, interruptible

NOTHING_WRITTEN = "nothing was written"
PARTS_BAR = "{desc}: {n_fmt}/{total_fmt} parts |{bar:24}| {elapsed}{postfix}"
MOST_THREADS = 1024  # far more make systems refuse memory that is there
OF_SCALE = ("optuna", "ray")  # packages of that extra
LONGEST_MESSAGE = 1000  # characters
DEFAULT_THREADS = learning_threads()


def _folder(name: str | Path) -> Path:
    if not str(name):  # which Path would take for the working folder
        raise typer.BadParameter("a folder needs a name, got ''; the working folder is called .")
    return Path(name)


Out = Annotated[
    Path,
    typer.Option(help="Folder for the results. It must be empty or not exist yet.", parser=_folder, metavar="PATH"),
]
Overwrite = Annotated[
    bool, typer.Option("--overwrite", help="Delete results in that folder first; refused if it holds other files.")
]
Resume = Annotated[
    bool,
    typer.Option("--resume", help="Go on in that folder, wherever it was stopped; begin if it is empty."),
]
Changes = Annotated[
    list[str] | None,
    typer.Option(
        "--set", help="Change a setting of the learned agents, e.g. --set n_timesteps=100000. May be repeated."
    ),
]
TaskName = Annotated[str, typer.Option(help="Name of a task in configs/tasks, or path of a YAML file.")]
TrainedTask = Annotated[
    str | None,
    typer.Option(
        help="Name of a task in configs/tasks, or path of a YAML file. Default: the task that the policy was "
        "trained on, or track."
    ),
]
WhichWorkers = Annotated[
    Literal["local", "ray"],
    typer.Option(
        "--workers",
        help="local: processes on this machine. ray: tasks on a Ray cluster, that of RAY_ADDRESS, or a new one on this "
        "machine; the folder must lie where all machines of the cluster see it.",
    ),
]
Threads = Annotated[
    int,
    typer.Option(
        min=1,
        max=MOST_THREADS,
        help="Threads per process, for networks and simulation. Results depend on this number. "
        "OMP_NUM_THREADS sets the default.",
    ),
]


def changes_of(options: list[str] | None) -> dict[str, Any]:
    """Settings from KEY=VALUE, values read as YAML."""
    parsed: dict[str, Any] = {}
    for option in options or []:
        key, equals, value = option.partition("=")
        if not equals or not key:
            raise ValueError(f"--set needs KEY=VALUE, got {brief(option)}")
        parsed[key] = parse_yaml(value, f"--set {cut(option)}")
        _check_colons(parsed[key], option)
    return parsed


def _check_colons(value: object, option: str) -> None:
    """Refuse a mapping such as {radius:0.02}, which YAML takes for a key without a value."""
    for key, inner in value.items() if isinstance(value, Mapping) else ():
        if inner is None and isinstance(key, str) and ":" in key:
            name, _, rest = key.partition(":")
            raise ValueError(f"--set {cut(option)}: a colon needs a space after it, as in '{name}: {rest}'")
        _check_colons(inner, option)


def files_among(*names: object) -> tuple[Path, ...]:
    """Those of the names of settings that may be names of files; a robot that stands in the settings has none."""
    return tuple(Path(name) for name in names if isinstance(name, str | Path))


@contextmanager
def progress(**options: Any) -> Iterator[Callable[..., None]]:
    """show(done, words) for a bar that appears when there is something to show, and not above a refusal.

    Into a file or a pipe nothing is written.
    """
    bars: list[tqdm[Any]] = []

    def show(done: int, words: str = "") -> None:
        if not bars:
            bars.append(tqdm(**options, disable=None))
        bars[0].update(done - bars[0].n)
        bars[0].set_postfix_str(words)

    try:
        yield show
    finally:
        for bar in bars:
            bar.close()


@contextmanager
def plain_errors(interrupted: str = "what was finished is kept") -> Iterator[None]:
    """Errors of the user's making as one sentence, and a quiet end on Ctrl-C or SIGTERM that says what is left."""
    try:
        with interruptible():
            yield
    except OSError as error:
        if error.filename and error.strerror:  # else the message is a sentence already
            refuse(f"{os.fsdecode(error.filename)}: {error.strerror.lower()}", error)
        refuse(str(error), error)
    except (ValueError, DependencyNotInstalled) as error:
        refuse(str(error), error)
    except MemoryError as error:
        refuse(f"there is not enough memory for this: {error or 'fewer robots or smaller batches need less'}", error)
    except RuntimeError as error:
        if "allocate" not in str(error):  # as Torch complains, with the place in its sources
            raise
        refuse("there is not enough memory for this: fewer robots, smaller batches or networks need less", error)
    except ModuleNotFoundError as error:
        if (error.name or "").startswith("caster_gym"):
            raise
        extra = "scale" if error.name in OF_SCALE else "train"
        refuse(f"this needs the Python package {error.name!r}: pip install 'caster_gym[{extra}]'", error)
    except KeyboardInterrupt as error:
        typer.echo(f"caster-gym: interrupted; {interrupted}", err=True)
        raise typer.Exit(exit_code(error)) from None


def refuse(message: str, error: BaseException) -> NoReturn:
    """End with a message on one line, and exit code 2."""
    line = " ".join(message.split())
    typer.echo(f"caster-gym: {line if len(line) <= LONGEST_MESSAGE else line[: LONGEST_MESSAGE - 1] + '…'}", err=True)
    raise typer.Exit(2) from error
