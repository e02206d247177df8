"""Random obstacles beside a path, near enough that a robot that deviates touches them."""

from typing import NamedTuple

import numpy as np

from caster_gym.arena.arena import Arena, Beside, Pillar, Wall
from caster_gym.arena.clearance import ROUNDING, separations
from caster_gym.arena.packing import hull_from, pack
from caster_gym.arrays import Array, Plane
from caster_gym.mechanics.separation import Hull, Obstacles

PRECISION = 1e-4  # [m] of the gaps that are drawn
_TRIES = 100  # places for each obstacle
_STEPS = 200  # away from the path at each place


class _Track(NamedTuple):
    """A path and the robot that follows it; points and directions are complex numbers x + i y."""

    hull: Hull
    position: Plane  # (K,) [m]
    heading: Plane  # (K,)
    tangent: Plane  # (K,)
    way: Array  # (K,) [m] at most, of the robot's points up to each pose


def draw_beside(
    arena: Arena, hull: Hull, poses: Array, index: int, name: str = "path", start_margin: float = 0.0
) -> Arena:
    """The arena with the obstacles beside a path drawn: always the same ones for a seed and the index of the path.

    poses (K, 4) along the path, dense: x, y [m], cos β, sin β. The least gap between an obstacle and the robot on the
    whole path lies in `gap`; that at the first pose is no less than start_margin [m]. Obstacles overlap no others.
    Raises ValueError if there is no room for one.
    """
    if arena.beside is None:
        return arena
    track = _track(hull, poses)
    drawn = _drawn(arena, arena.beside, track, index, start_margin)
    if _counts(drawn, arena) == (arena.beside.pillars, arena.beside.walls):
        return drawn
    fewer = arena.beside
    while (found := _counts(drawn, arena)) != (fewer.pillars, fewer.walls):  # fewer are drawn at other places
        pillars, walls = (count - count // 5 for count in found)  # many more tries would find some more
        fewer = fewer.model_copy(update={"pillars": pillars, "walls": walls})
        drawn = _drawn(arena, fewer, track, index, start_margin)
    raise ValueError(
        f"{arena.beside.pillars} pillars and {arena.beside.walls} walls do not fit beside path {name!r}; "
        f"'pillars' of {fewer.pillars} and 'walls' of {fewer.walls} would suffice"
    )


def _drawn(arena: Arena, beside: Beside, track: _Track, index: int, start_margin: float) -> Arena:
    """The arena with as many of the obstacles, one after another, as there is room for."""
    rng = np.random.default_rng((beside.seed, index))
    drawn = arena.model_copy(update={"beside": None})
    for shape in _shapes(beside, rng):
        places = (_beside_path(shape, beside, track, rng) for _ in range(_TRIES))
        found = next((one for one in places if _fits(one, drawn, track, beside, start_margin)), None)
        if found is None:
            return drawn
        key = "pillars" if isinstance(found, Pillar) else "walls"
        drawn = drawn.model_copy(update={key: (*getattr(drawn, key), found)})
    return drawn


def _counts(drawn: Arena, arena: Arena) -> tuple[int, int]:
    """Pillars and walls that were drawn into an arena."""
    return len(drawn.pillars) - len(arena.pillars), len(drawn.walls) - len(arena.walls)


def _track(hull: Hull, poses: Array) -> _Track:
    position, heading = poses[:, 0] + 1j * poses[:, 1], poses[:, 2] + 1j * poses[:, 3]
    steps, turns = np.diff(position), np.diff(heading)
    way = np.concatenate([[0.0], np.cumsum(np.abs(steps) + hull.reach * np.abs(turns))])
    direction = np.append(steps, steps[-1:] if len(steps) else 0.0)
    still = np.abs(direction) < ROUNDING  # where a path turns on the spot, or is one pose, all directions are beside it
    direction = np.where(still, heading, direction)
    return _Track(hull, position, heading, direction / np.abs(direction), way)


def _shapes(beside: Beside, rng: np.random.Generator) -> list[Pillar | Wall]:
    """All obstacles about the origin, walls along x."""
    shapes: list[Pillar | Wall] = [
        Pillar(centre=(0.0, 0.0), radius=rng.uniform(*beside.pillar_radius)) for _ in range(beside.pillars)
    ]
    for _ in range(beside.walls):
        half, thickness = 0.5 * rng.uniform(*beside.wall_length), rng.uniform(*beside.wall_thickness)
        shapes.append(Wall(start=(-half, 0.0), end=(half, 0.0), thickness=thickness))
    return shapes


def _beside_path(shape: Pillar | Wall, beside: Beside, track: _Track, rng: np.random.Generator) -> Pillar | Wall:
    """The shape at a random gap from the path, beside a random point of it."""
    along, side, turn, share = rng.random(4)
    k = int(np.searchsorted(track.way, along * track.way[-1], side="right")) - 1
    away = track.tangent[k] * (1j if side < 0.5 else -1j)
    direction = track.tangent[k] * np.exp(1j * beside.wall_turn * (2.0 * turn - 1.0))
    least, greatest = beside.gap
    wanted = least + share * max(greatest - least - PRECISION, 0.0)
    place = _far_enough(shape, track, k, away, direction, wanted)
    if isinstance(shape, Pillar):
        return Pillar(centre=(place.real, place.imag), radius=shape.radius)
    start, end = (place + direction * complex(*corner) for corner in (shape.start, shape.end))
    return Wall(start=(start.real, start.imag), end=(end.real, end.imag), thickness=shape.thickness)


def _far_enough(
    shape: Pillar | Wall, track: _Track, k: int, away: complex, direction: complex, wanted: float
) -> complex:
    """Where a shape that leaves pose k of the path straight `away` first has the wanted gap from the whole path.

    Gaps change by no more than the way, so that steps as long as what is missing never go too far.
    """
    obstacle, reach = _alone(shape), hull_from(shape.outline).reach
    place = complex(track.position[k])
    for _ in range(_STEPS):
        seen = (track.position - place) / direction
        near = np.abs(seen) < track.hull.reach + reach + wanted
        if not near.any():
            break
        gaps, _ = separations(track.hull, obstacle, _poses(seen[near], track.heading[near] / direction))
        missing = wanted - gaps.min()
        if missing <= 0.0:
            break
        place += away * max(missing, PRECISION)
    return place


def _fits(moved: Pillar | Wall, drawn: Arena, track: _Track, beside: Beside, start_margin: float) -> bool:
    """Is the path free of this obstacle, with room at its start, and is the obstacle free of all others?"""
    gaps, _ = separations(track.hull, _alone(moved), _poses(track.position, track.heading))
    others, _ = separations(hull_from(moved.outline), pack([drawn])[0], np.array([0.0, 0.0, 1.0, 0.0]))
    free = gaps.min() >= beside.gap[0] - ROUNDING and gaps[0, 0] >= start_margin
    return bool(free and (others > 0.0).all())


def _alone(shape: Pillar | Wall) -> Obstacles:
    arena = Arena(pillars=(shape,)) if isinstance(shape, Pillar) else Arena(walls=(shape,))
    return pack([arena])[0]


def _poses(position: Plane, heading: Plane) -> Array:
    return np.stack([position.real, position.imag, heading.real, heading.imag], axis=-1)
