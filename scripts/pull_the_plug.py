"""Kills trainings and goes on with them: python -m scripts.pull_the_plug --kills 100 --out docs/resuming

Real processes of `caster-gym train`, `benchmark` and `sweep` are ended by SIGKILL, or one of their writes fails, with a
full disk (ENOSPC) or a broken one (EIO), until they are done. What they leave is compared byte by byte with what an
undisturbed process left.
"""

import argparse
import csv
import errno
import io
import os
import random
import shutil
import signal
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any, NamedTuple

import yaml
from tqdm import tqdm

from caster_gym.durable_files import write_file
from caster_gym.engines.native.cores import usable_cores
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table

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
    code = process.wait(STUCK)
    await_end(process.pid)
    if report.exists():
        return Disturbance(work.name, errno.errorcode[error], 0.0)
    check(work, code, folder)
    return None


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


class Tally:
    """What several threads have met so far."""

    def __init__(self, bar: "tqdm[Any]") -> None:
        self.met: list[Disturbance] = []
        self.different: list[str] = []
        self.runs = 0
        self.stopped = False
        self._bar, self._lock = bar, threading.Lock()

    def add(self, met: Sequence[Disturbance], different: Sequence[str]) -> None:
        """Count a run that was disturbed until it was done."""
        with self._lock:
            self.met += met
            self.different += different
            self.runs += 1
            self._bar.update(self.kills - self._bar.n)

    @property
    def kills(self) -> int:
        """How many processes were killed."""
        return sum(one.how == "kill" for one in self.met)


def pull(kills: int, seed: int, names: Sequence[str] | None = None) -> Tally:
    """Disturb all commands in turns, one on each core, until there were so many kills."""
    with tempfile.TemporaryDirectory() as place, tqdm(total=kills, desc="kills", disable=None) as bar:
        tally = Tally(bar)
        library = build_library(Path(place))
        folders = [Path(place) / str(number) for number in range(usable_cores())]
        for folder in folders:
            folder.mkdir()
            commands = write_settings(folder)
        chosen = list(names or commands)
        works = [run_undisturbed(name, commands[name], folders[0]) for name in chosen]

        def disturb_in_turns(number: int) -> None:
            generator, turn = random.Random(f"{seed} {number}"), number
            while tally.kills < kills and not tally.stopped:
                work = works[turn % len(works)]
                met = disturb(work, folders[number], library, generator)
                tally.add(met, [f"{work.name}: {name}" for name in differing(work, folders[number])])
                shutil.rmtree(folders[number] / "run")
                turn += 1

        with ThreadPoolExecutor(len(folders)) as threads:
            try:
                list(threads.map(disturb_in_turns, range(len(folders))))
            except KeyboardInterrupt:  # what was seen so far is reported, once the present runs are done
                tally.stopped = True
        return tally


def page(met: Sequence[Disturbance], different: Sequence[str], runs: int, command: str) -> str:
    """What happened, as a page."""
    rows = [
        (
            work,
            *(sum(one.work == work and one.how == how for one in met) for how in ("kill", "ENOSPC", "EIO")),
            max((one.lost for one in met if one.work == work), default=0.0),
        )
        for work in dict.fromkeys(one.work for one in met)
    ]
    kills = sum(one.how == "kill" for one in met)
    return "\n\n".join(
        [
            "# Processes that were killed",
            f"{runs} runs were disturbed until they were done: {kills} times by SIGKILL and {len(met) - kills} "
            "times by a write that failed, at random instants, also while the process started. Files that differ from "
            f"those of an undisturbed run: {len(different)}.",
            markdown_table(("command", "kills", "ENOSPC", "EIO", "longest work lost [s]"), rows),
            f"A state was saved every {INTERVAL} s. Work lost is the time from the last state that was saved, or from "
            "the start of the process if it has saved none, to the kill: it includes the start of the process, and the "
            "round of collecting and learning at whose end the next state would have been saved.",
            f"Made by `{command}` with {versions_in_words('numpy', 'torch', 'stable-baselines3')}.\n",
        ]
    )


def main(arguments: Sequence[str] | None = None) -> None:
    """Command line."""
    parser = argparse.ArgumentParser(description="Kill trainings at random instants, go on with them, compare.")
    parser.add_argument("--kills", type=int, default=100)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--only", nargs="+", help="commands to disturb, such as 'train ppo'")
    parser.add_argument("--out", type=Path, help="folder for kills.md")
    options = parser.parse_args(arguments)
    tally = pull(options.kills, options.seed, options.only)
    different = tally.different
    text = page(tally.met, different, tally.runs, command_line("scripts.pull_the_plug", arguments))
    print(text)
    if different:
        sys.exit("\n".join(["these files differ:", *different]))
    if options.out:
        options.out.mkdir(parents=True, exist_ok=True)
        write_file(options.out / "kills.md", text)


if __name__ == "__main__":
    main()
