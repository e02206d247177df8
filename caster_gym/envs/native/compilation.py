"""Compilation in words: what is compiled for a task, how long it takes, and why it cannot be."""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

from numba.core.errors import NumbaError

from caster_gym.brief import cut
from caster_gym.engines.native.compilation import Work
from caster_gym.envs.native.reference import code_of, task_code
from caster_gym.own_errors import OwnCodeError


def of_restart(types: tuple[Any, ...]) -> Work:
    """A task as a whole: with the start of an episode, its step is compiled too."""
    world, sizes = types[2], types[6]
    return Work(_words(world, sizes, ""), _seconds(world, sizes, 1.0))


def of_single_step(types: tuple[Any, ...]) -> Work:
    """The step of a robot alone."""
    world, _, _, sizes = types[0].field_dict["content"].types
    return Work(_words(world, sizes, ", one robot"), _seconds(world, sizes, 0.8))


def of_batch_step(types: tuple[Any, ...]) -> Work:
    """The step of a batch."""
    world, sizes = types[2], types[5]
    return Work(_words(world, sizes, ", batches"), _seconds(world, sizes, 0.9))


def _words(world: Any, sizes: Any, how: str) -> str:
    task = code_of(_part(world, "source")).name
    around = " among obstacles" if _among_obstacles(world) else ""
    nearest = _count(sizes, "nearest")
    seen = f", {_several(nearest, 'observed obstacle')}" if nearest else ""
    around += " on a floor of finite friction" if _count(sizes, "slipping") else ""
    previewed = _several(_count(sizes, "preview"), "previewed point")
    return f"{_count(sizes, 'casters')} casters ({task}{around}, {previewed}{seen}{how})"


def _several(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _seconds(world: Any, sizes: Any, share: float) -> float:
    """A rule for what was measured with 2 to 4 casters."""
    slips = 2.0 if _count(sizes, "slipping") else 1.0
    return share * slips * (1.6 if _among_obstacles(world) else 1.0) * (10.0 + 4.0 * _count(sizes, "casters"))


def _among_obstacles(world: Any) -> bool:
    return hasattr(_part(world, "obstacles"), "types")  # else it is None


def _part(named: Any, field: str) -> Any:
    """Type of a field of a named tuple, from the compiler's type of the tuple."""
    return named.types[named.fields.index(field)]


def _count(named: Any, field: str) -> int:
    return len(_part(named, field))


@contextmanager
def told_plainly(source: Any) -> Iterator[None]:
    """What Numba says of code that it cannot compile, in one sentence. Raises OwnCodeError.

    source: the reference source of the task.
    """
    try:
        yield
    except NumbaError as error:
        name = task_code(type(source)).name
        raise OwnCodeError(f"the code of {name} cannot be compiled: {_innermost(str(error))}") from error


def _innermost(said: str) -> str:
    """The innermost of Numba's reasons, which it tells first, with its file and line."""
    before, *place = _FILE.split(said, maxsplit=1)
    reason = " ".join(_REASON.split(before)[-1].split())
    return cut(reason, 300) + (f" ({place[0]}, line {place[1]})" if place else "")


_FILE = re.compile(r'^ *File "([^"]+)", line (\d+):', re.M)
_REASON = re.compile(r"\(step: [^)]*\)|specific error:")
