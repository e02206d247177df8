"""The bare mechanics of many robots at once on Torch tensors."""

import operator
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from caster_gym.engines.model_inputs import listed_robots
from caster_gym.engines.tensor.compiler import compiled, replayed
from caster_gym.engines.tensor.scalars import (
    check_memory,
    checked_device,
    checked_dtype,
    parameter_rows,
    parameters_of,
)
from caster_gym.engines.time_step import check_fleet, follows, longest_of_robots
from caster_gym.floor import FloorLike, load_floor
from caster_gym.mechanics.floor import FloorTable, check_floor, floor_table, on_floor, surface_under, wrong_state
from caster_gym.mechanics.grip_or_slip import free_step
from caster_gym.mechanics.integration import pack_state, state_at_rest, state_rows, unpack_state
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.mechanics.slip_state import rolling_state, unpack_slip_state
from caster_gym.robot import Robot

_NO_WRENCH = (0.0, 0.0, 0.0)


class TorchFleet:
    """Robots with the same number of casters, each with its own parameters and state, moved together.

    robots: one Robot for all, or one for each. state (count, 7 + 2 N): x, y [m], cos β, sin β in the world,
    twist vx, vy, ω in B [m/s, rad/s], then cos δ, sin δ of each caster.

    floor: one of finite friction, on which wheels may slip, as the environments take it: a `caster_gym.floor.Floor` or
    a mapping. Then state (count, 9 + 4 N) goes on with η̇, θ̇ of each caster [rad/s] and the tilt that
    shifts loads [N m]; set to (count, 7 + 2 N), wheels start rolling without slip.

    compile fuses a step into one kernel: the first step then takes a minute, or some seconds where Torch's cache on
    disk has it. On a CUDA device its kernels are replayed as a graph, without gradients. Otherwise gradients pass
    through `step` from torques and states that ask for them, and from parameters of the robots, which may hold tensors.

    Raises ValueError for another precision, a device that is not there, a batch that does not fit into its memory, and
    robots with different numbers of casters. Values are not checked for being finite, which would wait for the device.

    >>> import caster_gym, torch
    >>> fleet = caster_gym.TorchFleet(caster_gym.load_robot("chung2008"), count=1000)
    >>> fleet.step(torch.tensor([0.1, 0.0] * 3).expand(1000, 6), dt=0.005, steps=20)
    >>> fleet.state.shape, fleet.state[0, :2]  # after 0.1 s: x, y [m]
    (torch.Size([1000, 13]), tensor([0.0079, 0.0000]))
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        count: int | None = None,
        dynamics: Dynamics = "exact",
        *,
        parameters: RobotParameters | None = None,
        floor: FloorLike = None,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
        compile: bool = False,
    ) -> None:
        self.dtype, self.device = checked_dtype(dtype), checked_device(device)
        if count is not None:
            check_memory(count, 4 * state_rows(0, False), self.dtype, self.device)
        self.robots = listed_robots(robots, count)
        self.count = len(self.robots)
        self._distinct = list({id(robot): robot for robot in self.robots}.values())
        self._longest = float(longest_of_robots(self._distinct).min())
        n = self._distinct[0].caster_count
        self._torque_rows, self._rolling_rows = 2 * n, state_rows(n, False)
        below = load_floor(floor)
        self._rows = state_rows(n, below is not None)
        if parameters is not None:
            self._parameters = parameters
        elif len(self._distinct) == 1:
            self._parameters = robot_parameters(self._distinct[0], dynamics)  # plain numbers, which the compiler folds
        else:
            self._parameters = parameters_of(parameter_rows(self.robots, self.dtype, self.device, dynamics))
        self._floor = None if below is None else _listed(floor_table(below))
        if below is not None:
            for robot in self._distinct:
                check_floor(robot, dynamics)
            self._parameters = on_floor(self._parameters, below)
        self._step: Callable[..., Any] = compiled(_step, self.device, self.device.type == "cuda") if compile else _step
        if compile and self.device.type == "cuda":
            self._step = replayed(self._step)
        self._state = torch.zeros((self._rows, self.count), dtype=self.dtype, device=self.device)
        at_rest = torch.tensor(pack_state(state_at_rest(n)), dtype=self.dtype, device=self.device)
        self._state[: len(at_rest)] = at_rest[:, None]

    @property
    def state(self) -> Tensor:
        """All states (count, 7 + 2 N), on a floor of finite friction (count, 9 + 4 N)."""
        return self._state.T

    @state.setter
    def state(self, value: Tensor) -> None:
        tensor = torch.as_tensor(value, dtype=self.dtype, device=self.device)
        if self._floor is not None and tensor.shape == (self.count, self._rolling_rows):
            # Torch ships this one function without types
            alike = torch.broadcast_tensors(*self._rolling(tensor))  # type: ignore[no-untyped-call]  # Torch's, untyped
            tensor = torch.stack(alike, 1)
        if tensor.shape != (self.count, self._rows):
            n, slippery = self._torque_rows // 2, self._floor is not None
            raise ValueError(wrong_state(tuple(tensor.shape), self.count, n, slippery))
        self._state = self._checked("state", tensor, self._rows).T.contiguous()

    def _rolling(self, state: Tensor) -> tuple[Tensor, ...]:
        """States (count, 7 + 2 N) as columns of those of wheels that may slip, but do not yet."""
        return pack_state(rolling_state(unpack_state(state.unbind(1)), self._parameters))

    def step(self, torque: Tensor, dt: float, steps: int = 1) -> None:
        """Steps of dt seconds under joint torques (count, 2 N) [N m]: roll_1, steer_1, roll_2, …"""
        steps = operator.index(steps)
        if steps < 0:
            raise ValueError(f"steps must be 0 or more, got {steps}")
        if not follows(dt, self._longest):
            check_fleet(self._distinct, dt)
        torques = self._checked("torque", torque, self._torque_rows).T.contiguous()
        for _ in range(steps):
            self._state = self._step(self._state, torques, float(dt), self._parameters, self._floor)

    def _checked(self, name: str, value: Any, width: int) -> Tensor:
        tensor = torch.as_tensor(value, dtype=self.dtype, device=self.device)
        if tensor.shape != (self.count, width):
            raise ValueError(f"{name} must have shape {(self.count, width)}, got {tuple(tensor.shape)}")
        return tensor


def _step(state: Tensor, torques: Tensor, h: float, robot: RobotParameters, floor: FloorTable | None) -> Tensor:
    """One step of h seconds of states (rows, robots) under joint torques (2 N, robots)."""
    now = unpack_state(state.unbind(0)) if floor is None else unpack_slip_state(state.unbind(0))
    end = free_step(now, pairs(torques.unbind(0)), _NO_WRENCH, h, robot, surface_under(now, robot, floor))
    return torch.stack(pack_state(end))


def _listed(floor: FloorTable) -> FloorTable:
    """The floor with plain numbers, which the compiler folds."""
    return FloorTable(floor.contact_time, None if floor.patches is None else floor.patches.tolist())
