"""Impacts that exceed the floor's friction, compared with MuJoCo: python -m scripts.impact_peer --out docs/truth

A robot runs head-on into a smooth wall. Here its wheels keep rolling without slip, whatever the floor must give for it;
MuJoCo's wheels slip where the friction of its floor does not suffice.
"""

import argparse
import math
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import mujoco
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from caster_gym import Model, Robot, load_robot
from caster_gym.export.mjcf import mjcf
from caster_gym.mechanics.ground import CONTACT_TIME, impact_traction
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.report.pages import join_parts, paragraph
from caster_gym.report.provenance import command_line, versions_in_words
from caster_gym.report.tables import markdown_table, write_csv
from scripts.mujoco_peer import spread
from scripts.mujoco_robot import joint_indices

ROBOTS = ("chung2008", "xr4000", "tidybot2")
SPEED = 0.5  # [m/s] head-on
RESTITUTION = 0.5
DRAWS = 12  # steering angles of each robot, drawn at random
STEP = 5e-5  # [s] MuJoCo's: two hundred in a contact
GAP = 1e-3  # [m] to the wall at the start, for the wheels to settle
FRONT = 0.3  # [m] of the bumper before C
RADIUS = 0.02  # [m] of the bumper
HEADS = (
    "robot",
    "draw",
    "ours_Ns",
    "ours_sideways_m_s",
    "impact_traction",
    "mujoco_Ns",
    "mujoco_sideways_m_s",
    "without_floor_Ns",
)


class Impact(NamedTuple):
    """One head-on impact: impulse of the wall [N s], and speed along it afterwards [m/s]."""

    robot: str
    draw: int
    impulse: float  # ours
    sideways: float
    traction: float  # [-] `impact_traction`
    peer_impulse: float  # MuJoCo's
    peer_sideways: float
    loose_impulse: float  # of the mobility without the floor


def steering_of(robot: Robot, draw: int) -> NDArray[np.float64]:
    """Steering angles (N,). [rad]"""
    return np.random.default_rng(draw).uniform(-np.pi, np.pi, robot.caster_count)


def compare(robot: Robot, draw: int) -> Impact:
    """Run a robot into the wall, here and in MuJoCo."""
    steering, model = steering_of(robot, draw), Model(robot)
    before = np.array([SPEED, 0.0, 0.0])
    ours, after = model.collide(steering, before, [FRONT, 0.0], [-1.0, 0.0], RESTITUTION)
    wheels = tuple((float(np.cos(a)), float(np.sin(a))) for a in steering)
    x, y, turn = (after - before).tolist()
    asked = float(impact_traction((x, y, turn), wheels, robot_parameters(robot)))
    theirs, sideways, loose = run_into_wall(robot, steering, robot.floor_friction)
    return Impact(robot.name, draw, float(ours[0]), abs(float(after[1])), asked, theirs, sideways, loose)


def run_into_wall(
    robot: Robot, steering: NDArray[np.float64], friction: float, step: float = STEP
) -> tuple[float, float, float]:
    """MuJoCo's impulse [N s], the speed along the wall afterwards [m/s], and the impulse of a robot without a floor."""
    model, data = before_wall(robot, steering, friction, step)
    (_, y, _), _ = joint_indices(robot, model)
    wall = model.geom("wall").id
    mujoco.mj_forward(model, data)
    loose = (1.0 + RESTITUTION) * SPEED / mobility(model, data)
    impulse, force, touched = 0.0, np.zeros(6), False
    for _ in range(round((GAP / SPEED + 3.0 * CONTACT_TIME) / step)):
        mujoco.mj_step(model, data)
        pressing = [i for i in range(data.ncon) if wall in data.contact.geom[i] and data.contact.efc_address[i] >= 0]
        for i in pressing:
            mujoco.mj_contactForce(model, data, i, force)
            impulse += force[0] * step
        if touched and not pressing:
            break
        touched = touched or bool(pressing)
    return impulse, abs(float(data.qvel[y])), loose


def mobility(model: Any, data: Any) -> float:
    """Speed of the bumper along x per unit of impulse on a robot whose wheels nothing holds. [1/kg]"""
    jacobian, inertia = np.zeros((3, model.nv)), np.zeros((model.nv, model.nv))
    mujoco.mj_jacGeom(model, data, jacobian, None, model.geom("bumper").id)
    mujoco.mj_fullM(model, data, inertia)
    return float(jacobian[0] @ np.linalg.solve(inertia, jacobian[0]))


def damped_spring() -> tuple[float, float]:
    """Damping ratio and rate [rad/s] of a spring that cannot pull, for our restitution and contact time.

    Pressed at a speed, it is pressed by no force any more after the phase π − arctan 2ζ√(1 − ζ²)/(1 − 2ζ²).
    """

    def phase(damping: float) -> float:
        return math.pi - math.atan2(2.0 * damping * math.sqrt(1.0 - damping**2), 1.0 - 2.0 * damping**2)

    def excess(damping: float) -> float:
        return math.exp(-damping / math.sqrt(1.0 - damping**2) * phase(damping)) - RESTITUTION

    damping = float(brentq(excess, 1e-3, 0.9))
    return damping, phase(damping) / (CONTACT_TIME * math.sqrt(1.0 - damping**2))


