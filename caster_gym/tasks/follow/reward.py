"""What following a path is rewarded for, on generic scalars."""

from typing import NamedTuple

from caster_gym.envs.tracking import Moment, both_kernels, distance_square, impact_share, turn_square
from caster_gym.mechanics.scalars import Scalar


class FollowWeights(NamedTuple):
    """Numbers of the reward and of the endings, as in `FollowParameters`."""

    progress_weight: Scalar
    cross_track_weight: Scalar
    heading_weight: Scalar
    effort_weight: Scalar
    impact_weight: Scalar
    cross_track_scale: Scalar
    heading_scale: Scalar
    impact_scale: Scalar
    coarse: Scalar
    corridor: Scalar
    touching_ends: Scalar  # 1 or 0


class FollowTerms(NamedTuple):
    """Reward terms; the reward is their sum."""

    progress: Scalar
    cross_track: Scalar
    heading: Scalar
    effort: Scalar
    impact: Scalar
    alive: Scalar


def reward(moment: Moment, weights: FollowWeights) -> FollowTerms:
    """Progress times quality minus effort and impacts, never negative in sum: staying in the task beats leaving it.

    Quality counts only as far as there is progress, so that resting on the path earns nothing but `alive`, which equals
    the greatest cost.
    """
    share = moment.situation.share
    near = both_kernels(distance_square(moment.errors), weights.cross_track_scale, weights.coarse)
    turned = both_kernels(turn_square(moment.errors), weights.heading_scale, weights.coarse)
    return FollowTerms(
        progress=weights.progress_weight * share,
        cross_track=weights.cross_track_weight * share * near,
        heading=weights.heading_weight * share * turned,
        effort=-weights.effort_weight * moment.effort,
        impact=-weights.impact_weight * impact_share(moment.record.pressing, weights.impact_scale),
        alive=weights.effort_weight + weights.impact_weight,
    )
