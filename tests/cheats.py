"""Drivers that try to be paid for something else than following, and must not be paid as well for it.

Each cheat is a function from observations (robots, size), their layout and the time [s] to the wanted twist (robots, 3)
in B; `Cheat` is an agent that drives it with the model. They see what every agent sees.
"""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.computed_torque import ComputedTorque, frame_rate
from caster_gym.arrays import Array
from caster_gym.envs.observation import ObservationLayout

Drive: TypeAlias = Callable[[NDArray[np.float32], ObservationLayout, float], Array]

PULL = 4.0  # [1/s] rate at which distances from where a cheat wants to be shrink
SPEED = 0.8  # [m/s]


def direction(observations: NDArray[np.float32], layout: ObservationLayout) -> Array:
    """Unit vectors (robots, 2) in B from the reference towards the farthest previewed point; 0 at the path's end."""
    farthest = layout.physical(observations, f"preview_{max(layout.preview):g}{layout.unit}")[:, :2]
    ahead = farthest - layout.physical(observations, "position_error")
    unit: Array = ahead / np.maximum(np.hypot(*ahead.T), 1e-6)[:, None]
    return unit


def left_of(vectors: Array) -> Array:
    """Vectors (robots, 2) turned left."""
    return np.stack([-vectors[:, 1], vectors[:, 0]], axis=1)


def honest_motion(observations: NDArray[np.float32], layout: ObservationLayout, offset: Array) -> Array:
    """Twist that goes where the reference goes, at an offset (robots, 2) [m] in B from it, turned like it.

    Along a path that is followed at one's own pace, at no less than half of SPEED.
    """
    motion = layout.physical(observations, "twist") + layout.physical(observations, "twist_error")
    if layout.unit == "m":
        speed = np.maximum(np.hypot(*motion[:, :2].T), 0.5 * SPEED)
        motion[:, :2] = speed[:, None] * direction(observations, layout)
    motion[:, :2] += PULL * (layout.physical(observations, "position_error") + offset)
    heading = layout.physical(observations, "heading_error")
    motion[:, 2] += PULL * np.arctan2(heading[:, 1], heading[:, 0])
    return motion


def park(observations: NDArray[np.float32], _layout: ObservationLayout, _time: float) -> Array:
    """Stay where the episode began."""
    return np.zeros((len(observations), 3))


def spin(observations: NDArray[np.float32], _layout: ObservationLayout, _time: float) -> Array:
    """Turn on the spot."""
    return np.tile([0.0, 0.0, 3.0], (len(observations), 1))


def spin_along(observations: NDArray[np.float32], layout: ObservationLayout, _time: float) -> Array:
    """Go where the reference goes, turning all the time."""
    motion = honest_motion(observations, layout, np.zeros((len(observations), 2)))
    motion[:, 2] = 3.0
    return motion


def zigzag(observations: NDArray[np.float32], layout: ObservationLayout, time: float) -> Array:
    """Follow the path from side to side of it: more way, at the same progress."""
    side = 0.1 if time % 1.0 < 0.5 else -0.1
    return honest_motion(observations, layout, side * left_of(direction(observations, layout)))


def shuttle(observations: NDArray[np.float32], layout: ObservationLayout, time: float) -> Array:
    """Back and forth about the same place, or about the reference where a clock leads it."""
    way = 1.0 if time % 0.6 < 0.3 else -1.0
    if layout.unit == "s":
        return honest_motion(observations, layout, 0.1 * way * direction(observations, layout))
    motion = np.zeros((len(observations), 3))
    motion[:, :2] = way * 0.5 * direction(observations, layout)
    return motion


def creep(observations: NDArray[np.float32], layout: ObservationLayout, time: float) -> Array:
    """Two steps forward, one back."""
    way = 1.0 if time % 0.9 < 0.6 else -1.0
    motion = honest_motion(observations, layout, np.zeros((len(observations), 2)))
    motion[:, :2] += (way - 1.0) * SPEED * direction(observations, layout)
    return motion


def ram(observations: NDArray[np.float32], layout: ObservationLayout, _time: float) -> Array:
    """Drive into the nearest obstacle that can be seen, else to the left of the path, and stay there."""
    towards = left_of(direction(observations, layout))
    if layout.nearest:
        seen = -layout.physical(observations, "obstacle_1")[:, 1:]
        towards = np.where((np.abs(seen) > 0.0).any(axis=1, keepdims=True), seen, towards)
    return np.column_stack([SPEED * towards, np.zeros(len(observations))])


def scrape(observations: NDArray[np.float32], layout: ObservationLayout, _time: float) -> Array:
    """Follow the path while leaning on whatever is beside it."""
    motion = honest_motion(observations, layout, np.zeros((len(observations), 2)))
    if layout.nearest:
        motion[:, :2] -= 0.3 * layout.physical(observations, "obstacle_1")[:, 1:]
    else:
        motion[:, :2] += 0.3 * left_of(direction(observations, layout))
    return motion


def rush_to_the_end(observations: NDArray[np.float32], layout: ObservationLayout, _time: float) -> Array:
    """Straight to the farthest point in sight, as fast as the motors can, and turned anyhow."""
    farthest = layout.physical(observations, f"preview_{max(layout.preview):g}{layout.unit}")[:, :2]
    return np.column_stack([PULL * farthest, np.zeros(len(observations))])


def cut_corners(observations: NDArray[np.float32], layout: ObservationLayout, _time: float) -> Array:
    """Stay on the inner side of all bends, where the way is shorter than the progress."""
    ahead = direction(observations, layout)
    nearest = layout.physical(observations, f"preview_{min(layout.preview):g}{layout.unit}")[:, :2]
    nearest -= layout.physical(observations, "position_error")
    inner = np.sign(nearest[:, 0] * ahead[:, 1] - nearest[:, 1] * ahead[:, 0])
    return honest_motion(observations, layout, 0.15 * inner[:, None] * left_of(ahead))


CHEATS: dict[str, Drive] = {
    drive.__name__: drive
    for drive in (park, spin, spin_along, zigzag, shuttle, creep, ram, scrape, rush_to_the_end, cut_corners)
}


class Cheat(ComputedTorque):
    """Reaches the twist that a cheat wants, by computed torque. It counts the time itself: make one an episode."""

    def __init__(self, layout: ObservationLayout, period: float, drive: Drive) -> None:
        super().__init__(layout, 10.0, period)
        self._drive, self._steps = drive, 0

    def _accelerations(self, observations: NDArray[np.float32], twist: Array) -> tuple[Array, Array]:
        wanted = self._drive(observations, self.layout, self._steps * self.period)
        self._steps += 1
        acceleration = 10.0 * (wanted - twist) + frame_rate(twist)
        return acceleration, acceleration


class FullTorque:
    """Every motor at full torque: no driver at all, but much effort."""

    def __init__(self, joints: int) -> None:
        self._joints = joints

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints)."""
        return np.ones((len(observations), self._joints), dtype=np.float32)


def scores(agent: Any, batch: Any, seed: int) -> Array:
    """Sum of the rewards (robots,) of one episode of each robot, on paths in turn."""
    paths = np.arange(batch.num_envs) % len(batch.unwrapped.engine.plan.names)
    observations, _ = batch.reset(seed=seed, options={"path": paths})
    total, running = np.zeros(batch.num_envs), np.ones(batch.num_envs, dtype=np.bool_)
    while running.any():
        observations, rewards, terminated, truncated, _ = batch.step(agent.act(observations))
        total += np.where(running, rewards, 0.0)
        running &= ~(terminated | truncated)
    return total
