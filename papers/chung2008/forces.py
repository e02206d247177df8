"""chung2008, V: the circle of Fig. 5, the motion of the joints, kinetic energy and operational forces, Figs. 5–9."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.headings import Spinning
from caster_gym.paths.shapes import Circle
from caster_gym.robot import Robot, load_robot
from papers.analysis.driven_motion import DrivenMotion, inertial_force, lead, work
from papers.analysis.model_comparison import carried_mass
from papers.chung2008 import inertia, wheel_mass
from papers.chung2008.motion_pictures import FORCE_AXES, draw_energy, draw_forces, draw_joints, draw_path
from papers.notation import CHUNG2008
from papers.page import Check, Difference, Section, Table

RADIUS = 1.0  # [m] of Fig. 5
DURATION = 60.0  # [s]
TIME_STEP = 0.05  # [s]
COEFFICIENTS = (0.0, 0.0, 0.0, 20.0 * np.pi / 60**3, -30.0 * np.pi / 60**4, 12.0 * np.pi / 60**5)  # a0 … a5 of (61)
CLOSE = 1e-6  # [-] integrals and derivatives of the same motion must agree this well
SIGNIFICANT = 0.1  # [-] share of the greatest force from which on we call a difference significant


class Forces(NamedTuple):
    """Operational forces (K + 1, 3) along one motion, in the body frame."""

    exact: Array
    printed: Array  # with wheels, but without (D1)
    bare: Array  # without wheels


def circle(radius: float) -> Circle:
    """The circle of Fig. 5: β of (61) is both the place on the circle and the heading."""
    return Circle(radius=radius, duration=DURATION, heading=Spinning())


def forces_along(motion: DrivenMotion, robot: Robot) -> Forces:
    """What the three models ask for."""
    models = (Model(robot), Model(robot, "chung2008"), Model(robot.without_wheels()))
    return Forces(*(inertial_force(motion, model) for model in models))


def section() -> Section:
    """Operational-space dynamics: inertia matrices, and the forces along the circle of Fig. 5."""
    robot = load_robot("chung2008")
    motion = lead(circle(RADIUS).trajectories(TIME_STEP)[0], robot)
    forces = forces_along(motion, robot)
    table, mass_checks, differences = inertia.mass_evidence(robot)
    checks = (
        *inertia.matrix_checks(robot),
        *mass_checks,
        *inertia.formula_checks(robot),
        inertia.contact_check(),
        *_time_law_checks(),
        *_motion_checks(motion, robot),
        *_force_checks(motion, forces, robot),
    )
    apart = _apart(forces.exact, forces.bare)
    in_world = _apart(motion.in_world(forces.exact), motion.in_world(forces.bare))
    without_term = _apart(forces.printed, forces.bare)[0]
    circle_body, circle_world = _force_along_x_on_large_circle(robot)
    significant = Difference(
        "E14",
        "V, Figs. 8 and 9",
        "significant differences at F_x, F_y and M_z between the models with and without wheels",
        "true in the world frame; Fig. 10 is true in the body frame: the paper mixes the two and names neither",
        f"Greatest difference over greatest force without wheels, in the world frame: {_shares(in_world)}, each over "
        f"{SIGNIFICANT:.0%}. In the body frame it is {_shares(apart)}, since the casters roll along y and the floor "
        f"holds the wheels across; without (D1), which the paper leaves out, F_x would differ by {without_term:.1%} "
        "there, so that even this is not the wheels' doing. Of the circle of 5 m the paper says that the force along x "
        f"is not affected that much: from no wheels to the heaviest it changes by {circle_body:.1%} in the body frame "
        f"and by {circle_world:.1%} in the world frame.",
        nature="reading",
    )
    pictures = (
        draw_path(motion, robot),
        draw_joints(motion, robot),
        draw_energy(motion, robot),
        draw_forces(
            motion,
            (
                ("with wheels, as printed", forces.printed),
                ("with wheels, exact", forces.exact),
                ("without wheels", forces.bare),
            ),
        ),
    )
    text = _text(motion, robot)
    return Section(
        "Operational-space dynamics", text, checks, (table, _peaks(forces)), pictures, (*differences, significant)
    )


def _text(motion: DrivenMotion, robot: Robot) -> str:
    angles = ", ".join(f"{angle:.2f}°" for angle in np.degrees(CHUNG2008.steering(motion.steering[0])))
    return f"""
