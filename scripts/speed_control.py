"""Rows of the page of speed: model-based control, the time that one robot's action takes."""

import gymnasium as gym
import numpy as np

from caster_gym import ComputedTorque, ObservationLayout, PredictiveControl, Robot
from caster_gym.agents.control.protocol import Agent
from scripts.speed_robots import each
from scripts.speed_timing import Row, Work, at_most

PERIOD = 0.02  # [s]
PREVIEW = (0.1, 0.2, 0.4)  # [s]
TOGETHER = 64


def acting(agent: Agent, robot: Robot, count: int) -> Work:
    """Actions of so many robots for an observation after half a second, when plans are those of a robot under way."""
    env = gym.make_vec("caster_gym:CasterTrack-v0", count, robot=robot, path="lemniscate")
    seen, _ = env.reset(seed=0)
    getattr(agent, "reset", lambda mask: None)(np.ones(count, dtype=np.bool_))
    for _ in range(25):
        seen, *_ = env.step(agent.act(seen))

    def call() -> int:
        agent.act(seen)
        return count

    return Work(call)


def control_rows(robot: Robot, seconds: float) -> list[Row]:
    """Computed torque and predictive control, for one robot and for a batch."""
    layout = ObservationLayout(robot, preview=PREVIEW)
    rows = [
        Row(
            f"control_{count}",
            f"computed torque, {told}",
            "µs",
            each(acting(ComputedTorque(layout, 30.0, PERIOD), robot, count), seconds),
        )
        for count, told in ((1, "one robot"), (TOGETHER, f"a robot of {TOGETHER}"))
    ]
    for horizon, count, most in ((10, 1, 500.0), (20, 1, 800.0), (10, TOGETHER, 200.0), (20, TOGETHER, None)):
        told = "one robot" if count == 1 else f"a robot of {count}"
        plan = acting(PredictiveControl(layout, PERIOD, horizon), robot, count)
        limit = () if most is None else (at_most(most),)
        rows.append(
            Row(
                f"predictive_{horizon}_{count}",
                f"predictive control, {horizon} periods, {told}",
                "µs",
                each(plan, seconds),
                *limit,
            )
        )
    return rows
