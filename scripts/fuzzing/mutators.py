"""Files changed at random: their bytes, their text, the values in them."""

import copy
import json
from collections.abc import Callable, Sequence
from random import Random
from typing import Any, TypeAlias

from caster_gym.plain_yaml import YamlError, read_plain_yaml

Mutator: TypeAlias = Callable[[Random, bytes, Sequence[bytes]], bytes]  # of a file, given others of its format

_TOKENS = (
    "&a ", "*a", "<<: *a", "!!set ", "!!binary ", "!!python/name:os.system ", "!x ", "? ", "- ", ": ", "\t", "\n", "\r",
    "%YAML 1.1\n", "---\n", "...\n", "'", '"', "{", "}", "[", "]", ",", "|", ">", "#", "\u2028", "\ufeff", "\x00",
    ".nan", ".inf", "~", "1e999", "0x", "0b2", "1_0", "1:30", "2001-02-03", "yes", "=", "sep=;\n", "−1", "1,5", "[mm]",
    "µ", "nan", "NaN", "Infinity", "1e308", "-1e308", "1e-302", "9" * 30, "9" * 90,
)  # fmt: skip
_ODD: tuple[Any, ...] = (
    None, True, False, "", "word", "~", "0", "a\x00b", "/", ".", "..", "~nobody/points.csv", "points.csv", "robot.yaml",
    "x" * 300, "x" * 5000, [], {}, [None], [[]], [{}], {"": None}, {"kind": None}, {"shape": []}, {"file": "."},
    0, 1, -1, 2, 3, 7, 0.0, -0.0, 0.5, -0.5, 1e-9, 1e-13, 1e-302, 5e-324, 1e6, 1e9, 1e12, 1e15, 1e16, 1e154, 1e308,
    -1e308, 2**31, 2**32, 2**53, 2**63, 2**64, -(2**63), 10**40, float("inf"), float("-inf"), float("nan"), 3.14, 90,
    360, 45.0, 1000, 100_000, "deg", "rad", "all", "grip", "tangent", "any", "auto", "roll_1", "track", "follow",
)  # fmt: skip
_LONGEST = 400_000  # bytes of what a mutator makes


