"""kim2001, IV: the set of the three steering joints, which the paper leaves out as its workspace is small."""

import numpy as np

from caster_gym.analysis.frames import turn_planar
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from papers.analysis.action_lines import smallest_singular_value
from papers.analysis.driven_motion import steady_steering
from papers.kim2001.isotropy_search import RATIOS, ROBOT, TYPES, searched
from papers.notation import in_words
from papers.page import Check

JOINTS = in_words("φ_1 φ_2 φ_3")
MOTIONS = 1000  # steady ones, at random
SWING, STEPS = 0.5, 400  # [rad] of every steering angle to either side, and steps of one round
ROUNDING = 1e-12  # [-] of singular values of lines of order 1


def steady_value() -> float:
    """The greatest σ of the set while casters trail: the centre of rotation is at least 3a away, or there is none."""
    rng = np.random.default_rng(6)
    way, omega = rng.uniform(-np.pi, np.pi, MOTIONS), rng.uniform(-1.0, 1.0, MOTIONS) / 3.0
    steering = steady_steering(ROBOT, np.stack((np.cos(way), np.sin(way), omega), axis=-1))
    return float(smallest_singular_value(ROBOT, steering, JOINTS).max())


def one_round() -> tuple[Array, float]:
    """Pose (3,) after one round of the steering angles about wheels that stand along the radii; least σ on the way.

    The angles swing one after the other, a third of a period apart, and end where they began. [a, a, rad]
    """
    model, phase = Model(ROBOT), np.linspace(0.0, 2.0 * np.pi, STEPS + 1)[:, None]
    middle = np.array([np.arctan2(caster.y, caster.x) for caster in ROBOT.casters])
    steering = middle + SWING * np.cos(phase + 2.0 * np.pi / 3.0 * np.arange(3))
    halfway = 0.5 * (steering[1:] + steering[:-1])
    ways = np.linalg.solve(model.jacobian(halfway, JOINTS), np.diff(steering, axis=0)[..., None])[..., 0]
    pose = np.zeros(3)
    for way in ways:
        pose = pose + turn_planar(way, np.exp(1j * (pose[2] + 0.5 * way[2])))
    return pose, float(smallest_singular_value(ROBOT, steering, JOINTS).min())


def workspace_check() -> Check:
    """What of "the workspace … is very small and limited" is so."""
    steady, (pose, least), trail = steady_value(), one_round(), ROBOT.casters[0].trail
    moved = float(np.hypot(pose[0], pose[1]))
    return Check(
        "IV: the workspace of (φ_1, φ_2, φ_3)",
        "“very small and limited”",
        f"at {MOTIONS} steady motions the set is singular, σ ≤ {steady:.0e}; one round of the angles by ±{SWING:g} rad "
        f"moves C by {moved:.1g} a, with d = {trail:g} a, and turns by {abs(pose[2]):.2g} rad",
        steady < ROUNDING and moved < trail,
        f"limited in that no motion can go on; but rounds (σ ≥ {least:.2f}) add up, so there is no bound",
    )


def text() -> str:
    """What the set's index is, and why it may be left out all the same."""
    own = searched(JOINTS).max(axis=(2, 3))
    others = np.max([searched(joints).max(axis=(2, 3)) for joints in TYPES.values()], axis=0)
    better = [f"({RATIOS[i]:g}, {RATIOS[j]:g})" for i, j in np.argwhere(own > others)]
    return f"""
The sixth type, (φ_1, φ_2, φ_3), is left out by the paper, as its workspace is "very small and limited". Its best mean
index is between {own.min():.3f} and {own.max():.3f}, and for {len(better)} of the {own.size} demands
(φ̇_max/θ̇_max, ω_max/v_max) greater than that of the five others, at {", ".join(better)}: isotropy alone does not rule
it out. But casters that trail steer no more, so that at each steady motion the three axles meet in its centre of
rotation or are parallel, and motors on them can neither drive nor hold it. What they can do is swing to and fro, as a
fish does: the platform then gains a little in each round.
"""
