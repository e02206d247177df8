"""What is measured of the tracking task."""

from typing import Annotated, NamedTuple, Self

import numpy as np

from caster_gym.arrays import Array
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import Counted, Metrics, Printed, costs, greatest, mean, overall, rms


class TrackMetrics(NamedTuple):
    """One number per episode (episodes,)."""

    position_rmse: Annotated[Array, Printed("position RMSE", "mm", 1e3)]  # [m] after settling
    heading_rmse: Annotated[Array, Printed("heading RMSE", "mrad", 1e3)]  # [rad] after settling
    worst_position: Annotated[Array, Printed("worst position error", "mm", 1e3)]  # [m] after settling
    position_rmse_transient: Annotated[Array, Printed("position RMSE, transient", "mm", 1e3)]  # [m] before
    heading_rmse_transient: Annotated[Array, Printed("heading RMSE, transient", "mrad", 1e3)]  # [rad] before
    effort: Annotated[Array, Printed("effort", "% of limits squared", 1e2)]  # the next four as in Costs
    peak_torque: Annotated[Array, Printed("peak torque", "N m")]
    torque_variation: Annotated[Array, Printed("torque variation", "1/s")]
    saturation: Annotated[Array, Printed("saturated", "%", 1e2)]
    reward: Array  # mean per step
    failed: Annotated[Array, Counted("failures")]  # 1 or 0


class TrackVerdict(NamedTuple):
    """How good an agent is on validation paths."""

    position_rmse: Annotated[float, Printed("position RMSE", "mm", 1e3, "log")]  # [m] over all episodes, settled
    worst_position: float  # [m]
    heading_rmse: float  # [rad]
    failures: int
    reward: float  # mean per step

    @property
    def merit(self) -> tuple[float, float]:
        """What makes an agent better than another: fewer failures, then a smaller error."""
        return -self.failures, -self.position_rmse

    @classmethod
    def of(cls, metrics: TrackMetrics) -> Self:
        """The verdict on episodes."""
        settled = np.isfinite(metrics.worst_position)
        return cls(
            overall(metrics.position_rmse),
            float(metrics.worst_position[settled].max()) if settled.any() else float("inf"),
            overall(metrics.heading_rmse),
            int(metrics.failed.sum()),
            float(np.nanmean(metrics.reward)),
        )


def measure(episodes: Episodes, settling: float) -> TrackMetrics:
    """Metrics of episodes, transient (before `settling` seconds) and steady apart.

    An episode that failed counts with what it did before; one that failed before settling has no steady values (NaN).
    """
    first = round(settling / episodes.period)
    return TrackMetrics(
        rms(episodes.position_error[first:]),
        rms(episodes.heading_error[first:]),
        greatest(episodes.position_error[first:]),
        rms(episodes.position_error[:first]),
        rms(episodes.heading_error[:first]),
        *costs(episodes),
        reward=mean(episodes.reward),
        failed=episodes.failed.astype(np.float64),
    )


METRICS = Metrics(measure, TrackVerdict, settling=2.0)
