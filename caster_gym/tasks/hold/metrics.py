"""What is measured of the holding task."""

from typing import Annotated, NamedTuple, Self

import numpy as np

from caster_gym.arrays import Array
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import Counted, Metrics, Printed, average, costs, greatest, overall, rms

NEAR, TURNED = 0.01, np.radians(1.0)  # [m], [rad] errors within which a robot has settled


class HoldMetrics(NamedTuple):
    """One number per episode (episodes,)."""

    settled: Annotated[Array, Counted("settled to 1 cm and 1°")]  # 1 or 0: stayed that near until the end
    settling_time: Annotated[Array, Printed("settling time", "s")]  # [s] NaN if it did not settle
    steady_position: Annotated[Array, Printed("steady position error", "mm", 1e3)]  # [m] RMS after settling
    steady_heading: Annotated[Array, Printed("steady heading error", "mrad", 1e3)]  # [rad] likewise
    overshoot: Annotated[Array, Printed("overshoot", "mm", 1e3)]  # [m] beyond the pose, along the line from the start
    effort: Annotated[Array, Printed("effort", "% of limits squared", 1e2)]  # the next four as in Costs
    peak_torque: Annotated[Array, Printed("peak torque", "N m")]
    torque_variation: Annotated[Array, Printed("torque variation", "1/s")]
    saturation: Annotated[Array, Printed("saturated", "%", 1e2)]
    reward: Annotated[Array, Printed("reward per step allowed")]  # steps that a failure cost count as 0
    failed: Annotated[Array, Counted("failures")]  # 1 or 0


class HoldVerdict(NamedTuple):
    """How good an agent is on validation poses."""

    settling_time: Annotated[float, Printed("settling time", "s")]  # mean of those that settled
    steady_position: Annotated[float, Printed("steady position error", "mm", 1e3, "log")]  # [m] over all episodes
    unsettled: int
    failures: int
    reward: float  # mean per step allowed

    @property
    def merit(self) -> tuple[float, float, float]:
        """What makes an agent better than another: fewer failures, then fewer that do not settle, then reward."""
        return -self.failures, -self.unsettled, self.reward

    @classmethod
    def of(cls, metrics: HoldMetrics) -> Self:
        """The verdict on episodes."""
        return cls(
            average(metrics.settling_time),
            overall(metrics.steady_position),
            int((metrics.settled == 0.0).sum()),
            int(metrics.failed.sum()),
            float(metrics.reward.mean()),
        )


def measure(episodes: Episodes, settling: float) -> HoldMetrics:
    """Metrics of episodes; errors from `settling` seconds on are steady ones."""
    first = round(settling / episodes.period)
    away = ~((np.abs(episodes.position_error) <= NEAR) & (np.abs(episodes.heading_error) <= TURNED))  # or over
    settled = ~away[-1]
    last_away = len(away) - 1 - away[::-1].argmax(axis=0)
    periods = np.where(away.any(axis=0), last_away + 2, 1)  # series begin after one control period
    place, target = episodes.pose[..., :2], episodes.reference[..., :2]
    line = target[0] - place[0]
    line = line / np.maximum(np.hypot(*line.T), 1e-9)[:, None]
    beyond = ((place - target) * line).sum(axis=-1)
    return HoldMetrics(
        settled.astype(np.float64),
        np.where(settled, periods * episodes.period, np.nan),
        rms(episodes.position_error[first:]),
        rms(episodes.heading_error[first:]),
        np.maximum(greatest(beyond), 0.0),
        *costs(episodes),
        reward=np.nansum(episodes.reward, axis=0) / episodes.allowed,
        failed=episodes.failed.astype(np.float64),
    )


METRICS = Metrics(measure, HoldVerdict, settling=3.0)
