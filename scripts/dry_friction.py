"""Creep of a robot under a load that dry friction should hold, here and in MuJoCo.

MuJoCo's dry friction is a constraint that holds a joint; ours passes smoothly through zero within `coulomb_speed`, so
that a joint below its breakaway turns slowly. All casters trail, and each rolling joint is driven by a share of its
`coulomb` torque.
"""

import math
from typing import NamedTuple

import mujoco
import numpy as np

from caster_gym import Model, Robot
from caster_gym.engines.time_step import longest_time_step, substeps_for
from caster_gym.report.tables import markdown_table
from scripts.mujoco_robot import joint_indices, placed

LOAD = 0.5  # [-] of the torque at which the joints break away
SECONDS = 1.0
PERIOD = 0.02  # [s] control period whose time steps are counted
SPEEDS = (0.1, 0.02, 0.005)  # [rad/s] `coulomb_speed`
PEER_STEP = 2e-3  # [s] MuJoCo's


class Creep(NamedTuple):
    """What a robot does under a load below its breakaway."""

    robot: str
    coulomb: float  # [N m] of a rolling joint
    ways: tuple[float, ...]  # [m] in a second, one for each of SPEEDS
    law: tuple[float, ...]  # [m] the same by the law of friction alone
    substeps: tuple[int, ...]  # of a control period, fewest that follow it
    peer: float  # [m] MuJoCo's


def creep(robot: Robot) -> Creep:
    """Load a robot at rest, here with each smoothing, and in MuJoCo."""
    state = np.zeros(6 + robot.caster_count)
    torque = np.array([share for caster in robot.casters for share in (LOAD * caster.roll.coulomb, 0.0)])
    ways, substeps = [], []
    for speed in SPEEDS:
        sharper = robot.model_copy(update={"coulomb_speed": speed})
        count = substeps_for(PERIOD, longest_time_step(sharper))
        end = Model(sharper).simulate(state, torque, PERIOD / count, round(SECONDS / PERIOD) * count)[-1]
        ways.append(float(np.hypot(*end[:2])))
        substeps.append(count)
    model, data = placed(robot, state, torque, PEER_STEP)
    (x, y, _), _ = joint_indices(robot, model)
    before = np.array(data.qpos[[x, y]])
    mujoco.mj_step(model, data, round(SECONDS / PEER_STEP))
    radius, coulomb = robot.casters[0].radius, robot.casters[0].roll.coulomb
    law = tuple(SECONDS * radius * speed * LOAD / math.sqrt(1.0 - LOAD**2) for speed in SPEEDS)
    return Creep(robot.name, coulomb, tuple(ways), law, tuple(substeps), float(np.hypot(*(data.qpos[[x, y]] - before))))


def creep_table(creeps: list[Creep]) -> str:
    """A row for each robot, as Markdown."""
    heads = ["robot", "`coulomb` [N m]"]
    heads += [f"creep at {speed:g} rad/s [mm] (substeps)" for speed in SPEEDS]
    heads.append(f"MuJoCo at {1e3 * PEER_STEP:g} ms [mm]")
    rows = []
    for one in creeps:
        ours = [f"{1e3 * way:.2g} ({count})" for way, count in zip(one.ways, one.substeps, strict=True)]
        rows.append((one.robot, f"{one.coulomb:g}", *ours, f"{1e3 * one.peer:.2g}"))
    return markdown_table(heads, rows)
