"""The mechanics on Torch tensors, eagerly and with gradients."""

import reprlib
from typing import Any

import torch
from torch import Tensor

from caster_gym.engines.numpy_model import RobotModel
from caster_gym.engines.tensor.scalars import checked_device, checked_dtype
from caster_gym.mechanics.parameters import Dynamics, RobotParameters
from caster_gym.robot import Robot


class TorchModel(RobotModel[Tensor]):
    """`caster_gym.Model` for tensors of one floating-point type on one device; gradients pass through every method.

    parameters may hold tensors, so that gradients with respect to the robot's own numbers exist too. Values are not
    checked for being finite, since that would wait for the device.

    >>> import caster_gym, torch
    >>> model = caster_gym.TorchModel(caster_gym.load_robot("chung2008"))
    >>> steering = torch.zeros(3, dtype=torch.float64, requires_grad=True)
    >>> model.inertia(steering)[0, 1].backward()
    >>> steering.grad  # of an element of the inertia matrix by the steering angles [kg/rad]
    tensor([0.7097, 0.7097, 0.7097], dtype=torch.float64)
    """

    _arrays: Any = torch

    def __init__(
        self,
        robot: Robot,
        dynamics: Dynamics = "exact",
        parameters: RobotParameters | None = None,
        dtype: torch.dtype = torch.float64,
        device: torch.device | str = "cpu",
    ) -> None:
        super().__init__(robot, dynamics, parameters)
        self.dtype = checked_dtype(dtype)
        self.device = checked_device(device)

    def _replaced(self, parameters: RobotParameters) -> None:
        """Numbers given in place of the robot's own may be tensors whose values nobody may ask for."""

    def _array(self, name: str, value: Any, last: int) -> Any:
        tensor = self._numbers(name, value)
        self._check_shape(name, tensor, last)
        return tensor

    def _numbers(self, name: str, value: Any) -> Any:
        try:
            return torch.as_tensor(value, dtype=self.dtype, device=self.device)
        except (ValueError, TypeError, RuntimeError) as error:  # the last of None, whose type it cannot infer
            raise ValueError(f"{name} must hold real numbers, got {reprlib.repr(value)}") from error

    def _scalar(self, value: Any) -> Tensor:
        number: Tensor = value
        return number

    def _stack(self, parts: Any, axis: int = -1) -> Tensor:
        tensors = [torch.as_tensor(part, dtype=self.dtype, device=self.device) for part in parts]
        # Torch ships this one function without types
        alike = torch.broadcast_tensors(*tensors)  # type: ignore[no-untyped-call]  # Torch ships it without types
        return torch.stack(alike, axis)
