"""chung2008, V, Figs. 10–15: what the wheels' mass does to the operational forces along a circle and an ellipse."""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.headings import Heading, Spinning, Tangent
from caster_gym.paths.shapes import Circle, Ellipse, Shape
from caster_gym.report.figures import new_figure
from caster_gym.robot import Robot, Wheel, load_robot
from papers.analysis.driven_motion import inertial_force, lead
from papers.page import Check, Difference, Picture, Section, Table

BASE = 0.1  # [m] radius b of the platform, a disc
TIME_STEP = 0.05  # [s]
MASSES = 13  # from none to the heaviest wheels
LARGE, SMALL = 0.25, 0.10  # [-] change over the greatest force that we call large, and not that much

_AXES = ("x", "y", "θ_z")
_LABELS = ("F_x [N]", "F_y [N]", "M_z [N m]")


class Case(NamedTuple):
    """A motion, and a platform on wheels of different masses."""

    name: str
    path: Shape
    platform_mass: float  # [kg]
    heaviest: float  # [kg] three wheels together


class Result(NamedTuple):
    """What a case comes to."""

    time: Array  # (K + 1,) [s]
    wheels: Array  # (MASSES,) [kg] three together
    force: Array  # (MASSES, K + 1, 3) in the body frame

    @property
    def peaks(self) -> Array:
        """Greatest force (MASSES, 3) in each direction."""
        return np.asarray(np.abs(self.force).max(axis=1))

    @property
    def change(self) -> Array:
        """Greatest change (3,) of the force at any moment from no wheels to the heaviest."""
        return np.asarray(np.abs(self.force[-1] - self.force[0]).max(axis=0))

    @property
    def effect(self) -> Array:
        """That change as a share (3,) of the greatest force without wheels."""
        return np.asarray(self.change / self.peaks[0])


def circle(duration: float = 60.0) -> Circle:
    """The circle of Figs. 10–12; β of (61) is both the place on the circle and the heading."""
    return Circle(radius=5.0, duration=duration, heading=Spinning())


def ellipse(heading: Heading) -> Ellipse:
    """The ellipse of Figs. 13–15."""
    return Ellipse(semi_axes=(3.0, 1.0), duration=30.0, heading=heading)


def with_masses(robot: Robot, platform_mass: float, wheels_mass: float) -> Robot:
    """The robot with a platform, a disc, and three wheels, solid discs, of other masses [kg]; links as they are."""
    if not platform_mass > 0.0:
        raise ValueError(f"platform_mass must be positive, got {platform_mass:g} kg")
    if not wheels_mass >= 0.0:
        raise ValueError(f"wheels_mass must not be negative, got {wheels_mass:g} kg")
    mass = wheels_mass / robot.caster_count
    casters = tuple(
        caster.model_copy(
            update={
                "wheel": Wheel(
                    mass=mass, spin_inertia=0.5 * mass * caster.radius**2, yaw_inertia=0.25 * mass * caster.radius**2
                )
            }
        )
        for caster in robot.casters
    )
    platform = robot.platform.model_copy(
        update={"mass": float(platform_mass), "inertia": 0.5 * platform_mass * BASE**2}
    )
    return robot.model_copy(update={"casters": casters, "platform": platform})


def compute(case: Case, robot: Robot) -> Result:
    """Forces along a case's motion. What the casters do does not depend on masses."""
    motion = lead(case.path.trajectories(TIME_STEP)[0], robot)
    wheels = np.linspace(0.0, case.heaviest, MASSES)
    robots = [with_masses(robot, case.platform_mass, float(mass)) for mass in wheels]
    return Result(motion.time, wheels, np.stack([inertial_force(motion, Model(r)) for r in robots]))


