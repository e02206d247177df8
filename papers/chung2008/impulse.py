"""Section 4 and Figs. 16 to 19 of chung2008: the impulse of a collision, by the direction of the motion."""

import numpy as np

from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS, legend_below, new_figure
from caster_gym.robot import load_robot
from papers.analysis.impulse_circles import greatest_elongation
from papers.analysis.impulse_shape import Extremes, anisotropy, extremes, impulse, loss_share
from papers.chung2008.impulse_checks import (
    ALL_ROUND,
    CONFIGURATIONS,
    RESTITUTION,
    SPEED,
    differences,
    equation_checks,
    figure_checks,
    size_of,
    steering_of,
)
from papers.page import Picture, Section, Table
from papers.robot_drawing import draw_robot


def section() -> Section:
    """The impulse of section 4 and its four figures."""
    model = Model(load_robot("chung2008"))
    bare = Model(model.robot.without_wheels())
    shapes = {name: extremes(model, steering_of(name)) for name in CONFIGURATIONS}
    return Section(
        title="Impulse of a collision: (53) to (60), Figs. 16 to 19",
        text=_text(model, shapes),
        checks=(*equation_checks(model), *figure_checks(model, bare, shapes)),
        tables=(_table(model, shapes),),
        pictures=(_picture(model, bare),),
        differences=differences(model),
    )


def _text(model: Model, shapes: dict[str, Extremes]) -> str:
    longest, mirrored = shapes["Fig. 16"], shapes["Fig. 18 mirrored"]
    greatest, where = greatest_elongation(model)
    spread = np.degrees(np.abs(np.angle(np.exp(2j * (where - where[0])))).max() / 2.0)
    steering = steering_of("Fig. 16")
    along = float(steering[0])
    heavier = 2.0 * float(np.abs(anisotropy(model, steering)[0])) / 3.0
    mass = model.robot.platform.mass + sum(c.wheel.mass + c.link.mass for c in model.robot.casters)
    spun_up = float(impulse(model, steering, along, RESTITUTION, SPEED)) - mass * (1.0 + RESTITUTION) * SPEED
    grip = model.robot.floor_friction * float(model.wheel_loads(steering).sum())
    kept = loss_share(model, steering_of("Fig. 18 mirrored"), ALL_ROUND, RESTITUTION).min()
    return f"""
The paper lets C run at {SPEED:g} m/s into a frictionless wall, e = {RESTITUTION:g}, and draws the impulse over all
directions of the motion. (60) is its size, with n = (n_x, n_y, 0). That is right for every line of impact through C,
hence anywhere on a round platform, and wrong elsewhere (see the differences). What answers is the effective mass Λ =
1/(nᵀ W n) of C, where W is the block of I*⁻¹ that belongs to the translations.

**Figs. 16 and 17.** All wheels are parallel. Along them the robot has to carry its wheels and spin them up; across
them they only swing about their contact points. Each caster is {heavier:.3f} kg heavier along than across, and so the
impulse is "greater in the moving direction" if that means the direction in which the wheels roll. Nothing is more
elongated: a search over all steering angles ends at a ratio of {_ratio(greatest):.6f} of greatest to least with the
wheels parallel to within {spread:.3f}°, and Figs. 16 and 17 have {float(longest.ratio):.6f}.

**Fig. 18.** The wheels stand across the radii of their pivots, and the robot turned by 120° is the same robot: such
a symmetry about C leaves the impulse no direction to prefer. Three wheels in evenly spaced directions would not be
enough. The mirrored steering (120°, 240°, 0°) has them too, and then the casters' direct part of the inertia is
uniform, but its coupling with the yaw is not: {size_of(mirrored.least)} to {size_of(mirrored.greatest)} N s. So
Fig. 18 also confirms the sense in which the paper counts φ. Other uniform configurations follow in the next part.

**Energy.** In an impact without coupling the wall takes 1 − e² = {1.0 - RESTITUTION**2:.2f} of the kinetic energy.
A coupled robot starts to turn and loses less: down to {kept:.4f} in Fig. 18 mirrored.

**A limit of the model.** The wheels must not slip during the impact. Along the wheels of Fig. 16 the floor has to
give {spun_up:.2f} N s to spin them up, for which friction of {model.robot.floor_friction:g} times the weight needs
{1e3 * spun_up / grip:.0f} ms. In a shorter impact the wheels slip, and the robot strikes as if it were lighter.
"""


