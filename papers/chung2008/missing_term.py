"""chung2008, (42)–(43): how large the term is that the zero array P*_φφφ leaves out, along motions and at random."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.headings import Spinning
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, Ellipse, Lemniscate, Shape
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot, load_robot
from papers.analysis.driven_motion import DrivenMotion, inertial_force, lead
from papers.analysis.model_comparison import carried_mass, force_by_momenta, force_size, missing_force
from papers.chung2008.missing_term_pictures import FORCE_AXES, Forces, picture_at_random, picture_on_circle
from papers.page import Check, Difference, Section, Table

ROBOTS = ("chung2008", "xr4000", "tidybot2")
ON_CIRCLE = ("chung2008", "xr4000")  # that are drawn
SPEED = 1.0  # [m/s] greatest of C in every motion
RADIUS = 1.0  # [m] of the circle of Figs. 8 and 9
STATES = 10_000  # at random
TIME_STEP = 0.01  # [s]
SAID = (0.03, 0.06)  # what docs/equations.md says of it: typically, as a share of h
DIGIT = 0.01  # the last one of that
CLOSE = 1e-3  # [-] differences that decide are a thousand times smaller than what they decide about

_OF_FORCES = ("exact", "as printed, without (D1)", "what is missing")


class Shares(NamedTuple):
    """The missing term along one or several motions of one robot."""

    robot: str
    motion: str
    of_force: Array  # (samples,) size over the size of the force
    of_bias: Array  # (samples,) size over the size of h
    root_mean_square: float  # over the motion, of the term over that of the force
    power: float  # greatest, over the product of its size and the speed's


class Residual(NamedTuple):
    """How far the two models are from the force that the bodies' momenta ask for, greatest over a motion. [N]"""

    robot: str
    motion: str
    force: float  # the greatest force itself
    exact: float
    printed: float


def section() -> Section:
    """How large the missing term is, and which model Newton's laws decide for."""
    robots = tuple(load_robot(name) for name in ROBOTS)
    motions = [(robot, kind, led) for robot in robots for kind, led in _motions(robot).items()]
    along = [_shares(robot, kind, led) for robot, kind, led in motions]
    residuals = [_residual(robot, kind, led[0]) for robot, kind, led in motions]
    at_random = {robot.name: random_shares(robot) for robot in robots}
    on_circle = [_forces(robot, led[0]) for robot, kind, led in motions if kind == "circle" and robot.name in ON_CIRCLE]
    return Section(
        "The missing term",
        _text(on_circle, along, at_random),
        (_size_check(at_random), *_steady_checks(robots, along), *_law_checks(along, residuals)),
        (_table_on_circle(on_circle), _table_along(along), _table_at_random(at_random), _table_of_residuals(residuals)),
        (picture_on_circle(on_circle, RADIUS, SPEED), picture_at_random(at_random, SAID)),
        (_difference(residuals),),
    )


def random_shares(robot: Robot) -> tuple[Array, Array]:
    """Size of the missing term over that of h, and over that of the force, (STATES,) each.

    Steering angles are uniform, twists have any direction and |ν| = 1 in SI units, and for the force so have their
    rates; the size of a wrench is taken with moments in SI units as well.
    """
    rng = np.random.default_rng(0)
    steering = rng.uniform(-np.pi, np.pi, (STATES, robot.caster_count))
    twist, rate = (v / np.linalg.norm(v, axis=-1, keepdims=True) for v in rng.normal(size=(2, STATES, 3)))
    model = Model(robot)
    bias = model.bias(steering, twist)
    force = np.einsum("kij,kj->ki", model.inertia(steering), rate) + bias
    missing, h, f = (np.linalg.norm(v, axis=-1) for v in (missing_force(robot, steering, twist), bias, force))
    return missing / h, missing / f


def steady_share(robot: Robot) -> float:
    """Share of (D1) in h on a circle with trailing casters, for pivots whose mean is C and a mass centre at C.

    By (F5) the casters' carried mass and the platform's mass are then felt alike.
    """
    carried = carried_mass(robot)
    return carried / (robot.platform.mass + carried)


def circle(radius: float, speed: float) -> Circle:
    """The circle of Figs. 8 and 9, with the same quintic (61), so that C has a greatest speed [m/s]."""
    return Circle(radius=radius, duration=1.875 * 2.0 * np.pi * radius / speed, heading=Spinning())


def at_speed(trajectory: Trajectory, speed: float) -> Trajectory:
    """The same motion in another time, with a greatest speed [m/s] of C."""
    faster = speed / float(np.hypot(*trajectory.samples[:, 4:6].T).max())
    scale = np.repeat((1.0, faster, faster**2), (4, 3, 3))
    return Trajectory(trajectory.name, trajectory.time_step / faster, trajectory.samples * scale)


