"""All sets of joints of a robot: which are singular, how far the others stay from it, and which are of one kind.

Derivation: docs/analysis.md, section L.
"""

from collections.abc import Sequence
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np

from caster_gym.design.joint_sets import JointSet, classify, kind_and_caster, named_joints
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot
from papers.analysis.action_lines import smallest_singular_value

ALIKE = 5e-3  # [-] lengths alike to this share are one: robots are drawn with rounded coordinates


class Bracket(NamedTuple):
    """The least of the smallest singular value over all steering angles."""

    lower: float  # [-] proved: nowhere is it smaller
    upper: float  # [-] attained
    steering: tuple[float, ...]  # [rad] where


def classify_all(robot: Robot) -> tuple[JointSet, ...]:
    """Every non-empty set of joints of a robot, 2^(2 N) − 1 of them, smaller sets first."""
    return tuple(
        classify(robot, joints)
        for count in range(1, 2 * robot.caster_count + 1)
        for joints in combinations(robot.joints, count)
    )


def least_singular_value(
    robot: Robot, joints: str | Sequence[str], precision: float = 0.02, most_cells: int | None = None
) -> Bracket:
    """The smallest singular value's least value over all steering angles, proved to within a precision. (L7)

    Branch and bound over the angles of the casters with named joints: precise for two of them in a tenth of a second,
    slow for four. It stops early before it looks at more than `most_cells` cells at once; its lower bound is proved all
    the same, and only further from the upper one. Raises ValueError for a precision that is not positive.
    """
    if not precision > 0.0:
        raise ValueError(f"precision must be positive, got {precision}")
    names = named_joints(robot, joints)
    moving = sorted({i for _, i in map(kind_and_caster, names)})
    slope = steepest(robot, names)
    corners = np.stack(np.meshgrid(*[(-1.0, 1.0)] * len(moving), indexing="ij"), axis=-1).reshape(-1, len(moving))
    centres, half = np.zeros((1, len(moving))), np.pi
    least, best, lower = np.inf, np.zeros(robot.caster_count), np.inf
    while len(centres):
        steering = np.zeros((len(centres), robot.caster_count))
        steering[:, moving] = centres
        values = smallest_singular_value(robot, steering, names)
        if values.min() < least:
            least, best = float(values.min()), steering[values.argmin()]
        bounds = np.maximum(values - slope * half, 0.0)
        open_cells = bounds < least - precision
        if most_cells is not None and np.count_nonzero(open_cells) * len(corners) > most_cells:
            open_cells[:] = False
        lower = min(lower, float(bounds[~open_cells].min(initial=np.inf)))
        half *= 0.5
        centres = (centres[open_cells, None, :] + half * corners).reshape(-1, len(moving))
    return Bracket(min(lower, least), least, tuple(map(float, best)))


def steepest(robot: Robot, joints: str | Sequence[str]) -> float:
    """Most that the smallest singular value changes while no angle changes by more than 1 rad. [1/rad]"""
    length = Model(robot).characteristic_length
    casters = [robot.casters[kind_and_caster(name)[1]] for name in named_joints(robot, joints)]
    return float(np.sqrt(sum(1.0 + (c.x**2 + c.y**2) / length**2 for c in casters)))  # (L7)


def proved_brackets(
    robot: Robot, sets: Sequence[JointSet], precision: float = 0.02, most_cells: int = 500_000
) -> dict[tuple[str, ...], Bracket]:
    """The least of the smallest singular value of each of the given sets that is never singular. [-]

    A set within it that is never singular lends a larger one its bound: more lines never lessen a singular value. A set
    is searched by `least_singular_value` if it has no such lender, or if a quick search finds no value within the
    precision of what is lent. Where that takes more than `most_cells` cells at once, as for most sets of four casters,
    bounds may lie further below the value found than the precision.
    """
    brackets: dict[tuple[str, ...], Bracket] = {}
    for one in sorted((one for one in sets if one.singular == "never"), key=lambda one: len(one.joints)):
        lenders = [bracket for joints, bracket in brackets.items() if set(joints) < set(one.joints)]
        if not lenders:
            brackets[one.joints] = least_singular_value(robot, one.joints, precision)
            continue
        lent = max(bracket.lower for bracket in lenders)
        found, steering = _least_found(robot, one.joints, [bracket.steering for bracket in lenders])
        lower = lent
        if found - lent > precision:
            searched = least_singular_value(robot, one.joints, precision, most_cells)
            lower = max(lent, searched.lower)
            if searched.upper < found:
                found, steering = searched.upper, searched.steering
        brackets[one.joints] = Bracket(lower, found, steering)
    return brackets


_SAMPLES, _KEPT, _ROUNDS, _SHRINKING = 5000, 20, 40, 0.75  # of the quick search; its last steps are below 1e-4 rad


def _least_found(
    robot: Robot, joints: tuple[str, ...], starts: Sequence[tuple[float, ...]]
) -> tuple[float, tuple[float, ...]]:
    """A small smallest singular value, and where [rad]: random samples, the best of them moved downhill."""
    rng = np.random.default_rng(0)
    count = robot.caster_count
    places = rng.uniform(-np.pi, np.pi, (_SAMPLES, count))
    places[: len(starts)] = np.array(starts)
    step = 1.0  # [rad]
    for _ in range(_ROUNDS):
        values = smallest_singular_value(robot, places, joints)
        kept = places[np.argsort(values)[:_KEPT]]
        tried = kept[:, None, :] + step * rng.standard_normal((_KEPT, _KEPT, count))
        places = np.concatenate([kept, tried.reshape(-1, count)])
        step *= _SHRINKING
    values = smallest_singular_value(robot, places, joints)
    return float(values.min()), tuple(map(float, places[values.argmin()]))


def rounded_down(bound: float) -> str:
    """A lower bound with three decimals that it still reaches."""
    return f"{np.floor(1e3 * bound) / 1e3:.3f}"


def set_types(robot: Robot, sets: Sequence[JointSet]) -> tuple[tuple[JointSet, ...], ...]:
    """Sets that the robot's symmetry turns or mirrors into each other, together; in the order of their first member.

    Casters may change places if all distances of pivots, trails and sizes of offsets stay alike to within `ALIKE`.
    """
    swaps = _symmetries(robot)
    found: dict[tuple[tuple[str, ...], str], list[JointSet]] = {}
    for one in sets:
        held = [kind_and_caster(joint) for joint in one.joints]
        images = (tuple(sorted(f"{kind}_{swap[i] + 1}" for kind, i in held)) for swap in swaps)
        found.setdefault((min(images), one.singular), []).append(one)
    return tuple(map(tuple, found.values()))


def _symmetries(robot: Robot) -> list[tuple[int, ...]]:
    """Orders of the casters that leave the distances of their pivots, their trails and the sizes of offsets alike."""
    pivots = np.array([[c.x, c.y] for c in robot.casters])
    distances = np.linalg.norm(pivots[:, None] - pivots, axis=-1)
    links = np.array([[c.trail, abs(c.offset)] for c in robot.casters])
    room = ALIKE * distances.max()

    def keeps(order: list[int]) -> bool:
        moved, same_links = distances[np.ix_(order, order)], links[order]
        return bool((abs(moved - distances) <= room).all() and (abs(same_links - links) <= ALIKE * links.max()).all())

    return [order for order in permutations(range(robot.caster_count)) if keeps(list(order))]
