"""Checks of what users give to an environment: counts, seeds, actions and the options of a reset.

Whatever cannot be used is refused with a sentence before anything has changed.
"""

import reprlib
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.arena.arena import Arena
from caster_gym.configuration import ConfigurationError, did_you_mean
from caster_gym.robot import Robot


class UnexpectedKeywordError(ConfigurationError, TypeError):
    """A keyword that a constructor does not know: a TypeError as Python's own, and a setting that does not exist."""


RobotLike: TypeAlias = str | Path | Robot | Mapping[str, Any]
ArenaLike: TypeAlias = str | Path | Mapping[str, Any] | Arena | None
Actuation: TypeAlias = str | list[str] | tuple[str, ...] | None
Seeds: TypeAlias = int | Sequence[int | None] | NDArray[np.integer] | None

FLOAT32 = np.dtype(np.float32)
_REAL = "fiu"  # kinds of NumPy types: floating, signed and unsigned
_OTHERS = {"c": "complex numbers", "b": "true or false", "U": "words", "S": "words"}


def check_counts(num_envs: Any, max_episode_steps: Any = None) -> None:
    """Refuse batches without robots, episodes without steps, and parts of either."""
    _check_count("num_envs", num_envs)
    if max_episode_steps is not None:
        _check_count("max_episode_steps", max_episode_steps)


def _check_count(name: str, count: Any) -> None:
    if not _is_whole(count):
        raise ValueError(f"{name} must be a whole number, got {count!r}")
    if count < 1:
        raise ValueError(f"{name} must be 1 or more, got {count}")


def check_keywords(given: Iterable[str], known: Iterable[str], owner: str, usual: Mapping[str, str]) -> None:
    """Refuse keywords that a constructor does not know, in Python's words and with the nearest one that it does.

    usual: as `Frozen.usual_names`, what other libraries call its keywords.
    """
    names = sorted(known)
    if unknown := [name for name in given if name not in names]:
        told = "; ".join(
            f"unexpected keyword argument {name!r}; {did_you_mean(name, names, usual)}" for name in unknown
        )
        raise UnexpectedKeywordError(f"{owner} got an {told}")


def checked_seed(seed: Any) -> int | None:
    """A seed as Python's own whole number, or None."""
    if seed is None:
        return None
    if not _is_whole(seed) or seed < 0:
        raise ValueError(f"a seed must be None or a whole number of 0 or more, got {seed!r}")
    return int(seed)


def checked_seeds(seed: Any, count: int) -> list[int | None]:
    """One seed a robot: seed + i from one number, those of a list, or none."""
    if seed is None:
        return [None] * count
    if not isinstance(seed, Iterable):
        first = checked_seed(seed)
        return [None if first is None else first + i for i in range(count)]
    if isinstance(seed, np.ndarray) and seed.ndim == 1:
        seed = seed.tolist()
    if not isinstance(seed, Sequence) or isinstance(seed, str | bytes):
        raise ValueError(f"seed must be None, a whole number or a list of {count} of these, got {seed!r}")
    if len(seed) != count:
        raise ValueError(f"seed must be one number or {count} of them, got {len(seed)}")
    return [checked_seed(one) for one in seed]


def read_actions(actions: Any, shape: tuple[int, ...] | None, name: str = "actions") -> NDArray[np.float32]:
    """Actions in the one memory layout that compiled code is made for; numbers that are not finite stay what they are.

    Any other layout, read-only arrays for instance, would be compiled for anew. Raises ValueError for another shape and
    for what are no real numbers.
    """
    if type(actions) is np.ndarray and actions.dtype is FLOAT32 and actions.flags.carray and actions.shape == shape:
        return actions
    try:
        given = np.asarray(actions)
    except (ValueError, TypeError) as error:
        raise ValueError(f"{name} must be an array of shape {shape}: {error}") from error
    if given.shape != shape:
        raise ValueError(f"{name} must have shape {shape}, got {given.shape}")
    if given.dtype.kind not in _REAL:
        raise ValueError(f"{name} must hold real numbers, got {_OTHERS.get(given.dtype.kind, 'other objects')}")
    with np.errstate(over="ignore"):  # too large a number is clipped, as infinity is
        return np.array(given, dtype=np.float32, order="C")


def checked_options(
    options: Any, known: Iterable[str], elsewhere: Mapping[str, str] = MappingProxyType({})
) -> Mapping[str, Any]:
    """The options of a reset. Raises ValueError for unknown ones.

    elsewhere: options that other environments know, and what takes their place, in words.
    """
    if options is None:
        return {}
    if not isinstance(options, Mapping):
        raise ValueError(f"options must be None or a mapping of names to values, got {options!r}")
    for name in options:
        if name not in known:
            hint = did_you_mean(name, [*known, *elsewhere])
            hint = next((words for other, words in elsewhere.items() if repr(other) in hint), did_you_mean(name, known))
            raise ValueError(f"reset knows no option {name!r}; {hint}")
    return options


def checked_mask(mask: Any, count: int) -> NDArray[np.bool_]:
    """Which robots of a batch a reset starts anew, as an array of its own."""
    if not isinstance(mask, np.ndarray) or mask.dtype != np.bool_ or mask.shape != (count,) or not mask.any():
        raise ValueError(
            f"options['reset_mask'] must be a boolean array of shape ({count},) with at least one True, got {mask!r}"
        )
    return mask.copy()


def checked_numbers(name: str, value: Any, count: int, width: int | None, meaning: str) -> NDArray[np.float64]:
    """Numbers (count, width), or (count,) without a width, from one entry for all robots or one for each."""
    tail = () if width is None else (width,)
    try:
        given = np.asarray(value)
    except (ValueError, TypeError):
        given = np.empty(0, dtype=object)
    if given.dtype.kind not in _REAL or given.shape not in (tail, (count, *tail)):
        one = "a real number" if width is None else f"{width} real numbers"
        each = f", or an array {(count, *tail)} of these" if count > 1 else ""
        raise ValueError(f"options[{name!r}] must be {meaning}: {one}{each}; got {reprlib.repr(value)}")
    return np.broadcast_to(given.astype(np.float64), (count, *tail)).copy()


def _is_whole(number: Any) -> bool:
    return isinstance(number, int | np.integer) and not isinstance(number, bool)
