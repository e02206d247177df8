"""Workers on this machine: processes that end with the one that has started them, however that ends."""

import multiprocessing
import signal
import threading
from collections import Counter, deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from multiprocessing.connection import Connection, wait
from multiprocessing.process import BaseProcess
from types import TracebackType
from typing import Any, Literal, NamedTuple, TypeAlias

from caster_gym.agents.workers.calls import ATTEMPTS, Call, Finished, Reported, Workers, lost, named, portable
from caster_gym.processes import end_with_parent

Message: TypeAlias = tuple[Literal["reported", "finished", "failed"], Any]


class _Worker(NamedTuple):
    process: BaseProcess
    connection: "Connection[Any, Message]"


class LocalWorkers(Workers):
    """A process for each place, started when it is needed, which then works off one call after the other."""

    def __init__(self, places: int) -> None:
        self.places = places
        self._context = multiprocessing.get_context("spawn")
        self._calls: list[Call] = []
        self._waiting: deque[int] = deque()
        self._attempts: Counter[int] = Counter()
        self._idle: list[_Worker] = []
        self._busy: dict[Any, tuple[_Worker, int]] = {}  # by connection

    def submit(self, call: Call) -> int:
        """Add a call."""
        self._calls.append(call)
        self._waiting.append(len(self._calls) - 1)
        return self._waiting[-1]

    def events(self) -> Iterator[Reported | Finished]:
        """Give calls to processes and hear of them, until all are finished."""
        while self._waiting or self._busy:
            while self._waiting and len(self._busy) < self.places:
                self._begin(self._waiting.popleft())
            for connection in wait(list(self._busy)):
                worker, number = self._busy[connection]
                try:
                    kind, content = worker.connection.recv()
                except (EOFError, OSError):
                    self._begin_again(number, worker)
                    continue
                if kind == "reported":
                    yield Reported(number, content)
                    continue
                del self._busy[connection]
                self._idle.append(worker)
                if kind == "failed":
                    raise named(content, self._calls[number].name)
                yield Finished(number, content)

    def _begin(self, number: int) -> None:
        self._attempts[number] += 1
        while True:
            worker = self._idle.pop() if self._idle else self._start()
            try:
                worker.connection.send(self._calls[number].work(self._attempts[number]))
            except OSError:  # somebody has killed it while it had nothing to do
                worker.process.join()
                continue
            self._busy[worker.connection] = worker, number
            return

    def _begin_again(self, number: int, worker: _Worker) -> None:
        """Another process takes up the call of one that was killed, be it for want of memory."""
        del self._busy[worker.connection]
        worker.process.join()
        if self._attempts[number] >= ATTEMPTS:
            raise lost(self._calls[number], f"the last one with exit code {worker.process.exitcode}")
        self._waiting.appendleft(number)

    def _start(self) -> _Worker:
        here, there = self._context.Pipe()
        process = self._context.Process(target=_work, args=(there,))
        with _without_interrupts():
            process.start()
        there.close()
        return _Worker(process, here)

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        workers = [*self._idle, *(worker for worker, _ in self._busy.values())]
        try:
            for worker in workers:
                if error is None:
                    worker.connection.close()
                else:
                    worker.process.terminate()
            for worker in workers:
                worker.process.join()
        except BaseException:  # interrupted once more: whoever waited has had enough
            for worker in workers:
                worker.process.kill()
            raise
        finally:
            for worker in workers:
                worker.connection.close()


@contextmanager
def _without_interrupts() -> Iterator[None]:
    """Processes that are started here never see Ctrl-C, which a terminal sends to all: their parent tells them.

    The one that starts them sees it afterwards.
    """
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _work(connection: "Connection[Message, Any]") -> None:
    """What a worker process does until its parent has no more calls, interrupts it, or is gone."""
    end_with_parent()
    interrupted = threading.Event()

    def interrupt(number: int, frame: object) -> None:
        """What Ctrl-C would do, once."""
        interrupted.set()
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise KeyboardInterrupt

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, interrupt)
    with suppress(EOFError, OSError, KeyboardInterrupt):
        while not interrupted.is_set():  # a call may make something else of the interrupt, such as a full disk's error
            function, arguments = connection.recv()
            try:
                answer: Message = (
                    "finished",
                    function(*arguments, lambda content: connection.send(("reported", content))),
                )
            except Exception as error:
                answer = "failed", portable(error)
            connection.send(answer)
