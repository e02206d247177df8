"""Every set of driven joints of a robot: is it never, somewhere or always singular? Exact, for any casters.

A set is singular at a point P that all its lines of action pass through, or where they are all parallel. What a caster
can do about it depends only on which of its joints are driven, on its pivot A and on the lengths d (trail) and s:

    rolling only     its line turns about A: through any P, in any direction
    steering only    the axle stays at a distance d from A: through any P with |P − A| ≥ d, in any direction
    both             two lines that meet in the wheel's centre: only P with |P − A| = ρ = √(d² + s²), never parallel

This is about joints; `singular_lines` says what gears change. Derivation: docs/analysis.md, section L.
"""

from collections.abc import Iterator, Sequence
from itertools import combinations, permutations
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from caster_gym.analysis.frames import wrap_angle
from caster_gym.arrays import Array
from caster_gym.design.singular_lines import kind_and_caster, named_joints, smallest_singular_value
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot

Class: TypeAlias = Literal["never", "somewhere", "always"]

TOUCH = 1e-9  # [-] of the robot's greatest length: circles nearer to each other than this touch
ALIKE = 5e-3  # [-] lengths alike to this share are one: robots are drawn with rounded coordinates


class JointSet(NamedTuple):
    """A set of driven joints, and where it is singular."""

    joints: tuple[str, ...]
    singular: Class
    steering: tuple[float, ...] | None  # [rad] angles where it is; None if nowhere
    point: tuple[float, float] | None  # [m] in B, where the lines meet there; None if they are parallel, or nowhere


class Bracket(NamedTuple):
    """The least of the smallest singular value over all steering angles."""

    lower: float  # [-] proved: nowhere is it smaller
    upper: float  # [-] attained
    steering: tuple[float, ...]  # [rad] where


class _Need(NamedTuple):
    """What it takes for the driven lines of one caster to pass through a point."""

    pivot: Array  # (2,) [m]
    trail: float  # d [m]
    reach: float  # ρ [m]
    lean: float  # [rad] from the line through O and A to f
    roll: bool
    steer: bool

    def admits(self, point: Array, slack: float) -> bool:
        """Can the driven lines pass through a point, lengths taken to within a slack [m]? (L5)"""
        distance = float(np.hypot(*(point - self.pivot)))
        if self.roll and self.steer:
            return abs(distance - self.reach) <= slack
        return not self.steer or distance >= self.trail - slack

    def towards(self, point: Array) -> float:
        """Steering angle at which the driven lines pass through a point that they admit. [rad] (L5)"""
        x, y = point - self.pivot
        if self.roll and self.steer:
            return float(wrap_angle(np.arctan2(-y, -x) + self.lean))
        if self.steer:
            return float(wrap_angle(np.arctan2(y, x) + np.arccos(max(-self.trail / np.hypot(x, y), -1.0))))
        return float(wrap_angle(np.arctan2(y, x) + self.lean)) if self.roll else 0.0


def classify(robot: Robot, joints: str | Sequence[str]) -> JointSet:
    """Is a set of joints never, somewhere or always singular, with a configuration that shows it? (L6)

    Raises ValueError for an unknown joint.
    """
    names = named_joints(robot, joints)
    needs = [need for need in _needs(robot, names) if need.roll or need.steer]
    one_pivot = all(np.array_equal(need.pivot, needs[0].pivot) for need in needs)
    if len(names) < 3 or (one_pivot and not any(need.steer for need in needs)):
        return JointSet(names, "always", (0.0,) * robot.caster_count, None)
    if not any(need.roll and need.steer for need in needs):
        return JointSet(names, "somewhere", turned_parallel(robot, names, 0.0), None)
    point = _meeting_point(needs, _slack(robot))
    if point is None:
        return JointSet(names, "never", None, None)
    return JointSet(names, "somewhere", turned_towards(robot, names, point), (float(point[0]), float(point[1])))


def classify_all(robot: Robot) -> tuple[JointSet, ...]:
    """Every non-empty set of joints of a robot, 2^(2 N) − 1 of them, smaller sets first."""
    return tuple(
        classify(robot, joints)
        for count in range(1, 2 * robot.caster_count + 1)
        for joints in combinations(robot.joints, count)
    )


