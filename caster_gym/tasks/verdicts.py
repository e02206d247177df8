"""Metrics of episodes and verdicts on them, checked: what a task of a user's own gives amiss is told in a sentence."""

import math
from numbers import Real
from typing import Any

import numpy as np

from caster_gym.brief import brief
from caster_gym.own_errors import OwnCodeError, in_own_code
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import Metrics


def measured(how: Metrics, episodes: Episodes, settling: float) -> Any:
    """A task's metrics of episodes, a named tuple of one number for each (episodes,). Raises OwnCodeError."""
    said = f"{how.measure.__module__}.{how.measure.__qualname__}, by which a task is measured,"
    with in_own_code(said, how.measure):
        given = how.measure(episodes, settling)
    if not getattr(given, "_fields", ()):
        raise OwnCodeError(f"{said} must return a named tuple of metrics, got a {type(given).__name__}")
    count = len(episodes.names)
    for name, values in given._asdict().items():
        shape, numbers = np.shape(values), np.asarray(values).dtype.kind in "biuf"
        if shape != (count,) or not numbers:
            raise OwnCodeError(
                f"{said} must give one number for each of {count} episodes as {name!r}, an array of shape ({count},), "
                f"got {f'shape {shape}' if numbers else 'what are no numbers'}"
            )
    return given


def verdict_of(how: Metrics, metrics: Any) -> Any:
    """A task's verdict on such metrics, which can be compared. Raises OwnCodeError."""
    kind, said = how.verdict, f"the verdict {how.verdict.__module__}.{how.verdict.__qualname__}"
    with in_own_code(said, kind):
        verdict = kind.of(metrics)
        if isinstance(verdict, kind):
            merit, failures = verdict.merit, verdict.failures
    if not isinstance(verdict, kind):
        raise OwnCodeError(f"{said} must be what its method `of` returns, got a {type(verdict).__name__}")
    if not isinstance(merit, tuple) or not merit:
        raise OwnCodeError(
            f"{said} must have a tuple of numbers as `merit`, such as (-self.failures,), got {brief(merit)}"
        )
    named = {**verdict._asdict(), "failures": failures, **{f"merit[{i}]": one for i, one in enumerate(merit)}}
    for name, number in named.items():
        if not isinstance(number, Real):
            raise OwnCodeError(f"{said} must have a number as `{name}`, got a {type(number).__name__}")
    for i, number in enumerate(merit):
        if math.isnan(number):
            raise OwnCodeError(f"{said} must have numbers that can be compared as `merit`, got nan at place {i + 1}")
    if not 0.0 <= failures < math.inf:
        raise OwnCodeError(f"{said} must count failures, 0 or more, as `failures`, got {brief(failures)}")
    return verdict
