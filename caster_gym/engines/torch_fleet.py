"""The bare mechanics of many robots at once on Torch tensors."""

import operator
from collections.abc import Callable, Sequence
from typing import Any

import torch
from torch import Tensor

from caster_gym.engines.time_step import check_fleet, follows, longest_of_robots
from caster_gym.engines.torch_compiler import compiled, replayed
from caster_gym.engines.torch_scalars import (
    check_memory,
    checked_device,
    checked_dtype,
    listed_robots,
    parameter_rows,
    parameters_of,
)
from caster_gym.mechanics.integration import pack_state, rk4_step, unpack_state
from caster_gym.mechanics.parameters import Dynamics, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.robot import Robot

BODY_ROWS = 7  # of a state before the casters' directions
_NO_WRENCH = (0.0, 0.0, 0.0)


class TorchFleet:
    """Robots with the same number of casters, each with its own parameters and state, moved together.

    robots: one Robot for all, or one for each. state (count, 7 + 2 N): x, y [m], cos β, sin β in the world,
    twist vx, vy, ω in B [m/s, rad/s], then cos δ, sin δ of each caster.

    compile fuses a step into one kernel: the first step then takes a minute, or some seconds where Torch's cache on
    disk has it. On a CUDA device its kernels are replayed as a graph, without gradients. Otherwise gradients pass
    through `step` from torques and states that ask for them, and from parameters of the robots, which may hold tensors.

    Raises ValueError for another precision, a device that is not there, a batch that does not fit into its memory, and
    robots with different numbers of casters. Values are not checked for being finite, which would wait for the device.
    """

    def __init__(
        self,
        robots: Robot | Sequence[Robot],
        count: int | None = None,
        dynamics: Dynamics = "exact",
        *,
        parameters: RobotParameters | None = None,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
        compile: bool = False,
    ) -> None:
        self.dtype, self.device = checked_dtype(dtype), checked_device(device)
        if count is not None:
            check_memory(count, 4 * BODY_ROWS, self.dtype, self.device)
        self.robots = listed_robots(robots, count)
        self.count = len(self.robots)
        self._distinct = list({id(robot): robot for robot in self.robots}.values())
        self._longest = float(longest_of_robots(self._distinct).min())
        n = self._distinct[0].caster_count
        self._rows, self._torque_rows = BODY_ROWS + 2 * n, 2 * n
        if parameters is not None:
            self._parameters = parameters
        elif len(self._distinct) == 1:
            self._parameters = robot_parameters(self._distinct[0], dynamics)  # plain numbers, which the compiler folds
        else:
            self._parameters = parameters_of(parameter_rows(self.robots, self.dtype, self.device, dynamics))
        self._step: Callable[..., Any] = compiled(_step, self.device, self.device.type == "cuda") if compile else _step
        if compile and self.device.type == "cuda":
            self._step = replayed(self._step)
        at_rest = torch.zeros((self._rows, self.count), dtype=self.dtype, device=self.device)
        at_rest[2] = 1.0
        at_rest[BODY_ROWS::2] = 1.0
        self._state = at_rest

    @property
    def state(self) -> Tensor:
        """All states (count, 7 + 2 N)."""
        return self._state.T

    @state.setter
    def state(self, value: Tensor) -> None:
        self._state = self._checked("state", value, self._rows).T.contiguous()

    def step(self, torque: Tensor, dt: float, steps: int = 1) -> None:
        """RK4 steps of dt seconds under joint torques (count, 2 N) [N m]: roll_1, steer_1, roll_2, …"""
        steps = operator.index(steps)
        if steps < 0:
            raise ValueError(f"steps must be 0 or more, got {steps}")
        if not follows(dt, self._longest):
            check_fleet(self._distinct, dt)
        torques = self._checked("torque", torque, self._torque_rows).T.contiguous()
        for _ in range(steps):
            self._state = self._step(self._state, torques, float(dt), self._parameters)

    def _checked(self, name: str, value: Any, width: int) -> Tensor:
        tensor = torch.as_tensor(value, dtype=self.dtype, device=self.device)
        if tensor.shape != (self.count, width):
            raise ValueError(f"{name} must have shape {(self.count, width)}, got {tuple(tensor.shape)}")
        return tensor


def _step(state: Tensor, torques: Tensor, h: float, robot: RobotParameters) -> Tensor:
    """One RK4 step of h seconds of states (7 + 2 N, robots) under joint torques (2 N, robots)."""
    end = rk4_step(unpack_state(state.unbind(0)), pairs(torques.unbind(0)), _NO_WRENCH, h, robot)
    return torch.stack(pack_state(end))
