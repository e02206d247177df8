"""Measurements of our robots: the bare equations, whole environments in batches, and one robot alone."""

from collections.abc import Callable, Sequence
from typing import Any

import gymnasium as gym
import numpy as np
from gymnasium.vector import AutoresetMode

from caster_gym import Robot
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.arena import Arena, distances
from caster_gym.arena.arena import Pillar
from caster_gym.arena.packing import surroundings
from caster_gym.engines.native.derivatives import PeriodDerivatives
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.native.threads import set_threads
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from scripts.speed_timing import RATE, Row, Work, at_least, at_most, rate

TRACK, FOLLOW = "caster_gym:CasterTrack-v0", "caster_gym:CasterFollow-v0"
COURSES = {"shape": "random_paths", "count": 16, "reversing": 0.0, "min_radius": 0.15}
WIDE = 20.0  # [m] corridor that random actions do not leave, so that episodes end by time
CIRCLES = tuple({"shape": "circle", "radius": 0.5, "duration": 6.0 + 0.46 * k} for k in range(16))  # end at any time
SCATTERING = 400  # control periods after which robots on these circles end their episodes one by one
ACTION = 0.1  # [-] random actions and torques, as shares of the greatest torques
SPEED = 0.5  # [m/s, rad/s] standard deviation of the random motions at the start
RK4_STEP = 0.005  # [s] the environments' own
SUBSTEPS = 4  # of it in a control period
COARSE_STEP = 0.01  # [s] the longest that chung2008 allows
COARSE_SUBSTEPS = 2
PERIOD = SUBSTEPS * RK4_STEP  # [s]
EXCERPT = 400  # RK4 steps of a motion
BANK = 64  # actions drawn beforehand
BANKED = 2**18  # robots in them at most, so that the greatest batches do not fill the memory
JACOBIANS = 1024  # robots of a batch
SMALL_BATCH = 16  # as many environments as are usual for SB3
HALF = 1.8  # [m] half of the square in which robots start
ROOM = Arena(
    room=((-2.0, -2.0), (2.0, 2.0)),
    pillars=tuple(Pillar(centre=(x, y), radius=0.15) for x in (-1.0, 1.0) for y in (-1.0, 1.0)),
)


def limits(robot: Robot) -> Any:
    """Greatest torques of all joints. [N m]"""
    return np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in robot.casters]).ravel()


def bare_equations(
    robot: Robot, count: int, arena: Arena | None = None, half: float = HALF, steps: int = EXCERPT, calls: int = 1
) -> Work:
    """RK4 steps of a batch under random torques, from random places and motions in a square, `calls` times `steps`."""
    fleet = Fleet(robot, count, around=None if arena is None else surroundings(robot, arena))
    rng = np.random.default_rng(0)
    poses = rng.uniform(-half, half, (20 * count, 3))
    if arena is not None:
        poses = poses[(distances(arena, robot, poses)[0] > 0.0).all(axis=1)]
    start = fleet.state
    start[:, :2] = poses[:count, :2]
    start[:, 2], start[:, 3] = np.cos(poses[:count, 2]), np.sin(poses[:count, 2])
    start[:, 4:7] = SPEED * rng.normal(size=(count, 3))
    torques = ACTION * rng.uniform(-1.0, 1.0, (count, len(robot.joints))) * limits(robot)

    def prepare() -> None:
        fleet.state = start

    def call() -> int:
        for _ in range(calls):
            fleet.step(torques, RK4_STEP, steps)
        return count * steps * calls

    return Work(call, prepare)


def derivatives(robot: Robot, count: int, parameters: Sequence[str] = ()) -> Work:
    """One RK4 step of a batch at a call, with its derivatives by states, torques and parameters."""
    of_a_step = PeriodDerivatives(robot, RK4_STEP, by=parameters)
    rng = np.random.default_rng(0)
    states = Fleet(robot, count).state
    states[:, 4:7] = SPEED * rng.normal(size=(count, 3))
    torques = ACTION * rng.uniform(-1.0, 1.0, (count, len(robot.joints))) * limits(robot)

    def call() -> int:
        for _ in range(BANK):
            of_a_step.at(states, torques)
        return count * BANK

    return Work(call)


