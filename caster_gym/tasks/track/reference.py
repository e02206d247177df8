"""Trajectories run by the clock: the reference source of the tracking task."""

from typing import TYPE_CHECKING, Any, NamedTuple, Self

import numpy as np

from caster_gym.engines.native.lanes import LANES
from caster_gym.envs.plan import PlaceName, joined
from caster_gym.envs.tracking import POINT_ROWS, REFERENCE_ROWS
from caster_gym.mechanics.integration import State
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
    spans: Any  # int64 (paths, 3): first and last row, control periods of an episode
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
    spans = np.column_stack([rows, rows[:, 1] - rows[:, 0]])
    periods = np.array([round(s / parameters.control_period) for s in parameters.preview], dtype=np.int64)

    def moment(k: int) -> str:
        return f"at {k * parameters.control_period:.2f} s"

    return Timetable(samples, spans, periods), [
        Way(one.name, one.samples, one.samples[:, :4], moment, one.description) for one in trajectories
    ]


def fetch(block: Any, lane: Any, row: Any, _state: State, clock: Any, path: Any, _before: Any, source: Any) -> Any:
    """Write reference and previewed points at a robot's clock; see `fetch_reference`."""
    base, end = source.spans[path, 0], source.spans[path, 1]
    now = min(base + clock, end)
    for j in range(REFERENCE_ROWS):
        block[(row + j) * LANES + lane] = source.samples[now, j]
    row += REFERENCE_ROWS
    for p in range(len(source.horizons)):
        then = min(base + clock + source.horizons[p], end)
        for j in range(POINT_ROWS):
            block[(row + p * POINT_ROWS + j) * LANES + lane] = source.samples[then, j]
    return 0.0, 0.0
