"""Obstacles as they are written in YAML and Python. All points and directions are in W."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, ClassVar, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, NonNegativeInt, field_validator, model_validator

from caster_gym.arena.obstacle import Obstacle, ObstacleFields, check_outline, point_in_words
from caster_gym.bounded_files import expanded
from caster_gym.configuration import ConfigurationError, Frozen, is_yaml, parse, read_yaml
from caster_gym.mechanics.impulse import ImpactLaw
from caster_gym.outlines import LEAST_EDGE, Outline, convex, polygon_fault

FARTHEST = 1e6  # [m] from the origin

Coordinate: TypeAlias = Annotated[float, Field(ge=-FARTHEST, le=FARTHEST)]
Point: TypeAlias = tuple[Coordinate, Coordinate]
Size: TypeAlias = Annotated[float, Field(gt=0.0, le=FARTHEST)]
Thickness: TypeAlias = Annotated[float, Field(ge=0.0, le=1000.0)]
Near: TypeAlias = Annotated[float, Field(ge=1e-3, le=1000.0)]
Count: TypeAlias = Annotated[int, Field(ge=0, le=1000)]


class HalfPlane(Obstacle):
    """All that lies behind a straight line; the robot stays on the side to which the normal points."""

    point: Point  # [m] on the line
    normal: tuple[float, float]  # of any length; kept as a unit vector

    @field_validator("normal")
    @classmethod
    def _of_unit_length(cls, normal: tuple[float, float]) -> tuple[float, float]:
        length = abs(complex(*normal))
        if not 0.0 < length < float("inf"):
            raise ValueError("must have a direction")
        same = abs(length - 1.0) < 1e-15  # so that a model read from its own dump is the same
        return normal if same else (normal[0] / length, normal[1] / length)

    def __str__(self) -> str:
        return f"through {point_in_words(self.point)}"

    @property
    def outline(self) -> Outline:
        """One face, no corner."""
        (x, y), (nx, ny) = self.point, self.normal
        return Outline(((nx, ny, nx * x + ny * y),), (), 0.0)


class Wall(Obstacle):
    """A straight wall with flat ends; its thickness lies half on either side of the line from start to end."""

    start: Point  # [m]
    end: Point  # [m]
    thickness: Thickness = 0.0  # [m]

    @model_validator(mode="after")
    def _has_a_length(self) -> Self:
        if abs(complex(*self.end) - complex(*self.start)) < LEAST_EDGE:
            start, end = point_in_words(self.start), point_in_words(self.end)
            raise ValueError(f"'start' and 'end' must differ, got {start} and {end}")
        return self

    def __str__(self) -> str:
        return f"from {point_in_words(self.start)} to {point_in_words(self.end)}"

    @property
    def outline(self) -> Outline:
        """Two corners and two faces; four of each with a thickness that can be told from none."""
        start, end = complex(*self.start), complex(*self.end)
        left = 0.5j * self.thickness * (end - start) / abs(end - start)
        corners = (start - left, end - left, end + left, start + left) if self.thickness >= LEAST_EDGE else (start, end)
        return convex(tuple((corner.real, corner.imag) for corner in corners))


class Pillar(Obstacle):
    """A round pillar."""

    centre: Point  # [m]
    radius: Size = 0.1  # [m]

    def __str__(self) -> str:
        return f"at {point_in_words(self.centre)}"

    @property
    def outline(self) -> Outline:
        """One corner with a radius, no face."""
        return Outline((), (self.centre,), self.radius)


class Polygon(Obstacle):
    """A convex polygon."""

    corners: Annotated[tuple[Point, ...], Field(min_length=3, max_length=100)]  # [m] counter-clockwise

    @field_validator("corners")
    @classmethod
    def _convex_and_counter_clockwise(cls, corners: tuple[Point, ...]) -> tuple[Point, ...]:
        if fault := polygon_fault(corners):
            raise ValueError(fault)
        return corners

    def __str__(self) -> str:
        return f"with its first corner at {point_in_words(self.corners[0])}"

    @property
    def outline(self) -> Outline:
        """As many faces as corners."""
        return convex(self.corners)


class Beside(Frozen):
    """Obstacles drawn at random beside each path: a robot that deviates by `gap` touches them, the path stays free."""

    pillars: Count = 4  # beside each path
    walls: Count = 2
    gap: tuple[Near, Near] = (0.03, 0.2)  # [m] least and greatest, to the robot along its whole path
    pillar_radius: tuple[Near, Near] = (0.05, 0.2)  # [m]
    wall_length: tuple[Near, Near] = (0.3, 1.0)  # [m]
    wall_thickness: tuple[Thickness, Thickness] = (0.0, 0.1)  # [m]
    wall_turn: Annotated[float, Field(ge=0.0, le=1.5708)] = 0.3  # [rad] greatest angle to the path
    seed: NonNegativeInt = 0

    @field_validator("gap", "pillar_radius", "wall_length", "wall_thickness")
    @classmethod
    def _from_least_to_greatest(cls, span: tuple[float, float]) -> tuple[float, float]:
        if span[0] > span[1]:
            raise ValueError("must be the least and the greatest value, in this order")
        return span


class Arena(ObstacleFields):
    """What is in the way, and how the robot bounces off it.

    >>> import caster_gym, gymnasium
    >>> pillar = {"centre": [0.0, 1.5], "radius": 0.1}
    >>> arena = caster_gym.Arena(room=[[-2, -2], [2, 2]], pillars=[pillar], restitution=0.3)
    >>> arena.obstacles[-1][0]
    'pillar 1 at (0, 1.5) m'
    >>> env = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate", arena=arena)
    """

    usual_names: ClassVar[Mapping[str, str]] = {
        "mu": "friction",
        "impact_friction": "friction",
        "coefficient_of_restitution": "restitution",
        "law": "impact_law",
        "floor_friction": "'friction' is that between hull and obstacles; wheels slip on the 'floor' of the task",
        "floor": "the 'floor' belongs to the task",
    }

    room: tuple[Point, Point] | None = None  # [m] ((x_min, y_min), (x_max, y_max)): four half-planes
    half_planes: tuple[HalfPlane, ...] = ()
    walls: tuple[Wall, ...] = ()
    pillars: tuple[Pillar, ...] = ()
    polygons: tuple[Polygon, ...] = ()
    beside: Beside | None = None
    restitution: Annotated[float, Field(ge=0.0, le=1.0)] = 0.5  # [-]
    friction: NonNegativeFloat = 0.2  # [-] between hull and obstacles
    impact_law: ImpactLaw = "stronge"  # of a single contact with friction

    @field_validator("room")
    @classmethod
    def _room_has_an_inside(cls, room: tuple[Point, Point] | None) -> tuple[Point, Point] | None:
        if room is not None and not (room[0][0] < room[1][0] and room[0][1] < room[1][1]):
            raise ValueError("must be [[x_min, y_min], [x_max, y_max]] with each minimum below its maximum")
        return room

    @model_validator(mode="after")
    def _obstacles_have_outlines(self) -> Self:
        for name, obstacle in self.obstacles:
            check_outline(name, obstacle)
        return self

    @property
    def sides(self) -> tuple[HalfPlane, ...]:
        """The room's walls at x_min, y_min, x_max and y_max."""
        if self.room is None:
            return ()
        low, high = self.room
        inwards = ((low, (1.0, 0.0)), (low, (0.0, 1.0)), (high, (-1.0, 0.0)), (high, (0.0, -1.0)))
        return tuple(HalfPlane(point=corner, normal=normal) for corner, normal in inwards)

    @property
    def obstacles(self) -> tuple[tuple[str, Obstacle], ...]:
        """Every obstacle that has a place, behind its name: kind, number and where it is."""
        ends = zip(("x_min", "y_min", "x_max", "y_max"), self.sides, strict=False)
        return (*((f"the room's side {end}", side) for end, side in ends), *self.numbered)


_KINDS = [name for name, field in Arena.model_fields.items() if field.default in (None, ())]
Arena.usual_names = {**Arena.usual_names, "obstacles": f"they stand by their kinds: {', '.join(map(repr, _KINDS))}"}


def read_arena(arena: str | Path | Mapping[str, Any] | Arena | None) -> Arena:
    """A checked arena from a mapping, a YAML file of one, a checked arena, or None, which has no obstacles.

    Raises ConfigurationError that names the obstacle, the key and the value.
    """
    if arena is None:
        return Arena()
    if isinstance(arena, Arena):
        return arena
    if isinstance(arena, Mapping):
        return parse(Arena, arena, "arena")
    if isinstance(arena, str | Path) and is_yaml(arena):
        path = expanded(arena)
        return parse(Arena, read_yaml(path), f"{path}: arena")
    raise ConfigurationError(f"an arena is a mapping or the name of a YAML file, got {arena!r}")
