"""What an environment holds at a moment, as a flat dictionary of arrays that any format can store, without pickle.

Names have parts, as "engine/clocks". What is not there at the moment is an empty array, texts are arrays of bytes, and
random generators and whole numbers of any size are arrays of 64-bit words.
"""

import json
from collections.abc import Collection, Mapping, Sequence
from hashlib import blake2b
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Flags, Seeds

State: TypeAlias = dict[str, NDArray[Any]]
AnyState: TypeAlias = Mapping[str, NDArray[Any]]

_LONGEST = 60  # characters of a value in a message
_SEED_WORDS = 4  # 256 bits with a sign; a seed that NumPy draws by itself has 128
_GENERATOR = "PCG64"  # which all of Gymnasium's are
_ALL_BITS = 2**64 - 1


def join_states(**parts: AnyState) -> State:
    """The states of parts as one, with the part's name before each name."""
    return {f"{part}/{name}": array for part, state in parts.items() for name, array in state.items()}


def part_of(state: AnyState, part: str) -> State:
    """The state of one part."""
    return {name.removeprefix(f"{part}/"): array for name, array in state.items() if name.startswith(f"{part}/")}


def without(state: AnyState, *parts: str) -> State:
    """The state without that of some parts."""
    return {name: array for name, array in state.items() if name.partition("/")[0] not in parts}


def check_state(owner: str, state: AnyState, expected: AnyState, optional: Collection[str] = ()) -> None:
    """Raise ValueError unless a state has the names, shapes and types of the expected one; optional ones may be empty.

    owner: what they belong to, in the message.
    """
    for name in sorted(state.keys() | expected.keys()):
        if name not in state:
            raise ValueError(f"the state of {owner} lacks {name!r}, {_shape(expected[name])}")
        if name not in expected:
            raise ValueError(f"the state of {owner} holds {name!r}, which {owner} has not")
        given, wanted = np.asarray(state[name]), np.asarray(expected[name])
        fits = given.shape == wanted.shape or (name in optional and given.size == 0)
        if given.dtype != wanted.dtype or not fits:
            raise ValueError(f"{name!r} in the state of {owner} must be {_shape(wanted)}, got {_shape(given)}")


def describe(facts: Mapping[str, Any]) -> NDArray[np.uint8]:
    """Plain facts about an environment as a text; of objects among them, the names of their classes."""
    return text_array(json.dumps(facts, default=lambda it: type(it).__name__))


def check_description(state: AnyState, expected: NDArray[np.uint8]) -> None:
    """Raise ValueError unless a state was taken from an environment that is described as expected."""
    if "made_of" not in state:
        raise ValueError("this is no state of such an environment: it lacks 'made_of', which says of what it is one")
    if np.array_equal(state["made_of"], expected):
        return
    try:
        given = json.loads(bytes(np.asarray(state["made_of"], dtype=np.uint8)))
    except ValueError:
        given = None
    where, theirs, ours = _difference("", given, json.loads(bytes(expected)))
    raise ValueError(
        f"the state is that of another environment: its {where or 'description'} is {_short(theirs)}, "
        f"and here it is {_short(ours)}"
    )


def fingerprint(*things: Any) -> str:
    """A short text that differs where arrays, numbers or texts differ, in tuples of any depth."""
    summed = blake2b(digest_size=8)

    def add(thing: Any) -> None:
        if isinstance(thing, tuple):
            summed.update(f"{type(thing).__name__} of {len(thing)}".encode())
            for one in thing:
                add(one)
        elif isinstance(thing, np.ndarray):
            summed.update(f"{thing.dtype.str}{thing.shape}".encode())
            summed.update(np.ascontiguousarray(thing).tobytes())
        else:
            summed.update(repr(thing).encode())

    add(things)
    return summed.hexdigest()


def text_array(text: str) -> NDArray[np.uint8]:
    """The bytes of a text."""
    return np.frombuffer(text.encode(), dtype=np.uint8).copy()


def seed_arrays(seeds: Sequence[int | None]) -> State:
    """Seeds of any size: which are given (n,), and their words (n, 4). Raises ValueError for ones above 2²⁵⁵."""
    try:
        words = [(seed or 0).to_bytes(8 * _SEED_WORDS, "little", signed=True) for seed in seeds]
    except OverflowError:
        most = max(seed for seed in seeds if seed is not None)
        raise ValueError(f"seeds of 2**{64 * _SEED_WORDS - 1} or more cannot be saved, got {most}") from None
    given = np.array([seed is not None for seed in seeds], dtype=np.bool_)
    return {
        "given": given,
        "words": np.frombuffer(b"".join(words), dtype="<u8").astype(np.uint64).reshape(-1, _SEED_WORDS),
    }


def read_seeds(state: AnyState) -> list[int | None]:
    """The seeds that `seed_arrays` has put into a state."""
    given: Flags = state["given"]
    rows = np.ascontiguousarray(state["words"], dtype="<u8")
    return [
        int.from_bytes(row.tobytes(), "little", signed=True) if one else None
        for row, one in zip(rows, given, strict=True)
    ]


def generator_words(generator: np.random.Generator) -> Seeds:
    """All that a generator of random numbers goes on from (6,). Raises ValueError for another kind than Gymnasium's."""
    state: Any = generator.bit_generator.state
    if state["bit_generator"] != _GENERATOR:
        raise ValueError(
            f"a random generator can be saved if it is a {_GENERATOR}, as Gymnasium's are, "
            f"got a {state['bit_generator']}"
        )
    numbers = state["state"]["state"], state["state"]["inc"]
    halves = [half for number in numbers for half in (number >> 64, number & _ALL_BITS)]
    return np.array([*halves, state["has_uint32"], state["uinteger"]], dtype=np.uint64)


def make_generator(words: Seeds) -> np.random.Generator:
    """A generator that goes on from what `generator_words` gave."""
    generator = np.random.Generator(np.random.PCG64(0))
    set_generator(generator, words)
    return generator


def set_generator(generator: np.random.Generator, words: Seeds) -> None:
    """Let a generator go on from what `generator_words` gave."""
    state, state_low, increment, increment_low, has_half, half = words.tolist()
    generator.bit_generator.state = {
        "bit_generator": _GENERATOR,
        "state": {"state": state << 64 | state_low, "inc": increment << 64 | increment_low},
        "has_uint32": has_half,
        "uinteger": half,
    }


def _difference(where: str, given: Any, expected: Any) -> tuple[str, Any, Any]:
    """Where two descriptions differ first, and what they say there."""
    if isinstance(given, dict) and isinstance(expected, dict):
        pairs = [(str(key), given.get(key), one) for key, one in expected.items()]
    elif isinstance(given, list) and isinstance(expected, list) and len(given) == len(expected):
        pairs = [(str(i), *pair) for i, pair in enumerate(zip(given, expected, strict=True))]
    else:
        return where, given, expected
    for key, mine, other in pairs:
        if mine != other:
            return _difference(f"{where}.{key}" if where else key, mine, other)
    return where, given, expected


def _shape(array: NDArray[Any]) -> str:
    return f"an array of {array.dtype} of shape {array.shape}"


def _short(value: Any) -> str:
    text = repr(value)
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]}…"
