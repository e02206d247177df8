"""Workers on a cluster: calls as Ray tasks, which other machines take up when one is lost or falls silent.

All machines need the same packages, and see the folders that calls are told of under the same names. Ray learns of a
machine that is frozen minutes later, if at all: each call gives a sign of life every few seconds, and one that has
given none for a while is begun on another machine. Whoever wakes up then learns that it no longer counts, and ends.
"""

import logging
import os
import pickle
import signal
import sys
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import suppress
from types import TracebackType
from typing import Any, NamedTuple, Self

import ray
from ray import cloudpickle
from ray.exceptions import RayError, RayTaskError
from ray.util.scheduling_strategies import NodeAffinitySchedulingStrategy

from caster_gym.agents.workers.calls import ATTEMPTS, Call, Finished, Reported, Workers, lost, named, portable
from caster_gym.durable_files import FolderInUseError

BEAT = 2.0  # [s] between signs of life
SILENT = 60.0  # [s] without one, usually
LOCKED = 180.0  # [s] that storage may take to release what a lost machine had locked
LOOK = 0.5  # [s] between looks at what is reported


class _Running(NamedTuple):
    task: Any  # Ray's reference to what it will return
    number: int
    attempt: int


class RayWorkers(Workers):
    """Tasks on the cluster of RAY_ADDRESS, on one that runs on this machine, or on a new one there.

    threads: cores that each call is given. places: calls that are given to Ray at a time; it runs as many of them as
    the cluster has cores. silent: [s] without a sign of life, after which a call is begun elsewhere.
    """

    def __init__(self, threads: int, places: int, silent: float = SILENT) -> None:
        self.places = places
        self._silent = silent
        self._threads = threads
        self._calls: list[Call] = []
        self._waiting: deque[tuple[int, int]] = deque()  # numbers and attempts
        self._running: dict[int, _Running] = {}  # by number
        self._avoided: set[str] = set()  # machines that fell silent
        self._signs: Any = None
        self._work: Any = ray.remote(_work)

    def __enter__(self) -> Self:
        os.environ.setdefault("RAY_USAGE_STATS_ENABLED", "0")
        self._begun = not ray.is_initialized()
        if self._begun:
            _join()
        here = NodeAffinitySchedulingStrategy(ray.get_runtime_context().get_node_id(), soft=False)
        self._signs = ray.remote(_Signs).options(num_cpus=0, scheduling_strategy=here).remote(self._silent)
        return self

    def submit(self, call: Call) -> int:
        """Add a call."""
        self._calls.append(call)
        self._waiting.append((len(self._calls) - 1, 1))
        return len(self._calls) - 1

    def events(self) -> Iterator[Reported | Finished]:
        """Give calls to Ray and hear of them, until all are finished."""
        while self._waiting or self._running:
            while self._waiting and len(self._running) < self.places:
                self._begin(*self._waiting.popleft())
            tasks = {one.task: one for one in self._running.values()}
            done, _ = ray.wait(list(tasks), num_returns=len(tasks), timeout=LOOK)
            reports, silent = ray.get(self._signs.take.remote())
            yield from (Reported(*report) for report in reports)
            for task in done:
                yield from self._end(tasks[task])
            for number, machine in silent:
                if number in self._running:
                    self._avoided.add(machine)
                    ray.cancel(self._running[number].task, force=True)
                    self._begin_again(self._running[number], f"nothing was heard for {self._silent:g} s")

    def _begin(self, number: int, attempt: int) -> None:
        call = self._calls[number]
        ray.get(self._signs.expect.remote(number, attempt))
        work = cloudpickle.dumps(call.work(attempt))  # functions of a script by their code
        task = self._work.options(
            name=call.name, num_cpus=self._threads, max_retries=0, scheduling_strategy=self._elsewhere()
        )
        reference = task.remote(work, [*sys.path], [*sys.argv], self._signs, number, attempt)
        self._running[number] = _Running(reference, number, attempt)

    def _elsewhere(self) -> Any:
        """Where to begin a call: anywhere, unless some machine fell silent that Ray still counts on."""
        nodes = [one for one in ray.nodes() if one["Alive"]]
        others = [one for one in nodes if one["NodeID"] not in self._avoided and one["Resources"].get("CPU", 0.0)]
        if len(nodes) == len(others) or not others or not any(one["NodeID"] in self._avoided for one in nodes):
            return "DEFAULT"
        return NodeAffinitySchedulingStrategy(others[len(self._running) % len(others)]["NodeID"], soft=False)

    def _end(self, ended: _Running) -> Iterator[Finished]:
        """The end of a task: its result, its error, or one more attempt where its process or its machine was lost."""
        try:
            kind, content = pickle.loads(ray.get(ended.task))
        except RayTaskError as error:  # before the call, as where a machine lacks a package
            raise lost(self._calls[ended.number], str(error.cause)) from error
        except RayError as error:
            self._begin_again(ended, type(error).__name__)
            return
        del self._running[ended.number]
        if kind == "failed":
            raise named(content, self._calls[ended.number].name)
        yield Finished(ended.number, content)

    def _begin_again(self, ended: _Running, why: str) -> None:
        del self._running[ended.number]
        if ended.attempt >= ATTEMPTS:
            raise lost(self._calls[ended.number], why)
        self._waiting.appendleft((ended.number, ended.attempt + 1))

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            tasks = [one.task for one in self._running.values()]
            if tasks:
                for task in tasks:
                    ray.cancel(task)  # raises KeyboardInterrupt there
                ray.wait(tasks, num_returns=len(tasks))
        finally:
            if self._begun:
                ray.shutdown()
            elif self._signs is not None:
                ray.kill(self._signs)


