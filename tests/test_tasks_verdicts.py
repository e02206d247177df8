"""caster_gym.tasks.verdicts: what a task of a user's own measures and says of it is used, or told in a sentence."""

import math
from typing import Any, NamedTuple

import numpy as np
import pytest

from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.measuring import Metrics
from caster_gym.tasks.registry import TASKS, find_task
from caster_gym.tasks.verdicts import measured, verdict_of
from tests.series import episodes

HERE = r"test_tasks_verdicts\.py, line \d+"


class Found(NamedTuple):
    """Metrics of an own task."""

    error: Any
    failed: Any


class Verdict(NamedTuple):
    """An own verdict."""

    error: Any
    failures: Any = 0

    @property
    def merit(self) -> Any:
        return (-self.error,)

    @classmethod
    def of(cls, metrics: Found) -> Any:
        return cls(float(np.mean(metrics.error)))


class Listed(Verdict):
    @property
    def merit(self) -> Any:
        return [-self.error]


class Empty(Verdict):
    @classmethod
    def of(cls, metrics: Found) -> Any:
        return {"error": 1.0}


class Mistaken(Verdict):
    @classmethod
    def of(cls, metrics: Found) -> Any:
        return cls(metrics.speed)  # type: ignore[attr-defined]


class Negative(Verdict):
    @classmethod
    def of(cls, metrics: Found) -> Any:
        return cls(1.0, -1)


class Arrays(Verdict):
    @classmethod
    def of(cls, metrics: Found) -> Any:
        return cls(metrics.error)


def own(given: Any = None, verdict: Any = Verdict) -> Metrics:
    return Metrics(lambda episodes, settling: given, verdict, settling=2.0)


@pytest.mark.parametrize("name", TASKS)
def test_tasks_of_the_package_are_measured_as_they_say(name):
    how = find_task(name).metrics
    seen = episodes()
    metrics = measured(how, seen, 0.0)
    np.testing.assert_equal(metrics, how.measure(seen, 0.0))
    np.testing.assert_equal(verdict_of(how, metrics), how.verdict.of(metrics))


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({"error": [0.1, 0.2]}, "must return a named tuple of metrics, got a dict"),
        (None, "must return a named tuple of metrics, got a NoneType"),
        (Found(0.1, np.zeros(2)), r"one number for each of 2 episodes as 'error', an array of shape \(2,\), got shape"),
        (Found(np.zeros(2), np.zeros((5, 2))), r"as 'failed', an array of shape \(2,\), got shape \(5, 2\)"),
        (Found(np.zeros(2), np.array(["no", "yes"])), "as 'failed', .* got what are no numbers"),
    ],
)
def test_what_are_no_metrics_is_told(given, message):
    with pytest.raises(OwnCodeError, match=message):
        measured(own(given), episodes((5, 5)), 0.0)


def test_an_error_of_metrics_is_told_with_its_line():
    def measure(episodes: Any, settling: float) -> Any:
        return Found(episodes.speed, episodes.failed)

    with pytest.raises(
        OwnCodeError, match=rf"measure, by which a task is measured,: AttributeError: .*'speed'.*{HERE}"
    ):
        measured(Metrics(measure, Verdict, 2.0), episodes((5, 5)), 0.0)


@pytest.mark.parametrize(
    ("verdict", "error", "message"),
    [
        (Verdict, math.nan, "must have numbers that can be compared as `merit`, got nan at place 1"),
        (Listed, 1.0, r"must have a tuple of numbers as `merit`, such as \(-self\.failures,\), got \[-1\.0\]"),
        (Empty, 1.0, "must be what its method `of` returns, got a dict"),
        (Mistaken, 1.0, rf"AttributeError: .*'speed'.*{HERE}"),
        (Negative, 1.0, "must count failures, 0 or more, as `failures`, got -1"),
        (Arrays, 1.0, "must have a number as `error`, got a ndarray"),
    ],
)
def test_what_is_no_verdict_is_told(verdict, error, message):
    with pytest.raises(OwnCodeError, match=message):
        verdict_of(own(verdict=verdict), Found(np.full(2, error), np.zeros(2)))
