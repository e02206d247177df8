"""Freedoms of a robot on casters: counted by Grübler's formula, and as motions that exist. docs/analysis.md, J.

Seen from above, for an instant, a caster is a chain of three joints of one freedom each: it turns about its contact
point, its wheel's centre slides along the rolling direction, and it turns on the platform about its pivot.
"""

import operator
from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.arrays import Array
from caster_gym.robot import Robot, check_joints
from papers.analysis.joint_kinematics import DELTA, THETA, forward_jacobian

PLANE = 3  # freedoms of a body in the plane
CHAIN = (1, 1, 1)  # freedoms of a caster's joints

_COLUMN = {"roll": THETA, "steer": DELTA}
_ZERO = 1e-12  # [-] of the greatest singular value: rounding of angles and products leaves some 1e-15


def grubler_mobility(space: int, links: int, freedoms: Sequence[int]) -> int:
    """Grübler's count M = space (links − 1) − Σ (space − freedom) over the joints; chung2008 (1).

    space: freedoms of a free body, 3 in the plane; links: the ground included; freedoms: one number a joint. Raises
    ValueError for a space that is not 3 or 6, fewer than one link, a joint that is no joint in that space, and
    fractions.
    """
    if space not in (3, 6):
        raise ValueError(f"space must be 3 (the plane) or 6, got {space}")
    if _whole("links", links) < 1:
        raise ValueError(f"links must be 1 or more, the ground included, got {links}")
    wrong = [freedom for freedom in freedoms if not 1 <= _whole("the freedom of a joint", freedom) < space]
    if wrong:
        raise ValueError(f"a joint must have 1 to {space - 1} freedoms, got {wrong[0]}")
    return space * (links - 1) - sum(space - freedom for freedom in freedoms)  # (J1)


def counted_mobility(caster_count: int) -> int:
    """Grübler's count for a platform on so many casters: ground, platform and two links a caster; always 3."""
    if _whole("the number of casters", caster_count) < 1:
        raise ValueError(f"the number of casters must be 1 or more, got {caster_count}")
    return grubler_mobility(PLANE, 2 + (len(CHAIN) - 1) * caster_count, CHAIN * caster_count)


def loop_closure(robot: Robot, steering: ArrayLike) -> Array:
    """Matrix (..., 3 (N − 1), 3 N) that is zero times the joint rates η̇_1, θ̇_1, δ̇_1, η̇_2, … of every true motion.

    It says that all casters carry the same platform. steering (..., N) [rad]. Raises ValueError as `forward_jacobian`.
    """
    return closed(forward_jacobian(robot, steering))


def closed(chains: Array) -> Array:
    """The same of forward Jacobians (..., N, 3, 3), or its rate of change of theirs."""
    count = chains.shape[-3]
    closure = np.zeros((*chains.shape[:-3], count - 1, 3, count, 3))
    for i in range(1, count):
        closure[..., i - 1, :, 0, :] = chains[..., 0, :, :]  # (J3)
        closure[..., i - 1, :, i, :] = -chains[..., i, :, :]  # (J3)
    return closure.reshape(*chains.shape[:-3], 3 * (count - 1), 3 * count)


def mobility(robot: Robot, steering: ArrayLike, locked: str | Sequence[str] = ()) -> NDArray[np.int64]:
    """Freedoms (...) of motion that exist at the steering angles (..., N) [rad], by the rank of the loop closure.

    locked: joints that are held, such as ("roll_1", "roll_2", "steer_3"). What is then still free is what motors at
    these joints cannot determine: more than 0 is a singularity of that set. Raises ValueError for an unknown joint,
    wrong shapes and angles that are not finite.
    """
    closure = loop_closure(robot, steering)
    named = (locked,) if isinstance(locked, str) else tuple(locked)
    held = check_joints(named, robot.caster_count) if named else ()
    columns = [3 * (int(number) - 1) + _COLUMN[kind] for kind, number in (joint.split("_") for joint in held)]
    free = np.delete(closure, columns, axis=-1)
    values = np.linalg.svd(free, compute_uv=False)
    rank = (values > _ZERO * values[..., :1]).sum(axis=-1)
    left: NDArray[np.int64] = np.asarray(free.shape[-1] - rank)  # (J4)
    return left


def _whole(name: str, number: int) -> int:
    try:
        return operator.index(number)
    except TypeError:
        raise ValueError(f"{name} must be a whole number, got {number!r}") from None