def _table(model: Model, shapes: dict[str, Extremes]) -> Table:
    rows: list[tuple[str | float, ...]] = []
    for name, phi in CONFIGURATIONS.items():
        shape, steering = shapes[name], steering_of(name)
        round_ = float(shape.ratio) - 1.0 < 1e-6
        axes = (
            ("any", "any")
            if round_
            else tuple(f"{np.degrees(a):.1f}" for a in (shape.along_least, shape.along_greatest))
        )
        twist = np.stack((-np.cos(ALL_ROUND), -np.sin(ALL_ROUND), 0.0 * ALL_ROUND), -1) * SPEED
        still = np.broadcast_to(steering, (len(ALL_ROUND), 3))
        _, after = model.collide(still, twist, np.zeros_like(twist[:, :2]), -twist[:, :2] / SPEED, RESTITUTION)
        rows.append(
            (
                name,
                ", ".join(f"{angle:g}" for angle in phi),
                size_of(shape.least),
                axes[0],
                size_of(shape.greatest),
                axes[1],
                f"{float(shape.ratio):.4f}",
                f"{np.abs(after[:, 2]).max():.3f}",
            )
        )
    return Table(
        "impulses",
        f"Impulse of C at {SPEED:g} m/s, e = {RESTITUTION:g}, with the axis of the motion in the body frame, and the "
        "greatest yaw rate that an impact leaves.",
        (
            "figure",
            "φ [°]",
            "least [N s]",
            "along [°]",
            "greatest [N s]",
            "along [°] ",
            "greatest/least",
            "yaw rate after [rad/s]",
        ),
        rows,
    )


def _picture(model: Model, bare: Model) -> Picture:
    figure = new_figure(2, len(CONFIGURATIONS), size=(2.9, 2.9))
    above, below = np.array(figure.axes).reshape(2, -1)
    cosine, sine = np.cos(ALL_ROUND), np.sin(ALL_ROUND)
    for robot_axis, axis, (name, phi) in zip(above, below, CONFIGURATIONS.items(), strict=True):
        steering = steering_of(name)
        draw_robot(robot_axis, model.robot, steering)
        robot_axis.set_title(f"{name}\nφ = ({', '.join(f'{angle:g}°' for angle in phi)})", fontsize=10)
        robot_axis.set_xlabel("x [m]")
        for of, colour, style, label in (
            (bare, COLOURS[2], "--", "without wheels"),
            (model, COLOURS[0], "-", "with wheels"),
        ):
            size = impulse(of, steering, ALL_ROUND, RESTITUTION, SPEED)
            axis.plot(size * cosine, size * sine, style, color=colour, label=label)
        shape = extremes(model, steering)
        if shape.ratio > 1.0 + 1e-6:
            reach = (1.0 + RESTITUTION) * SPEED * shape.greatest * np.array([-1.0, 1.0])
            ends = reach * np.cos(shape.along_greatest), reach * np.sin(shape.along_greatest)
            axis.plot(*ends, ":o", color=COLOURS[3], markersize=4, label="greatest")
        axis.set(xlabel="towards +x [N s]", xlim=(-15.0, 15.0), ylim=(-15.0, 15.0), aspect="equal")
    above[0].set_ylabel("y [m]")
    below[0].set_ylabel("towards +y [N s]")
    legend_below(figure, below[0], 3, frameon=False)
    caption = (
        "Figs. 16 to 19 and Fig. 18 mirrored. Above: the steering, in the body frame. Below: the impulse over all "
        "directions of the motion. Of these five it is uniform in Fig. 18 alone; without wheels it always is."
    )
    return Picture("impulse_shapes", "Impulse over all directions, Figs. 16 to 19", caption, figure)


def _ratio(size: float) -> float:
    """Greatest over least of an elongation |ε|."""
    return (1.0 + size) / (1.0 - size)
