"""Robots walked among obstacles, one step after another, for the tests of contact."""

import numpy as np

from caster_gym.arena import read_arena
from caster_gym.arena.packing import surroundings
from caster_gym.mechanics.contact import guarded_step
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.separation import Hull, Obstacles, clearance
from caster_gym.robot import Footprint

ALLOWED = 1e-4  # m, deepest that a robot may be found in an obstacle
TRIANGLE = ((0.3, 0.0), (-0.2, 0.25), (-0.15, -0.2))
NEEDLE = ((0.3, 0.0), (-0.3, 0.004), (-0.3, -0.004))
BOX = ((0.15, -0.08), (0.15, 0.08), (-0.15, 0.08), (-0.15, -0.08))
FLOOR = {"half_planes": [{"point": [0.0, 0.0], "normal": [0.0, 1.0]}]}


def shaped(robot, outline):
    """The robot with another outline: a radius [m] or corners."""
    shape = {"disc": outline} if isinstance(outline, float) else {"polygon": outline}
    platform = robot.platform.model_copy(update={"footprint": Footprint(**shape)})
    return robot.model_copy(update={"platform": platform})


def around_it(robot, arena, **bounce):
    return surroundings(robot, read_arena({"restitution": 0.0, "friction": 0.0, **arena, **bounce}))


def listed(part):
    return part.tolist() if isinstance(part, np.ndarray) else part


class Walk:
    """A robot, or a batch of it, stepped among obstacles; sums up what it meets."""

    def __init__(self, robot, around, state, torque=None):
        self.parameters = robot_parameters(robot)
        self.hull, self.obstacles = Hull(*map(listed, around.hull)), Obstacles(*map(listed, around.obstacles))
        self.count = len(around.obstacles.radii)
        self.state = state
        torque = np.zeros(2 * robot.caster_count) if torque is None else torque
        self.torques = tuple((float(torque[2 * i]), float(torque[2 * i + 1])) for i in range(robot.caster_count))
        self.wrench = (0.0, 0.0, 0.0)
        self.impulse, self.impacts, self.pressing, self.work, self.asked = np.zeros(2), 0.0, 0.0, 0.0, 0.0

    def step(self, h, steps=1):
        for _ in range(steps):
            self.state, touch = guarded_step(
                self.state, self.torques, self.wrench, h, self.parameters, self.hull, self.obstacles, 0, self.count
            )
            self.impulse = self.impulse + np.stack(touch.impulse, -1)
            self.impacts = self.impacts + touch.impacts
            self.pressing = self.pressing + touch.pressing
            self.work, self.asked = self.work + touch.work, np.maximum(self.asked, touch.impact_traction)
        return self

    @property
    def gap(self):
        return clearance(self.state.position, self.state.heading, self.hull, self.obstacles, 0, self.count)


def state_of(x, y, beta, velocity, omega, steering):
    """A state from the velocity (2,) of C in W; numbers or arrays."""
    c, s = np.cos(beta), np.sin(beta)
    vx, vy = velocity
    directions = tuple((np.cos(angle), np.sin(angle)) for angle in steering)
    return State((x, y), (c, s), (c * vx + s * vy, c * vy - s * vx, omega), directions)


def floats(state):
    """The same state in Python's numbers, which are the fastest for one robot."""
    (x, y), (c, s), (vx, vy, omega) = (map(float, part) for part in state[:3])
    return State(
        (x, y),
        (c, s),
        (vx, vy, omega),
        tuple((float(c), float(s)) for c, s in state.directions),
    )


def steering_of(state):
    return np.stack([np.arctan2(s, c) for c, s in state.directions], -1)


def energy(model, state):
    return model.kinetic_energy(steering_of(state), np.stack(state.twist, -1))


def corners_of(outline, state):
    """Corners (M, 2) of a robot in W; a disc is a polygon of 90 corners."""
    if isinstance(outline, float):
        angles = np.arange(90) * 2.0 * np.pi / 90
        outline = outline * np.stack([np.cos(angles), np.sin(angles)], -1)
    c, s = state.heading
    return np.asarray(outline) @ np.array([[c, s], [-s, c]]) + np.asarray(state.position)
