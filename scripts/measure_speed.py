"""How fast the robots run, in one table: python -m scripts.measure_speed

All rows are measured in turn, and the turns repeated, so that a busy moment of the machine does not fall on one row
alone. Every row shows the median over the turns and the range.
"""

import argparse
import os
import platform
import shlex
import subprocess
import sys
import time
from collections.abc import Callable
from importlib.metadata import version
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

import gymnasium as gym
import mujoco
import numpy as np
from tqdm import tqdm

from caster_gym import Robot, load_robot
from caster_gym.arena import Arena, distances
from caster_gym.arena.arena import Pillar
from caster_gym.arena.packing import surroundings
from caster_gym.engines.numba_fleet import Fleet
from caster_gym.engines.threads import get_threads, set_threads
from caster_gym.export.mjcf import mjcf
from scripts.mujoco_peer import joint_indices

ENVIRONMENT = "caster_gym:CasterTrack-v0"
FOLLOW = "caster_gym:CasterFollow-v0"
COURSES = {"shape": "random_paths", "count": 16, "reversing": 0.0, "min_radius": 0.15}
WIDE = 20.0  # [m] corridor that random actions do not leave, so that episodes end by time
ACTION = 0.1  # [-] random actions and torques, as shares of the greatest torques
SPEED = 0.5  # [m/s, rad/s] standard deviation of the random motions at the start
RK4_STEP = 0.005  # [s] the environments' own
MUJOCO_STEP = 0.002  # [s] its default, above which its wheels slip noticeably
EXCERPT = 2.0  # [s] of motion, for the bare equations as for MuJoCo
BANK = 64  # batches of actions drawn beforehand
ROOM = Arena(
    room=((-2.0, -2.0), (2.0, 2.0)),
    pillars=tuple(Pillar(centre=(x, y), radius=0.15) for x in (-1.0, 1.0) for y in (-1.0, 1.0)),
)
EQUATIONS = "bare RK4, batch of 4,096, 1 core"
AMONG = "bare RK4 among 8 obstacles, batch of 4,096, 1 core"
FOLLOWING = "following among 6 obstacles, batch of 1,024, 1 core"
FREE_FOLLOWING = "following without obstacles, batch of 1,024, 1 core"
ALONE = "one environment, `gym.make`"
MUJOCO = "MuJoCo `mj_step`, 1 core"
LIBRARIES = ("caster_gym", "gymnasium", "mujoco", "numba", "numpy")

IMPORT = "import time; t = time.perf_counter(); import caster_gym; print(time.perf_counter() - t)"
FIRST_STEP = f"""
import time
t = time.perf_counter()
import gymnasium as gym
environment = gym.make({ENVIRONMENT!r})
environment.reset(seed=0)
environment.step(environment.action_space.sample())
print(time.perf_counter() - t)
"""

NOTES = """\
A step of the environment is a control period of 20 ms: four RK4 steps, observation, reward, infos and, where an episode
has ended, the reset. Actions are random, up to a tenth of the greatest torques, and the corridor is wide, so that
episodes end by time. Following is CasterFollow-v0 on random paths, with six pillars and walls drawn beside each.

Bare RK4 is the equations alone at 5 ms, from random places and motions; the 8 obstacles are the walls of a room of
4 m × 4 m and four pillars, off which the robots bounce. MuJoCo steps the same robot as rigid bodies at 2 ms, one robot
at a time, many steps in a call. The engine alone skips Gymnasium's wrappers and the dictionary of infos. A fresh
process counts from its first import to its first step, with the compiled code on disk. The load of an idle machine at
the start is 0; at the end it is that of the measurement.
"""


class Row(NamedTuple):
    """One line of the table; rates are better when greater, times when smaller."""

    name: str
    unit: str  # "steps/s", "µs" or "s"
    measure: Callable[[], float]  # once, in that unit
    goal: float | None = None

    def reached(self, value: float) -> str:
        """What is said about the goal."""
        if self.goal is None:
            return ""
        good = value >= self.goal if self.unit == "steps/s" else value <= self.goal
        bound = "≥" if self.unit == "steps/s" else "≤"
        return f"{bound} {shown(self.goal)}: {'reached' if good else 'missed'}"


def rate(call: Callable[[], int], seconds: float) -> float:
    """Steps per second of a call that returns how many steps it made, over at least so long."""
    call()  # compiles, and fills the caches
    steps, start, passed = 0, time.perf_counter(), 0.0
    while passed < seconds or not steps:
        steps += call()
        passed = time.perf_counter() - start
    return steps / passed


