"""Rewards that are not finite are told by the term and the task that gave them, before anybody learns from them."""

import math
from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.task import Task


def check_rewards(task: Task, rewards: Any, tell: Callable[[], Mapping[str, Any]]) -> None:
    """Refuse rewards (robots,), arrays or tensors, of which one is infinite or not a number. Raises OwnCodeError.

    tell: the infos of the same step, with the terms of the rewards.
    """
    if math.isfinite(float(rewards.sum())):
        return
    code = task.reward.__code__
    place = f"{code.co_filename}, line {code.co_firstlineno}"
    for name, values in _terms(tell()):
        if (wrong := _not_finite(values)) is not None:
            where = f"task {task.name!r} ({place})" if name in task.terms._fields else "the features"
            raise OwnCodeError(f"the reward term {name!r} of {where} was {wrong} in a step: it must always be finite")
    if (wrong := _not_finite(rewards)) is not None:
        raise OwnCodeError(f"a reward of task {task.name!r} ({place}) was {wrong} in a step: it must always be finite")


def _terms(infos: Mapping[str, Any]) -> Iterator[tuple[str, Any]]:
    """Terms of all robots; of those whose episode has ended, the last ones are apart."""
    for told in (infos, infos.get("final_info", {})):
        yield from told.get("reward_terms", {}).items()


def _not_finite(values: Any) -> float | None:
    """The first number that is not finite, if there is one."""
    numbers = np.asarray(values.tolist(), dtype=np.float64)  # of arrays and of tensors anywhere
    wrong = numbers[~np.isfinite(numbers)]
    return float(wrong[0]) if wrong.size else None
