"""Tasks for learners that keep the robots as tensors."""

from typing import Any

import torch

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.learning.settings import OnTensors


def torch_fields(task: TaskSettings) -> dict[str, Any]:
    """What `TorchTask` and `TorchVectorEnv` call the robot, its surroundings and its training paths.

    Raises ValueError for wrappers and shaped rewards, which work on arrays.
    """
    for kind, features in (("wrappers", task.wrappers), ("shaping", task.shaping)):
        if features:
            raise ValueError(
                f"{kind!r} of the task need NumPy arrays, and this agent works on tensors: train agent 'ppo' or 'sac', "
                f"or leave out {', '.join(repr(feature.kind) for feature in features)}"
            )
    return {"robot": task.robot, "path": task.train, "actuation": task.actuation, "arena": task.arena}


def check_compiler(settings: OnTensors) -> None:
    """Raises ValueError if the robots' step is to be compiled for the CPU and there is no C++ compiler."""
    if not settings.compile or torch.device(settings.device).type != "cpu":
        return
    from torch._inductor.cpp_builder import get_cpp_compiler  # as Torch itself finds it; slow to import
    from torch._inductor.exc import InvalidCxxCompiler

    try:
        get_cpp_compiler()
    except InvalidCxxCompiler:
        raise ValueError(
            "compile=true needs a C++ compiler, and none was found: install g++ or name one in the environment "
            "variable CXX, or set compile=false, which takes many times as long"
        ) from None
