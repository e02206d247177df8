"""What the model leaves out, and how large each effect is: python -m scripts.model_limits --out docs/truth.md

Every number follows from the equations themselves: how much of the floor's friction is asked for, how far from lifting
the wheels are, how far motions part when a term is left out. How well the equations hold where their assumptions do is
measured against MuJoCo, on pages of their own.
"""

import argparse
import math
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from caster_gym import Model, Robot, load_robot
from caster_gym.arrays import Array
from caster_gym.mechanics.ground import CONTACT_TIME, impact_traction, tilt, wheel_loads
from caster_gym.mechanics.parameters import RobotParameters, robot_parameters
from caster_gym.report.provenance import versions_in_words
from caster_gym.report.tables import markdown_table

ROBOTS = ("chung2008", "tidybot2", "xr4000")
DIRECTIONS = 64  # in which a robot drives off
DRAWS = 2000  # of postures and commands
RESTITUTION = 0.5  # of the impacts
LAG = 0.02  # [s] of motors
STEP, FINE = 5e-3, 3.125e-4  # [s] time steps whose ends are compared
SECONDS = 4.0  # that robots are driven for


class Row(NamedTuple):
    """What is left out, its size on each robot, and what takes it in."""

    what: str
    sizes: tuple[str, ...]
    option: str


def rows(robots: Sequence[Robot]) -> list[Row]:
    """The table."""

    def row(what: str, size: str, option: str, *values: tuple[float, ...]) -> Row:
        return Row(what, tuple(size.format(*numbers) for numbers in values), option)

    return [
        row(
            "wheels that slip: use of friction at the maximum torque of all rolling motors, forwards or braking",
            "{:.2g}",
            '`floor`; `info["traction_use"]`',
            *(((at_full_torque(robot)[0]),) for robot in robots),
        ),
        row(
            "the same with maximum torques of random signs on all motors: share of draws in which a wheel would slip "
            "(would lift)",
            "{:.0%} ({:.0%})",
            "as above",
            *(random_shares(robot) for robot in robots),
        ),
        row(
            f"impacts that exceed the floor's friction: speed above which every second one does [m/s], in contacts of "
            f"{1e3 * CONTACT_TIME:g} ms",
            "{:.2g}",
            '`floor`; `info["impact_traction"]`',
            *((impact_speed(robot),) for robot in robots),
        ),
        row(
            "loads that shift: use of friction at full torque with the loads at rest → with the shifted loads",
            "{1:.2g} → {0:.2g}",
            "`platform.height`, in the robots' files",
            *(at_full_torque(robot) for robot in robots),
        ),
        row(
            "wheels that lift: smallest acceleration [m/s²] that lifts one",
            "{:.2g}",
            '`info["wheels_lifted"]`',
            *((lifting_acceleration(robot),) for robot in robots),
        ),
        row(
            "joints that stick: creep at half the breakaway torque [mm/s]",
            "{:.2g}",
            "a smaller `coulomb_speed`",
            *((creep(robot),) for robot in robots),
        ),
        row(
            f"motors that lag: distance lost in the first second at full torque with a lag of {1e3 * LAG:g} ms [mm]",
            "{:.2g}",
            "`motor_lag`, `action_delay`",
            *((way_lost(robot),) for robot in robots),
        ),
        row(
            "rotors that couple both joints of a caster: error of accelerations without it, median (95 % quantile)",
            "{:.2g} % ({:.2g} %)",
            "`rotor`, in the robots' files",
            *(off_without(robot, "cross_armature") for robot in robots),
        ),
        row(
            "(D1), which chung2008 leaves out: error of accelerations without it, median (95 % quantile)",
            "{:.2g} % ({:.2g} %)",
            'always; `dynamics="chung2008"` leaves it out',
            *(off_without(robot, "off_axis") for robot in robots),
        ),
        row(
            f"time steps of {1e3 * STEP:g} ms: error of the position after {SECONDS:g} s, median of 20 drives [µm]",
            "{:.2g}",
            "more `substeps`",
            *((step_error(robot),) for robot in robots),
        ),
    ]


def full_torque(robot: Robot) -> tuple[Array, Array]:
    """Postures with trailing casters (2 DIRECTIONS, N), and greatest torques of all rolling motors, either way."""
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    torque = [c.roll.max_torque * gear for c in robot.casters for gear in c.gear[0]]
    both = np.repeat((1.0, -1.0), DIRECTIONS)[:, None] * torque
    return np.tile(angles[:, None], (2, robot.caster_count)), both


