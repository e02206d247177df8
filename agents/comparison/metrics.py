"""How each task is measured and judged: the one place that knows what belongs to which."""

from collections.abc import Callable
from typing import Any, NamedTuple, TypeAlias

from caster_gym.agents.comparison import follow_metrics, track_metrics
from caster_gym.agents.comparison.evaluation import Episodes
from caster_gym.agents.comparison.follow_metrics import FollowMetrics, FollowVerdict
from caster_gym.agents.comparison.measuring import Printed, shown
from caster_gym.agents.comparison.track_metrics import TrackMetrics, TrackVerdict
from caster_gym.envs.follow_task import FollowTask
from caster_gym.envs.task import Task
from caster_gym.envs.track_task import TrackTask

Metrics: TypeAlias = TrackMetrics | FollowMetrics
Verdict: TypeAlias = TrackVerdict | FollowVerdict


class Yardstick(NamedTuple):
    """How episodes of a task are measured, and what is better."""

    measure: Callable[[Episodes, float], Any]  # Metrics from episodes and settling [s]
    verdict: type[TrackVerdict] | type[FollowVerdict]
    settling: float  # [s] what comes before counts as transient


_YARDSTICKS: dict[type[Task], Yardstick] = {
    TrackTask: Yardstick(track_metrics.measure, TrackVerdict, track_metrics.SETTLING),
    FollowTask: Yardstick(follow_metrics.measure, FollowVerdict, follow_metrics.SETTLING),
}


def yardstick(task: Task) -> Yardstick:
    """How a task is measured."""
    return _YARDSTICKS[type(task)]


def in_words(verdict: Verdict) -> str:
    """The verdict's main numbers and its failures, such as "position RMSE 1.23 mm, 0 failures"."""
    parts = []
    for name, how in shown(type(verdict)):
        if isinstance(how, Printed):
            parts.append(f"{how.title} {how.factor * getattr(verdict, name):.3g} {how.unit}")
    return ", ".join([*parts, f"{verdict.failures} failure{'s' * (verdict.failures != 1)}"])
