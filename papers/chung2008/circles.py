"""All steering angles at which the robot of chung2008 is hit alike from all sides, and how other robots are hit."""

from collections.abc import Callable

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS, legend_below, new_figure
from caster_gym.robot import load_robot
from papers.analysis.impulse_circles import CELLS, SLICES, CircleCurve, circle_curves, greatest_elongation
from papers.analysis.impulse_shape import anisotropy, effective_mass, ellipse_gap, elongation, extremes
from papers.chung2008.impulse_checks import (
    ALL_ROUND,
    CONFIGURATIONS,
    size_of,
    steering_of,
    with_unrounded_pivots,
)
from papers.notation import CHUNG2008
from papers.page import Check, Picture, Section, Table
from papers.robot_drawing import draw_robot

JOINTS = ("steer_1", "steer_2", "steer_3")
ROBOTS = ("chung2008", "xr4000", "tidybot2")
KINDS = ("symmetric", "balanced")


def section() -> Section:
    """Beyond the figures: every uniform configuration, the most elongated ones, and other robots."""
    model = Model(load_robot("chung2008"))
    curves = _curves(model)
    finer = circle_curves(model, np.zeros(3), JOINTS, slices=2 * SLICES, cells=2 * CELLS)
    holding = [curve.holds(steering_of("Fig. 18")) for curve in curves]
    others = _table_of_robots()
    return Section(
        title="Where the impulse is uniform, and other robots",
        text=_text(model, curves, len(finer)),
        checks=(
            Check(
                "Fig. 18 lies on a curve of uniform configurations",
                "on one",
                f"on the {KINDS[holding.index(True)]} one" if any(holding) else "on none",
                any(holding),
                "as near as the rounding of the pivots lets it",
                own=True,
            ),
        ),
        tables=(_table_of_curves(model, curves), others),
        pictures=(_picture_of_curves(model, curves), _picture_of_robots()),
    )


def _curves(model: Model) -> list[CircleCurve]:
    """The circles of a robot on three casters, those first whose direct part vanishes."""
    found = circle_curves(model, np.zeros(3), JOINTS)
    return sorted(found, key=lambda curve: float(_direct(model, curve).max()))


def _direct(model: Model, curve: CircleCurve) -> Array:
    """What the casters' direct part alone would elongate, along a curve. [kg]"""
    return np.abs(anisotropy(model, curve.steering)[0])


def _text(model: Model, curves: list[CircleCurve], finer: int) -> str:
    _, balanced = curves
    sizes = [size_of(extremes(model, curve.steering).greatest.mean()) for curve in curves]
    return f"""
With $w_i = e^{{2 i \\delta_i}}$ the impulse is uniform where $\\sum_i k_i w_i = m^2/(2 M_{{\\omega\\omega}})$: one
complex equation. On its left stands what the casters do directly, on its right the coupling
$m = M_{{x\\omega}} + i M_{{y\\omega}}$ of the translations with the yaw. Three steering angles less two equations
leave one freedom, so that the uniform configurations form closed curves. Half a turn of a caster changes nothing
here; counted up to half turns there are **{len(curves)} curves** ({sum(curve.copies for curve in curves)} over
whole turns). A search with twice as many slices, each of four times as many cells, finds {finer}.

- On the *symmetric* curve, which holds Fig. 18, both sides vanish: all wheels stand at one angle to the radii of
  their pivots, whatever that angle is, and the impulse stays at {sizes[0]} N s.
- On the *balanced* curve the casters are uneven by {_direct(model, balanced).mean():.3f} kg, and the coupling just
  makes up for it: no symmetry about C asks for it. The impulse is {sizes[1]} N s.

The robot's own symmetries keep each of them: {_symmetries(model)}.

**Other robots** need not be heavier along their wheels. A caster is heavier along its rolling direction by
$m_w + m_l + (I_s + J_\\theta)/r^2 - (I_{{\\eta\\eta}} + J_\\delta)/d^2$ if it has no lateral offset. A short trail
and a geared steering motor turn the sign: xr4000 and tidybot2 are heavier *across* their wheels, as a blow from the
side has to turn link and rotor at speed/trail. There the wheels decide the impact, and on tidybot2 the curve is far
from an ellipse.
"""


