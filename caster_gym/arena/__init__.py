"""Obstacles: half-planes, walls, pillars and convex polygons on the floor."""

from caster_gym.arena.arena import Arena, read_arena
from caster_gym.arena.clearance import distances

__all__ = ["Arena", "distances", "read_arena"]
