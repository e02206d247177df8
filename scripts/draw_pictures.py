"""The pictures that README opens with, drawn by the environment itself: python -m scripts.draw_pictures

Computed torque drives one episode; a moment of it becomes a picture, and its beginning a short film.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import gymnasium as gym
import yaml
from PIL import Image

from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.envs.scene import Scene
from caster_gym.render.recording import recording
from caster_gym.render.viewer import Viewer

ROOT = Path(__file__).resolve().parent.parent
ENVIRONMENT = "caster_gym:CasterFollow-v0"
SETTINGS: dict[str, Any] = {
    "path": "lemniscate",
    "arena": {
        "room": [[-1.45, -1.3], [1.45, 1.3]],
        "pillars": [{"centre": [0.58, 0.0], "radius": 0.12}, {"centre": [-0.58, 0.0], "radius": 0.12}],
        "walls": [
            {"start": [-0.25, 0.7], "end": [0.25, 0.7], "thickness": 0.06},
            {"start": [-0.25, -0.7], "end": [0.25, -0.7], "thickness": 0.06},
        ],
        "polygons": [
            {"corners": [[-1.45, -1.3], [-0.95, -1.3], [-1.45, -0.8]]},
            {"corners": [[1.45, 1.3], [0.95, 1.3], [1.45, 0.8]]},
        ],
    },
}
NATURAL_FREQUENCY = 10.0  # [rad/s]
PICTURE, FILM = (1440, 960), (720, 480)  # [px]
SKIPPED = 1  # of two frames in the film, which so has 25 a second
MOST_BYTES = 2_000_000  # of the film, that a page loads quickly


def scenes(environment: str, settings: dict[str, Any], seed: int) -> Iterator[Scene]:
    """One episode, moment by moment."""
    env: Any = gym.make(environment, **settings).unwrapped
    agent = ComputedTorque(env.engine.layout, NATURAL_FREQUENCY, env.task.control_period)
    observation, _ = env.reset(seed=seed)
    ended = False
    while not ended:
        yield env.engine.scene(0)
        observation, _, terminated, truncated, _ = env.step(agent.act(observation[None])[0])
        ended = terminated or truncated


def draw(folder: Path, environment: str, settings: dict[str, Any], seed: int, moment: float, seconds: float) -> None:
    """robot.png, the moment [s] of the episode, and robot.gif, its first seconds."""
    folder.mkdir(parents=True, exist_ok=True)
    episode = [scene for scene in scenes(environment, settings, seed) if scene.time <= max(moment, seconds)]
    still = Viewer("rgb_array", PICTURE)
    for scene in episode:
        if scene.time <= moment:
            still.show([scene])
    Image.fromarray(still.frame()).save(folder / "robot.png", optimize=True)
    chosen = [scene for scene in episode if scene.time <= seconds][:: SKIPPED + 1]
    viewer = Viewer("rgb_array", FILM)
    with recording(folder / "robot.gif", 1.0 / (chosen[1].time - chosen[0].time), overwrite=True) as film:
        for scene in chosen:
            viewer.show([scene])
            film.add(viewer.frame())
    if (size := (folder / "robot.gif").stat().st_size) > MOST_BYTES:
        raise SystemExit(f"robot.gif has {size / 1e6:.1f} MB, more than {MOST_BYTES / 1e6:g}; ask for fewer --seconds")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, default=ROOT / "docs" / "pictures", help="folder of the pictures")
    parser.add_argument("--environment", default=ENVIRONMENT, help="what gym.make is given")
    parser.add_argument(
        "--settings", type=yaml.safe_load, default=SETTINGS, help="its arguments as YAML: '{path: circle}'"
    )
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--moment", type=float, default=5.2, help="of the picture [s]")
    parser.add_argument("--seconds", type=float, default=7.0, help="length of the film [s]")
    arguments = parser.parse_args()
    draw(
        arguments.out,
        arguments.environment,
        arguments.settings,
        arguments.seed,
        arguments.moment,
        arguments.seconds,
    )
