"""Scenes to draw, made by hand."""

import math
from typing import Any

import numpy as np

from caster_gym import load_robot
from caster_gym.envs.scene import Scene
from caster_gym.mechanics.separation import Obstacles

ROBOT = load_robot("chung2008")
ANGLES = np.linspace(0.0, 2.0 * np.pi, 200)
CIRCLE = np.stack([np.cos(ANGLES), np.sin(ANGLES)], axis=1)  # of 1 m about the origin


def obstacles(*, pillars=(), half_planes=(), polygons=()):
    """pillars: (x, y, radius). half_planes: (nx, ny, offset). polygons: corners, counter-clockwise."""
    faces: list[Any] = []
    corners: list[Any] = []
    radii, spans = [], []
    for x, y, radius in pillars:
        spans.append((len(faces), len(faces), len(corners), len(corners) + 1))
        corners.append((x, y))
        radii.append(radius)
    for face in half_planes:
        spans.append((len(faces), len(faces) + 1, len(corners), len(corners)))
        faces.append(face)
        radii.append(0.0)
    for polygon in polygons:
        spans.append((len(faces), len(faces) + len(polygon), len(corners), len(corners) + len(polygon)))
        for (ax, ay), (bx, by) in zip(polygon, [*polygon[1:], polygon[0]], strict=True):
            length = math.hypot(bx - ax, by - ay)
            nx, ny = (by - ay) / length, (ax - bx) / length
            faces.append((nx, ny, nx * ax + ny * ay))
        corners.extend(polygon)
        radii.append(0.0)
    return Obstacles(
        np.array(faces, dtype=float).reshape(-1, 3),
        np.array(corners, dtype=float).reshape(-1, 2),
        np.array(radii, dtype=float),
        np.array(spans, dtype=np.int64).reshape(-1, 4),
        0.5,
        0.2,
    )


def scene(x=1.0, y=0.0, turn=0.0, time=0.0, **changes):
    """A robot beside a circle, its wheels straight ahead and unloaded."""
    robot = changes.get("robot", ROBOT)
    n = robot.caster_count
    fields = {
        "robot": robot,
        "time": time,
        "pose": np.array([x, y, math.cos(turn), math.sin(turn)]),
        "twist": np.zeros(3),
        "directions": np.tile([1.0, 0.0], (n, 1)),
        "torque": np.zeros(2 * n),
        "ground_forces": np.zeros((n, 2)),
        "path": CIRCLE,
        "corridor": 0.5,
        "reference": np.array([1.0, 0.0, 0.0, 1.0]),
        "obstacles": obstacles(),
        "impulse": np.zeros(2),
        "impact_point": np.full(2, np.nan),
        "failed": False,
        "slip": np.zeros((n, 2)),
    }
    return Scene(**{**fields, **changes})


def centroid(frame, colour):
    """Mean place (column, row) of the pixels of a colour, in continuous pixel coordinates."""
    rows, columns = np.nonzero((frame == colour).all(axis=2))
    assert len(rows), f"no pixel has the colour {colour}"
    return np.array([columns.mean() + 0.5, rows.mean() + 0.5])