def section() -> Section:
    """Forces over wheel mass."""
    robot = load_robot("chung2008")
    beside = -0.5 * np.pi  # from the tangent to a body x-axis that is radial on a circle
    cases = {
        "circle": Case("circle, Figs. 10–12", circle(), 5.0, 3.0),
        "ellipse": Case("ellipse, Figs. 13–15", ellipse(Spinning()), 20.0, 5.0),
        "same": Case("ellipse, robot of the circle", ellipse(Spinning()), 5.0, 3.0),
        "normal": Case("ellipse, y along the path", ellipse(Tangent(offset=beside)), 20.0, 5.0),
        "tangent": Case("ellipse, x along the path", ellipse(Tangent()), 20.0, 5.0),
        "fast": Case("circle in 30 s", circle(30.0), 5.0, 3.0),
    }
    results = {key: compute(case, robot) for key, case in cases.items()}
    return Section(
        "Wheel mass",
        _text(results),
        (*_circle_checks(results), *_ellipse_checks(results)),
        (_table(cases, results),),
        (
            _picture(
                "fig10_12",
                "Operational forces on the circle by wheel mass, Figs. 10 to 12",
                "Figs. 10 to 12: operational forces along the circle of 5 m, platform of 5 kg, body frame. Heavier "
                "wheels are felt along the path (F_y) and in turning (M_z); in F_x all curves lie upon each other.",
                results["circle"],
            ),
            _picture(
                "fig13_15",
                "Operational forces on the ellipse by wheel mass, Figs. 13 to 15",
                "Figs. 13 to 15: operational forces along the ellipse of 3 m by 1 m, platform of 20 kg, body frame. "
                "The heading turns at the rate of the eccentric anomaly, so that the casters do not keep their angles "
                "and heavier wheels are felt in all three directions.",
                results["ellipse"],
            ),
        ),
        (_difference(results),),
    )


def _text(results: dict[str, Result]) -> str:
    normal, chosen = (_shares(results[key].effect) for key in ("normal", "ellipse"))
    return f"""
The wheels are solid discs, as (43) and the tensor of Table 2 have them, so their inertias grow with their mass; the
links keep their 0.1 kg. The platform of 20 kg has the inertia ½ m_pl b². Forces are those of the exact model in the
body frame; the printed model gives the same picture (see the section on the missing term). The effect of the wheels
in a direction is the greatest change of the force at any moment, from no wheels to the heaviest, as a share of the
greatest force without: over {LARGE:.0%} is large, under {SMALL:.0%} is not that much.

Of the ellipse the paper does not tell the heading. We take (61) for the eccentric anomaly and the heading alike, as
on the circle. If the body y-axis points along the path instead, as it also does on the circle, the casters stay nearly
where they are, and the forces in x, y and θ_z change by {normal} instead of {chosen}: x is then hardly affected, as on
the circle. So what the paper says of x on the ellipse rests on a heading that does not follow the path.
"""


def _shares(values: Array) -> str:
    return ", ".join(f"{value:.1%}" for value in values)


def _circle_checks(results: dict[str, Result]) -> tuple[Check, ...]:
    effect, fast = results["circle"].effect, results["fast"].peaks[-1] / results["circle"].peaks[-1]
    checks = [
        Check(
            f"Figs. 10–12: the force in {axis} is affected largely",
            "largely",
            f"changes by {effect[k]:.1%}",
            bool(effect[k] > LARGE),
        )
        for k, axis in ((1, "y"), (2, "θ_z"))
    ]
    return (
        *checks,
        Check(
            "Fig. 10: the force in x is not affected that much",
            "not that much",
            f"changes by {effect[0]:.1%}",
            bool(effect[0] < SMALL),
        ),
        Check(
            "the speed of the motion also affects the dynamic forces",
            "affects",
            "circle in half the time: " + ", ".join(f"{ratio:.3f}" for ratio in fast) + " times the forces",
            np.allclose(fast, 4.0, rtol=1e-6, atol=0.0),
            "all inertial forces go with the square of the speed",
        ),
    )


