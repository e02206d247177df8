"""Compilation is announced when it starts, done by one process for all others, and kept on disk.

Numba asks the cache of a function for each specialisation, that is, for each set of argument types. What is not there
will be compiled now: this is the only moment at which an announcement is sure to be true.
"""

import hashlib
import multiprocessing
import pickle
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

from numba.core import compiler, event, serialize
from numba.core.caching import _Cache

from caster_gym.engines.cache_folders import say, say_once
from caster_gym.engines.native import compiled_files
from caster_gym.engines.native.outside_sources import outside_digest
from caster_gym.engines.native.turns import Turn, take_turn

_dumps: Any = serialize.dumps  # Numba ships these without types
_register: Any = event.register
_CompileResult: Any = compiler.CompileResult


class Work(NamedTuple):
    """What is compiled, in words that follow "compiling for", and how long that usually takes."""

    what: str
    seconds: float  # on one core of a current server


Describe = Callable[[tuple[Any, ...]], Work]  # from the types of a function's arguments

_included = False  # in an announcement that has been made
_count = 0  # of specialisations that this process has begun to compile


def compilations() -> int:
    """How many specialisations this process has compiled, or begun to."""
    return _count


@contextmanager
def included() -> Iterator[None]:
    """What is compiled inside belongs to what has just been announced."""
    global _included
    before, _included = _included, True
    try:
        yield
    finally:
        _included = before


class SharedCache(_Cache):
    """Keeps the specialisations of one function for all environments with the same version of everything.

    describe: says what is about to be compiled; None for a function that only others call while they are compiled.
    """

    def __init__(self, function: Callable[..., Any], describe: Describe | None) -> None:
        self._function, self._describe = function, describe
        self._name = f"{function.__module__}.{function.__qualname__}"
        self._source = hashlib.sha256(_source(function)).hexdigest()
        self._enabled = True
        self._turn: Turn | None = None

    @property
    def cache_path(self) -> str:
        """Folder of this version; empty if there is none."""
        return str(compiled_files.version_folder() or "")

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The specialisation as it was kept, or None: then Numba compiles it as soon as this returns."""
        global _count
        target_context.refresh()
        if not self._enabled:
            return None
        key = self._key(sig, target_context.codegen())
        found = self._load(key, target_context) if key else None
        if found is not None or self._describe is None:
            return found
        work = self._describe(sig if isinstance(sig, tuple) else sig.args)

        def on_waiting() -> None:
            if multiprocessing.parent_process() is None:  # workers share a terminal with whoever compiles
                say(f"another process is compiling for {work.what}, waiting for it")

        self._end_turn()
        folder = compiled_files.version_folder()
        if key and folder is not None:
            self._turn = take_turn(folder / f"{_file_name(self._function, key)}.turn", on_waiting)
            found = self._load(key, target_context)  # which another process may just have kept
        if found is not None:
            self._end_turn()
            return found
        _count += 1
        if not _included:
            say(f"compiling for {work.what}, about {_rounded(work.seconds)} s, once on this machine")
        return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep what has just been compiled."""
        try:
            if self._enabled and not data.library.has_dynamic_globals:
                key = self._key(sig, data.codegen)
                if key:
                    compiled_files.keep(_file_name(self._function, key), _dumps((key, data._reduce())))
        except OSError as error:
            advice = "set NUMBA_CACHE_DIR to a folder that can be written, and where others cannot write"
            say_once(f"what was compiled cannot be kept ({error}): {advice}", "cannot be kept")
        finally:
            self._end_turn()

    def enable(self) -> None:
        """Read from and write to disk."""
        self._enabled = True

    def disable(self) -> None:
        """Leave the disk alone."""
        self._enabled = False

    def flush(self) -> None:
        """Forget nothing: other environments may need it."""

    def on_failure(self, function: Callable[..., Any]) -> None:
        """Compiling was interrupted: let other processes try."""
        if function is self._function:
            self._end_turn()

    def _load(self, key: str, target_context: Any) -> Any:
        name = _file_name(self._function, key)
        content = compiled_files.read(name)
        if content is None:
            return None
        try:
            kept, parts = pickle.loads(content)
            if kept == key:
                return _CompileResult._rebuild(target_context, *parts)
        except Exception:  # whatever is wrong with what another process has left, compiling anew mends it
            pass
        compiled_files.remove(name)
        return None

    def _key(self, sig: Any, codegen: Any) -> str:
        """All that a specialisation depends on, beside the version: its types, sources from outside, the processor.

        Empty where it cannot be kept.
        """
        outside = outside_digest(sig if isinstance(sig, tuple) else sig.args)
        if outside is None:
            return ""
        return repr((self._name, self._source, str(sig), *([outside] if outside else []), codegen.magic_tuple()))

    def _end_turn(self) -> None:
        if self._turn is not None:
            self._turn.end()
            self._turn = None


class _Failures(event.Listener):
    """Tells caches of compilations that have failed or were interrupted, of which Numba does not tell them."""

    def __init__(self) -> None:
        self.caches: list[SharedCache] = []

    def on_start(self, event: Any) -> None:
        """Nothing to do."""

    def on_end(self, event: Any) -> None:
        """End turns of what is not compiled after all. (The event tells so itself, but `is_failed` is inverted.)"""
        dispatcher = event.data["dispatcher"]
        if tuple(event.data["args"]) not in dispatcher.overloads:
            for cache in self.caches:
                cache.on_failure(dispatcher.py_func)


_failures = _Failures()
_register("numba:compile", _failures)


def share(dispatcher: Any, function: Callable[..., Any], describe: Describe | None) -> None:
    """Give a function that Numba compiles a cache that environments share."""
    dispatcher._cache = SharedCache(function, describe)
    _failures.caches.append(dispatcher._cache)


def _source(function: Callable[..., Any]) -> bytes:
    """The file that a function stands in, or its code where there are no files."""
    try:
        return Path(function.__code__.co_filename).read_bytes()
    except OSError:
        return function.__code__.co_code


def _file_name(function: Callable[..., Any], key: str) -> str:
    return f"{function.__qualname__.strip('_')}-{hashlib.sha256(key.encode()).hexdigest()[:24]}.nbc"


def _rounded(seconds: float) -> int:
    return round(seconds) if seconds < 5.0 else 5 * round(seconds / 5.0)
