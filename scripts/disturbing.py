"""Commands whose processes are killed, or whose writes fail, and what they leave compared byte by byte."""

import csv
import errno
import io
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import yaml

INTERVAL = 0.2  # [s] between two states
STUCK = 300.0  # [s] after which a process hangs
CLOCKS = ("seconds", "validation/seconds", "time/fps", "time/time_elapsed")  # columns that tell the time of day
DATED = (".png", ".svg", ".db", ".sqlite3")  # pictures and databases hold times
SOURCE = Path(__file__).with_name("failing_writes.c")
PATHS: dict[str, Any] = {"shape": "random_paths", "count": 3, "duration": 1.0, "max_speed": 0.3}
TASK = {
    "train": [{**PATHS, "seed": 0}],
    "validation": [{**PATHS, "seed": 1}],
    "test": [{**PATHS, "seed": 2}],
}
ARRAYS = {**TASK, "wrappers": [{"kind": "sensor_noise", "position": 0.001}], "shaping": [{"kind": "effort"}]}
COMMON = {"net_arch": [16], "validations": 8, "save_every": INTERVAL}
AGENTS: dict[str, dict[str, Any]] = {
    "ppo": {"algorithm": "ppo", "n_envs": 8, "n_steps": 64, "batch_size": 64, "n_timesteps": 20_000},
    "sac": {
        "algorithm": "sac",
        "n_envs": 8,
        "batch_size": 64,
        "buffer_size": 5000,
        "learning_starts": 500,
        "n_timesteps": 4_000,
    },
    "shac": {"algorithm": "shac", "n_envs": 8, "n_steps": 4, "batch_size": 32, "compile": False, "n_timesteps": 1_000},
}


class Work(NamedTuple):
    """A command, and how many seconds it takes undisturbed."""

    name: str
    arguments: tuple[str, ...]  # of caster-gym, without its folder
    seconds: float
    content: Mapping[str, bytes]  # of the files that it left


class Disturbance(NamedTuple):
    """How a process was disturbed, and how that ended."""

    work: str
    how: str  # "kill", "ENOSPC" or "EIO"
    lost: float  # [s] of work that was not in a saved state; of kills


def write_settings(folder: Path) -> dict[str, tuple[str, ...]]:
    """Files of a task, agents and a comparison; returns the commands by their names."""
    for name, content in (("task", ARRAYS), ("plain", TASK)):
        (folder / f"{name}.yaml").write_text(yaml.safe_dump(content), encoding="utf-8")
    for name, content in AGENTS.items():
        (folder / f"{name}.yaml").write_text(yaml.safe_dump({**content, **COMMON}), encoding="utf-8")
    comparison = {"task": "task.yaml", "agents": ["ppo.yaml", "computed_torque"], "seeds": [0, 1]}
    (folder / "comparison.yaml").write_text(yaml.safe_dump(comparison), encoding="utf-8")
    space = {"agent.gamma": {"low": 0.9, "high": 0.99}}
    search = {"task": "plain.yaml", "agent": "shac.yaml", "space": space, "trials": 3}
    (folder / "search.yaml").write_text(yaml.safe_dump(search), encoding="utf-8")
    return {
        "train ppo": ("train", "ppo.yaml", "--task", "task.yaml"),
        "train sac": ("train", "sac.yaml", "--task", "task.yaml"),
        "train shac": ("train", "shac.yaml", "--task", "plain.yaml"),
        "benchmark": ("benchmark", "--config", "comparison.yaml"),
        "sweep": ("sweep", "search.yaml"),
    }


def content_of(folder: Path) -> dict[str, bytes]:
    """The bytes of all files that a command left, but for columns that tell the time, and records of the command."""
    kept = {}
    for path in sorted(path for path in folder.rglob("*") if path.is_file()):
        name = str(path.relative_to(folder))
        if path.name in (".caster-gym", "run.yaml") or "tfevents" in name:
            continue
        kept[name] = without_clocks(path) if path.name in ("validation.csv", "progress.csv") else path.read_bytes()
    return {name: one for name, one in kept.items() if not name.endswith(DATED)}


def without_clocks(path: Path) -> bytes:
    """A CSV file without the columns that tell the time."""
    with path.open(newline="", encoding="utf-8") as file:
        rows = [[cell for name, cell in row.items() if name not in CLOCKS] for row in csv.DictReader(file)]
    text = io.StringIO()
    csv.writer(text).writerows(rows)
    return text.getvalue().encode()


def start(arguments: Sequence[str], folder: Path, extra: Mapping[str, str] | None = None) -> "subprocess.Popen[bytes]":
    """A process of caster-gym in a session of its own, which goes on in a folder `run`."""
    environment = {**os.environ, "OMP_NUM_THREADS": "1", **(extra or {})}
    command = [sys.executable, "-m", "caster_gym", *arguments, "--out", "run", "--resume"]
    with (folder / "output.txt").open("ab") as output:
        return subprocess.Popen(
            command, cwd=folder, env=environment, stdout=output, stderr=output, start_new_session=True
        )


