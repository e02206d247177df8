"""Whether a set of driven joints is never, somewhere or always singular: exact, for any casters.

A set is singular at a point P that all its lines of action pass through, or where they are all parallel. What a caster
can do about it depends only on which of its joints are driven, on its pivot A and on the lengths d (trail) and s:

    rolling only     its line turns about A: through any P, in any direction
    steering only    the axle stays at a distance d from A: through any P with |P − A| ≥ d, in any direction
    both             two lines that meet in the wheel's centre: only P with |P − A| = ρ = √(d² + s²), never parallel

This is about joints, and so about motors that turn one joint each; where a gear couples both motors of a caster, it
holds of casters with both or none driven. Derivation: docs/analysis.md, section L.
"""

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from caster_gym.analysis.frames import wrap_angle
from caster_gym.arrays import Array
from caster_gym.robot import Robot, check_joints

Class: TypeAlias = Literal["never", "somewhere", "always"]

TOUCH = 1e-9  # [-] of the robot's greatest length: circles nearer to each other than this touch


class JointSet(NamedTuple):
    """A set of driven joints, and where it is singular."""

    joints: tuple[str, ...]
    singular: Class
    steering: tuple[float, ...] | None  # [rad] angles where it is; None if nowhere
    point: tuple[float, float] | None  # [m] in B, where the lines meet there; None if they are parallel, or nowhere


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


def named_joints(robot: Robot, joints: str | Sequence[str]) -> tuple[str, ...]:
    """The joints that "all", one name or several mean. Raises ValueError for an unknown or repeated one."""
    if isinstance(joints, str):
        return robot.joints if joints == "all" else check_joints((joints,), robot.caster_count)
    return check_joints(tuple(joints), robot.caster_count)


def kind_and_caster(joint: str) -> tuple[str, int]:
    """("roll", 0) for roll_1."""
    kind, number = joint.split("_")
    return kind, int(number) - 1


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
