"""What a long run lets robots do: one leg of it after the other, each drawn from the seed and its number alone."""

import math
from typing import Any, NamedTuple

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv

from caster_gym.wrappers import read_features, wrap

ROBOTS = ("chung2008", "tidybot2", "xr4000")
TASKS = ("track", "follow", "hold", "track on a slippery floor")
KINDS = len(ROBOTS) * len(TASKS)  # of legs, which take turns: all code is compiled in the first round
ENVIRONMENTS = {"track": "CasterTrack-v0", "follow": "CasterFollow-v0", "hold": "CasterHold-v0"}
PATHS = {"shape": "random_paths", "count": 16, "extent": 2.0, "duration": 6.0, "reversing": 0.0, "min_radius": 0.25}
CLEAR = 2.9  # [m] from the origin, within which obstacles that have a place would stand on paths
HALF = 4.2  # [m] of the room's sides, at least
FEW = 1.0 / 64.0  # of the robots where an inner loop, which takes long, follows their commands
FEATURES: tuple[dict[str, Any], ...] = (
    {"kind": "payload", "mass": [0.0, 3.0], "x": [-0.05, 0.05], "y": [-0.05, 0.05], "inertia": 0.02},
    {"kind": "friction", "viscous_scale": [0.5, 2.0], "coulomb_scale": [0.5, 2.0]},
    {"kind": "wheel_errors", "trail": [-0.001, 0.001], "radius": [-0.001, 0.001]},
    {"kind": "pushes", "rate": 2.0, "force": [0.0, 20.0], "moment": [-2.0, 2.0]},
    {"kind": "sensor_noise", "position": 0.01, "heading": 0.01, "speed": 0.05, "yaw_rate": 0.05, "position_bias": 0.01},
    {"kind": "steering_offset"},
    {"kind": "action_delay", "periods": [0, 3]},
    {"kind": "motor_lag", "time_constant": [0.005, 0.05]},
    {"kind": "potential", "quantity": "position_error", "margin": 0.5, "discount": 0.99},
    {"kind": "tolerance", "quantity": "clearance", "margin": 0.1, "shape": "long_tail"},
    {"kind": "effort"},
    {"kind": "smoothness"},
    {"kind": "traction_use"},
    {"kind": "impact"},
)
COMMANDS: tuple[dict[str, Any], ...] = (
    {"kind": "twist_commands"},
    {"kind": "twist_commands", "frame": "world"},
    {"kind": "joint_speeds"},
)


class Leg(NamedTuple):
    """One batch of robots in a room of its own, and what they are asked to do."""

    number: int
    robot: str
    task: str
    features: tuple[dict[str, Any], ...]
    mode: AutoresetMode
    settings: dict[str, Any]  # of the environment
    share: float  # of the robots that take part
    calm: float  # share of robots that keep their command from one control period to the next


def draw_leg(seed: int, number: int) -> Leg:
    """The leg of that number: kinds take turns, all else is drawn."""
    rng = np.random.default_rng((seed, number))
    robot, task = ROBOTS[number % len(ROBOTS)], TASKS[number // len(ROBOTS) % len(TASKS)]
    slippery = task.endswith("floor")
    features = [one for one in FEATURES if rng.random() < 0.35]
    commanded = rng.random() < 0.1
    if commanded:
        features.append(COMMANDS[rng.integers(len(COMMANDS))])
    arena = draw_arena(rng)
    if task == "hold":  # starts that far from a pose leave no room beside it
        arena.pop("beside")
    settings: dict[str, Any] = {
        "robot": robot,
        "path": PATHS | {"seed": int(rng.integers(1000))},
        "arena": arena,
        "corridor": float(np.exp(rng.uniform(np.log(1.0), np.log(20.0)))),  # [m]
        "nearest": 3,
        "max_episode_steps": int(rng.integers(50, 400)),
        "touching": "ends" if rng.random() < 0.1 else "allowed",
    }
    if slippery:
        settings["floor"] = {"friction": float(rng.uniform(0.05, 0.5))}
    mode = list(AutoresetMode)[rng.integers(len(AutoresetMode))]
    calm, share = float(rng.uniform(0.5, 0.98)), FEW if commanded else 1.0
    return Leg(number, robot, task, tuple(features), mode, settings, share, calm)


def draw_arena(rng: np.random.Generator) -> dict[str, Any]:
    """A closed room with obstacles of all kinds, some of which overlap or leave gaps as wide as a robot."""
    low, high = -rng.uniform(HALF, HALF + 1.0, 2), rng.uniform(HALF, HALF + 1.0, 2)

    def place(far: float) -> tuple[float, float]:
        """A point that stays clear of the paths by `far`, in any direction."""
        distance, angle = rng.uniform(CLEAR + far, HALF), rng.uniform(0.0, 2.0 * math.pi)
        return float(distance * math.cos(angle)), float(distance * math.sin(angle))

    def triangle(x: float, y: float) -> list[list[float]]:
        first, size = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(0.1, 0.4)
        angles = (first + 2.0 * math.pi * k / 3.0 for k in range(3))
        return [[float(x + size * math.cos(angle)), float(y + size * math.sin(angle))] for angle in angles]

    def wall(x: float, y: float) -> dict[str, Any]:
        angle, length = rng.uniform(0.0, math.pi), rng.uniform(0.1, 0.4)
        dx, dy = float(length * math.cos(angle)), float(length * math.sin(angle))
        thickness = float(rng.choice((0.0, 0.1)))
        return {"start": [x - dx, y - dy], "end": [x + dx, y + dy], "thickness": thickness}

    x, y = place(0.5)
    return {
        "room": [low.tolist(), high.tolist()],
        "half_planes": [{"point": [x, y], "normal": [-x, -y]}],
        "walls": [wall(*place(0.5)) for _ in range(3)],
        "pillars": [{"centre": place(0.3), "radius": float(rng.uniform(0.02, 0.3))} for _ in range(4)],
        "polygons": [{"corners": triangle(*place(0.4))} for _ in range(3)],
        "beside": {
            "pillars": 1,
            "walls": 1,
            "gap": [0.1, 0.4],
            "pillar_radius": [0.02, 0.1],
            "wall_length": [0.1, 0.3],
            "seed": int(rng.integers(1000)),
        },
        "restitution": float(rng.choice((0.0, 0.5, 0.9, 1.0))),
        "friction": float(rng.choice((0.0, 0.2, 0.8))),
        "impact_law": str(rng.choice(("stronge", "chatterjee_ruina"))),
    }


def make_batch(leg: Leg, robots: int) -> VectorEnv[Any, Any, Any]:
    """The robots of a leg."""
    made = gym.make_vec(
        f"caster_gym:{ENVIRONMENTS[leg.task.split()[0]]}",
        num_envs=max(1, round(robots * leg.share)),
        autoreset_mode=leg.mode,
        **leg.settings,
    )
    return wrap(made, *read_features(leg.features)) if leg.features else made
