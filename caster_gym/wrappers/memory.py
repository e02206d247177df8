"""What a feature at work remembers: arrays, numbers and generators among its attributes, and in collections of them."""

from collections import deque
from collections.abc import Collection, Mapping
from enum import Enum
from typing import Any

import numpy as np
from gymnasium.spaces import Space
from numpy.typing import NDArray
from pydantic import BaseModel

from caster_gym.states import AnyState, State, check_state, generator_words, make_generator, without

_NOTHING = np.zeros(0, dtype=np.bool_)  # for None, and for a collection without items
_CONSTANT = (str, bytes, BaseModel, Space, Enum, slice, frozenset)  # as frozen dataclasses, and what can be called
_COLLECTIONS = (list, dict, deque)  # that grow and shrink
_NUMBERS = np.ndarray | np.generic | bool | int | float


def read_memory(owner: str, attributes: Mapping[str, Any], constants: Collection[str]) -> State:
    """Copies of what changes among attributes, apart from constants, by names such as "last" or "queue/0".

    Raises TypeError for what may change and is nothing of these; owner: whose attributes they are, in the message.
    """
    state: State = {}
    for name, value in attributes.items():
        if name not in constants:
            _add(state, name, value, owner)
    return state


def check_memory(owner: str, attributes: Mapping[str, Any], constants: Collection[str], state: AnyState) -> None:
    """Raise ValueError unless a state fits attributes: None may become an array, collections may grow and shrink."""
    now = read_memory(owner, attributes, constants)
    flexible = {name for name, value in attributes.items() if value is None or isinstance(value, _COLLECTIONS)}
    expected = {name: array for name, array in now.items() if name.partition("/")[0] not in flexible}
    gone = {name for name in expected if name in state and _is_nothing(np.asarray(state[name]))}
    here = expected.keys() & state.keys()
    check_state(owner, {name: state[name] for name in here - gone}, without(expected, *gone))


def set_memory(attributes: dict[str, Any], constants: Collection[str], state: AnyState) -> None:
    """Give attributes what `read_memory` read. Arrays are written into, so that whoever shares them sees it."""
    tree = _tree(state)
    for name in tree.keys() - set(constants):
        attributes[name] = _restored(attributes.get(name), tree[name])


def _add(state: State, name: str, value: Any, owner: str) -> None:
    items = _items(value)
    if value is None or (items is not None and not items):
        state[name] = _NOTHING.copy()
    elif items is not None:
        for key, one in items.items():
            if not isinstance(key, str) or "/" in key:
                raise TypeError(f"{owner} keeps {name!r} with the key {key!r}; a key must be a text without '/'")
            _add(state, f"{name}/{key}", one, owner)
    elif isinstance(value, _NUMBERS) and np.asarray(value).dtype.kind in "biufc":
        state[name] = np.array(value)
    elif isinstance(value, np.random.Generator):
        state[name] = generator_words(value)
    elif not _never_changes(value):
        raise TypeError(
            f"{owner} keeps {name!r}, a {type(value).__name__}, whose state cannot be saved: keep arrays, numbers or "
            "collections of them, name it in 'constants' if it never changes, or write get_state, check_state and "
            "set_state"
        )


def _items(value: Any) -> Mapping[Any, Any] | None:
    """What a collection holds, by its place; None for what is no collection."""
    if isinstance(value, list | tuple | deque):
        return {str(i): one for i, one in enumerate(value)}
    return value if isinstance(value, dict) else None


def _never_changes(value: Any) -> bool:
    if isinstance(value, _CONSTANT) or callable(value):
        return True
    parameters = getattr(type(value), "__dataclass_params__", None)
    return parameters is not None and bool(parameters.frozen)


def _tree(state: AnyState) -> dict[str, Any]:
    """Arrays by name, those of collections in dictionaries."""
    tree: dict[str, Any] = {}
    for name, array in state.items():
        *outer, last = name.split("/")
        branch = tree
        for part in outer:
            branch = branch.setdefault(part, {})
        branch[last] = array
    return tree


def _restored(old: Any, saved: Any) -> Any:
    """What stood where `old` stands, from an array or, of a collection, from a tree of them."""
    if isinstance(saved, np.ndarray):
        return _restored_leaf(old, saved)
    before = _items(old) or {}
    kept = {key: one for key, one in before.items() if _never_changes(one)}
    fresh = kept | {key: _restored(before.get(key), one) for key, one in saved.items()}
    if isinstance(old, dict):
        old.clear()
        old.update(fresh)
        return old
    ordered = [fresh[key] for key in sorted(fresh, key=int)]
    if isinstance(old, tuple):
        return type(old)(*ordered) if hasattr(old, "_fields") else tuple(ordered)
    old.clear()
    old.extend(ordered)
    return old


def _restored_leaf(old: Any, saved: NDArray[Any]) -> Any:
    if isinstance(old, np.random.Generator):
        return make_generator(saved)
    if isinstance(old, np.ndarray) and (old.shape, old.dtype) == (saved.shape, saved.dtype):
        if not old.flags.writeable:
            return saved.copy()
        old[...] = saved
        return old
    if _is_nothing(saved):
        return old.clear() or old if isinstance(old, _COLLECTIONS) else None
    if isinstance(old, np.generic):
        return saved[()]
    return saved.copy() if saved.ndim else saved.item()


def _is_nothing(array: NDArray[Any]) -> bool:
    return array.dtype == np.bool_ and array.shape == (0,)
