"""Which workers there are, by name."""

from typing import Literal

from caster_gym.agents.workers.calls import Workers
from caster_gym.agents.workers.local import LocalWorkers
from caster_gym.engines.native.cores import usable_cores


def open_workers(kind: Literal["local", "ray"], threads: int, most: int) -> Workers:
    """Workers for calls with so many threads each, of which at most so many run at a time."""
    if kind == "ray":
        from caster_gym.agents.workers.on_ray import RayWorkers

        return RayWorkers(threads, most)
    return LocalWorkers(max(1, min(most, usable_cores() // threads)))