def _join() -> None:
    """Join a cluster, or start one; SIGTERM does what it did before, whereas Ray would end the process at once."""
    before = signal.getsignal(signal.SIGTERM)
    try:
        ray.init(log_to_driver=False, logging_level=logging.ERROR, include_dashboard=False)
    except ConnectionError as error:
        raise ConnectionError(
            f"no Ray cluster could be joined at {os.environ.get('RAY_ADDRESS', 'this machine')}: "
            "docs/scaling.md tells how to start one; RAY_ADDRESS names its address; if it asks for a token, set "
            "RAY_AUTH_MODE=token"
        ) from error
    finally:
        if threading.current_thread() is threading.main_thread():
            signal.signal(signal.SIGTERM, before)


class _Signs:
    """What is heard of calls; it lives on the machine of whoever has submitted them."""

    def __init__(self, silent: float) -> None:
        self._silent = silent
        self._reports: list[tuple[int, Any]] = []
        self._attempts: dict[int, int] = {}  # that is expected, by the numbers of calls
        self._heard: dict[int, tuple[float, str]] = {}  # when the last sign was given, and on which machine

    def expect(self, number: int, attempt: int) -> None:
        """Another attempt is the one that counts."""
        self._attempts[number] = attempt
        self._heard.pop(number, None)

    def hear(self, number: int, attempt: int, machine: str, reports: list[Any]) -> bool:
        """Take a sign of life and reports; returns whether that attempt still counts."""
        if self._attempts.get(number) != attempt:
            return False
        self._heard[number] = time.monotonic(), machine
        self._reports += [(number, one) for one in reports]
        return True

    def take(self) -> tuple[list[tuple[int, Any]], list[tuple[int, str]]]:
        """Reports since the last time, and the calls that fell silent, with their machines."""
        reports, self._reports = self._reports, []
        now = time.monotonic()
        silent = [(number, machine) for number, (when, machine) in self._heard.items() if now - when > self._silent]
        for number, _ in silent:
            del self._heard[number]
        return reports, silent


def _work(work: bytes, paths: list[str], arguments: list[str], signs: Any, number: int, attempt: int) -> bytes:
    """A call in a process of the cluster, with the modules and the command line of whoever has submitted it."""
    sys.path += [path for path in paths if path not in sys.path]
    sys.argv = arguments
    ended = threading.Event()
    machine = ray.get_runtime_context().get_node_id()
    reports: deque[Any] = deque()

    def tell() -> None:
        heard = [reports.popleft() for _ in range(len(reports))]
        if not ray.get(signs.hear.remote(number, attempt, machine, heard)):
            os._exit(1)  # another attempt counts; what was saved is what it goes on from

    def beat() -> None:
        with suppress(RayError):
            while not ended.wait(BEAT):
                tell()

    tell()
    threading.Thread(target=beat, daemon=True).start()
    try:
        function, given = pickle.loads(work)
        answer = "finished", _when_unlocked(function, given, reports.append, LOCKED if attempt > 1 else 0.0)
    except Exception as error:
        answer = "failed", portable(error)
    finally:
        ended.set()
    tell()
    return pickle.dumps(answer)


def _when_unlocked(function: Any, given: tuple[Any, ...], report: Any, patience: float) -> Any:
    """Call something as soon as the folder that it uses is no longer locked by who was lost."""
    end = time.monotonic() + patience
    while True:
        try:
            return function(*given, report)
        except FolderInUseError:
            if time.monotonic() >= end:
                raise
        time.sleep(LOOK)