def cycled(step: Callable[[Any], object], actions: Any, robots: int) -> Work:
    """A step of so many robots at every call, with one of the actions after the other."""
    made = 0

    def call() -> int:
        nonlocal made
        step(actions[made % len(actions)])
        made += 1
        return robots

    return Work(call)


def drawn_actions(space: Any) -> Any:
    """Random actions of a whole batch, a few times (K, robots, driven joints)."""
    times = max(2, min(BANK, BANKED // space.shape[0]))
    return np.random.default_rng(0).uniform(-ACTION, ACTION, (times, *space.shape)).astype(np.float32)


def batch(robot: str, count: int, name: str = TRACK, path: Any = CIRCLES, **options: Any) -> Work:
    """The native batch, with observations, rewards, infos and resets."""
    environment = gym.make_vec(name, num_envs=count, robot=robot, path=path, corridor=WIDE, **options)
    environment.reset(seed=0)
    work = cycled(environment.step, drawn_actions(environment.action_space), count)
    scatter(work)
    return work


def scatter(work: Work) -> None:
    """Step until episodes end at different times, as they do in training."""
    for _ in range(SCATTERING):
        work.call()


def engine(robot: str, count: int) -> Work:
    """The engine beneath a batch: actions in, observations, rewards and reports out."""
    environment: Any = gym.make_vec(TRACK, num_envs=count, robot=robot, corridor=WIDE)
    environment.reset(seed=0)
    return cycled(environment.engine.step, drawn_actions(environment.action_space), count)


def for_sb3(robot: str, count: int) -> Work:
    """The native batch as SB3 sees it."""
    native = CasterTrackVectorEnv(count, robot, autoreset_mode=AutoresetMode.SAME_STEP, corridor=WIDE)
    environment = SB3VecEnv(native)
    environment.reset()
    return cycled(environment.step, drawn_actions(native.action_space), count)


def one(step: Callable[[Any], Any], reset: Callable[[], object], actions: Any) -> Work:
    """Steps of one environment, with its resets."""

    def call() -> int:
        for action in actions:
            _, _, terminated, truncated, _ = step(action)
            if terminated or truncated:
                reset()
        return len(actions)

    return Work(call)


def single(robot: str, wrapped: bool) -> Work:
    """One environment from `gym.make`, with Gymnasium's wrappers or beneath them."""
    made: Any = gym.make(TRACK, robot=robot, corridor=WIDE)
    made.reset(seed=0)
    shape = (BANK, *made.action_space.shape)
    actions = list(np.random.default_rng(0).uniform(-ACTION, ACTION, shape).astype(np.float32))
    environment = made if wrapped else made.unwrapped
    return one(environment.step, environment.reset, actions)


def single_engine(robot: str) -> Work:
    """Control periods of one robot by its engine."""
    environment: Any = gym.make(TRACK, robot=robot, corridor=WIDE).unwrapped
    environment.reset(seed=0)
    shape = (BANK, *environment.action_space.shape)
    actions = np.random.default_rng(0).uniform(-ACTION, ACTION, shape).astype(np.float32)

    def call() -> int:
        for action in actions:
            environment.engine.step_alone(action)
        return BANK

    return Work(call)


def on(threads: int, work: Work, seconds: float) -> Callable[[], float]:
    """Steps per second with so many threads."""

    def measure() -> float:
        set_threads(threads)
        return rate(work, seconds)

    return measure


def each(work: Work, seconds: float) -> Callable[[], float]:
    """Microseconds of a step on one thread."""
    steps_per_second = on(1, work, seconds)
    return lambda: 1e6 / steps_per_second()


def bare_rows(robot: Robot, cores: int, seconds: float) -> list[Row]:
    """The equations alone."""
    equations = bare_equations(robot, 4096)
    by_period = bare_equations(robot, 4096, steps=SUBSTEPS, calls=EXCERPT // SUBSTEPS)
    return [
        Row("bare", "bare RK4, batch of 4,096, 1 core", RATE, on(1, equations, seconds)),
        Row("bare_cores", f"bare RK4, batch of 4,096, {cores} cores", RATE, on(cores, equations, seconds)),
        Row(
            "bare_periods",
            f"the same, new torques every {SUBSTEPS} steps, {cores} cores",
            RATE,
            on(cores, by_period, seconds),
        ),
        Row(
            "bare_among",
            "bare RK4, batch of 4,096 among 8 obstacles, 1 core",
            RATE,
            on(1, bare_equations(robot, 4096, ROOM), seconds),
        ),
        Row("bare_one", "bare RK4, one robot, 1 core", RATE, on(1, bare_equations(robot, 1), seconds)),
        Row(
            "bare_call",
            "the same, one step at a call",
            "µs",
            each(bare_equations(robot, 1, steps=1, calls=BANK), seconds),
        ),
        Row(
            "jacobian",
            "an RK4 step and its derivatives by state and torques, one robot, 1 core",
            "µs",
            each(derivatives(robot, 1), seconds),
            at_most(8.0),
        ),
        Row(
            "jacobian_batch",
            f"the same, a robot of a batch of {JACOBIANS:,}, 1 core",
            "µs",
            each(derivatives(robot, JACOBIANS), seconds),
        ),
        Row(
            "jacobian_parameters",
            "the same, also by five parameters",
            "µs",
            each(derivatives(robot, JACOBIANS, ("mass", "com_x", "com_y", "inertia", "radius")), seconds),
        ),
    ]


def environment_rows(robot: str, cores: int, seconds: float) -> list[Row]:
    """Whole environments."""
    many = batch(robot, 4096)
    fewer = batch(robot, 4096, substeps=COARSE_SUBSTEPS)
    among = batch(robot, 1024, FOLLOW, path=COURSES, arena={"beside": {}})
    alone = batch(robot, 1024, FOLLOW, path=COURSES)
    thousand = batch(robot, 1024)
    return [
        Row("env", "environment, batch of 4,096, 1 core", RATE, on(1, many, seconds)),
        Row("env_cores", f"environment, batch of 4,096, {cores} cores", RATE, on(cores, many, seconds), at_least(2e6)),
        Row(
            "env_fewer",
            f"environment, batch of 4,096, {COARSE_SUBSTEPS} substeps of {1e3 * COARSE_STEP:g} ms, {cores} cores",
            RATE,
            on(cores, fewer, seconds),
            at_least(4e6),
        ),
        Row(
            "engine_cores",
            f"engine alone, batch of 4,096, {cores} cores",
            RATE,
            on(cores, engine(robot, 4096), seconds),
        ),
        Row("env_1024", "environment, batch of 1,024, 1 core", RATE, on(1, thousand, seconds)),
        Row("env_1024_cores", f"environment, batch of 1,024, {cores} cores", RATE, on(cores, thousand, seconds)),
        Row(
            "env_small", f"environment, batch of {SMALL_BATCH}, 1 core", RATE, on(1, batch(robot, SMALL_BATCH), seconds)
        ),
        Row(
            "sb3_small",
            f"environment, batch of {SMALL_BATCH} as SB3's VecEnv, 1 core",
            RATE,
            on(1, for_sb3(robot, SMALL_BATCH), seconds),
        ),
        Row("follow", "following, batch of 1,024, 1 core", RATE, on(1, alone, seconds)),
        Row("follow_among", "following among 6 obstacles, batch of 1,024, 1 core", RATE, on(1, among, seconds)),
    ]


def single_rows(robot: str, seconds: float) -> list[Row]:
    """One robot alone."""
    return [
        Row("one", "one environment, `gym.make`", "µs", each(single(robot, True), seconds)),
        Row(
            "one_beneath",
            "one environment, without Gymnasium's wrappers",
            "µs",
            each(single(robot, False), seconds),
            at_most(5.0),
        ),
        Row("one_engine", "one environment, engine alone", "µs", each(single_engine(robot), seconds)),
    ]