The paper adds the inertias of wheels and links to the platform's, each through the inverse Jacobian of its caster,
(48), and gives the result "at a configuration" that it does not tell. It is the one of Fig. 5: on a circle of
{RADIUS:g} m about the origin of the world, with the body x-axis radial, casters that trail and steer no more stand at
φ = ({angles}). There all six entries come out to within two units of the fourth decimal, and to the last digit if all
casters are turned by a few thousandths of a degree. With leading casters the sign of the entry (1, 2) would be the
opposite: the paper's robot trails its wheels. The masses of Table 2 do not give this matrix (E1); the table below shows
which do.

Along the circle β follows (61). The steering angles are integrated from the rates (15)–(17), from the configuration
above on, and stay what they are; the driving angles are integrated as well and their rates come back from the inverse
kinematics. Forces are in the body frame, x radial and y along the path. The exact model has the term that (42) lacks
(E3); it changes F_x alone here, as {carried_mass(robot):.3g} kg more on the circle would (F5).
"""


def _time_law_checks() -> tuple[Check, ...]:
    """(61) with the printed coefficients."""
    beta = np.polynomial.Polynomial(COEFFICIENTS)
    ends = np.array([[beta.deriv(n)(t) if n else beta(t) for t in (0.0, DURATION)] for n in range(3)])
    wanted = np.array([[0.0, 2.0 * np.pi], [0.0, 0.0], [0.0, 0.0]])
    return (
        Check(
            "(61), β at 0 and 60 s",
            "0, 2π: the initial and final positions are the same",
            f"{ends[0, 0] / np.pi:.12g} π, {ends[0, 1] / np.pi:.12g} π",
            np.allclose(ends[0], wanted[0], rtol=0.0, atol=1e-12),
        ),
        Check(
            "(61), velocity at both ends [rad/s]",
            "zero",
            f"{np.abs(ends[1]).max():.1e}",
            np.allclose(ends[1:], wanted[1:], rtol=0.0, atol=1e-12),
            "the acceleration is zero there too",
        ),
    )


def _motion_checks(motion: DrivenMotion, robot: Robot) -> tuple[Check, ...]:
    """What the casters do on the circle."""
    from scipy.interpolate import CubicSpline

    model = Model(robot)
    turned = float(np.ptp(motion.steering, axis=0).max())
    changed = float(np.ptp(model.inertia(motion.steering), axis=0).max())
    pivots = np.array([np.hypot(RADIUS + caster.x, caster.y) for caster in robot.casters])
    ways = 2.0 * np.pi * np.sqrt(pivots**2 - robot.casters[0].trail ** 2)
    rolled = motion.rolling[-1] * robot.casters[0].radius
    full, bare = (Model(r).kinetic_energy(motion.steering, motion.twist) for r in (robot, robot.without_wheels()))
    ratio = full[1:-1] / bare[1:-1]
    theta = model.rates(motion.steering, motion.twist)[1]
    slip = float(np.abs(CubicSpline(motion.time, motion.rolling).derivative()(motion.time) - theta).max() / theta.max())
    masses, bare_masses = (np.diag(Model(r).inertia(motion.steering[0])) for r in (robot, robot.without_wheels()))
    growth = masses / bare_masses - 1.0
    return (
        Check(
            "the robot keeps its configuration with respect to the body-fixed frame; its model keeps its value",
            "the same value",
            f"steering within {np.degrees(turned):.1e}°, every entry of M within {changed:.1e} of its scale in SI",
            max(turned, changed) < CLOSE,
            "the casters have to start at these angles; from others they come to them within a few trails",
        ),
        Check(
            "Fig. 6(a): ways of the wheels, integrated, beside the circles of their centres [m]",
            ", ".join(f"{way:.6f}" for way in ways),
            ", ".join(f"{way:.6f}" for way in rolled),
            np.allclose(rolled, ways, rtol=CLOSE, atol=0.0),
            own=True,
        ),
        Check(
            "Fig. 6(c): rates of the integrated driving angles, beside those of the inverse kinematics",
            "equal",
            f"within {slip:.1e} of the greatest",
            slip < CLOSE,
            "a spline's derivative",
            own=True,
        ),
        Check(
            "Fig. 7: kinetic energy with wheels is larger than without",
            "larger",
            f"by {ratio.min() - 1.0:.1%} to {ratio.max() - 1.0:.1%} all the way",
            bool((ratio > 1.0).all()),
        ),
        Check(
            "inertia matrices: a substantial discrepancy especially in the y-direction",
            "y",
            "M_xx, M_yy, M_zz grow by " + ", ".join(f"{share:.1%}" for share in growth),
            bool(growth[1] > SIGNIFICANT > growth[0]),
            "of masses; the moment of inertia grows more, in proportion, but the paper speaks of directions",
        ),
    )


def _force_checks(motion: DrivenMotion, forces: Forces, robot: Robot) -> tuple[Check, ...]:
    """Figs. 8 and 9, and that work is the change of kinetic energy whatever the model."""
    apart = _apart(forces.exact, forces.bare)
    in_world = _apart(motion.in_world(forces.exact), motion.in_world(forces.bare))
    checks = [
        Check(
            f"Figs. 8, 9: a significant difference at {axis.split()[0]}, with and without wheels",
            "significant",
            f"{here:.1%} of the greatest force in the body frame, {there:.1%} in the world frame",
            bool(here > SIGNIFICANT),
            f"significant: over {SIGNIFICANT:.0%}"
            + ("" if here > SIGNIFICANT else "; E14: it is in the world frame, which may be meant"),
        )
        for axis, here, there in zip(FORCE_AXES, apart, in_world, strict=True)
    ]
    for name, force, r in (
        ("the exact model", forces.exact, robot),
        ("the printed model", forces.printed, robot),
        ("the model without wheels", forces.bare, robot.without_wheels()),
    ):
        energy = Model(r).kinetic_energy(motion.steering, motion.twist)
        gap = float(np.abs(work(motion, force) - energy).max() / energy.max())
        checks.append(
            Check(
                f"Figs. 7–9: the work of {name} is the kinetic energy",
                "equal",
                f"within {gap:.1e} of the greatest",
                gap < CLOSE,
                "the missing term has no power, so that energy cannot tell the two models apart"
                if name == "the printed model"
                else "",
                own=True,
            )
        )
    return tuple(checks)


def _apart(force: Array, other: Array) -> Array:
    """Greatest difference of two forces in each direction, as a share of the greatest of the other."""
    return np.asarray(np.abs(force - other).max(axis=0) / np.abs(other).max(axis=0))


def _shares(values: Array) -> str:
    return ", ".join(f"{value:.1%}" for value in values)


def _force_along_x_on_large_circle(robot: Robot) -> tuple[float, float]:
    """What the heaviest wheels of Fig. 10 change of F_x, over its greatest without: in the body frame, in the world."""
    motion = lead(wheel_mass.circle().trajectories(TIME_STEP)[0], robot)
    robots = (wheel_mass.with_masses(robot, 5.0, mass) for mass in (3.0, 0.0))
    heavy, none = (inertial_force(motion, Model(one)) for one in robots)
    return float(_apart(heavy, none)[0]), float(_apart(motion.in_world(heavy), motion.in_world(none))[0])


def _peaks(forces: Forces) -> Table:
    rows: list[tuple[str | float, ...]] = [
        (name, *(float(peak) for peak in np.abs(force).max(axis=0)))
        for name, force in zip(("exact", "as printed, without (D1)", "without wheels"), forces, strict=True)
    ]
    caption = f"Greatest operational forces on the circle of {RADIUS:g} m in {DURATION:g} s, body frame"
    return Table("peak_forces", caption, ("model", *FORCE_AXES), rows)