def _motions(robot: Robot) -> dict[str, list[DrivenMotion]]:
    """The robot led along paths, each at the same greatest speed."""
    paths: dict[str, Shape | RandomPaths] = {
        "circle": circle(RADIUS, SPEED),
        "ellipse": Ellipse(semi_axes=(3.0, 1.0), duration=30.0, heading=Spinning()),
        "lemniscate": Lemniscate(duration=12.0),
        "random paths": RandomPaths(count=6, max_speed=1.0, reversing=0.0),
    }
    return {
        name: [lead(at_speed(one, SPEED), robot) for one in path.trajectories(TIME_STEP)]
        for name, path in paths.items()
    }


def _forces(robot: Robot, motion: DrivenMotion) -> Forces:
    exact, printed = (inertial_force(motion, Model(robot, dynamics)) for dynamics in ("exact", "chung2008"))
    return Forces(robot.name, motion.time, exact, printed)


def _shares(robot: Robot, kind: str, motions: list[DrivenMotion]) -> Shares:
    model, inner = Model(robot), slice(1, -1)  # at rest all forces are zero
    missing = np.concatenate([missing_force(robot, m.steering, m.twist)[inner] for m in motions])
    force = np.concatenate([inertial_force(m, model)[inner] for m in motions])
    bias = np.concatenate([model.bias(m.steering, m.twist)[inner] for m in motions])
    twist = np.concatenate([m.twist[inner] for m in motions])
    small, f, h = (force_size(robot, part) for part in (missing, force, bias))
    power = np.abs(np.einsum("ki,ki->k", missing, twist))
    most = np.linalg.norm(missing, axis=-1) * np.linalg.norm(twist, axis=-1)
    mean = float(np.sqrt((small**2).sum() / (f**2).sum()))
    return Shares(robot.name, kind, small / f, small / h, mean, float((power / most).max()))


def _residual(robot: Robot, kind: str, motion: DrivenMotion) -> Residual:
    measured, inner = force_by_momenta(motion, robot), slice(2, -2)
    exact, printed = (inertial_force(motion, Model(robot, dynamics))[inner] for dynamics in ("exact", "chung2008"))
    greatest = (float(force_size(robot, f).max()) for f in (measured, exact - measured, printed - measured))
    return Residual(robot.name, kind, *greatest)


def _size_check(at_random: dict[str, tuple[Array, Array]]) -> Check:
    low, middle, high = np.percentile(at_random["chung2008"][0], (25.0, 50.0, 75.0))
    return Check(
        "at any steering, the missing term as a share of h",
        f"typically {SAID[0]:.0%} to {SAID[1]:.0%}",
        f"half of all states from {low:.1%} to {high:.1%}, median {middle:.1%}",
        max(abs(low - SAID[0]), abs(high - SAID[1])) < 0.5 * DIGIT,
        "E3; chung2008's robot, |ν| = 1 in SI units",
        own=True,
    )


def _steady_checks(robots: tuple[Robot, ...], along: list[Shares]) -> tuple[Check, ...]:
    measured = {s.robot: float(np.median(s.of_bias)) for s in along if s.motion == "circle"}
    return tuple(
        Check(
            f"{robot.name} on a circle, casters trailing: share of h, by (F5) and along the motion",
            f"{steady_share(robot):.4%}",
            f"{measured[robot.name]:.4%}",
            abs(measured[robot.name] - steady_share(robot)) < CLOSE * steady_share(robot),
            "Σ m_l p / d over itself and the platform's mass",
            own=True,
        )
        for robot in robots
    )


def _law_checks(along: list[Shares], residuals: list[Residual]) -> tuple[Check, ...]:
    """What decides between the two models, and why energy does not."""
    own = [r.printed / r.force for r in residuals if r.robot == "chung2008"]
    power = max(s.power for s in along)
    return (
        Check(
            "the force with P*_φφφ = 0 is what Newton's and Euler's laws ask for, body by body",
            "P*_φφφ becomes a zero array",
            f"off by {min(own):.1%} to {max(own):.1%} of the greatest force, chung2008's robot",
            max(own) < CLOSE,
            "E3; momenta of all bodies differentiated along the motions of the last table",
        ),
        Check(
            "the force with (D1) is what these laws ask for, all robots and motions",
            f"off by less than {CLOSE:g} of what it is without",
            f"at least {min(r.printed / r.exact for r in residuals):.0f} times closer than without, off by at most "
            f"{max(r.exact / r.force for r in residuals):.1e} of the greatest force",
            all(r.exact < CLOSE * r.printed for r in residuals),
            "what is left is the numerical derivative",
            own=True,
        ),
        Check(
            "power of the missing term, all robots and motions",
            "0",
            f"at most {power:.1e} of size times speed",
            power < 1e-9,
            "so neither kinetic energy nor work, as in Fig. 7, can show that it is missing",
            own=True,
        ),
    )


