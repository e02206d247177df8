"""Gymnasium's specification of an environment in plain values, for JSON and `gymnasium.make`."""

from collections.abc import Mapping
from dataclasses import replace
from enum import Enum
from os import PathLike, fspath
from typing import TYPE_CHECKING, Any

import numpy as np
from gymnasium.envs.registration import EnvSpec
from numpy.typing import NDArray
from pydantic import BaseModel

from caster_gym.paths.timed import timed_path
from caster_gym.paths.trajectory import Trajectory
from caster_gym.states import describe

if TYPE_CHECKING:
    from caster_gym.envs.native.engine import TaskEngine  # which imports SciPy, by way of Numba


def plain_specification(spec: EnvSpec | None) -> EnvSpec | None:
    """The specification with the objects among its keywords as mappings, lists, numbers and words."""
    return spec if spec is None else replace(spec, kwargs={name: plain(value) for name, value in spec.kwargs.items()})


def describe_environment(task: BaseModel, engine: "TaskEngine", **more: Any) -> NDArray[np.uint8]:
    """What tells an environment from others whose state it could not go on from; more: facts beside task and robot."""
    parameters = {"kind": type(task).__name__, **plain(task)}
    facts = {"number of robots": engine.count, "task": parameters, "robot": plain(engine.robot), **more}
    return describe(facts | {"fingerprint of paths": engine.plan_fingerprint})


def plain(value: Any) -> Any:
    """What a robot, a path or any other part of a description is in YAML; what has no such form stays as it is."""
    if isinstance(value, Trajectory):
        return plain(timed_path(value))
    if isinstance(value, BaseModel):
        return {name: plain(getattr(value, name)) for name in type(value).model_fields}
    if isinstance(value, Mapping):
        return {key: plain(one) for key, one in value.items()}
    if isinstance(value, list | tuple):
        return [plain(one) for one in value]
    if isinstance(value, np.ndarray | np.generic):
        return value.tolist()
    if isinstance(value, Enum):
        return value.value
    return fspath(value) if isinstance(value, PathLike) else value