def bare_equations(robot: Robot, count: int, arena: Arena | None = None) -> Callable[[], int]:
    """RK4 steps of a batch under random torques, from random places and motions in the room, with its walls or not."""
    fleet = Fleet(robot, count, around=None if arena is None else surroundings(robot, arena))
    rng = np.random.default_rng(0)
    poses = rng.uniform(-1.8, 1.8, (20 * count, 3))
    free = poses[(distances(ROOM, robot, poses)[0] > 0.0).all(axis=1)][:count]
    start, steps = fleet.state, round(EXCERPT / RK4_STEP)
    start[:, :2] = free[:, :2]
    start[:, 2], start[:, 3] = np.cos(free[:, 2]), np.sin(free[:, 2])
    start[:, 4:7] = SPEED * rng.normal(size=(count, 3))
    torques = ACTION * rng.uniform(-1.0, 1.0, (count, len(robot.joints))) * limits(robot)

    def call() -> int:
        fleet.state = start
        fleet.step(torques, RK4_STEP, steps)
        return count * steps

    return call


def limits(robot: Robot) -> Any:
    """Greatest torques of all joints. [N m]"""
    return np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in robot.casters]).ravel()


def batch(robot: str, count: int, name: str = ENVIRONMENT, **options: Any) -> Callable[[], int]:
    """Steps of the native batch, with observations, rewards, infos and resets."""
    environment = gym.make_vec(name, num_envs=count, robot=robot, corridor=WIDE, **options)
    environment.reset(seed=0)
    shape = (BANK, *environment.action_space.shape)
    actions = np.random.default_rng(0).uniform(-ACTION, ACTION, shape).astype(np.float32)
    made = 0

    def call() -> int:
        nonlocal made
        environment.step(actions[made % BANK])
        made += 1
        return count

    return call


def single(name: str, scale: float | None = None, **options: Any) -> Callable[[], int]:
    """Steps of one environment from `gym.make`, with its resets; actions sampled, or uniform up to a scale."""
    environment = gym.make(name, **options)
    environment.reset(seed=0)
    environment.action_space.seed(0)
    actions = [environment.action_space.sample() for _ in range(BANK)]
    if scale is not None:
        actions = [np.asarray(scale * action, dtype=np.float32) for action in actions]

    def call() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = environment.step(action)
            if terminated or truncated:
                environment.reset()
        return BANK

    return call


def bare_engine(robot: str) -> Callable[[], int]:
    """Control periods of one robot by its engine alone: actions in, observation, reward and report out."""
    environment: Any = gym.make(ENVIRONMENT, robot=robot, corridor=WIDE).unwrapped
    environment.reset(seed=0)
    shape = (BANK, 1, *environment.action_space.shape)
    actions = np.random.default_rng(0).uniform(-ACTION, ACTION, shape).astype(np.float32)

    def call() -> int:
        for action in actions:
            environment.engine.step(action)
        return BANK

    return call


def mujoco_steps(robot: Robot) -> Callable[[], int]:
    """mj_step of the same robot as rigid bodies on the floor, under random torques, from rest."""
    model: Any = mujoco.MjModel.from_xml_string(mjcf(robot, MUJOCO_STEP))
    data: Any = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    _, joints = joint_indices(robot, model)
    steps = round(EXCERPT / MUJOCO_STEP)

    def call() -> int:
        mujoco.mj_resetData(model, data)
        data.qpos[joints[1::2]] = rng.uniform(-np.pi, np.pi, robot.caster_count)
        data.ctrl[:] = ACTION * rng.uniform(-1.0, 1.0, len(robot.joints)) * limits(robot)
        mujoco.mj_step(model, data, steps)
        return steps

    return call


def fresh(code: str) -> float:
    """The number that a fresh Python prints."""
    return float(subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout)


def rows(robot: Robot, name: str, seconds: float) -> list[Row]:
    """All measurements; those of compiled code say on how many cores."""
    cores = min(2, get_threads())

    def on(threads: int, call: Callable[[], int]) -> Callable[[], float]:
        def measure() -> float:
            set_threads(threads)
            return rate(call, seconds)

        return measure

    def each(call: Callable[[], int]) -> Callable[[], float]:
        return lambda: 1e6 / rate(call, seconds)

    equations = bare_equations(robot, 4096)
    return [
        Row(EQUATIONS, "steps/s", on(1, equations), 3e6),
        Row(AMONG, "steps/s", on(1, bare_equations(robot, 4096, ROOM))),
        Row(f"bare RK4, batch of 4,096, {cores} cores", "steps/s", on(cores, equations)),
        Row("environment, batch of 128, 1 core", "steps/s", on(1, batch(name, 128))),
        Row("environment, batch of 1,024, 1 core", "steps/s", on(1, batch(name, 1024))),
        Row(f"environment, batch of 1,024, {cores} cores", "steps/s", on(cores, batch(name, 1024)), 1e6),
        Row(f"environment, batch of 4,096, {cores} cores", "steps/s", on(cores, batch(name, 4096))),
        Row(FREE_FOLLOWING, "steps/s", on(1, batch(name, 1024, FOLLOW, path=COURSES))),
        Row(FOLLOWING, "steps/s", on(1, batch(name, 1024, FOLLOW, path=COURSES, arena={"beside": {}}))),
        Row(ALONE, "steps/s", on(1, single(ENVIRONMENT, ACTION, robot=name, corridor=WIDE)), 3e4),
        Row("one robot, engine alone, per step", "µs", each(bare_engine(name))),
        Row(MUJOCO, "steps/s", on(1, mujoco_steps(robot))),
        Row("Gymnasium CartPole-v1, per step", "µs", each(single("CartPole-v1"))),
        Row("Gymnasium Pendulum-v1, per step", "µs", each(single("Pendulum-v1"))),
        Row("`import caster_gym`", "s", lambda: fresh(IMPORT), 0.5),
        Row("fresh process to first step", "s", lambda: fresh(FIRST_STEP)),
    ]


