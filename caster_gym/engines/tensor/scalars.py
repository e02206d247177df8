"""Torch tensors as scalars of the mechanics, on a device. Every Torch engine starts from this file."""

import os
from collections.abc import Sequence

import numpy as np
import torch
from torch import Tensor

from caster_gym.mechanics.parameters import (
    Dynamics,
    RobotParameters,
    pack_parameters,
    robot_parameters,
    unpack_parameters,
)
from caster_gym.mechanics.scalars import register
from caster_gym.robot import Robot


def _sqrt(x: Tensor) -> Tensor:
    """√x whose derivative at 0 is 1, not infinite: what is chosen away must not turn a gradient into NaN."""
    none = x == 0.0
    return torch.where(none, x, torch.sqrt(torch.where(none, 1.0, x)))


register(torch.Tensor, torch.where, _sqrt, torch.any)


def checked_dtype(dtype: torch.dtype) -> torch.dtype:
    """Single or double precision; half precision cannot carry the equations."""
    if dtype not in (torch.float32, torch.float64):
        raise ValueError(f"dtype must be torch.float32 or torch.float64, got {dtype}")
    return dtype


def checked_device(device: torch.device | str) -> torch.device:
    """A device of this machine."""
    try:
        place = torch.device(device)
        torch.empty(0, device=place)
    # Torch raises a RuntimeError for an unknown name or number, and one of the others, depending on the kind of device,
    # where it was built without that kind
    except (RuntimeError, AssertionError, NotImplementedError, ImportError) as error:
        reason = str(error).splitlines()[0]
        raise ValueError(
            f"device must be one that Torch finds on this machine, got {str(device)!r}: {reason}"
        ) from None
    return place


def check_memory(robots: int, numbers: int, dtype: torch.dtype, device: torch.device) -> None:
    """Refuse a batch whose robots, each of so many numbers, do not fit into the memory of the device."""
    if robots < 1:
        raise ValueError(f"a batch needs 1 robot or more, got {robots}")
    needed = robots * numbers * torch.finfo(dtype).bits // 8
    if device.type == "cuda":
        room = torch.cuda.mem_get_info(device)[0]
    else:
        room = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    if needed > room:
        raise ValueError(
            f"a batch of {robots:,} robots needs at least {needed / 2**30:,.3g} GiB of memory, and device "
            f"{str(device)!r} has {room / 2**30:,.3g} GiB: take fewer robots"
        )


def parameter_rows(
    robots: Sequence[Robot], dtype: torch.dtype, device: torch.device, dynamics: Dynamics = "exact"
) -> Tensor:
    """The numbers of each robot (robots, fields), in the order of `pack_parameters`."""
    packed = {id(robot): pack_parameters(robot_parameters(robot, dynamics)) for robot in robots}
    rows = np.array([packed[id(robot)] for robot in robots])
    return torch.as_tensor(rows, dtype=dtype, device=device)


def parameters_of(rows: Tensor) -> RobotParameters:
    """Parameters whose fields are tensors (robots,), from rows (robots, fields)."""
    return unpack_parameters(rows.unbind(1))
