"""What tracking is rewarded for, on generic scalars.

Rational kernels 1 / (1 + e²/ℓ²) keep rewards bounded and free of roots and exponentials.
"""

from typing import NamedTuple

from caster_gym.envs.tracking import (
    Moment,
    both_kernels,
    distance_square,
    impact_share,
    kernel,
    turn_square,
    twist_square,
)
from caster_gym.mechanics.scalars import Scalar


class TrackWeights(NamedTuple):
    """Numbers of the reward and of the endings, as in `TrackParameters`."""

    position_weight: Scalar
    heading_weight: Scalar
    speed_weight: Scalar
    effort_weight: Scalar
    impact_weight: Scalar
    position_scale: Scalar
    heading_scale: Scalar
    speed_scale: Scalar
    yaw_rate_scale: Scalar
    impact_scale: Scalar
    coarse: Scalar
    corridor: Scalar
    touching_ends: Scalar  # 1 or 0


class TrackTerms(NamedTuple):
    """Reward terms; the reward is their sum."""

    position: Scalar
    heading: Scalar
    speed: Scalar
    effort: Scalar
    impact: Scalar
    alive: Scalar


def reward(moment: Moment, weights: TrackWeights) -> TrackTerms:
    """Bounded tracking quality minus effort and impacts, never negative in sum: staying in the task beats leaving it.

    The term `alive` equals the greatest cost.
    """
    errors, wide = moment.errors, weights.coarse
    rate = twist_square(errors, weights.speed_scale, weights.yaw_rate_scale)
    position = both_kernels(distance_square(errors), weights.position_scale, wide)
    heading = both_kernels(turn_square(errors), weights.heading_scale, wide)
    speed = 0.5 * (kernel(rate, 1.0) + kernel(rate, wide))
    return TrackTerms(
        position=weights.position_weight * position,
        heading=weights.heading_weight * heading,
        speed=weights.speed_weight * speed,
        effort=-weights.effort_weight * moment.effort,
        impact=-weights.impact_weight * impact_share(moment.record.pressing, weights.impact_scale),
        alive=weights.effort_weight + weights.impact_weight,
    )
