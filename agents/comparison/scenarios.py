"""Scenarios: what a comparison adds to its task, by name, and for which of them an agent is prepared."""

import re
from collections.abc import Mapping, Sequence
from typing import Annotated, Any, ClassVar, TypeAlias

from pydantic import AfterValidator, BeforeValidator, Discriminator, Tag

from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.brief import brief
from caster_gym.configuration import Frozen
from caster_gym.file_names import NameOrFile
from caster_gym.wrappers.specification import FeatureSpecification

EACH = "each"  # every scenario
_TAKEN = (EACH, "policies")  # names that mean something else


class Entrant(Frozen):
    """An agent that takes part, and the scenario that it is prepared for, by training or by tuning."""

    usual_names: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(("name", "file"), "agent"),
        **dict.fromkeys(("scenario", "trained_on", "tuned_on", "on"), "prepared_for"),
    }
    agent: NameOrFile  # name of a file in configs/agents, or path of one
    prepared_for: str = EACH  # a scenario; each: every one apart, and then it is tested on that one alone

    def prepared(self, tested: str) -> str:
        """The scenario for which it was prepared that is tested on this one."""
        return tested if self.prepared_for == EACH else self.prepared_for


def _how_written(agent: object) -> str:
    return "named" if isinstance(agent, str) else "mapping"


AnyEntrant: TypeAlias = Annotated[
    Annotated[NameOrFile, Tag("named")] | Annotated[Entrant, Tag("mapping")], Discriminator(_how_written)
]


def _named(features: Any) -> Any:
    if not isinstance(features, list | tuple):
        return features
    return [{"kind": feature} if isinstance(feature, str) else feature for feature in features]


def _is_a_folder(name: str) -> str:
    if not re.fullmatch("[A-Za-z0-9_-]{1,40}", name) or name in _TAKEN:
        raise ValueError(
            f"names of scenarios consist of at most 40 letters, digits, _ and -, and are not {' or '.join(_TAKEN)}, "
            f"got {brief(name)}"
        )
    return name


ScenarioName: TypeAlias = Annotated[str, AfterValidator(_is_a_folder)]  # of its folder of results too
Scenario: TypeAlias = Annotated[tuple[FeatureSpecification, ...], BeforeValidator(_named)]  # after the task's wrappers


def tasks_of(task: TaskSettings, scenarios: Mapping[str, Sequence[Any]]) -> dict[str, TaskSettings]:
    """The task of each scenario, by its name; where there are no scenarios, the task itself, whose name is empty."""
    if not scenarios:
        return {"": task}
    return {
        name: task.model_copy(update={"wrappers": (*task.wrappers, *features)}) for name, features in scenarios.items()
    }