def ratios(medians: dict[str, float]) -> list[tuple[str, str]]:
    """What the medians say about each other."""
    rk4, mj, alone = medians[EQUATIONS], medians[MUJOCO], medians[ALONE]
    many = max(value for name, value in medians.items() if "batch of 1,024" in name)
    pendulum, cartpole = (medians[f"Gymnasium {name}, per step"] for name in ("Pendulum-v1", "CartPole-v1"))
    return [
        ("simulated seconds per second, bare RK4 at 5 ms, 1 core", shown(RK4_STEP * rk4)),
        ("simulated seconds per second, MuJoCo at 2 ms, 1 core", shown(MUJOCO_STEP * mj)),
        ("one environment, `gym.make`, time of a step", f"{1e6 / alone:.1f} µs"),
        ("bare RK4 among 8 obstacles over none, steps (goal: at least 0.5)", f"{medians[AMONG] / rk4:.2f}"),
        ("following among 6 obstacles over none, steps", f"{medians[FOLLOWING] / medians[FREE_FOLLOWING]:.2f}"),
        ("bare RK4 over MuJoCo, steps", f"{rk4 / mj:.1f}"),
        ("bare RK4 over MuJoCo, simulated time", f"{RK4_STEP * rk4 / (MUJOCO_STEP * mj):.1f}"),
        ("batch of 1,024 over one environment, steps", f"{many / alone:.1f}"),
        ("one environment over Pendulum-v1, time", f"{1e6 / alone / pendulum:.2f}"),
        ("one environment over CartPole-v1, time", f"{1e6 / alone / cartpole:.2f}"),
    ]


def shown(value: float) -> str:
    """Three digits, thousands separated."""
    if value < 999.5:
        return f"{value:.3g}"
    unit = 10 ** (len(str(round(value))) - 3)
    return f"{round(value / unit) * unit:,}"


def page(table: list[tuple[Row, list[float]]], command: str, loads: tuple[float, float]) -> str:
    """The results as Markdown."""
    lines = [
        "# Speed",
        "",
        "Written by the command below; each row is measured in several turns.",
        "",
        "| what | median | range | goal |",
        "|---|---|---|---|",
    ]
    for row, values in table:
        low, middle, high = min(values), median(values), max(values)
        lines.append(
            f"| {row.name} | {shown(middle)} {row.unit} | {shown(low)} – {shown(high)} | {row.reached(middle)} |"
        )
    lines += ["", "| derived from the medians | |", "|---|---|"]
    lines += [f"| {name} | {value} |" for name, value in ratios({row.name: median(values) for row, values in table})]
    versions = ", ".join(f"{library} {version(library)}" for library in LIBRARIES)
    return "\n".join(
        [
            *lines,
            "",
            NOTES,
            f"- Command: `{command}`",
            f"- Machine: {processor()}, {os.cpu_count()} cores",
            f"- Load of the machine: {loads[0]:.1f} at the start, {loads[1]:.1f} at the end",
            f"- Versions: Python {platform.python_version()}, {versions}",
            "",
        ]
    )


def processor() -> str:
    """What the system calls its processor."""
    info = Path("/proc/cpuinfo")
    lines = info.read_text(encoding="utf-8").splitlines() if info.exists() else []
    names = [line.split(":", 1)[1].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.processor() or platform.machine()


def main(arguments: list[str] | None = None) -> None:
    """Measure, print the page and write it where asked."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--robot", default="chung2008", help="name of a robot or path of its file")
    parser.add_argument("--quick", action="store_true", help="two short turns instead of seven of a second a row")
    parser.add_argument("--out", type=Path, help="file for the page")
    chosen = parser.parse_args(arguments)
    turns, seconds = (2, 0.05) if chosen.quick else (7, 1.0)
    load = os.getloadavg()[0]
    fresh(FIRST_STEP)  # leaves compiled code on disk
    table: list[tuple[Row, list[float]]] = [(row, []) for row in rows(load_robot(chosen.robot), chosen.robot, seconds)]
    with tqdm(total=turns * len(table), file=sys.stderr) as progress:
        for _ in range(turns):
            for row, values in table:
                progress.set_description(row.name)
                values.append(row.measure())
                progress.update()
    given = sys.argv[1:] if arguments is None else arguments
    text = page(table, shlex.join(["python", "-m", "scripts.measure_speed", *given]), (load, os.getloadavg()[0]))
    print(text)
    if chosen.out is not None:
        chosen.out.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
