"""States and outcomes of a batch on tensors as arrays on the CPU, and back onto their device."""

from typing import Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caster_gym.engines.tensor.scalars import parameters_of
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.envs.tensor.state import TaskOutcome, TaskState
from caster_gym.mechanics.integration import state_rows
from caster_gym.mechanics.parameters import RobotParameters, pack_parameters
from caster_gym.states import AnyState, State, check_state


def state_arrays(state: TaskState, outcome: TaskOutcome) -> State:
    """Copies of the tensors by the names of their fields."""
    return {name: _array(tensor) for name, tensor in (state._asdict() | outcome._asdict()).items()}


def expected_arrays(engine: TaskEngine, dtype: torch.dtype, count: int) -> State:
    """Arrays of the shapes and types of `state_arrays` of so many robots."""
    number, size = np.dtype(str(dtype).removeprefix("torch.")), engine.layout.size
    rows = state_rows(engine.robot.caster_count, engine.slipping > 0)
    numbers: dict[str, tuple[int, ...]] = {
        "bodies": (rows, count),
        "observations": (count, size),
        "report": (engine.report_rows, count),
    }
    numbers |= dict.fromkeys(("progress", "room", "rewards"), (count,))
    expected: State = {name: np.broadcast_to(number.type(0), shape) for name, shape in numbers.items()}
    expected |= {name: np.zeros(count, dtype=np.int64) for name in ("clocks", "paths", "keys", "episodes")}
    return expected | {name: np.zeros(count, dtype=np.bool_) for name in ("terminated", "truncated")}


def check_arrays(engine: TaskEngine, dtype: torch.dtype, arrays: AnyState, count: int) -> None:
    """Raise ValueError unless arrays are those of so many robots of this task."""
    check_state("the robots", arrays, expected_arrays(engine, dtype, count))
    engine.plan.check_clocks(arrays["clocks"], arrays["paths"])


def tensors_of(arrays: AnyState, device: torch.device) -> tuple[TaskState, TaskOutcome]:
    """Copies of the arrays as tensors, laid out in memory as those of a step."""
    tensors = {name: torch.tensor(array, device=device) for name, array in arrays.items()}
    tensors["observations"] = tensors["observations"].T.contiguous().T
    state, outcome = ({name: tensors[name] for name in kind._fields} for kind in (TaskState, TaskOutcome))
    return TaskState(**state), TaskOutcome(**outcome)


def parameter_array(parameters: RobotParameters) -> NDArray[np.floating]:
    """Robots' own numbers (robots, fields); none (0, fields) where all share plain ones."""
    fields = pack_parameters(parameters)
    if not any(isinstance(field, Tensor) for field in fields):
        return np.zeros((0, len(fields)))
    tensors = [field for field in fields if isinstance(field, Tensor)]
    rows = [torch.as_tensor(field, dtype=tensors[0].dtype).expand(len(tensors[0])) for field in fields]
    return _array(torch.stack([row.cpu() for row in rows], 1)).astype(np.float64)


def parameters_from(rows: NDArray[np.floating], dtype: torch.dtype, device: torch.device) -> RobotParameters:
    """Robots' own numbers from rows (robots, fields)."""
    return parameters_of(torch.tensor(rows, dtype=dtype, device=device))


def _array(tensor: Tensor) -> NDArray[Any]:
    return tensor.detach().cpu().numpy().copy()
