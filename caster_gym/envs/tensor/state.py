"""The state, inputs and outcome of a batch of robots on tensors in a control period."""

from typing import NamedTuple

from torch import Tensor

from caster_gym.envs.report import RECORD
from caster_gym.mechanics.parameters import RobotParameters


class TaskState(NamedTuple):
    """All that a batch keeps from one control period to the next; robots are the last axis."""

    bodies: Tensor  # (7 + 2 N, robots): x, y, cos β, sin β in W, twist in B, cos δ, sin δ of each caster; if wheels may
    # slip, yaw rate over ground and rolling rate of each caster, and the tilt: 2 N + 2 rows more
    progress: Tensor  # (robots,) [m] along the path, where the task measures it
    room: Tensor  # (robots,) [m] gap to the nearest obstacle, infinite where there is none
    clocks: Tensor  # int64 (robots,) control periods done in the episode
    paths: Tensor  # int64 (robots,) index of the path
    keys: Tensor  # int64 (robots,) from which all random numbers of a robot count
    episodes: Tensor  # int64 (robots,) number of the episode that starts next

    def detached(self) -> "TaskState":
        """The same state without its past, through which no gradient passes any more."""
        return TaskState(*(tensor.detach() for tensor in self))


class TaskOutcome(NamedTuple):
    """What a control period brought."""

    observations: Tensor  # (robots, size)
    rewards: Tensor  # (robots,)
    terminated: Tensor  # bool (robots,)
    truncated: Tensor  # bool (robots,)
    report: Tensor  # (quantities, robots), which `TorchTask.info` names

    @property
    def ended(self) -> Tensor:
        """Whose episode is over (robots,)."""
        return self.terminated | self.truncated


class Given(NamedTuple):
    """What drives the robots during a control period, and what they are: numbers for all, or tensors (robots,)."""

    commands: Tensor  # (2 N, robots), −1 … 1
    push: Tensor  # (3, robots) external wrench at C, in B [N, N, N m]
    robot: RobotParameters


def empty_record(bodies: Tensor, casters: int, slipping: int) -> Tensor:
    """The record of a control period in which nothing has happened yet: rows as `record_parts` takes them apart.

    bodies (rows, robots): whether they want gradients is what the record does. slipping: how many wheels may slip.
    """
    rows = 2 * casters + len(RECORD) + slipping
    return bodies.new_zeros((rows, bodies.shape[1])).requires_grad_(bodies.requires_grad)


def record_parts(record: Tensor, casters: int) -> tuple[Tensor, Tensor, Tensor]:
    """Mean motor torques [N m] (2 N, robots), the numbers of a `Record`, and greatest slips of wheels that may slip."""
    first = 2 * casters
    end = first + len(RECORD)
    return record[:first], record[first:end], record[end:]