def run_undisturbed(name: str, arguments: tuple[str, ...], folder: Path) -> Work:
    """What a command leaves that nobody disturbs."""
    begun = time.monotonic()
    if start(arguments, folder).wait(STUCK):
        raise RuntimeError(f"{name} fails undisturbed: {(folder / 'output.txt').read_text(encoding='utf-8')}")
    work = Work(name, arguments, time.monotonic() - begun, content_of(folder / "run"))
    shutil.rmtree(folder / "run")
    return work


def newest_state(folder: Path) -> float | None:
    """When the last state was saved, by the clock of files."""
    times = [path.stat().st_mtime for path in folder.rglob("state.safetensors") if path.exists()]
    return max(times, default=None)


def kill(work: Work, folder: Path, wait: float) -> Disturbance | None:
    """Start a process and end it after some seconds by SIGKILL; None if it was done before."""
    process, begun = start(work.arguments, folder), time.time()
    try:
        process.wait(wait)
    except subprocess.TimeoutExpired:
        os.kill(process.pid, signal.SIGKILL)  # and not its children, which must end by themselves
        process.wait()
        saved = newest_state(folder / "run")
        await_end(process.pid)
        return Disturbance(work.name, "kill", time.time() - max(begun, saved or 0.0))
    check(work, process.returncode, folder)
    return None


def await_end(session: int) -> None:
    """Wait until no process of a session is left. Raises RuntimeError for orphans that go on."""
    end = time.monotonic() + 20.0
    while left := processes_of(session):
        if time.monotonic() > end:
            raise RuntimeError(f"a killed process left running children: {' '.join(left)}")
        time.sleep(0.05)


def processes_of(session: int) -> list[str]:
    """Numbers of the processes of a session that run."""
    return subprocess.run(["pgrep", "-s", str(session)], capture_output=True, text=True, check=False).stdout.split()


def fail_a_write(work: Work, folder: Path, library: Path, number: int, error: int) -> Disturbance | None:
    """Run a process of which one operation on its folder fails; None if it was done before that."""
    report = folder / "failed"
    report.unlink(missing_ok=True)
    process = start(
        work.arguments,
        folder,
        {
            "LD_PRELOAD": str(library),
            "PLUG_FOLDER": str(folder / "run"),
            "PLUG_NUMBER": str(number),
            "PLUG_ERROR": str(error),
            "PLUG_REPORT": str(report),
        },
    )
    code = outcome(work, process)
    await_end(process.pid)
    if report.exists():
        return Disturbance(work.name, errno.errorcode[error], 0.0)
    check(work, code, folder)
    return None


def outcome(work: Work, process: "subprocess.Popen[bytes]") -> int:
    """The exit code of a process. Raises RuntimeError for one that hangs, and ends it."""
    try:
        return process.wait(STUCK)
    except subprocess.TimeoutExpired as error:
        os.killpg(process.pid, signal.SIGKILL)
        raise RuntimeError(f"{work.name} hangs: it has not ended within {STUCK:g} s") from error


def check(work: Work, code: int, folder: Path) -> None:
    """Raise RuntimeError for a process that failed though nobody disturbed it."""
    if code:
        raise RuntimeError(
            f"{work.name} fails after a disturbance: {(folder / 'output.txt').read_text('utf-8')[-2000:]}"
        )


def differing(work: Work, folder: Path) -> list[str]:
    """Files that are not, byte by byte, those of an undisturbed process."""
    found = content_of(folder / "run")
    return [name for name in {**work.content, **found} if work.content.get(name) != found.get(name)]


def disturb(work: Work, folder: Path, library: Path | None, generator: random.Random) -> list[Disturbance]:
    """Disturb a command until it is done."""
    met: list[Disturbance] = []
    while True:
        if library is not None and generator.random() < 0.3:
            error = generator.choice((errno.ENOSPC, errno.EIO))
            one = fail_a_write(work, folder, library, int(10 ** generator.uniform(0.0, 2.7)), error)
        else:
            one = kill(work, folder, generator.uniform(0.3, 1.0) * work.seconds)
        if one is None:
            return met
        met.append(one)


def build_library(folder: Path) -> Path | None:
    """The library that lets writes fail, where there is a C compiler and a loader that takes it."""
    compiler = shutil.which("cc")
    if compiler is None or sys.platform != "linux":
        return None
    library = folder / "failing_writes.so"
    subprocess.run([compiler, "-O1", "-shared", "-fPIC", "-o", library, SOURCE, "-ldl"], check=True)
    return library
