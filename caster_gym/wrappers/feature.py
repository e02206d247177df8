"""Features: a description that is checked once, and the part that works for a number of robots.

Arrays have one row per robot. `robots` picks some of them: an array of indices, or slice(None) for all.
"""

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, TypeAlias

import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray
from pydantic import AfterValidator

from caster_gym.arrays import Array, Flags, Indices, Seeds
from caster_gym.configuration import Extensible
from caster_gym.states import AnyState, State
from caster_gym.wrappers.memory import check_memory, read_memory, set_memory

if TYPE_CHECKING:
    from caster_gym.envs.native.engine import TaskEngine
    from caster_gym.envs.observation import Part
    from caster_gym.tasks.parameters import TaskParameters

Actions: TypeAlias = NDArray[np.float32]
Observations: TypeAlias = NDArray[np.float32]
Robots: TypeAlias = Indices | slice
Quantities: TypeAlias = Callable[[str], Array]  # a quantity (robots, …) of the environment's info, by its name


def _rising(value: float | tuple[float, float]) -> float | tuple[float, float]:
    low, high = limits(value)
    if low > high:
        raise ValueError("must rise from its first to its second number")
    return value


def _not_negative(value: float | tuple[float, float]) -> float | tuple[float, float]:
    if limits(value)[0] < 0.0:
        raise ValueError("must not be negative")
    return value


Range: TypeAlias = Annotated[float | tuple[float, float], AfterValidator(_rising)]
"""A number, or two between which each episode draws one uniformly."""

Size: TypeAlias = Annotated[Range, AfterValidator(_not_negative)]
"""A range of numbers that are not negative."""


def limits(value: float | tuple[float, float]) -> tuple[float, float]:
    """Least and greatest number of a range."""
    return value if isinstance(value, tuple) else (value, value)


def between(value: float | tuple[float, float], shares: Array) -> Array:
    """The numbers at shares 0 … 1 of a range."""
    low, high = limits(value)
    return low + (high - low) * shares


@dataclass(frozen=True, eq=False)
class Place:
    """Where a feature works."""

    engine: "TaskEngine"
    task: "TaskParameters"
    width: int  # of the actions that the feature inside understands
    seeds: Seeds  # (robots,) of the feature's random numbers in the present episodes; the stack keeps them up to date
    clocks: Indices  # (robots,) control periods done in them, likewise

    @property
    def count(self) -> int:
        """Number of robots."""
        return self.engine.count

    @property
    def period(self) -> float:
        """Control period [s]."""
        return self.task.control_period

    def part(self, name: str) -> "Part":
        """A part of the observation."""
        return next(part for part in self.engine.layout.parts if part.name == name)


class Runtime:
    """A feature at work; each kind overrides what it changes. Its memory starts anew with every episode of a robot."""

    action_space: "Box[Any] | None" = None
    """Space of one robot's action, if it means something else than inside."""

    observation_space: "Box[Any] | None" = None
    """Space of one robot's observation, if more is shown than inside."""

    constants: ClassVar[frozenset[str]] = frozenset()
    """Attributes that never change, of other kinds than texts, frozen settings and functions: no state holds them."""

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        """New episodes of some robots have begun; quantities are those after their reset."""

    def look(self, quantities: Quantities) -> None:
        """A control period is over; quantities are those at its end. What is observed then follows."""

    def act(self, actions: Actions) -> Actions:
        """Actions for the inside from those of the outside."""
        return actions

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        """Observations for the outside from those of the inside, of some robots. The given array stays as it is."""
        return observations

    def get_state(self) -> State:
        """Copies of all arrays, numbers and generators among the attributes, also in lists, tuples and dictionaries.

        Raises TypeError for an attribute that may change and is none of these; such a feature overrides this and the
        next two.
        """
        return read_memory(self._called, vars(self), self.constants)

    def check_state(self, state: AnyState) -> None:
        """Raise ValueError unless the state is one of this feature."""
        check_memory(self._called, vars(self), self.constants, state)

    def set_state(self, state: AnyState) -> None:
        """Go on from what `get_state` gave."""
        set_memory(vars(self), self.constants, state)

    @property
    def _called(self) -> str:
        return f"the feature at work {type(self).__name__.strip('_')!r}"


class RewardRuntime(Runtime, ABC):
    """A feature that adds a term to the reward."""

    def __init__(self, name: str) -> None:
        self.name = name

    @abstractmethod
    def term(self, quantities: Quantities, terminated: Flags) -> Array:
        """The term (robots,) of a step."""


class PlantRuntime(Runtime, ABC):
    """A feature that changes the plant, which no agent is told."""

    @abstractmethod
    def rebuild(self, parameters: Array, seeds: Seeds) -> Array:
        """Mechanics parameters (k, fields) of robots whose episodes with these seeds (k,) are about to start."""

    def extremes(self, parameters: Array) -> Array:
        """The hardest to follow by time steps (more, fields) of what `rebuild` makes of robots (k, fields).

        A plant that does not tell is judged by a number of draws alone.
        """
        return parameters


class PushingRuntime(Runtime, ABC):
    """A feature that pushes the robots from outside."""

    @abstractmethod
    def wrenches(self) -> Array:
        """Wrenches at C in B (robots, 3) during the coming control period. [N, N, N m]"""


class Feature(Extensible):
    """Something that an environment does differently, told in numbers with units."""

    redefines_actions: ClassVar[bool] = False
    """Whether actions mean something else outside; only one feature of an environment may do that."""

    @abstractmethod
    def runtime(self, place: Place) -> Runtime:
        """The feature at work. Raises ValueError for a place where it cannot be."""

    def added(self, size: int, width: int) -> int:
        """Numbers that are shown behind an observation of that size, with actions of that width.

        Only reward terms may follow a feature that adds some.
        """
        return 0
