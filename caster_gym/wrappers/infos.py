"""Infos and observations of a step, as features want them and as they leave them."""

from typing import Any

import numpy as np

from caster_gym.arrays import Flags
from caster_gym.wrappers.feature import Observations


def last(observations: Observations, infos: dict[str, Any]) -> Observations:
    """What the environment showed at the end of the step, before any reset."""
    if "final_obs" not in infos:
        return observations
    shown, ended = observations.copy(), infos["_final_obs"]
    shown[ended] = np.stack(list(infos["final_obs"][ended]))
    return shown


def batch_of_one(info: dict[str, Any]) -> dict[str, Any]:
    """Info of one robot as that of a batch; reward terms as they are."""
    return {key: value if isinstance(value, dict) else np.asarray(value)[None] for key, value in info.items()}


def tell(infos: dict[str, Any], task_reward: Any, terms: dict[str, Any], mask: Flags | None = None) -> None:
    """Put the task's reward and the added terms into infos, with masks if they are those of a batch."""
    infos["task_reward"] = task_reward
    infos["reward_terms"].update(terms)
    if mask is not None:
        infos["_task_reward"] = mask.copy()
        infos["reward_terms"].update({f"_{name}": mask.copy() for name in terms})
