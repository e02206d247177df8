"""Paths and timed trajectories of the platform."""

from caster_gym.paths.specification import PathSpecification, build_trajectories, read_paths
from caster_gym.paths.trajectory import COLUMNS, Trajectory

__all__ = ["COLUMNS", "PathSpecification", "Trajectory", "build_trajectories", "read_paths"]
