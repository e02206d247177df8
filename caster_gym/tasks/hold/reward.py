"""What holding a pose is rewarded for, on generic scalars."""

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


class HoldWeights(NamedTuple):
    """Numbers of the reward and of the endings, as in `HoldParameters`."""

    position_weight: Scalar
    heading_weight: Scalar
    rest_weight: Scalar
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


class HoldTerms(NamedTuple):
    """Reward terms; the reward is their sum."""

    position: Scalar
    heading: Scalar
    rest: Scalar
    effort: Scalar
    impact: Scalar
    alive: Scalar


def reward(moment: Moment, weights: HoldWeights) -> HoldTerms:
    """Nearness, and rest as far as the robot is near, minus effort and impacts; never negative in sum.

    The term `alive` equals the greatest cost. The pose is at rest, so that errors of the twist are the robot's own.
    """
    errors = moment.errors
    rate = twist_square(errors, weights.speed_scale, weights.yaw_rate_scale)
    near = both_kernels(distance_square(errors), weights.position_scale, weights.coarse)
    turned = both_kernels(turn_square(errors), weights.heading_scale, weights.coarse)
    return HoldTerms(
        position=weights.position_weight * near,
        heading=weights.heading_weight * turned,
        rest=weights.rest_weight * near * turned * kernel(rate, 1.0),
        effort=-weights.effort_weight * moment.effort,
        impact=-weights.impact_weight * impact_share(moment.record.pressing, weights.impact_scale),
        alive=weights.effort_weight + weights.impact_weight,
    )
