"""Long lists of points, of which the first wrong one is told: telling of all would take more memory than the list."""

from collections.abc import Collection
from numbers import Real
from typing import Any

from caster_gym.brief import brief

FEW = 30  # points, of which all that are wrong are told, by the types


def check_long(points: Any, what: str, sizes: Collection[int] = ()) -> None:
    """Refuse a long list in which some item is no point of one of these sizes, or, without any, no number."""
    if not isinstance(points, list | tuple) or len(points) <= FEW:
        return
    for number, point in enumerate(points, start=1):
        parts = point if sizes and isinstance(point, list | tuple) else [point]
        if (sizes and len(parts) not in sizes) or not all(map(_is_number, parts)):
            wanted = f"{' or '.join(map(str, sorted(sizes)))} numbers" if sizes else "a number"
            raise ValueError(f"{what} {number} should be {wanted}, got {brief(point)}")


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool)
