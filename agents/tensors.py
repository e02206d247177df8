"""Tasks for learners that keep the robots as tensors."""

from typing import Any

from .settings import TaskSettings


def torch_fields(task: TaskSettings) -> dict[str, Any]:
    """What `TorchTask` and `TorchVectorEnv` call the robot, its surroundings and its training paths.

    Raises ValueError for wrappers and shaped rewards, which work on arrays.
    """
    for kind, features in (("wrappers", task.wrappers), ("shaping", task.shaping)):
        if features:
            raise ValueError(
                f"{kind} work on NumPy arrays, not on tensors: train with algorithm 'ppo' or 'sac', "
                f"or leave out {', '.join(repr(feature.kind) for feature in features)}"
            )
    return {"robot": task.robot, "path": task.train, "actuation": task.actuation, "arena": task.arena}
