"""What a search may choose: typed dimensions, each of a field of the settings of a task or an agent."""

import json
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Annotated, Any, Self, TypeAlias

from pydantic import Discriminator, Field, PositiveFloat, PositiveInt, Tag, model_validator

from caster_gym.configuration import ConfigurationError, Frozen

if TYPE_CHECKING:
    from optuna.distributions import BaseDistribution

Plain: TypeAlias = bool | int | float | str | None


class WholeRange(Frozen):
    """Whole numbers from low to high, both included."""

    low: int
    high: int
    log: bool = False  # equally often in each decade, so that low must be 1 or more
    step: PositiveInt = 1  # from one number to the next, counted from low

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _check_range(self.low, self.high, self.log, self.step != 1)
        return self

    @property
    def distribution(self) -> "BaseDistribution":
        """What Optuna calls it."""
        from optuna.distributions import IntDistribution

        last = self.high - (self.high - self.low) % self.step
        return IntDistribution(self.low, last, log=self.log, step=self.step)

    @property
    def examples(self) -> tuple[int, ...]:
        """Values to try."""
        return self.low, self.high

    def value(self, chosen: Plain) -> Any:
        """The setting that a choice of Optuna means."""
        return chosen


class Range(Frozen):
    """Numbers from low to high."""

    low: float
    high: float
    log: bool = False  # equally often in each decade, so that low must be positive
    step: PositiveFloat | None = None  # from one number to the next, counted from low; None: all numbers in between

    @model_validator(mode="after")
    def _is_a_range(self) -> Self:
        _check_range(self.low, self.high, self.log, self.step is not None)
        return self

    @property
    def distribution(self) -> "BaseDistribution":
        """What Optuna calls it."""
        from optuna.distributions import FloatDistribution

        return FloatDistribution(self.low, self.high, log=self.log, step=self.step)

    @property
    def examples(self) -> tuple[float, ...]:
        """Values to try."""
        return self.low, self.high

    def value(self, chosen: Plain) -> Any:
        """The setting that a choice of Optuna means."""
        return chosen


class Choices(Frozen):
    """One of several values of any kind, in no order."""

    choices: Annotated[tuple[Any, ...], Field(min_length=1)]

    @model_validator(mode="after")
    def _differ(self) -> Self:
        if len(set(self._labels)) < len(self._labels):
            raise ValueError(f"'choices' must differ from one another, got {list(self.choices)}")
        return self

    @property
    def _labels(self) -> tuple[str, ...]:
        """Names of the choices, which a database can hold whatever the values are."""
        return tuple(json.dumps(one) for one in self.choices)

    @property
    def distribution(self) -> "BaseDistribution":
        """What Optuna calls it."""
        from optuna.distributions import CategoricalDistribution

        return CategoricalDistribution(self._labels)

    @property
    def examples(self) -> tuple[Any, ...]:
        """Values to try."""
        return self.choices

    def value(self, chosen: Plain) -> Any:
        """The setting that a choice of Optuna means."""
        return self.choices[self._labels.index(str(chosen))]


def _kind(content: Any) -> str:
    """Which kind of dimension is meant; a range is one of whole numbers if all that is given is whole."""
    if isinstance(content, Frozen):
        return {WholeRange: "whole", Choices: "choices"}.get(type(content), "range")
    if not isinstance(content, Mapping) or "choices" in content:
        return "choices"
    return "range" if any(isinstance(content.get(key), float) for key in ("low", "high", "step")) else "whole"


Dimension: TypeAlias = Annotated[
    Annotated[WholeRange, Tag("whole")] | Annotated[Range, Tag("range")] | Annotated[Choices, Tag("choices")],
    Discriminator(_kind),
]


def _check_range(low: float, high: float, log: bool, steps: bool) -> None:
    if low >= high:
        raise ValueError(f"'low' must be below 'high', got {low:g} and {high:g}")
    if log and low <= 0.0:
        raise ValueError(f"'low' must be positive where 'log' is true, got {low:g}")
    if log and steps:
        raise ValueError("'step' is for ranges without 'log'")


def with_settings(content: Mapping[str, Any], settings: Mapping[str, Any]) -> dict[str, Any]:
    """Content of a YAML file with some settings changed, by the keys that lead to them, as "learning_rate.start".

    Items of lists are counted from 0, as "train.0.duration". Mappings that are not there are made.
    """
    changed: Any = dict(content)
    for name, value in settings.items():
        changed = _changed(changed, name.split("."), value, name)
    return dict(changed)


def _changed(content: Any, keys: Sequence[str], value: Any, name: str) -> Any:
    if not keys:
        return value
    key, *rest = keys
    if isinstance(content, list):
        if not key.isdecimal() or int(key) >= len(content):
            raise ConfigurationError(f"{name!r}: {key!r} is no item of a list of {len(content)}, counted from 0")
        return [_changed(one, rest, value, name) if i == int(key) else one for i, one in enumerate(content)]
    inner = dict(content) if isinstance(content, Mapping) else {}
    return {**inner, key: _changed(inner.get(key), rest, value, name)}
