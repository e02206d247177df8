"""How tasks are measured: what metrics are, how they are printed, and means over time of series with gaps."""

import math
from collections.abc import Callable, Iterator
from typing import Annotated, Any, Literal, NamedTuple, get_args, get_origin, get_type_hints

import numpy as np

from caster_gym.arrays import Array
from caster_gym.tasks.episodes import Episodes

SATURATED = 0.999  # commands from here on count as saturated, and torques that differ from theirs by the rest


class Printed(NamedTuple):
    """How a quantity appears in tables and figures; it stands in the annotation of its field."""

    title: str
    unit: str = ""
    factor: float = 1.0  # from the SI unit to that one
    scale: Literal["linear", "log"] = "linear"  # of an axis

    @property
    def label(self) -> str:
        """Title and unit."""
        return f"{self.title} [{self.unit}]" if self.unit else self.title


class Counted(NamedTuple):
    """How a quantity that is 1 or 0 appears in tables: how many are 1, of how many."""

    label: str


class Metrics(NamedTuple):
    """How episodes of a task are measured, and what is better.

    A verdict is a named tuple that tells how good an agent is on validation paths: `verdict.of(measured)` makes it,
    `failures` counts, and the greatest `merit`, a tuple of numbers, is the best. `Printed` and `Counted` in annotations
    of fields say what tables and figures show.
    """

    measure: Callable[[Episodes, float], Any]  # a named tuple of metrics (episodes,), from episodes and settling [s]
    verdict: Any
    settling: float  # [s] what comes before counts as transient


def shown(quantities: type[Any]) -> Iterator[tuple[str, Printed | Counted]]:
    """Names of the fields of a NamedTuple that are to be seen, with how, in their order."""
    for name, hint in get_type_hints(quantities, include_extras=True).items():
        if get_origin(hint) is Annotated:
            yield from ((name, how) for how in get_args(hint)[1:] if isinstance(how, Printed | Counted))


class Costs(NamedTuple):
    """What driving cost, one number per episode (episodes,)."""

    effort: Array  # mean square torque as a share of the limits
    peak_torque: Array  # [N m]
    torque_variation: Array  # [1/s] total variation of the torque shares per second, mean over driven motors
    saturation: Array  # share of torques that a motor's limit cut, or that were asked at the limit


def costs(episodes: Episodes) -> Costs:
    """What the torques of whole episodes cost."""
    share = episodes.share[..., episodes.driven]
    limited = np.abs(share - episodes.command) > 1.0 - SATURATED
    at_limit = limited | (np.abs(episodes.command) >= SATURATED)
    steps = np.isfinite(episodes.reward).sum(axis=0)
    change = np.nansum(np.abs(np.diff(share, axis=0)), axis=0) / (steps * episodes.period)[:, None]
    return Costs(
        effort=mean(np.square(share).mean(axis=-1)),
        peak_torque=greatest(np.abs(episodes.torque).max(axis=-1)),
        torque_variation=change.mean(axis=-1),
        saturation=at_limit.sum(axis=(0, 2)) / (steps * at_limit.shape[2]),
    )


def mean(series: Array) -> Array:
    """Mean over time of what is there; NaN where nothing is."""
    there = np.isfinite(series)
    count = there.sum(axis=0)
    total = np.where(there, series, 0.0).sum(axis=0)
    return np.where(count > 0, total / np.maximum(count, 1), np.nan)


def rms(series: Array) -> Array:
    """Root mean square over time of what is there."""
    return np.sqrt(mean(np.square(series)))


def greatest(series: Array) -> Array:
    """Greatest value over time of what is there; not a number where nothing is."""
    there = np.isfinite(series)
    most = np.where(there, series, -np.inf).max(axis=0, initial=-np.inf)
    return np.where(there.any(axis=0), most, np.nan)


def average(numbers: Array) -> float:
    """Mean over the episodes that have such a number; infinite if there is none."""
    there = numbers[np.isfinite(numbers)]
    return float(there.mean()) if there.size else math.inf


def overall(rmse: Array) -> float:
    """Root mean square of the episodes' own, those without one left out; infinite if there is none."""
    return math.sqrt(average(np.square(rmse)))