def at_full_torque(robot: Robot) -> tuple[float, float]:
    """Greatest use of friction as the robot drives off or brakes: with loads that shift, and with those at rest."""
    model, (steering, torque) = Model(robot), full_torque(robot)
    still = np.zeros((len(steering), 3))
    force = np.linalg.norm(model.ground_forces(steering, still, torque), axis=-1)
    shifted, at_rest = model.wheel_loads(steering, still, torque), model.wheel_loads(steering)
    least = 1e-3 * at_rest.mean()
    return tuple(  # type: ignore[return-value]  # two of them
        float((force / (robot.floor_friction * np.maximum(loads, least))).max()) for loads in (shifted, at_rest)
    )


def random_shares(robot: Robot) -> tuple[float, float]:
    """Shares of full commands of random signs at rest that make a wheel slip, and that lift one."""
    rng, model = np.random.default_rng(1), Model(robot)
    steering = rng.uniform(-np.pi, np.pi, (DRAWS, robot.caster_count))
    signs = rng.choice((-1.0, 1.0), (DRAWS, robot.caster_count, 2))
    most = np.array([(c.roll.max_torque, c.steer.max_torque) for c in robot.casters])
    torque = np.einsum("nij,dni->dnj", [c.gear for c in robot.casters], signs * most).reshape(DRAWS, -1)
    force = np.linalg.norm(model.ground_forces(steering, np.zeros((DRAWS, 3)), torque), axis=-1)
    loads = model.wheel_loads(steering, None, torque)
    slips = (force > robot.floor_friction * loads).any(axis=-1)
    return float(slips.mean()), float((loads <= 0.0).any(axis=-1).mean())


def impact_speed(robot: Robot) -> float:
    """Speed [m/s] above which every second impact asks for more than the floor's friction."""
    rng, model = np.random.default_rng(2), Model(robot)
    steering = rng.uniform(-np.pi, np.pi, (DRAWS, robot.caster_count))
    angle = rng.uniform(-np.pi, np.pi, DRAWS)
    normal = np.stack((np.cos(angle), np.sin(angle)), axis=-1)
    twist = np.concatenate((-normal, np.zeros((DRAWS, 1))), axis=1)  # head-on at 1 m/s; all is in proportion to it
    point = -robot.platform.footprint.outline.reach * normal
    _, after = model.collide(steering, twist, point, normal, RESTITUTION)
    directions = tuple((np.cos(one), np.sin(one)) for one in steering.T)
    use = impact_traction(tuple((after - twist).T), directions, robot_parameters(robot))
    return float(1.0 / np.median(use))


def lifting_acceleration(robot: Robot) -> float:
    """Least acceleration of the platform [m/s²], forwards or braking, at which a wheel lifts while casters trail."""
    parameters = robot_parameters(robot)
    angles = 2.0 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
    directions = ((np.cos(angles), np.sin(angles)),) * robot.caster_count
    at_rest, pushed = (loads_at(a, angles, directions, parameters) for a in (0.0, 1.0))
    return float((at_rest / np.maximum(np.abs(at_rest - pushed), 1e-12)).min())  # loads are linear in it


def loads_at(
    acceleration: float, angles: Array, directions: tuple[tuple[Array, Array], ...], robot: RobotParameters
) -> Array:
    """Loads (N, DIRECTIONS) [N] of a robot that accelerates from rest."""
    still = (0.0, 0.0, 0.0)
    rate = acceleration * np.cos(angles), acceleration * np.sin(angles), 0.0 * angles
    return np.array(wheel_loads(directions, tilt(still, rate, directions, still, robot), robot))


def creep(robot: Robot) -> float:
    """Speed of wheels that are driven by half of their breakaway torque [mm/s]; 0 without dry friction."""
    if not any(caster.roll.coulomb for caster in robot.casters):
        return 0.0
    return 1e3 * robot.coulomb_speed * max(caster.radius for caster in robot.casters) / math.sqrt(3.0)