def _ellipse_checks(results: dict[str, Result]) -> tuple[Check, ...]:
    around, along, same = results["circle"], results["ellipse"], results["same"]
    checks = []
    for k, axis in enumerate(_AXES):
        checks.append(
            Check(
                f"Figs. 13–15: in {axis} the change with the wheels' mass is drastic beside the circle's",
                "drastically compared to the circular trajectory",
                f"{along.change[k]:.3g} beside {around.change[k]:.3g}",
                bool(along.change[k] > 2.0 * around.change[k]),
                "in N and N m; drastic: more than twice",
            )
        )
    for k, axis in enumerate(_AXES):
        relative, there = along.effect[k], around.effect[k]
        checks.append(
            Check(
                f"Figs. 13–15: the same in {axis}, relative to the greatest force without wheels",
                "drastically compared to the circular trajectory",
                f"{relative:.1%} beside {there:.1%}; {same.effect[k]:.1%} with the robot of the circle",
                bool(relative > there),
                ""
                if relative > there
                else "E15: the paper names no measure; the wheels are 25 % of this platform, 60 % of the circle's",
            )
        )
    larger = along.peaks[-1] / around.peaks[-1]
    checks.append(
        Check(
            "the ellipse in 30 s yields larger operational forces and moment than the circle in 60 s",
            "larger",
            ", ".join(f"{ratio:.1f}" for ratio in larger) + " times, heaviest wheels",
            bool((larger > 1.0).all()),
            "with the robot of the circle "
            + ", ".join(f"{ratio:.1f}" for ratio in same.peaks[-1] / around.peaks[-1])
            + " times",
        )
    )
    return tuple(checks)


def _difference(results: dict[str, Result]) -> Difference:
    around, along, same = results["circle"], results["ellipse"], results["same"]
    return Difference(
        "E15",
        "V, Figs. 13 to 15",
        "as the wheel mass increases, the forces in x, y and θ_z increase drastically compared to the circle",
        "true in newtons and newton metres, as the figures are drawn; relative to the force without wheels, a measure "
        "that the paper does not use, the force in y changes less than on the circle, since the wheels are 25 % of the "
        "platform here and 60 % there",
        "Greatest change from no wheels to the heaviest over the greatest force without, in x, y, θ_z: "
        f"{_shares(along.effect)} on the ellipse with its platform of 20 kg, {_shares(around.effect)} on the circle. "
        f"With the circle's robot on the ellipse it is {_shares(same.effect)}: the path makes it larger in all three.",
        nature="reading",
    )


def _table(cases: dict[str, Case], results: dict[str, Result]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for key, case in cases.items():
        peaks = results[key].peaks
        for mass, peak in ((0.0, peaks[0]), (case.heaviest, peaks[-1])):
            rows.append((case.name, case.path.duration, case.platform_mass, mass, *(float(p) for p in peak)))
    columns = ("motion", "time [s]", "platform [kg]", "wheels [kg]", *_LABELS)
    return Table("wheel_mass", "Greatest operational forces, body frame", columns, rows)


def _picture(name: str, title: str, caption: str, result: Result) -> Picture:
    from matplotlib import colormaps
    from matplotlib.cm import ScalarMappable
    from matplotlib.colors import ListedColormap, Normalize

    figure = new_figure(1, 3, size=(4.2, 3.4))
    colours = ListedColormap(colormaps["viridis_r"](np.linspace(0.15, 1.0, 256)))  # the lightest are lost on white
    scale = Normalize(0.0, float(result.wheels[-1]))
    for k, axis in enumerate(figure.axes):
        for mass, force in zip(result.wheels, result.force, strict=True):
            axis.plot(result.time, force[:, k], color=colours(scale(mass)), linewidth=1.1)
        axis.set(xlabel="time [s]", ylabel=_LABELS[k])
    figure.colorbar(ScalarMappable(scale, colours), ax=figure.axes, label="three wheels together [kg]", pad=0.01)
    return Picture(name, title, caption, figure)
