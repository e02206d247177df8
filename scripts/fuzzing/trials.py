"""Trials of mutated files in a process of their own: what became of each, how long it took, how much memory it needed.

Time is that of the processor, so that a busy machine does not count. A trial that does not end is ended by the process
that asked for it, which watches `Progress`.
"""

import os
import resource
import signal
import sys
import time
import warnings
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from multiprocessing.sharedctypes import Synchronized
from pathlib import Path
from random import Random
from tempfile import TemporaryDirectory
from typing import Any

SECONDS, MEGABYTES, LONGEST = 1.0, 200.0, 4000  # of a trial, beyond what the process holds; characters of a sentence
OBJECT, SENTENCE = "object", "sentence"
OTHER, UNCLEAR, RAN, SLOW, LARGE = "other exception", "unclear sentence", "code run", "above 1 s", "above 200 MB"
FAULTS = (OTHER, UNCLEAR, RAN, SLOW, LARGE)

_LINUX = sys.platform == "linux"
_GUARD = 2 << 30  # [bytes] of address space beyond what the process holds; more is refused by the system
_RUNS_CODE = frozenset((
    "exec", "os.system", "os.exec", "os.fork", "os.forkpty", "os.posix_spawn", "os.spawn", "os.startfile",
    "subprocess.Popen", "socket.connect", "socket.bind", "ctypes.dlopen", "pickle.find_class", "code.__new__",
    "marshal.loads", "os.remove", "os.rmdir", "os.chmod", "os.link", "os.symlink", "shutil.rmtree", "webbrowser.open",
))  # fmt: skip
_WRITES = os.O_WRONLY | os.O_RDWR | os.O_CREAT | os.O_TRUNC | os.O_APPEND


@dataclass
class Tally:
    """What became of some inputs."""

    counts: Counter[tuple[str, str]] = field(default_factory=Counter)  # by format and outcome
    slowest: tuple[float, str, int] = (0.0, "", -1)  # [s], format, input
    largest: tuple[float, str, int] = (0.0, "", -1)  # [MB], format, input
    faults: list[tuple[int, str, str, str]] = field(default_factory=list)  # input, format, outcome, words

    def add(self, other: "Tally") -> None:
        """Count those of another one too."""
        self.counts += other.counts
        self.slowest, self.largest = max(self.slowest, other.slowest), max(self.largest, other.largest)
        self.faults += other.faults


class Trials:
    """Inputs by their numbers, each made of the seed and its number alone, and tried one at a time."""

    def __init__(self, folder: Path) -> None:
        from scripts.fuzzing.formats import check_seeds, formats  # late: only processes that try need Torch

        self._folder = folder
        self._formats = formats(folder)
        for _ in range(2):  # imports and caches are complete then
            check_seeds(self._formats, folder)
        self._names, shares = list(self._formats), [one.share for one in self._formats.values()]
        self._shares, self._events = shares, Events()
        sys.addaudithook(self._events.hear)
        if _LINUX:
            limit = _status("VmSize") + _GUARD
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))

    def made(self, seed: int, number: int) -> tuple[str, bytes]:
        """The format and the content of an input."""
        rng = Random(f"{seed} {number}")
        name = rng.choices(self._names, self._shares)[0]
        one = self._formats[name]
        content = one.mutate(rng, rng.choice(one.seeds), one.seeds)
        return name, content

    def tried(self, seed: int, number: int, tally: Tally) -> None:
        """Count what becomes of an input."""
        name, content = self.made(seed, number)
        path = self._folder / self._formats[name].file
        path.write_bytes(content)
        before, start = _peak(anew=True), time.process_time()
        self._events.heard, self._events.listens = [], True
        outcome, words = outcome_of(self._formats[name].read, path)
        self._events.listens = False
        seconds, megabytes = time.process_time() - start, _peak() - before
        tally.slowest, tally.largest = (
            max(tally.slowest, (seconds, name, number)),
            max(tally.largest, (megabytes, name, number)),
        )
        faults = [(outcome, words)] if outcome in FAULTS else []
        faults += [(RAN, event) for event in self._events.heard[:1]]
        faults += [(SLOW, f"{seconds:.2f} s, {outcome}: {words[:200]}")] if seconds > SECONDS else []
        faults += [(LARGE, f"{megabytes:.0f} MB, {outcome}: {words[:200]}")] if megabytes > MEGABYTES else []
        for fault, told in faults:
            tally.faults.append((number, name, fault, told))
        tally.counts.update((name, fault) for fault, _ in faults or [(outcome, "")])


def outcome_of(read: Callable[[Path], object], path: Path) -> tuple[str, str]:
    """What becomes of a file, and the message."""
    try:
        read(path)
    except ValueError as error:
        words = str(error)
        clear = 0 < len(words) <= LONGEST and (path.suffix == ".txt" or path.stem in words or "policy" in words)
        return (SENTENCE if clear else UNCLEAR), f"{type(error).__name__}: {words[:LONGEST]}"
    except Exception as error:  # which is what is looked for
        return OTHER, f"{type(error).__name__}: {str(error)[:LONGEST]}"
    return OBJECT, ""


class Events:
    """What Python tells of code that is run and of files that are written."""

    def __init__(self) -> None:
        self.listens, self.heard = False, list[str]()

    def hear(self, event: str, arguments: tuple[Any, ...]) -> None:
        if self.listens and (event in _RUNS_CODE or (event == "open" and _is_written(arguments))):
            self.heard.append(f"{event} {arguments!r}"[:LONGEST])


def _is_written(arguments: tuple[Any, ...]) -> bool:
    return isinstance(arguments[2], int) and bool(arguments[2] & _WRITES)


def _peak(anew: bool = False) -> float:
    """Greatest memory that the process has held [MB]; anew: counted from now on, which returns what it holds now.

    On Linux alone; elsewhere 0.
    """
    if not _LINUX:
        return 0.0
    if anew:
        Path("/proc/self/clear_refs").write_text("5")
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0


def _status(name: str) -> int:
    """A size of this process [bytes]."""
    lines = Path("/proc/self/status").read_text().splitlines()
    return next(int(line.split()[1]) << 10 for line in lines if line.startswith(f"{name}:"))


def work(seed: int, number: "Synchronized[int]", asked: Connection) -> None:
    """Try ranges of inputs that are asked for until None is; number says which one is being tried, −1 none."""
    os.environ["OMP_NUM_THREADS"] = "1"
    warnings.simplefilter("ignore")
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # which is meant for the process that asks
    with TemporaryDirectory(dir=_memory()) as folder:
        trials = Trials(Path(folder))
        while (inputs := asked.recv()) is not None:
            tally = Tally()
            for one in inputs:
                number.value = one
                trials.tried(seed, one, tally)
            number.value = -1
            asked.send(tally)


def _memory() -> str | None:
    """A file system in memory, if there is one."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def by_format(counts: Mapping[tuple[str, str], int]) -> dict[str, Counter[str]]:
    """Counts of the outcomes of each format."""
    found: dict[str, Counter[str]] = {}
    for (name, outcome), count in sorted(counts.items()):
        found.setdefault(name, Counter())[outcome] += count
    return found
