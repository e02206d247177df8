"""Drives a robot by keyboard: held keys give the wanted twist, and the exact model finds the torques."""

from collections.abc import Callable, Mapping

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.computed_torque import ComputedTorque, frame_rate
from caster_gym.arrays import Array
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import Robot

Held = Callable[[], frozenset[str]]
SLOWING = 4.0  # [1/s] rate at which the twist approaches the wanted one
SHARE = 0.4  # of the robot's top speed
MOST_SPEED = 0.8  # [m/s] what a person follows easily
MOST_YAW_RATE = 2.0  # [rad/s]
KEYS: Mapping[str, tuple[float, float, float]] = {  # shares of the greatest vx, vy, ω, in B
    "w": (1.0, 0.0, 0.0),
    "up": (1.0, 0.0, 0.0),
    "s": (-1.0, 0.0, 0.0),
    "down": (-1.0, 0.0, 0.0),
    "a": (0.0, 1.0, 0.0),
    "left": (0.0, 1.0, 0.0),
    "d": (0.0, -1.0, 0.0),
    "right": (0.0, -1.0, 0.0),
    "q": (0.0, 0.0, 1.0),
    "e": (0.0, 0.0, -1.0),
}


class KeyboardDriver(ComputedTorque):
    """Computed torque whose wanted acceleration comes from keys instead of the reference.

    W, S, ↑, ↓ drive ahead and back, A, D, ←, → to the left and right of the robot, Q and E turn it. held tells the
    names of the keys that are down, as in KEYS; period [s] between actions.
    """

    def __init__(self, layout: ObservationLayout, period: float, held: Held) -> None:
        super().__init__(layout, SLOWING, period)
        self._held = held
        self._rate = -np.expm1(-SLOWING * period) / period  # held for a period, it leaves exp(−SLOWING · period)
        self._greatest = greatest_twist(layout.robot)

    @property
    def name(self) -> str:
        """What tables and figures call it."""
        return "keyboard"

    def _accelerations(self, observations: NDArray[np.float32], twist: Array) -> tuple[Array, Array]:
        rate = self._rate * (self._greatest * wanted_shares(self._held()) - twist)
        acceleration = rate + frame_rate(twist)
        return acceleration, acceleration


def greatest_twist(robot: Robot) -> Array:
    """The twist (3,) that a person may ask for: slow enough for the motors and for the person."""
    speed = min(SHARE * robot.top_speed, MOST_SPEED)
    return np.array([speed, speed, min(speed / robot.pivot_reach, MOST_YAW_RATE)])


def wanted_shares(held: frozenset[str]) -> Array:
    """Shares (3,) of the greatest twist in −1 … 1 for the keys that are down; opposite ones cancel."""
    shares = sum((np.array(KEYS[key]) for key in held if key in KEYS), np.zeros(3))
    return np.clip(shares, -1.0, 1.0)


def keys_of_window() -> frozenset[str]:
    """The keys that are down in the window that has the focus."""
    from caster_gym.render.pygame_loader import pygame

    down = pygame.key.get_pressed()
    return frozenset(key for key in KEYS if down[pygame.key.key_code(key)])