def _difference(residuals: list[Residual]) -> Difference:
    own = [r for r in residuals if r.robot == "chung2008"]
    return Difference(
        "E3",
        "after (43)",
        "P*_φφφ becomes a zero array",
        "off-axis term (D1)",
        "momenta of all bodies, differentiated along the motions: the printed model's force is off by up to "
        f"{max(r.printed / r.force for r in own):.1%} of the greatest force, the exact one's by "
        f"{max(r.exact / r.force for r in own):.0e} (sizes as in the row above)",
    )


def _text(on_circle: list[Forces], along: list[Shares], at_random: dict[str, tuple[Array, Array]]) -> str:
    worst = max(along, key=lambda s: s.root_mean_square)
    least = min(along, key=lambda s: s.root_mean_square)
    medians = ", ".join(f"{np.median(at_random[name][0]):.1%} ({name})" for name in ROBOTS)
    return f"""
After (43) the paper argues that its inertia matrix is constant in the coordinates (η, θ, φ) and that therefore no
velocity terms remain. That holds for coordinates that tell where the robot is; these do not, since wheels roll (E3).
What is missing is (D1) of docs/equations.md, and (F5) gives it a plain meaning: each caster carries a mass m_l p / d at
its pivot that feels η̇ ẑ × v of the pivot, across its motion and so without power.

On the circle of Figs. 8 and 9, driven with a greatest speed of {SPEED:g} m/s, casters trail steadily and the term is
felt across the path alone: the greatest force in x falls short by
{" and by ".join(f"{np.abs(one.missing[:, 0]).max():.2g} N on {one.robot}" for one in on_circle)}.

Here both models are put beside the force that follows from the momenta of all bodies, differentiated numerically along
the motion (F6). Along the motions below, each with a greatest speed of {SPEED:g} m/s, the term is between
{least.root_mean_square:.1%} ({least.robot}, {least.motion}) and {worst.root_mean_square:.1%}
({worst.robot}, {worst.motion}) of the force, as root mean squares. As a share of h at random steering angles its median
is {medians}: small for the light links of the paper's robot, and not for the forks of a real one.
"""


def _table_on_circle(on_circle: list[Forces]) -> Table:
    rows: list[tuple[str | float, ...]] = [
        (one.robot, what, SPEED, float(one.time[-1]), *(float(peak) for peak in np.abs(force).max(axis=0)))
        for one in on_circle
        for what, force in zip(_OF_FORCES, (one.exact, one.printed, one.missing), strict=True)
    ]
    columns = ("robot", "model", "greatest speed [m/s]", "time [s]", *FORCE_AXES)
    caption = f"Greatest operational forces on the circle of {RADIUS:g} m, greatest speed {SPEED:g} m/s, body frame"
    return Table("missing_circle", caption, columns, rows)


def _table_along(along: list[Shares]) -> Table:
    rows: list[tuple[str | float, ...]] = [
        (
            s.robot,
            s.motion,
            SPEED,
            s.root_mean_square,
            *(float(v) for v in np.percentile(s.of_force, (50.0, 95.0))),
            *(float(v) for v in np.percentile(s.of_bias, (50.0, 95.0))),
        )
        for s in along
    ]
    columns = (
        "robot",
        "motion",
        "greatest speed [m/s]",
        "rms / rms of F",
        "median of F",
        "95 % of F",
        "median of h",
        "95 % of h",
    )
    caption = (
        "Size of the missing term as a share of the force F = M ν̇ + h and of h, moments over the pivots' distance, "
        f"greatest speed {SPEED:g} m/s"
    )
    return Table("missing_along", caption, columns, rows)


def _table_at_random(at_random: dict[str, tuple[Array, Array]]) -> Table:
    rows: list[tuple[str | float, ...]] = [
        (name, what, *(float(v) for v in np.percentile(share, (5.0, 25.0, 50.0, 75.0, 95.0))))
        for name, shares in at_random.items()
        for what, share in zip(("of h", "of F"), shares, strict=True)
    ]
    columns = ("robot", "share", "5 %", "25 %", "median", "75 %", "95 %")
    return Table("missing_at_random", f"The same at {STATES} random states, |ν| = |ν̇| = 1", columns, rows)


def _table_of_residuals(residuals: list[Residual]) -> Table:
    columns = ("robot", "motion", "greatest force [N]", "exact model off by [N]", "printed model off by [N]")
    caption = (
        "Distance of both models from the force that the momenta of all bodies ask for, greatest speed of each motion "
        f"{SPEED:g} m/s"
    )
    return Table("missing_residuals", caption, columns, residuals)