def before_wall(robot: Robot, steering: NDArray[np.float64], friction: float, step: float) -> tuple[Any, Any]:
    """MuJoCo's model and data of a robot that rolls towards a wall, which springs back with our restitution."""
    damping, rate = damped_spring()
    spring: dict[str, Any] = {
        "priority": 1,
        "condim": 1,
        "solref": [1.0 / (damping * rate), damping],
        "solimp": [0.9999, 0.9999, 1e-3, 0.5, 2.0],
    }
    spec = mujoco.MjSpec.from_string(mjcf(robot, step, friction))
    height = max(caster.radius for caster in robot.casters)
    bumper = {"name": "bumper", "type": mujoco.mjtGeom.mjGEOM_SPHERE, "size": [RADIUS, 0.0, 0.0], "mass": 0.0}
    spec.body("platform").add_geom(pos=[FRONT - RADIUS, 0.0, height], contype=4, conaffinity=0, **bumper)
    wall = {"name": "wall", "type": mujoco.mjtGeom.mjGEOM_PLANE, "size": [1.0, 1.0, 0.1]}
    facing = [math.sqrt(0.5), 0.0, -math.sqrt(0.5), 0.0]  # the plane's normal, z, turned to −x
    spec.worldbody.add_geom(pos=[FRONT + GAP, 0.0, height], quat=facing, contype=0, conaffinity=4, **wall, **spring)
    model: Any = spec.compile()
    data: Any = mujoco.MjData(model)
    (x, _, _), joints = joint_indices(robot, model)
    _, rolling, turning = Model(robot).rates(steering, [SPEED, 0.0, 0.0])
    data.qpos[joints[1::2]] = steering
    data.qvel[x] = SPEED
    data.qvel[joints] = np.stack((rolling, turning), axis=-1).ravel()
    return model, data


def write_table(file: Path, impacts: list[Impact]) -> None:
    """A line for each impact."""
    write_csv(file, HEADS, ([one.robot, one.draw, *(f"{number:.4g}" for number in one[2:])] for one in impacts))


def impact_table(impacts: list[Impact]) -> str:
    """A row for each robot, as Markdown: medians, least and greatest."""
    heads = (
        "robot",
        "our impulse [N s]",
        "MuJoCo [N s]",
        "without a floor [N s]",
        "our sideways speed [m/s]",
        "MuJoCo [m/s]",
        "`impact_traction`",
    )
    rows = []
    for name in dict.fromkeys(one.robot for one in impacts):
        mine = [one for one in impacts if one.robot == name]
        columns = [
            [one.impulse for one in mine],
            [one.peer_impulse for one in mine],
            [one.loose_impulse for one in mine],
            [one.sideways for one in mine],
            [one.peer_sideways for one in mine],
            [one.traction for one in mine],
        ]
        rows.append((name, *map(spread, columns)))
    return markdown_table(heads, rows)


def page(impacts: list[Impact], command: str) -> str:
    """The comparison as Markdown."""
    draws = max(Counter(one.robot for one in impacts).values())
    parts = [
        "# Impacts that exceed the floor's friction",
        paragraph(
            f"""This page compares impacts with MuJoCo's. In the model, wheels keep rolling without slip during an
            impact: the robot's inertia is M(δ), which includes wheels and rotors, and the floor supplies whatever
            impulse that takes. A real floor supplies no more than its friction allows in the {1e3 * CONTACT_TIME:g} ms
            of a contact. If that is not enough, the wheels slip, and the wall meets a lighter robot. Below, each robot
            runs head-on into a smooth wall at {SPEED:g} m/s with a restitution of {RESTITUTION:g}, {draws} times with
            different steering angles. In MuJoCo the wall is a spring with the same restitution and about the same
            contact time, and the floor has the friction given in the robot's file."""
        ),
        impact_table(impacts),
        "Medians, with minimum and maximum in brackets; [all impacts](impacts.csv).",
        paragraph(
            """`impact_traction` is the impulse that the impact needs from the floor, as a share of what the floor can
            supply; `info` contains it after every step. Where it is about 1 or less, both models agree. Where it is far
            above 1, MuJoCo's impulse is nearly that of a robot without a floor, which the table shows, too; it follows
            from the mobility of MuJoCo's bodies. On a floor of friction 1000, MuJoCo's impulses equal ours
            (`tests/test_impact_peer.py`). On a [floor of finite friction](../floor.md), wheels slip in our impacts,
            too."""
        ),
        f"- Command: `{command}`\n- MuJoCo's time step: {1e3 * STEP:g} ms\n"
        f"- Versions: {versions_in_words('caster_gym', 'mujoco', 'numpy')}",
    ]
    return join_parts(parts)


def main(arguments: list[str] | None = None) -> None:
    """Compare, and write a page and a table into a folder."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--robots", nargs="+", default=list(ROBOTS), help="names or files")
    parser.add_argument("--draws", type=int, default=DRAWS, help="steering angles of each robot")
    parser.add_argument("--out", type=Path, default=Path("docs/truth"), metavar="DIR")
    chosen = parser.parse_args(arguments)
    impacts = [compare(load_robot(name), draw) for name in chosen.robots for draw in range(chosen.draws)]
    chosen.out.mkdir(parents=True, exist_ok=True)
    write_table(chosen.out / "impacts.csv", impacts)
    command = command_line("scripts.impact_peer", arguments)
    (chosen.out / "impacts.md").write_text(page(impacts, command), encoding="utf-8")


if __name__ == "__main__":
    main()