def _symmetries(model: Model) -> str:
    """What the mirror x → −x of the robot and its turn by 120°, with the casters' new numbers, make of its circles."""
    unrounded = Model(with_unrounded_pivots(model.robot))
    images: tuple[tuple[str, Model, Callable[[Array], Array]], ...] = (
        ("mirrored at its y-axis", model, lambda delta: np.pi - delta[..., [1, 0, 2]]),
        ("turned by 120°", unrounded, lambda delta: np.roll(delta, 1, -1) + 2.0 * np.pi / 3.0),
    )
    found = []
    for name, of, image in images:
        own = _curves(of)
        kept = sum(all(curve.holds(image(steering)) for steering in curve.steering) for curve in own)
        worst = max(float(np.abs(elongation(of, image(curve.steering))).max()) for curve in own)
        found.append(f"{name}, {kept} of {len(own)} curves lie on themselves (uniform to {worst:.0e})")
    return "; ".join(found)


def _table_of_curves(model: Model, curves: list[CircleCurve]) -> Table:
    rows: list[tuple[str, ...]] = []
    for kind, curve in zip(KINDS, curves, strict=True):
        direct, size = _direct(model, curve), extremes(model, curve.steering).greatest
        for steering, uneven, mass in list(zip(curve.steering, direct, size, strict=True))[:: len(direct) // 6]:
            phi = np.degrees(CHUNG2008.steering(steering)) % 180.0
            rows.append((kind, *(f"{angle:.2f}" for angle in phi), f"{uneven:.1e}", size_of(mass)))
    columns = ("curve", "φ_1 [°]", "φ_2 [°]", "φ_3 [°]", "direct part [kg]", "impulse [N s]")
    caption = "Some configurations of uniform impulse, up to half turns of each caster; what the casters do directly."
    return Table("uniform_impulses", caption, columns, rows)


def _table_of_robots() -> Table:
    rows: list[tuple[str, ...]] = []
    for name in ROBOTS:
        model = Model(load_robot(name))
        parallel = np.zeros(model.robot.caster_count)
        along, across = effective_mass(model, parallel, np.array([0.0, 0.5 * np.pi]))
        bare = float(effective_mass(Model(model.robot.without_wheels()), parallel, 0.0))
        ratio = float(extremes(model, parallel).ratio)
        size, steering = greatest_elongation(model)
        rows.append(
            (
                name,
                f"{bare:.2f}",
                f"{along:.2f}",
                f"{across:.2f}",
                f"{ratio:.3f}",
                f"{100.0 * float(ellipse_gap(ratio)):.1f}",
                f"{(1.0 + size) / (1.0 - size):.3f}",
                ", ".join(f"{angle:.0f}" for angle in np.degrees(steering)),
            )
        )
    return Table(
        "impulse_of_other_robots",
        "Effective masses at C without wheels, and with all wheels parallel, along and across them; greatest over "
        "least; by how much the curve bulges over an ellipse; the greatest ratio over all steering angles, and where.",
        (
            "robot",
            "without wheels [kg]",
            "along [kg]",
            "across [kg]",
            "greatest/least",
            "bulge [%]",
            "greatest of all",
            "at δ [°]",
        ),
        rows,
    )


def _picture_of_curves(model: Model, curves: list[CircleCurve]) -> Picture:
    shown = 2  # configurations drawn of each curve
    figure = new_figure(1, 1 + shown * len(curves), size=(3.0, 3.3), width_ratios=(1.9, *(1.0,) * shown * len(curves)))
    plane, *robots = figure.axes
    for kind, curve, own in zip(KINDS, curves, (robots[:shown], robots[shown:]), strict=True):
        phi = np.degrees(CHUNG2008.steering(curve.steering)) % 180.0
        first, second, third = phi.T
        shades = plane.scatter(first, second, c=third, cmap="twilight", vmin=0.0, vmax=180.0, s=22, edgecolors="none")
        for k, axis in enumerate(own):
            number = (2 * k + 1) * len(phi) // (2 * shown)
            x, y = float(first[number]), float(second[number])
            draw_robot(axis, model.robot, curve.steering[number])
            size = size_of(extremes(model, curve.steering[number]).greatest)
            angles = ", ".join(f"{angle:.0f}°" for angle in phi[number])
            axis.set_title(f"{kind} {k + 1}, {size} N s\nφ = ({angles})", fontsize=9)
            axis.set(xlabel="x [m]", xticks=(-0.1, 0.0, 0.1), yticks=(-0.1, 0.0, 0.1))
            plane.plot(x, y, "o", color="none", markeredgecolor=COLOURS[3], markersize=10)
            offset, side = ((8, -10), "left") if kind == KINDS[0] else ((-8, 6), "right")  # beside both curves
            plane.annotate(f"{kind} {k + 1}", (x, y), offset, textcoords="offset points", ha=side, color=COLOURS[3])
    robots[0].set_ylabel("y [m]")
    figure.colorbar(shades, ax=plane, label="φ₃ [°], up to half turns", ticks=range(0, 181, 45))
    x, y, _ = np.array(CONFIGURATIONS["Fig. 18"]) % 180.0
    plane.plot(x, y, "*", color=COLOURS[7], markersize=10)
    plane.annotate("Fig. 18", (x, y), (8, -10), textcoords="offset points")
    ticks = range(0, 181, 45)
    plane.set(
        xlabel="φ₁ [°]", ylabel="φ₂ [°]", xlim=(0, 180), ylim=(0, 180), xticks=ticks, yticks=ticks, aspect="equal"
    )
    caption = (
        "Every configuration of uniform impulse, up to half turns of the casters, and right the four that are ringed. "
        "Along both curves all three angles go round once. The straight curve is the symmetric one."
    )
    return Picture("uniform_impulses", "Configurations of uniform impulse", caption, figure)


def _picture_of_robots() -> Picture:
    figure = new_figure(1, len(ROBOTS), size=(3.4, 3.5))
    cosine, sine = np.cos(ALL_ROUND), np.sin(ALL_ROUND)
    for axis, name in zip(figure.axes, ROBOTS, strict=True):
        model = Model(load_robot(name))
        parallel = np.zeros(model.robot.caster_count)
        mass = effective_mass(model, parallel, ALL_ROUND)
        bare = effective_mass(Model(model.robot.without_wheels()), parallel, ALL_ROUND)
        shape = extremes(model, parallel)
        turn = shape.along_greatest
        x, y = shape.greatest * cosine, shape.least * sine
        axis.plot(bare * cosine, bare * sine, "--", color=COLOURS[2], label="without wheels")
        axis.plot(
            x * np.cos(turn) - y * np.sin(turn), x * np.sin(turn) + y * np.cos(turn), ":", color="0.2", label="ellipse"
        )
        axis.plot(mass * cosine, mass * sine, color=COLOURS[0], label="with wheels")
        reach = 1.08 * float(shape.greatest) * np.array([-1.0, 1.0])
        axis.set(title=name, xlabel="along the wheels [kg]", aspect="equal", xlim=reach, ylim=reach)
    figure.axes[0].set_ylabel("across the wheels [kg]")
    legend_below(figure, figure.axes[0], 3, frameon=False)
    caption = (
        "Effective mass of C over all directions of the motion, all wheels parallel to x; dotted the ellipse with the "
        "same half axes. Where the ratio of greatest to least exceeds 2 the curve is dented."
    )
    return Picture("impulse_of_other_robots", "Effective mass over all directions, three robots", caption, figure)
