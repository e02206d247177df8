"""A task prepared for the compiled step: paths, rewards, obstacles and pace."""

from collections.abc import Sequence
from typing import Any, Literal, NamedTuple, Protocol, Self, TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.rows import numbered
from caster_gym.floor import Floor
from caster_gym.mechanics.separation import Surroundings


class Span(NamedTuple):
    """Where a path stands among the rows of its source, and how long an episode on it takes."""

    first: Any  # row
    last: Any
    periods: Any  # control periods of an episode


class Beside(NamedTuple):
    """Which obstacles are beside a path."""

    first: Any
    end: Any


SPAN, BESIDE = numbered(Span), numbered(Beside)

PlaceName: TypeAlias = Literal["time", "progress"]


class ReferenceSource(Protocol):
    """Where references come from: a named tuple of arrays that compiled code reads, with `weights` behind all others.

    place: how a place along a path is given at a reset: the time [s] of a clock, or the progress [m] that the task
    measures along rows which are `spacings` [m] apart; None where there are no places. `on_tensors(dtype, device)`
    makes the same for a batch of tensors, see `caster_gym.envs.tensor.reference`.
    """

    @property
    def place(self) -> PlaceName | None:
        """See above."""
        ...

    @property
    def spans(self) -> NDArray[np.int64]:
        """(paths, 3) as in `Span`."""
        ...

    @property
    def weights(self) -> NDArray[np.float64]:
        """Numbers of the reward, taken apart in every call: an array costs less than its numbers."""
        ...

    def still(self) -> Self:
        """The same under which progress stays, wherever the robot is."""
        ...


class Plan(NamedTuple):
    """All paths of a task as the compiled step reads them, and what there is to say and to draw of them."""

    source: Any  # ReferenceSource
    names: tuple[str, ...]  # of the paths
    tables: tuple[NDArray[np.float64], ...]  # (K, 10) samples of each path, x and y first
    terms: tuple[str, ...]  # names of the reward's terms
    around: Surroundings
    arenas: NDArray[np.int64]  # (paths, 2) as in `Beside`
    descriptions: tuple[str, ...]  # what was made of each path

    def check_clocks(self, clocks: NDArray[np.int64], paths: NDArray[np.int64]) -> None:
        """Raise ValueError for control periods (robots,) and indices of paths (robots,) that cannot be."""
        if clocks.min() < 0 or paths.min() < 0 or paths.max() >= len(self.names):
            raise ValueError(
                f"a state must hold clocks of 0 or more and paths in 0 … {len(self.names) - 1}, "
                f"got clocks from {clocks.min()} and paths in {paths.min()} … {paths.max()}"
            )

    def __deepcopy__(self, _memo: dict[int, Any]) -> Self:
        """Itself: nobody writes into its tables, which the environments of a process share."""
        return self


class Pace(NamedTuple):
    """What the engine needs to know of a task."""

    substeps: int
    time_step: float  # [s]
    corridor: float  # [m]
    start_offset: float  # [m]
    start_turn: float  # [rad]
    floor: Floor | None = None  # None: wheels roll without slip


def joined(tables: Sequence[NDArray[np.float64]]) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
    """All tables of paths in one (rows, columns), with each one's first and last row (paths, 2)."""
    lengths = np.array([len(table) for table in tables])
    ends = np.cumsum(lengths)
    return np.ascontiguousarray(np.concatenate(tables)), np.stack([ends - lengths, ends - 1], axis=1).astype(np.int64)
