"""What an obstacle is, and how an arena finds the obstacles in its fields."""

import inspect
import re
from abc import abstractmethod
from collections import Counter
from collections.abc import Iterator
from typing import Any, get_args, get_origin

from caster_gym.configuration import Frozen
from caster_gym.outlines import Outline, OutlineError, outline_fault
from caster_gym.own_errors import in_own_code


class Obstacle(Frozen):
    """A convex obstacle on the floor. A kind of obstacles is a subclass."""

    @property
    @abstractmethod
    def outline(self) -> Outline:
        """Its shape in W."""

    def __str__(self) -> str:
        """Where it is, which tells it from others of its kind: by its first point, unless the kind says it better."""
        points = ((name, value) for name, value in self if isinstance(value, tuple) and len(value) == 2)
        return next((f"with its {name.replace('_', ' ')} at {point_in_words(value)}" for name, value in points), "")


class ObstacleFields(Frozen):
    """Settings of which each field `tuple[Kind, ...]` holds obstacles of one kind."""

    def __init_subclass__(cls, **kwargs: Any) -> None:
        """Refuse a field whose items cannot stand in an arena. Raises TypeError."""
        super().__init_subclass__(**kwargs)
        for name, annotation in inspect.get_annotations(cls).items():
            items = get_args(annotation)[:-1] if get_args(annotation)[1:] == (Ellipsis,) else ()
            for kind in _classes(annotation):
                if hasattr(kind, "outline") or kind in items:
                    _check_kind(kind, f"{cls.__name__}.{name} holds {kind.__name__}")

    @property
    def numbered(self) -> Iterator[tuple[str, Obstacle]]:
        """The obstacles of all fields, in their order, each behind its name: kind, number and where it is."""
        counts: Counter[type] = Counter()
        for _, value in self:
            items = value if isinstance(value, tuple | list) else (value,)
            for one in (one for one in items if isinstance(one, Obstacle)):
                counts[type(one)] += 1
                kind = re.sub("(?<=[a-z])(?=[A-Z])", "-", type(one).__name__).lower()
                name = f"{kind} {counts[type(one)]}"
                with in_own_code(f"{name}: its place cannot be told in words", type(one)):
                    place = str(one)
                yield f"{name} {place}".rstrip(), one


def check_outline(name: str, obstacle: Obstacle) -> None:
    """Refuse an obstacle that is no convex shape. Raises ValueError that begins with its name."""
    with in_own_code(f"{name}: its outline cannot be worked out", type(obstacle)):
        try:
            fault = outline_fault(obstacle.outline)
        except OutlineError as error:  # of its numbers
            fault = str(error)
    if fault:
        raise ValueError(f"{name}: its outline {fault}")


def point_in_words(point: tuple[float, float]) -> str:
    """Its coordinates, as messages tell them."""
    return f"({point[0]:.4g}, {point[1]:.4g}) m"


def _check_kind(kind: type, what: str) -> None:
    if not issubclass(kind, Obstacle):
        raise TypeError(f"{what}, which must be a subclass of caster_gym.arena.obstacle.Obstacle to stand in an arena")
    if inspect.isabstract(kind):
        raise TypeError(f"{what}, which needs a property `outline`, such as `return convex((corner, corner, …))`")


def _classes(annotation: Any) -> Iterator[type]:
    """The classes of which an annotation is made."""
    if isinstance(annotation, type) and get_origin(annotation) is None:
        yield annotation
    for part in get_args(annotation):
        yield from _classes(part)
