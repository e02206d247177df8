"""How far the columns of a trajectory are from being derivatives of each other, by finite differences."""

import numpy as np

from caster_gym.paths.trajectory import Trajectory


def slope(values: np.ndarray, h: float) -> np.ndarray:
    """Derivative at all samples but two at each end; its error is h⁴/30 times the fifth derivative."""
    differences: np.ndarray = values[:-4] - 8.0 * values[1:-3] + 8.0 * values[3:-1] - values[4:]
    return differences / (12.0 * h)


def derivative_error(trajectories: tuple[Trajectory, ...]) -> float:
    """Greatest difference between a column and the finite difference of the one that it is the derivative of."""
    worst = 0.0
    for trajectory in trajectories:
        d, here = slope(trajectory.samples, trajectory.time_step), trajectory.samples[2:-2]
        cos, sin, omega = here[:, 2], here[:, 3], here[:, 6]
        heading = d[:, 2:4] - np.stack([-omega * sin, omega * cos], axis=1)
        errors = (d[:, 0:2] - here[:, 4:6], heading, d[:, 4:7] - here[:, 7:10])
        worst = max(worst, *(float(np.abs(error).max()) for error in errors))
    return worst