def turned_towards(robot: Robot, joints: str | Sequence[str], point: Sequence[float] | Array) -> tuple[float, ...]:
    """Steering angles (N) [rad] at which the lines of all named joints pass through a point (2,) in B [m].

    Wheels of casters without a named joint lie at 0, wheels that only roll stand beyond their pivots. Raises ValueError
    if a line cannot pass through the point, naming its caster.
    """
    target = np.asarray(point, dtype=np.float64)
    if target.shape != (2,) or not np.isfinite(target).all():
        raise ValueError(f"point must be two finite coordinates, got {point!r}")
    names = named_joints(robot, joints)
    slack = _slack(robot)
    angles = []
    for i, need in enumerate(_needs(robot, names), start=1):
        if not need.admits(target, slack):
            where = "must be exactly" if need.roll else "must be at least"
            length, distance = need.reach if need.roll else need.trail, np.linalg.norm(target - need.pivot)
            raise ValueError(
                f"the point {tuple(target.tolist())} lies {distance:g} m from the pivot of caster {i}, whose driven "
                f"lines need another distance: it {where} {length:g} m"
            )
        angles.append(need.towards(target))
    return tuple(angles)


def turned_parallel(robot: Robot, joints: str | Sequence[str], angle: float) -> tuple[float, ...]:
    """Steering angles (N) [rad] at which the lines of all named joints run at one angle [rad] to the body x-axis.

    Raises ValueError if a caster has both joints named: its two lines are never parallel.
    """
    if not np.isfinite(angle):
        raise ValueError(f"angle must be finite, got {angle}")
    angles = []
    for i, need in enumerate(_needs(robot, named_joints(robot, joints)), start=1):
        if need.roll and need.steer:
            raise ValueError(f"both joints of caster {i} are named, whose two lines are never parallel")
        turn = -0.5 * np.pi if need.steer else need.lean  # from the line to f
        angles.append(float(wrap_angle(angle + turn)) if need.roll or need.steer else 0.0)  # (L5)
    return tuple(angles)


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


def _needs(robot: Robot, names: tuple[str, ...]) -> list[_Need]:
    driven = {kind_and_caster(name) for name in names}
    needs = []
    for i, c in enumerate(robot.casters):
        reach, lean = float(np.hypot(c.trail, c.offset)), float(np.arctan2(c.offset, c.trail))
        pivot, roll, steer = np.array([c.x, c.y]), ("roll", i) in driven, ("steer", i) in driven
        needs.append(_Need(pivot, c.trail, reach, lean, roll, steer))
    return needs


def _slack(robot: Robot) -> float:
    """How far circles may miss each other and still touch. [m]"""
    return TOUCH * max(length for c in robot.casters for length in (abs(c.x), abs(c.y), c.trail, abs(c.offset)))


def _meeting_point(needs: Sequence[_Need], slack: float) -> Array | None:
    """A point that the lines of all casters admit, the clearest of steering discs; None if there is none. (L6)

    needs: at least one of a caster with both joints driven.
    """
    circle, *others = [need for need in needs if need.roll and need.steer]
    crossed = next((one for one in others if np.hypot(*(one.pivot - circle.pivot)) > slack), None)
    discs = [need for need in needs if not need.roll]
    if crossed is not None:
        candidates = [*_crossings(circle, crossed.pivot, crossed.reach, slack)]
    else:
        ways = [circle.pivot - need.pivot for need in discs] + [circle.pivot, np.array([1.0, 0.0])]
        candidates = [circle.pivot + circle.reach * way / np.hypot(*way) for way in ways if np.hypot(*way) > slack]
        candidates += [point for disc in discs for point in _crossings(circle, disc.pivot, disc.trail, slack)]
    open_to_all = [point for point in candidates if all(need.admits(point, slack) for need in needs)]

    def clearance(point: Array) -> float:
        return min((float(np.hypot(*(point - disc.pivot))) - disc.trail for disc in discs), default=0.0)

    return max(open_to_all, key=clearance, default=None)


def _crossings(circle: _Need, centre: Array, radius: float, slack: float) -> Iterator[Array]:
    """Points where a caster's circle of radius ρ meets another one; none if they share their centre.

    Circles that miss give points that lie on neither.
    """
    apart = centre - circle.pivot
    distance = float(np.hypot(*apart))
    if distance <= slack:
        return
    along = 0.5 * (distance + (circle.reach - radius) * (circle.reach + radius) / distance)
    aside = np.sqrt(max((circle.reach - along) * (circle.reach + along), 0.0))
    unit = apart / distance
    for side in (1.0, -1.0):
        yield circle.pivot + along * unit + side * aside * np.array([-unit[1], unit[0]])


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
