"""A task as one object: parameters, paths, what is observed, reference source, reward, endings and metrics."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from numbers import Real
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.native.reference import TaskCode, register_task
from caster_gym.envs.observation import PreviewUnit
from caster_gym.envs.tracking import endings
from caster_gym.own_errors import OwnCodeError
from caster_gym.paths.specification import AnyPath, PathLike
from caster_gym.robot import Robot
from caster_gym.tasks.measuring import Metrics
from caster_gym.tasks.names import check_names, class_of
from caster_gym.tasks.parameters import TaskParameters

if TYPE_CHECKING:
    from caster_gym.envs.plan import Plan, ReferenceSource
    from caster_gym.tasks.environment import TaskEnv, TaskVectorEnv


class Way(NamedTuple):
    """One path of a task."""

    name: str
    table: NDArray[np.float64]  # (K, columns) samples, x and y [m] first
    poses: NDArray[np.float64]  # (K, 4) x, y, cos and sin of the heading, which must be free of obstacles
    place: Callable[[int], str]  # where the sample of an index is, in words
    description: str = ""  # what was made of the path


class Pictures(NamedTuple):
    """How the figures of a comparison show episodes of a task."""

    path: str = "path"  # what the line that is to be driven is called
    magnified: float = 1.0  # how much larger errors are drawn beside it
    around: float = 0.15  # [m] that is shown on all sides of it, at least
    speeds: bool = False  # whether the speed along the path is shown, beside that of the time law in its last column


def _no_facts(plan: "Plan") -> dict[str, NDArray[np.float64]]:
    return {}


@dataclass(frozen=True, eq=False)
class Task:
    """All that there is to say of a task. Whoever makes one teaches its functions to the compiler.

    The functions `fetch`, `reward` and `endings` are compiled, with all functions of the modules in which they stand;
    `reward` and `endings` also run on tensors, and are written on generic scalars (`caster_gym.mechanics.scalars`).
    """

    name: str  # by which settings and commands know it
    environment: str  # module and first part of the names of its classes, as "module:CasterTrack"
    purpose: str  # what a robot is to do, in words
    parameters: type[TaskParameters]
    default_path: PathLike
    short_path: Mapping[str, Any]  # one that is quickly made and that no robot fails on, to compile with
    preview_unit: PreviewUnit  # of the horizons at which observations show the coming reference

    source: type[Any]  # type of the reference source, a named tuple; see `ReferenceSource`
    # from parameters; its weights are still to be filled in
    lay_out: Callable[[Robot, tuple[AnyPath, ...], Any], "tuple[ReferenceSource, list[Way]]"]
    # writes what a robot is to do next; see `caster_gym.envs.native.reference.fetch_reference`
    fetch: Callable[..., Any]

    weights: type[Any]  # type of the reward's numbers: a named tuple whose fields are those of the parameters
    terms: type[Any]  # type of the reward's terms: a named tuple
    reward: Callable[[Any, Any], Any]  # terms from a `caster_gym.envs.tracking.Moment` and weights

    metrics: Metrics
    endings: Callable[[Any, Any], Any] = endings  # `caster_gym.envs.tracking.Endings` from the same
    facts: Callable[["Plan"], dict[str, NDArray[np.float64]]] = _no_facts  # of each path (paths,), for the metrics
    pictures: Pictures = field(default=Pictures())

    def __post_init__(self) -> None:
        check_names(self)
        code = TaskCode(self.title, self.fetch, self.weights, self.reward, self.endings)
        register_task(self.source, code)

    @property
    def title(self) -> str:
        """First part of the names of its classes, such as CasterTrack."""
        return self.environment.partition(":")[2]

    @property
    def single(self) -> "type[TaskEnv]":
        """The environment of one robot."""
        from caster_gym.tasks.environment import TaskEnv  # which imports tasks

        found: type[TaskEnv] = class_of(self, "Env", TaskEnv)
        return found

    @property
    def batch(self) -> "type[TaskVectorEnv]":
        """The environment of many robots."""
        from caster_gym.tasks.environment import TaskVectorEnv

        found: type[TaskVectorEnv] = class_of(self, "VectorEnv", TaskVectorEnv)
        return found

    def weights_of(self, parameters: TaskParameters) -> NDArray[np.float64]:
        """The reward's numbers (weights,). Raises OwnCodeError for a weight that is no parameter."""
        numbers = [getattr(parameters, name, None) for name in self.weights._fields]
        for name, number in zip(self.weights._fields, numbers, strict=True):
            if not isinstance(number, Real):
                raise OwnCodeError(
                    f"task {self.name!r}: each field of {self.weights.__name__} must be a number of "
                    f"{type(parameters).__name__}, and {name!r} is none there"
                )
        return np.array(numbers, dtype=np.float64)
