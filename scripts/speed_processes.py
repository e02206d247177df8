"""Measurements that need a process of their own: start-up, compiling from scratch, memory."""

import os
import subprocess
import sys
import tempfile
from functools import partial
from pathlib import Path

from scripts.speed_robots import TRACK
from scripts.speed_timing import Row, at_most

STATUS = Path("/proc/self/statm")  # where Linux tells how much memory a process has
BIG = 65536  # robots whose memory is measured
COMPILING = "caster_gym: compiling for 3 casters"  # begins the message that must not be missing

IMPORT = "import time; t = time.perf_counter(); import caster_gym; print(time.perf_counter() - t)"
FIRST_STEP = f"""
import time
t = time.perf_counter()
import gymnasium as gym
environment = gym.make({TRACK!r}, robot=ROBOT)
environment.reset(seed=0)
environment.step(environment.action_space.sample())
print(time.perf_counter() - t)
"""
_BATCHES = f"""
import os, tracemalloc
from pathlib import Path
import gymnasium as gym
import numpy as np
from caster_gym import load_robot
from caster_gym.engines.native.fleet import Fleet
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.registry import find_task

def environment(count):
    batch = gym.make_vec({TRACK!r}, num_envs=count, robot=ROBOT)
    batch.reset(seed=0)
    for _ in range(3):
        last = batch.step(np.zeros(batch.action_space.shape, dtype=np.float32))
    return batch, last

def engine(count):
    batch, _ = build_engine(find_task("track"), ROBOT, None, None, None, dict(), count)
    batch.restart(np.arange(count))
    for _ in range(3):
        last = batch.step(np.zeros((count, len(batch.robot.driven)), dtype=np.float32))
    return batch, last

def fleet(count):
    robot = load_robot(ROBOT)
    batch = Fleet(robot, count)
    batch.step(np.zeros((count, len(robot.joints))), 0.005)
    return batch

def resident():
    return int(Path({str(STATUS)!r}).read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE")

warm = WHAT(64)  # loads the compiled code
"""
RESIDENT = f"{_BATCHES}\nbefore = resident()\nkept = WHAT({BIG})\nprint((resident() - before) / {BIG})"
ALLOCATED = f"{_BATCHES}\ntracemalloc.start()\nkept = WHAT({BIG})\nprint(tracemalloc.get_traced_memory()[0] / {BIG})"


def fresh(code: str, robot: str, what: str = "None", cache: Path | None = None, message: str = "") -> float:
    """The number that a fresh Python prints; with a cache folder for compiled code, and a message that must come."""
    environment = {**os.environ, **({} if cache is None else {"NUMBA_CACHE_DIR": str(cache)})}
    done = subprocess.run(
        [sys.executable, "-c", f"ROBOT = {robot!r}\n{code.replace('WHAT', what)}"],
        capture_output=True,
        text=True,
        check=False,
        env=environment,
    )
    if done.returncode != 0:
        raise RuntimeError(f"a fresh process failed:\n{done.stderr}")
    if message not in done.stderr:
        raise RuntimeError(f"a fresh process should have said {message!r}, but it said {done.stderr!r}")
    return float(done.stdout)


def cold_start(robot: str) -> float:
    """Seconds from the first import to the first step where nothing is compiled yet."""
    with tempfile.TemporaryDirectory() as folder:
        return fresh(FIRST_STEP, robot, cache=Path(folder), message=COMPILING)


def start_rows(robot: str, cold: bool) -> list[Row]:
    """Start-up; compiling from nothing only if asked for, and once."""
    again = "fresh process until its first step, compiled before"
    rows = [
        Row("import", "`import caster_gym`", "s", lambda: fresh(IMPORT, robot), at_most(0.4), 5),
        Row("first", again, "s", lambda: fresh(FIRST_STEP, robot), at_most(1.0), 5),
    ]
    if cold:
        name = "fresh process until its first step, nothing compiled yet"
        rows.append(Row("cold", name, "s", lambda: cold_start(robot), at_most(20.0), 1))
    return rows


def memory_rows(robot: str) -> list[Row]:
    """Memory per robot of a big batch."""
    kinds = (
        ("environment", "environment", at_most(2000.0)),
        ("engine", "engine alone", at_most(2000.0)),
        ("fleet", "bare equations", None),
    )
    ways = (("resident", "growth of the process", RESIDENT), ("allocated", "Python's and NumPy's own count", ALLOCATED))
    return [
        Row(
            f"{way}_{kind}",
            f"{title}, batch of {BIG:,}, {how}",
            "bytes per robot",
            partial(fresh, code, robot, kind),
            goal,
            1,
        )
        for kind, title, goal in kinds
        for way, how, code in ways
        if way == "allocated" or STATUS.exists()
    ]
