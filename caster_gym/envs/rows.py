"""Rows from names: one walk over the fields of named tuples gives the place of each number in an array.

    class Motion(NamedTuple):
        pose: Pose  # x, y, cos, sin
        speed: Scalar

    MOTION = numbered(Motion)  # MOTION.pose.cos == 2, MOTION.speed == 4
    array[MOTION.speed], array[span(MOTION.pose)]

Whoever writes such an array writes `flat(motion)`, the same walk over the values: a field that is added, removed or
moved is so everywhere at once.
"""

from typing import Any, TypeVar, get_type_hints

Named = TypeVar("Named", bound=tuple[Any, ...])


def flat(nested: tuple[Any, ...]) -> tuple[Any, ...]:
    """All numbers of tuples within tuples, in order."""
    numbers: tuple[Any, ...] = ()
    for part in nested:
        numbers += flat(part) if isinstance(part, tuple) else (part,)
    return numbers


def numbered(kind: type[Named], first: int = 0) -> Named:
    """A named tuple of a kind, holding in place of each number its row, counted from `first`.

    Its fields are numbers, or named tuples of such fields. Raises TypeError for a field of another type.
    """
    parts: list[Any] = []
    for name, hint in get_type_hints(kind).items():
        if hint is not Any and not hasattr(hint, "_fields"):
            raise TypeError(f"field {name!r} of {kind.__name__} must be a number or a named tuple, got {hint}")
        parts.append(first if hint is Any else numbered(hint, first))
        first += len(flat((parts[-1],)))
    return kind(*parts)


def span(rows: tuple[Any, ...]) -> slice:
    """Rows that follow each other, as a slice. Raises ValueError for ones that do not."""
    numbers = flat(rows)
    if numbers != tuple(range(numbers[0], numbers[0] + len(numbers))):
        raise ValueError(f"rows {numbers} do not follow each other: let their fields stand side by side, in this order")
    return slice(numbers[0], numbers[-1] + 1)


def check_names(names: tuple[str, ...], what: str, others: tuple[str, ...], whose: str) -> None:
    """Refuse names that differ from others; the error says what they are, and whose. Raises TypeError."""
    if names != others:
        raise TypeError(f"{what} ({', '.join(names)}) must be {whose} ({', '.join(others)})")