def way_lost(robot: Robot) -> float:
    """Way [mm] that a robot lacks after a second at full torque from rest when its torque lags."""
    steering, torque = full_torque(robot)
    rate = Model(robot).forward_dynamics(steering, np.zeros((len(steering), 3)), torque)
    acceleration = float(np.median(np.hypot(rate[:, 0], rate[:, 1])))
    return 1e3 * acceleration * LAG * (1.0 - LAG)  # once the lag has died away: a T (t − T)


def off_without(robot: Robot, term: str) -> tuple[float, float]:
    """Median and 95 % quantile of how far accelerations are off without a term of the casters. [%]

    Of robots that move at up to 1 m/s along each axis and 2 rad/s, under up to 30 % of the greatest torques.
    """
    rng = np.random.default_rng(3)
    steering = rng.uniform(-np.pi, np.pi, (DRAWS, robot.caster_count))
    twist = rng.uniform(-1.0, 1.0, (DRAWS, 3)) * [1.0, 1.0, 2.0]
    most = np.array([size for c in robot.casters for size in (c.roll.max_torque, c.steer.max_torque)])
    torque = rng.uniform(-0.3, 0.3, (DRAWS, 2 * robot.caster_count)) * most
    whole = robot_parameters(robot)
    lacking = whole._replace(casters=tuple(caster._replace(**{term: 0.0}) for caster in whole.casters))
    exact = Model(robot).forward_dynamics(steering, twist, torque)
    without = Model(robot, parameters=lacking).forward_dynamics(steering, twist, torque)
    length = Model(robot).characteristic_length
    size = np.linalg.norm(exact * [1.0, 1.0, length], axis=-1)
    off = 100.0 * np.linalg.norm((without - exact) * [1.0, 1.0, length], axis=-1) / size
    return float(np.median(off)), float(np.quantile(off, 0.95))


def step_error(robot: Robot) -> float:
    """Median distance [µm] of ends at the usual time step from those at a fine one."""
    rng = np.random.default_rng(4)
    start = np.zeros((20, 6 + robot.caster_count))
    start[:, 6:] = rng.uniform(-np.pi, np.pi, (20, robot.caster_count))
    most = np.array([size for c in robot.casters for size in (c.roll.max_torque, c.steer.max_torque)])
    torque = 0.05 * rng.uniform(-1.0, 1.0, (20, 2 * robot.caster_count)) * most
    ends = [Model(robot).simulate(start, torque, h, round(SECONDS / h))[-1] for h in (STEP, FINE)]
    return float(np.median(1e6 * np.hypot(*(ends[0] - ends[1])[:, :2].T)))


def page(found: list[Row], robots: Sequence[Robot], command: str) -> str:
    """The page as Markdown."""
    heads = ["what", *(robot.name for robot in robots), "included by"]
    table = markdown_table(heads, [(one.what, *one.sizes, one.option) for one in found])
    return f"""# How true the model is

The equations assume rigid bodies on a level floor, on which every wheel rolls without slip. Where that holds, they are
exact: two independent derivations agree to rounding, and MuJoCo converges to them as its time step shrinks. This page
says what the equations leave out, how large each effect is on each robot of the package, and which option includes it.

{table}

The numbers follow from the robots' files, whose masses, heights and friction are partly estimates. The floor's friction
is {robots[0].floor_friction:g} everywhere. A use of friction above 1 means that the wheel would slip.

Some assumptions have no number here, because no robot file contains what they depend on. Contact patches are points,
which resist turning viscously (`scrub`). Tyres, floor and gears are stiff and have no play. The floor is level.
Batteries keep their voltage. Spinning rotors do not tilt the robot. Sensors are exact unless
[features](wrappers.md#sensors) change them.

## Compared with other people's code

- [MuJoCo's motion](truth/mujoco.md): the limit of rolling without slip, and the effect of dry friction at rest.
- [Impacts](truth/impacts.md): impacts that exceed the floor's friction.
- [Slip](truth/slip.md): wheels that may slip (`floor`), beside MuJoCo's wheels on the same floor.

- Command: `{command}`
- Versions: {versions_in_words("caster_gym", "numpy")}
"""


def main(arguments: list[str] | None = None) -> None:
    """Measure, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--out", type=Path, default=Path("docs/truth.md"), metavar="FILE")
    out = parser.parse_args(arguments).out
    robots = [load_robot(name) for name in ROBOTS]
    out.write_text(page(rows(robots), robots, f"python -m scripts.model_limits --out {out}"), encoding="utf-8")


if __name__ == "__main__":
    main()
