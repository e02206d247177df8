"""What is measured of the following task."""

from typing import Annotated, NamedTuple, Self

import numpy as np

from caster_gym.arrays import Array
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import Counted, Metrics, Printed, average, costs, greatest, overall, rms


class FollowMetrics(NamedTuple):
    """One number per episode (episodes,). On the way: until the path was done, or the episode over."""

    finished: Annotated[Array, Counted("finished")]  # 1 or 0
    lap_time: Annotated[Array, Printed("time for the path", "s")]  # [s] NaN if it was not finished
    lap_share: Annotated[Array, Printed("time over the time law's", "%", 1e2)]  # the same, of what the time law takes
    mean_speed: Annotated[Array, Printed("mean speed along it", "m/s")]  # [m/s] on the way
    cross_track_rmse: Annotated[Array, Printed("cross-track RMSE", "mm", 1e3)]  # [m] on the way, after settling
    worst_cross_track: Annotated[Array, Printed("worst cross-track error", "mm", 1e3)]  # [m] likewise
    heading_rmse: Annotated[Array, Printed("heading RMSE", "mrad", 1e3)]  # [rad] likewise
    impacts: Annotated[Array, Printed("impacts per episode")]
    greatest_impulse: Annotated[Array, Printed("greatest normal impulse", "N s")]  # [N s] in a control period
    least_clearance: Annotated[Array, Printed("least clearance", "mm", 1e3)]  # [m] NaN where there is no obstacle
    effort: Annotated[Array, Printed("effort", "% of limits squared", 1e2)]  # the next four as in Costs
    peak_torque: Annotated[Array, Printed("peak torque", "N m")]
    torque_variation: Annotated[Array, Printed("torque variation", "1/s")]
    saturation: Annotated[Array, Printed("saturated", "%", 1e2)]
    reward: Annotated[Array, Printed("reward per step allowed")]  # steps that a failure cost count as 0
    failed: Annotated[Array, Counted("failures")]  # 1 or 0


class FollowVerdict(NamedTuple):
    """How good an agent is on validation paths."""

    lap_share: Annotated[float, Printed("time for the path", "% of the time law's", 1e2)]  # mean of those finished
    cross_track_rmse: Annotated[float, Printed("cross-track RMSE", "mm", 1e3, "log")]  # [m] over all episodes, settled
    heading_rmse: float  # [rad]
    impacts: float  # mean per episode
    unfinished: int
    failures: int
    reward: float  # mean per step allowed

    @property
    def merit(self) -> tuple[float, float, float]:
        """What makes an agent better than another: fewer failures, then fewer paths left unfinished, then reward."""
        return -self.failures, -self.unfinished, self.reward

    @classmethod
    def of(cls, metrics: FollowMetrics) -> Self:
        """The verdict on episodes."""
        return cls(
            average(metrics.lap_share),
            overall(metrics.cross_track_rmse),
            overall(metrics.heading_rmse),
            float(metrics.impacts.mean()),
            int((metrics.finished == 0.0).sum()),
            int(metrics.failed.sum()),
            float(metrics.reward.mean()),
        )


def measure(episodes: Episodes, settling: float) -> FollowMetrics:
    """Metrics of episodes. Errors of the first `settling` seconds do not count.

    An episode that failed counts with what it did before; one that was over before settling has no errors (NaN).
    """
    arrived = episodes.progress >= episodes.facts["goal"]
    finished = np.asarray(arrived.any(axis=0))
    steps = np.isfinite(episodes.reward).sum(axis=0)
    last = np.where(finished, arrived.argmax(axis=0), steps - 1)
    time = (last + 1) * episodes.period
    k = np.arange(len(arrived))[:, None]
    counts = (k <= last) & (k >= round(settling / episodes.period))
    off, turned = (np.where(counts, e, np.nan) for e in (episodes.position_error, episodes.heading_error))
    lap_time = np.where(finished, time, np.nan)
    reached = np.take_along_axis(episodes.progress, last[None], axis=0)[0]
    return FollowMetrics(
        finished.astype(np.float64),
        lap_time,
        lap_time / episodes.facts["law"],
        reached / time,
        rms(off),
        greatest(off),
        rms(turned),
        np.nansum(episodes.impacts, axis=0),
        greatest(episodes.normal_impulse),
        -greatest(-episodes.clearance),
        *costs(episodes),
        reward=np.nansum(episodes.reward, axis=0) / episodes.allowed,
        failed=episodes.failed.astype(np.float64),
    )


METRICS = Metrics(measure, FollowVerdict, settling=1.0)
