"""How many cores this process may use, which in containers and under schedulers are fewer than the machine has."""

import math
import os
import warnings
from pathlib import Path, PurePosixPath

_ROOT = Path("/")


def usable_cores(root: Path = _ROOT) -> int:
    """Cores of this process: its affinity, and the processor time that its control group is allowed.

    root: of the file system that holds proc and sys.
    """
    return max(1, min(_affinity(), math.ceil(min(_allowed_cores(root), 1e6))))


def default_threads(root: Path = _ROOT) -> int:
    """Threads for compiled code: NUMBA_NUM_THREADS, else the usable cores, of which OMP_NUM_THREADS may leave some.

    A list such as OMP_NUM_THREADS=4,2 counts with its first number: as in OpenMP, later ones are for nested loops.
    """
    cores = usable_cores(root)
    if (numba := _number("NUMBA_NUM_THREADS", cores)) is not None:
        return numba
    return min(cores, _number("OMP_NUM_THREADS", cores) or cores)


def learning_threads() -> int:
    """Threads for learning and evaluating: OMP_NUM_THREADS, else one, see `caster_gym.engines.tensor.threads`."""
    return _number("OMP_NUM_THREADS", 1) or 1


def _affinity() -> int:
    if hasattr(os, "process_cpu_count"):  # Python 3.13, which knows PYTHON_CPU_COUNT too
        return os.process_cpu_count() or 1
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _number(name: str, otherwise: int) -> int | None:
    """Value of a variable of the environment, if it is a number of threads; else a warning says what is done."""
    given = os.environ.get(name, "")
    first = given.split(",")[0].strip()
    if first.isdecimal() and int(first) > 0:
        return int(first)
    if given.strip():
        warnings.warn(
            f"{name} must be a number of threads such as 4, got {given!r}; it is ignored, {otherwise} may be used",
            RuntimeWarning,
            stacklevel=2,
        )
    return None


def _allowed_cores(root: Path) -> float:
    """Least quota of processor time per time, of the control group and of all that it is part of; ∞ without any."""
    try:
        lines = (root / "proc/self/cgroup").read_text().splitlines()
    except OSError:  # not Linux
        return math.inf
    mounts = root / "sys/fs/cgroup"
    least = math.inf
    for line in lines:
        _, controllers, path = line.split(":", 2)
        group = PurePosixPath(path.lstrip("/"))
        for part in (group, *group.parents):  # a container's own group may show as the root
            if not controllers:
                least = min(least, _quota(mounts / part / "cpu.max"))
            elif "cpu" in controllers.split(","):
                for mount in (controllers, "cpu"):
                    folder = mounts / mount / part
                    least = min(least, _quota(folder / "cpu.cfs_quota_us", folder / "cpu.cfs_period_us"))
    return least


def _quota(*files: Path) -> float:
    """Processor time over time, which two numbers say, in one file or in two."""
    try:
        time, period = (float(word) for file in files for word in file.read_text().split())
    except (OSError, ValueError):  # not there, or "max" for no limit
        return math.inf
    return time / period if time > 0.0 and period > 0.0 else math.inf
