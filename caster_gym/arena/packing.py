"""Arenas and robots as the tables of numbers that the mechanics reads."""

from collections.abc import Sequence

import numpy as np

from caster_gym.arena.arena import Arena
from caster_gym.arrays import Array, Indices
from caster_gym.mechanics.impulse import LAWS
from caster_gym.mechanics.separation import Hull, Obstacles, Surroundings
from caster_gym.outlines import Outline
from caster_gym.robot import Robot


def hull_of(robot: Robot) -> Hull:
    """The outline of a robot's platform, in B."""
    return hull_from(robot.platform.footprint.outline)


def surroundings(robot: Robot, arena: Arena) -> Surroundings:
    """A robot in an arena, as the engines take it.

    >>> import caster_gym
    >>> robot = caster_gym.load_robot("chung2008")
    >>> around = caster_gym.surroundings(robot, caster_gym.Arena(pillars=[{"centre": [0.5, 0.0], "radius": 0.1}]))
    >>> coasting = [0, 0, 0, 0.5, 0, 0, 0, 0, 0]  # at 0.5 m/s towards the pillar
    >>> states = caster_gym.Model(robot).simulate(coasting, [0.0] * 6, dt=0.005, steps=200, around=around)
    >>> float(states[-1, 3].round(3))  # vx [m/s] after the impact, of restitution 0.5
    -0.25
    """
    return Surroundings(hull_of(robot), pack([arena])[0])


def hull_from(outline: Outline) -> Hull:
    """A hull of any outline about the origin of its frame."""
    return Hull(_table(outline.faces, 3), _table(outline.corners, 2), outline.radius, outline.reach)


def pack(arenas: Sequence[Arena]) -> tuple[Obstacles, Indices]:
    """All obstacles of some arenas in one table, and the first and the end (arenas, 2) of those of each.

    The arenas share restitution, friction and the law of impacts. Obstacles are in the order of `Arena.obstacles`.
    """
    if not arenas:
        raise ValueError("at least one arena is needed, got none")
    if any(arena.beside is not None for arena in arenas):
        raise ValueError("obstacles beside a path have no place before they are drawn: call draw_beside first")
    bounces = {(arena.restitution, arena.friction) for arena in arenas}
    if len(bounces) > 1:
        raise ValueError(f"arenas in one table must share restitution and friction, got {sorted(bounces)}")
    laws = {arena.impact_law for arena in arenas}
    if len(laws) > 1:
        raise ValueError(f"arenas in one table must share impact_law, got {', '.join(sorted(laws))}")
    outlines = [[one.outline for _, one in arena.obstacles] for arena in arenas]
    everything = [outline for those in outlines for outline in those]
    obstacles = Obstacles(
        faces=_table([face for outline in everything for face in outline.faces], 3),
        corners=_table([corner for outline in everything for corner in outline.corners], 2),
        radii=np.array([outline.radius for outline in everything], dtype=np.float64),
        spans=np.hstack(
            [_spans([len(one.faces) for one in everything]), _spans([len(one.corners) for one in everything])]
        ),
        restitution=arenas[0].restitution,
        friction=arenas[0].friction,
        law=LAWS[arenas[0].impact_law],
    )
    return obstacles, _spans([len(those) for those in outlines])


def _spans(counts: Sequence[int]) -> Indices:
    """First and end (K, 2) of consecutive parts of these lengths."""
    ends = np.cumsum(np.array(counts, dtype=np.int64))
    return np.stack([ends - np.array(counts, dtype=np.int64), ends], axis=1)


def _table(rows: Sequence[Sequence[float]], columns: int) -> Array:
    return np.array(rows, dtype=np.float64).reshape(-1, columns)
