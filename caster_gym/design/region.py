"""Radii and trails within the bounds of a target, and the robots with them. Derivation: docs/analysis.md, section S.

Wheels and links keep their masses and grow in likeness: with the radius the wheel's inertias by its square, with the
trail the link's inertia by its square and its mass centre in proportion. Pivots, lateral offsets, platform and motors
stay.

    place      point of the unit square for which radius and trail stand, see `Region`     [-]
"""

from typing import Annotated, Literal, NamedTuple, Self, TypeAlias

import numpy as np
from pydantic import AfterValidator

from caster_gym.analysis.actuation import SINGULAR, worst_conditioning
from caster_gym.arrays import Array
from caster_gym.configuration import Positive
from caster_gym.design.sizing import trajectories_of
from caster_gym.design.target import Target, check_actuation, check_conditioning, driven_as
from caster_gym.paths.trajectory import rounded_down
from caster_gym.robot import Robot

Objective: TypeAlias = Literal["isotropy", "torque", "use"]

MOST_CASTERS = 12
_AT_BOUND = 1e-3  # [-] of the region's width
TYPICAL = ((0.5, 0.5), (0.0, 0.0), (1.0, 1.0), (0.0, 1.0), (1.0, 0.0))  # places where designs are tried beforehand


def _ordered(bounds: tuple[float, float]) -> tuple[float, float]:
    if bounds[0] >= bounds[1]:
        raise ValueError(f"the first bound must be below the second, got [{bounds[0]:g}, {bounds[1]:g}]")
    return bounds


Bounds: TypeAlias = Annotated[tuple[Positive, Positive], AfterValidator(_ordered)]


class DesignTarget(Target):
    """A target, what is to be best, and between which bounds.

    isotropy   greatest global isotropy
    torque     least of the largest motor torque, as a share of what the file's motor has at standstill (S9)
    use        least of the largest use: torque as a share of what the file's motor has left at its speed (S5)
    """

    objective: Objective = "isotropy"
    radius: Bounds  # [m]
    trail: Bounds  # [m]


class Region(NamedTuple):
    """Radii and trails within bounds whose wheels cannot touch; it is the image of the unit square."""

    radius: tuple[float, float]  # [m]
    trail: tuple[float, float]  # [m]
    room: float  # [m] greatest sum of radius and trail

    @classmethod
    def of(cls, robot: Robot, target: DesignTarget) -> Self:
        """Raises ValueError if all wheels within the bounds could touch one another."""
        room = wheel_room(robot)
        least = target.radius[0] + target.trail[0]
        if least >= room:
            together = f"together must stay below {rounded_down(room, 4):g} m" if room > 0.0 else "have no room at all"
            raise ValueError(
                f"wheels of radius {target.radius[0]:g} m and trail {target.trail[0]:g} m, the least that the bounds "
                f"allow, could touch those of another caster of robot {robot.name!r}: radius and trail {together}"
            )
        return cls((target.radius[0], min(target.radius[1], room - target.trail[0])), target.trail, room)

    def design(self, place: Array) -> tuple[Array, Array]:
        """Radius and trail (...) [m] at places (..., 2): evenly by their ratios."""
        radius = self.radius[0] * (self.radius[1] / self.radius[0]) ** place[..., 0]
        trail = self.trail[0] * (self.longest(radius) / self.trail[0]) ** place[..., 1]
        return radius, trail

    def longest(self, radius: Array) -> Array:
        """Greatest trail [m] for a radius [m]."""
        return np.clip(self.room - radius, self.trail[0], self.trail[1])

    def bounds_at(self, place: Array, target: DesignTarget) -> tuple[str, ...]:
        """In words, the bounds on which a place lies."""
        radius, _ = self.design(place)
        words = []
        if place[0] < _AT_BOUND:
            words.append("the least radius")
        if place[0] > 1.0 - _AT_BOUND:
            words.append("the greatest radius" if self.radius[1] == target.radius[1] else "the room between the wheels")
        if place[1] < _AT_BOUND:
            words.append("the least trail")
        if place[1] > 1.0 - _AT_BOUND:
            free = self.longest(radius) == self.trail[1]
            words.append("the greatest trail" if free else "the room between the wheels")
        return tuple(dict.fromkeys(words))


def radius_and_trail(robot: Robot) -> tuple[float, float]:
    """Those of all casters of a robot. [m] Raises ValueError if casters differ."""
    for name in ("radius", "trail"):
        values = sorted({getattr(caster, name) for caster in robot.casters})
        if len(values) > 1:
            raise ValueError(
                f"all casters of robot {robot.name!r} must have the same {name} to be designed together, "
                f"got {values[0]:g} m and {values[-1]:g} m"
            )
    return robot.casters[0].radius, robot.casters[0].trail


def redesigned(robot: Robot, radius: float, trail: float) -> Robot:
    """The robot with another wheel radius and trail [m] of all casters, masses kept. (S7)"""
    casters = []
    for caster in robot.casters:
        wider, longer = radius / caster.radius, trail / caster.trail
        wheel = caster.wheel.model_copy(
            update={
                "spin_inertia": caster.wheel.spin_inertia * wider**2,
                "yaw_inertia": caster.wheel.yaw_inertia * wider**2,
            }
        )
        behind, left = caster.link.com
        link = caster.link.model_copy(
            update={"inertia": caster.link.inertia * longer**2, "com": (behind * longer, left)}
        )
        casters.append(caster.model_copy(update={"radius": radius, "trail": trail, "wheel": wheel, "link": link}))
    return robot.model_copy(update={"casters": tuple(casters)})


def wheel_room(robot: Robot) -> float:
    """Sum of radius and trail [m] below which no wheel reaches another, whatever the steering angles. (S8)

    A wheel counts as a disc seen from its edge, without thickness.
    """
    pivots = np.array([complex(caster.x, caster.y) for caster in robot.casters])
    between = np.abs(pivots[:, None] - pivots)[np.triu_indices(len(pivots), 1)]
    aside = max(abs(caster.offset) for caster in robot.casters)
    return float(max((0.5 * between.min()) ** 2 - aside**2, 0.0) ** 0.5)


def check_designable(robot: Robot, target: DesignTarget) -> Region:
    """The region of the designs of a robot, if there is anything to be found in it.

    Raises ValueError for more casters than can be searched, casters that differ, for bounds within which all wheels
    could touch, for driven joints that are singular at some steering angles, for motors that push too unevenly as the
    robot is or in all designs, and for paths that cannot be timed.
    """
    if robot.caster_count > MOST_CASTERS:
        raise ValueError(
            f"robot {robot.name!r} has {robot.caster_count} casters; designs are searched for at most {MOST_CASTERS}, "
            "since the combinations of their steering angles grow as a power"
        )
    radius_and_trail(robot)
    trajectories_of(target)
    able = driven_as(robot, target)
    region = Region.of(able, target)
    designs = [redesigned(able, *map(float, region.design(np.array(place)))) for place in TYPICAL]
    check_actuation(designs[0])  # it is the same for all designs of the region, see (S8)
    check_conditioning(next((one for one in designs if worst_conditioning(one)[0] >= SINGULAR), designs[0]))
    check_actuation(able)
    check_conditioning(able)
    return region