def mutate_bytes(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """Bits flipped, pieces cut out, doubled, moved, taken from other files or from a dictionary."""
    data = bytearray(content)
    for _ in range(rng.choice((1, 1, 1, 2, 4, 8))):
        at = rng.randrange(len(data) + 1)
        end = min(len(data), at + rng.choice((1, 2, 4, 16, 64, 256)))
        kind = rng.randrange(7)
        if kind == 0 and data:
            data[rng.randrange(len(data))] ^= 1 << rng.randrange(8)
        elif kind == 1:
            del data[at:end]
        elif kind == 2:
            data[at:at] = data[at:end] * rng.choice((1, 1, 2, 10, 100))
        elif kind == 3:
            data[at:at] = rng.choice(_TOKENS).encode()
        elif kind == 4:
            other = rng.choice(others)
            start = rng.randrange(len(other) + 1)
            data[at:end] = other[start : start + rng.choice((4, 32, 256, 2048))]
        elif kind == 5:
            data[at:end] = rng.randbytes(end - at)
        elif rng.random() < 0.2:
            del data[at:]
    return bytes(data[:_LONGEST])


def mutate_yaml(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A mapping with some of its values, keys and lists changed; else its bytes."""
    kind = rng.random()
    if kind < 0.3:
        return mutate_bytes(rng, content, others)
    if kind < 0.33:
        return _many_aliases(rng) + content
    try:
        tree = _tree(content)
        donor = _tree(rng.choice(others)) if rng.random() < 0.3 else tree
    except (UnicodeDecodeError, YamlError):
        return mutate_bytes(rng, content, others)
    return _written(_changed(rng, copy.deepcopy(tree), donor))


def mutate_json(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """As `mutate_yaml`, for JSON."""
    if rng.random() < 0.3:
        return mutate_bytes(rng, content, others)
    tree = json.loads(content)
    text = json.dumps(_changed(rng, tree, json.loads(rng.choice(others))))
    return text.encode()[:_LONGEST]


def mutate_table(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """Cells, headers, rows and separators changed; else its bytes."""
    if rng.random() < 0.3:
        return mutate_bytes(rng, content, others)
    lines = content.decode().splitlines()
    for _ in range(rng.choice((1, 1, 2, 4))):
        row = rng.randrange(len(lines))
        kind = rng.randrange(7)
        if kind <= 2:
            cells = lines[row].split(",")
            odd = str(rng.choice(_ODD)) if rng.random() < 0.7 else rng.choice(_TOKENS)
            cells[rng.randrange(len(cells))] = odd
            lines[row] = ",".join(cells)
        elif kind == 3:
            lines[row:row] = lines[row : row + rng.randrange(1, 20)] * rng.choice((1, 1, 2, 50))
        elif kind == 4 and len(lines) > 1:
            del lines[row : row + rng.choice((1, 1, 5))]
        elif kind == 5:
            lines[row], lines[-1] = lines[-1], lines[row]
        else:
            lines[row] = rng.choice(rng.choice(others).decode(errors="replace").splitlines() or [""])
        lines = lines or [""]
    text = "\n".join(lines)
    if rng.random() < 0.1:
        text = text.replace(",", rng.choice((";", "\t", " ", ",,")))
    return text.encode("utf-16" if rng.random() < 0.02 else "utf-8")[:_LONGEST]


def mutate_weights(rng: Random, content: bytes, others: Sequence[bytes]) -> bytes:
    """A safetensors file with another header, other numbers, or other bytes."""
    kind = rng.random()
    if kind < 0.3:
        return mutate_bytes(rng, content, others)
    length = int.from_bytes(content[:8], "little")
    header, data = json.loads(content[8 : 8 + length]), bytearray(content[8 + length :])
    if kind < 0.45:
        for _ in range(rng.choice((1, 3))):
            at = 4 * rng.randrange(len(data) // 4)
            data[at : at + 4] = rng.choice((b"\0\0\xc0\x7f", b"\0\0\x80\x7f", b"\0\0\x80\xff", rng.randbytes(4)))
    elif kind < 0.5:
        length = rng.choice((0, 1, 2**20, 2**31, 2**63 - 1, 2**64 - 1, length + 1, length - 1))
        return length.to_bytes(8, "little") + content[8:]
    else:
        name = rng.choice([one for one in header if one != "__metadata__"])
        told = header[name]
        what = rng.randrange(6)
        if what == 0:
            told["dtype"] = rng.choice(("F64", "F16", "BF16", "I8", "BOOL", "F8_E4M3", "", None, 3, "F32 "))
        elif what == 1:
            told["shape"] = rng.choice(([], [0], [-1], [2**32, 2**32], told["shape"][::-1], None, [1] * 40, "6"))
        elif what == 2:
            told["data_offsets"] = [rng.choice((0, -1, 4, 2**63, None, "0", *told["data_offsets"])) for _ in range(2)]
        elif what == 3:
            header[rng.choice(("head.bias", "x", "", "__metadata__", name + "_"))] = header.pop(name)
        else:
            header = _changed(rng, header, header)
    text = json.dumps(header).encode()
    return len(text).to_bytes(8, "little") + text + bytes(data)


def _many_aliases(rng: Random) -> bytes:
    """Lists of aliases of lists of aliases, of up to some hundred thousand values."""
    width, depth = rng.randrange(2, 20), rng.randrange(1, 5)
    lines = ["a0: &a0 [1, 2]"]
    lines += [f"a{k}: &a{k} [{', '.join([f'*a{k - 1}'] * width)}]" for k in range(1, depth)]
    return ("\n".join(lines) + "\n").encode()


_TREES: dict[bytes, Any] = {}


def _tree(content: bytes) -> Any:
    if content not in _TREES:  # of the few files that are mutated
        _TREES[content] = read_plain_yaml(content.decode())
    return _TREES[content]


def _written(tree: Any) -> bytes:
    """A tree as YAML in the form of JSON."""
    text = json.dumps(tree, ensure_ascii=False)
    return text.replace("Infinity", ".inf").replace("NaN", ".nan").encode(errors="replace")[:_LONGEST]


def _changed(rng: Random, tree: Any, donor: Any) -> Any:
    """A tree in which some places are changed. donor: a tree from which values are taken."""
    most = 3000  # times that values are repeated, in all
    for _ in range(rng.choice((1, 1, 1, 2, 3, 6))):
        times = min(rng.choice((1, 1, 2, 3, 10, 100, 3000)), most)
        holder, key = _place(rng, tree)
        if holder is None:
            return rng.choice(_ODD) if rng.random() < 0.05 else tree
        value, kind = holder[key], rng.randrange(12)
        if kind <= 3:
            holder[key] = _odd(rng)
        elif kind == 4 and isinstance(value, int | float) and not isinstance(value, bool):
            holder[key] = value * rng.choice((-1, 0.1, 10, 1e3, 1e-3, 1e6, 1e-6, 1 + 1e-9)) + rng.choice((0, 0, 1e-9))
        elif kind == 5 and isinstance(holder, dict):
            holder[rng.choice((key + "s", key[:-1], key.upper(), "x" * 200, *map(str, holder)))] = holder.pop(key)
        elif kind == 6:
            del holder[key]
        elif kind == 7 and isinstance(holder, list):
            holder[key:key] = [value] * times
            most //= times
        elif kind == 8:
            holder[key] = [value] * times
            most //= times
        elif kind == 9:
            holder[key] = _deep(rng, value)
        else:
            other, at = _place(rng, donor)
            if other is not None:
                holder[key] = copy.deepcopy(other[at])
    return tree


def _odd(rng: Random) -> Any:
    odd = copy.deepcopy(rng.choice(_ODD))
    return [copy.deepcopy(rng.choice(_ODD)) for _ in range(rng.randrange(5))] if rng.random() < 0.1 else odd


def _deep(rng: Random, value: Any) -> Any:
    for _ in range(rng.choice((1, 2, 10, 60))):
        value = [value] if rng.random() < 0.5 else {"x": value}
    return value


def _place(rng: Random, tree: Any) -> tuple[Any, Any]:
    """A mapping or list in a tree, and a key or index in it; None if there is none."""
    holder, key = None, None
    while isinstance(tree, dict | list) and tree and (holder is None or rng.random() < 0.75):
        holder = tree
        key = rng.choice(list(tree)) if isinstance(tree, dict) else rng.randrange(len(tree))
        tree = tree[key]
    return holder, key
