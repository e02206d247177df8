"""Mutated files of every format, read one after another: `python -m scripts.fuzz_files --inputs 1000000 --seed 0`.

Each must become an object or one sentence, within a second and 200 MB, and none may run code. An input follows from the
seed and its number. A run that was interrupted goes on with --resume; --first 123 --inputs 1 tries a single one again,
and --show prints it. Linux alone tells how much memory was needed.
"""

import argparse
import json
import multiprocessing
import sys
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from multiprocessing.connection import Connection, wait
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tqdm import tqdm

from caster_gym.durable_files import write_file
from scripts.fuzzing.page import page
from scripts.fuzzing.trials import SLOW, Tally, Trials, work

CHUNK = 500  # inputs that a process is asked for at a time
PATIENCE = 120.0  # [s] after which a process that is still busy with one input is ended; the machine may be busy too


class _Worker:
    """A process that tries inputs, and the inputs that it was asked for."""

    def __init__(self, seed: int) -> None:
        context = multiprocessing.get_context("spawn")
        self._seed, self.number = seed, context.Value("q", -1)
        self.asked: Connection
        self.asked, theirs = context.Pipe()
        self._process = context.Process(target=work, args=(seed, self.number, theirs), daemon=True)
        self._process.start()
        theirs.close()
        self.inputs = range(0)
        self._seen, self._since = -1, time.monotonic()

    def ask(self, inputs: range) -> None:
        """Have inputs tried; the answer is a Tally."""
        self.inputs = inputs
        self._since = time.monotonic()
        self.asked.send(inputs)

    def stuck_at(self) -> int | None:
        """The input at which the process has been for too long, or at which it died."""
        now = int(self.number.value)
        if now != self._seen:
            self._seen, self._since = now, time.monotonic()
        if now >= 0 and (not self._process.is_alive() or time.monotonic() - self._since > PATIENCE):
            return now
        return None

    def end(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()


def tallies(seed: int, chunks: list[range], workers: int) -> Iterator[tuple[range, Tally]]:
    """What became of the inputs of each chunk, in the order in which they are ready.

    An input at which a process dies or stays counts as too slow; its chunk goes on behind it.
    """
    waiting, busy = list(reversed(chunks)), [_Worker(seed) for _ in range(min(workers, len(chunks)))]
    try:
        for worker in busy:
            worker.ask(waiting.pop())
        while busy:
            ready = wait([worker.asked for worker in busy], timeout=1.0)
            for worker in list(busy):
                stuck = worker.stuck_at()
                if worker.asked in ready:
                    try:
                        yield worker.inputs, worker.asked.recv()
                    except EOFError:
                        stuck = max(worker.number.value, worker.inputs.start)
                    else:
                        if waiting:
                            worker.ask(waiting.pop())
                        else:
                            busy.remove(worker)
                            worker.end()
                        continue
                if stuck is not None:
                    busy.remove(worker)
                    worker.end()
                    lost = Tally(Counter({("a process that died or stayed", SLOW): 1}))
                    lost.faults.append((stuck, "?", SLOW, "its process died or did not go on"))
                    yield range(stuck, stuck + 1), lost
                    rest = (range(worker.inputs.start, stuck), range(stuck + 1, worker.inputs.stop))
                    waiting += [one for one in rest if one]
                    if waiting:
                        busy.append(_Worker(seed))
                        busy[-1].ask(waiting.pop())
    finally:
        for worker in busy:
            worker.end()


class _State:
    """What is known of a run so far, in a file: chunks that are done, and what became of them."""

    def __init__(self, path: Path, resumed: bool) -> None:
        self._path, self.done = path, set[tuple[int, int]]()
        self.total, self.seconds = Tally(), 0.0
        if resumed and path.exists():
            kept = json.loads(path.read_text(encoding="utf-8"))
            self.done = {(one[0], one[1]) for one in kept["done"]}
            self.total = Tally(
                Counter({(one[0], one[1]): one[2] for one in kept["counts"]}),
                tuple(kept["slowest"]),
                tuple(kept["largest"]),
                [tuple(one) for one in kept["faults"]],
            )
            self.seconds = kept["seconds"]

    def keep(self, seconds: float) -> None:
        """Write all that is known."""
        kept: dict[str, Any] = {
            "done": sorted(self.done),
            "counts": [(*key, count) for key, count in self.total.counts.items()],
            "slowest": self.total.slowest,
            "largest": self.total.largest,
            "faults": self.total.faults,
            "seconds": self.seconds + seconds,
        }
        self._path.parent.mkdir(parents=True, exist_ok=True)
        write_file(self._path, json.dumps(kept))


def main() -> None:
    """Try all inputs, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--inputs", type=int, default=1_000_000)
    parser.add_argument("--first", type=int, default=0, help="number of the first input")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=multiprocessing.cpu_count())
    parser.add_argument("--resume", action="store_true", help="go on with what --state holds")
    parser.add_argument("--state", type=Path, default=Path("runs/fuzzing.json"), help="file of what is done")
    parser.add_argument("--show", action="store_true", help="print the first input and end")
    parser.add_argument("--out", type=Path, help="page to write, as docs/fuzzing.md")
    given = parser.parse_args()
    if given.show:
        with TemporaryDirectory() as folder:
            name, content = Trials(Path(folder)).made(given.seed, given.first)
        sys.stdout.buffer.write(f"{name}\n".encode() + content)
        return
    state, start = _State(given.state, given.resume), time.monotonic()
    starts = range(given.first, given.first + given.inputs, CHUNK)
    chunks = [range(one, min(one + CHUNK, given.first + given.inputs)) for one in starts]
    chunks = [one for one in chunks if (one.start, one.stop) not in state.done]
    with suppress(KeyboardInterrupt), tqdm(total=given.inputs, disable=None, unit="files") as bar:
        bar.update(given.inputs - sum(map(len, chunks)))
        kept = start
        for chunk, tally in tallies(given.seed, chunks, given.workers):
            state.total.add(tally)
            state.done.add((chunk.start, chunk.stop))
            bar.update(len(chunk))
            if time.monotonic() - kept > 10.0:
                kept = time.monotonic()
                state.keep(kept - start)
    state.keep(time.monotonic() - start)
    for number, name, fault, words in sorted(state.total.faults)[:100]:
        print(f"{number} {name}: {fault}: {' '.join(words.split())[:300]}")
    faults = len(state.total.faults)
    tried = sum(state.total.counts.values())
    print(f"{tried} inputs, {faults} faults" + ("" if tried >= given.inputs else "; --resume goes on"))
    if given.out:
        text = page(state.total, given.seed, state.seconds + time.monotonic() - start, given.workers)
        given.out.write_text(text, encoding="utf-8")
    sys.exit(faults > 0)


if __name__ == "__main__":
    main()
