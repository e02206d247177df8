"""Trajectories run by the clock: the reference source of the tracking task."""

from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from caster_gym.envs.native.layout import write_point, write_reference
from caster_gym.envs.plan import SPAN, PlaceName, Span, joined
from caster_gym.envs.tracking import POSE, REFERENCE, Reference, point_of
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.scalars import entries
from caster_gym.paths.specification import AnyPath, build_trajectories
from caster_gym.robot import Robot
from caster_gym.tasks.task import Way
from caster_gym.tasks.track.parameters import TrackParameters

if TYPE_CHECKING:
    import torch

    from caster_gym.tasks.track.tensor import TorchTimetable


class Timetable(NamedTuple):
    """Trajectories in time."""

    samples: Any  # float64 (rows of all trajectories, 10), as in caster_gym.paths.trajectory
    spans: Any  # int64 (paths, 3) as in `caster_gym.envs.plan.Span`
    horizons: Any  # int64 (previewed points,): control periods ahead
    weights: Any = np.zeros(0)  # float64 (weights,), as in TrackWeights

    @property
    def place(self) -> PlaceName | None:
        """Of starts."""
        return "time"

    def still(self) -> Self:
        """Itself: a clock leads."""
        return self

    def on_tensors(self, dtype: "torch.dtype", device: "torch.device") -> "TorchTimetable":
        """The same for a batch of tensors."""
        from caster_gym.tasks.track.tensor import TorchTimetable  # late: most do without Torch

        return TorchTimetable(self, dtype, device)


def lay_out(robot: Robot, paths: tuple[AnyPath, ...], parameters: TrackParameters) -> tuple[Timetable, list[Way]]:
    """The trajectories of all paths."""
    trajectories = build_trajectories(paths, robot, parameters.control_period)
    samples, rows = joined([trajectory.samples for trajectory in trajectories])
    first, last = rows.T
    spans = np.stack(Span(first, last, periods=last - first), axis=1)
    periods = np.array([round(s / parameters.control_period) for s in parameters.preview], dtype=np.int64)

    def moment(k: int) -> str:
        return f"at {k * parameters.control_period:.2f} s"

    return Timetable(samples, spans, periods), [
        Way(one.name, one.samples, one.samples[:, POSE], moment, one.description) for one in trajectories
    ]


def fetch(block: Any, lane: Any, row: Any, _state: State, clock: Any, path: Any, _before: Any, source: Any) -> Any:
    """Write reference and previewed points at a robot's clock; see `fetch_reference`."""
    now, end = source.spans[path, SPAN.first] + clock, source.spans[path, SPAN.last]
    write_reference(block, lane, row, _sample(source.samples, min(now, end)))
    for i in range(len(source.horizons)):
        coming = _sample(source.samples, min(now + source.horizons[i], end))
        write_point(block, lane, row, i, point_of(coming))
    return 0.0, 0.0


def _sample(samples: Any, k: Any) -> Reference:
    return Reference(*entries(samples, k, REFERENCE))
