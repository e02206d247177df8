"""Announcements of compilation: what is compiled for a task, and how long it takes."""

from typing import Any

from caster_gym.engines.native.compilation import Work
from caster_gym.envs.native.reference import code_of


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
