"""What chung2008 says of the impulse of a collision, checked, and where we differ."""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import Robot
from papers.analysis.impulse_shape import (
    Extremes,
    effective_mass,
    ellipse_gap,
    elongation,
    extremes,
)
from papers.notation import CHUNG2008
from papers.page import Check, Difference

CONFIGURATIONS = {
    "Fig. 16": (0.0, 0.0, 0.0),
    "Fig. 17": (45.0, 45.0, 45.0),
    "Fig. 18": (240.0, 120.0, 0.0),
    "Fig. 19": (60.0, 135.0, 315.0),
    "Fig. 18 mirrored": (120.0, 240.0, 0.0),
}  # φ of the paper [°]; the last is ours
RESTITUTION, SPEED = 0.8, 1.0  # [-], [m/s]
ROUNDING = 1e-9  # what double precision surely leaves of an identity between quantities of the order of 1
ALL_ROUND = np.linspace(0.0, 2.0 * np.pi, 721)  # directions, one every half degree [rad]


def steering_of(name: str) -> Array:
    """δ (3,) [rad] of a figure."""
    return CHUNG2008.steering(np.radians(CONFIGURATIONS[name]))


def with_unrounded_pivots(robot: Robot) -> Robot:
    """The robot whose pivots form an equilateral triangle exactly: l/2 = √3 b/2, which Table 1 rounds to 0.0865 m."""
    half = 0.5 * np.sqrt(3.0) * robot.casters[2].y
    casters = tuple(c.model_copy(update={"x": float(np.sign(c.x) * half)}) for c in robot.casters)
    return robot.model_copy(update={"casters": casters})


def size_of(mass: float | Array) -> str:
    """Impulse [N s] of an effective mass."""
    return f"{(1.0 + RESTITUTION) * SPEED * float(mass):.2f}"


def printed_impulse(
    model: Model, steering: ArrayLike, twist: ArrayLike, normal: ArrayLike, restitution: float
) -> Array:
    """(60) letter by letter: −(1 + e) u̇ᵀn / (nᵀ I*⁻¹ n), n = (n_x, n_y, 0). [N s]"""
    n = np.concatenate((normal, np.zeros_like(np.asarray(normal)[..., :1])), -1)
    yielding = np.linalg.solve(model.inertia(steering), n[..., None])[..., 0]
    return np.asarray(-(1.0 + restitution) * np.vecdot(twist, n) / np.vecdot(n, yielding))


def equation_checks(model: Model) -> list[Check]:
    """(53) to (60), and the energy, over random steering, motion and walls."""
    rng = np.random.default_rng(4)
    steering, twist = rng.uniform(-np.pi, np.pi, (1000, 3)), rng.uniform(-1.0, 1.0, (1000, 3))
    angle = rng.uniform(-np.pi, np.pi, 1000)
    normal = np.stack((np.cos(angle), np.sin(angle)), -1)
    twist[np.vecdot(twist[:, :2], normal) > 0.0] *= -1.0  # towards the wall
    jump, after = model.collide(steering, twist, np.zeros((1000, 2)), normal, RESTITUTION)
    size = jump[:, 0]
    pushed = np.concatenate((normal * size[:, None], np.zeros((1000, 1))), -1)
    speed = np.vecdot(twist[:, :2], normal)
    rebound = np.abs(np.vecdot(after[:, :2] - twist[:, :2], normal) + (1.0 + RESTITUTION) * speed).max()
    momentum = np.abs(np.matvec(model.inertia(steering), after - twist) - pushed).max()
    formula = np.abs(printed_impulse(model, steering, twist, normal, RESTITUTION) - size).max()
    lost = model.kinetic_energy(steering, twist) - model.kinetic_energy(steering, after)
    mass = np.array([effective_mass(model, *impact) for impact in zip(steering, angle, strict=True)])
    energy = np.abs(lost - 0.5 * (1.0 - RESTITUTION**2) * speed**2 * mass).max()
    rows = (
        ("the contact leaves at e times the speed of its approach", "(53)", rebound, "m/s", False),
        ("momentum: inertia times jump of the twist is the impulse", "(56), (57), (59)", momentum, "N s", False),
        ("size of the impulse at C", "(60)", formula, "N s", False),
        ("loss of kinetic energy is (1 − e²) v_n² Λ / 2", "(C2)", energy, "J", True),
    )
    elsewhere, right = _off_centre(model)
    return [
        *(
            Check(
                what, printed, f"off by {error:.1e} {unit} at most", bool(error < ROUNDING), "1000 random impacts", own
            )
            for what, printed, error, unit, own in rows
        ),
        Check(
            "size of the impulse at a contact beside C",
            "(60)",
            f"Fig. 16 at (0.1 m, 0): {right:.2f} N s; (60) gives {elsewhere:.2f}",
            False,
            "E16: right if the line of impact passes C, or if n is a vector of three with its arm about C",
        ),
    ]


def figure_checks(model: Model, bare: Model, shapes: dict[str, Extremes]) -> list[Check]:
    everywhere = np.random.default_rng(5).uniform(-np.pi, np.pi, (1000, 3))
    bare_most = float(np.abs(elongation(bare, everywhere)).max())
    unrounded = Model(with_unrounded_pivots(model.robot))
    rest = float(shapes["Fig. 18"].ratio) - 1.0
    exact = float(extremes(unrounded, steering_of("Fig. 18")).ratio) - 1.0
    to_radius = np.exp(1j * (steering_of("Fig. 18") - _polar_angles(unrounded.robot)))
    turned = float(np.abs(to_radius - to_radius[0]).max())
    mirrored, longest = shapes["Fig. 18 mirrored"], shapes["Fig. 16"]
    light = float(extremes(bare, steering_of("Fig. 16")).greatest)
    checks = [
        Check(
            "without wheel dynamics",
            '"always generates a circular shape"',
            f"|ε| at most {bare_most:.0e} at 1000 random steering angles",
            bare_most < ROUNDING,
            "always, as the platform's mass centre is C; a robot with another has no circle even so",
        )
    ]
    for name in ("Fig. 16", "Fig. 17"):
        shape, phi = shapes[name], CONFIGURATIONS[name]
        rolling = float(CHUNG2008.steering(np.radians(phi[0])))
        off = abs(np.degrees(np.angle(np.exp(2j * (shape.along_greatest - rolling))))) / 2.0
        checks.append(
            Check(
                f"{name}: where the impulse is greatest",
                '"greater in the moving direction"',
                f"{size_of(shape.greatest)} N s, {off:.1f}° off the rolling direction; {size_of(shape.least)} across",
                bool(off < 1e-6 and shape.ratio > 1.1),
                "the moving direction taken for the rolling direction of the three parallel wheels",
            )
        )
    return [
        *checks,
        Check(
            "Fig. 18: uniform",
            '"a uniform ellipsoid"',
            f"greatest over least impulse is 1 + {rest:.1e}",
            rest < 1e-6,
            f"what is left comes from rounding l/2 = {unrounded.robot.casters[1].x:.6f} m to 0.0865 m; with the "
            f"unrounded length it is {_one_and(exact)}",
        ),
        Check(
            "Fig. 18: why it is uniform",
            '"the wheel dynamics contributes … symmetrically"',
            f"turned by 120° the robot is the same, to {turned:.0e} rad; with the mirrored steering it is not, and the "
            f"impulse is {size_of(mirrored.least)} to {size_of(mirrored.greatest)} N s",
            bool(turned < ROUNDING and mirrored.ratio > 1.01),
            "symmetry about C; three wheels in evenly spaced directions would not do",
        ),
        Check(
            "the shape of the curve",
            '"ellipse"',
            f"in Fig. 16 up to {100 * _gap(model, 'Fig. 16'):.3f} % outside the ellipse with its half axes",
            False,
            "E17: 1/(nᵀ W n) is no ellipse; 1/√(nᵀ W n) would be one",
        ),
        Check(
            "wheel dynamics matters to the impact",
            '"significantly"',
            f"{size_of(longest.least)} to {size_of(longest.greatest)} N s in Fig. 16, {size_of(light)} N s without it",
            bool(longest.greatest > 1.1 * light),
            "more than a tenth taken as significant",
        ),
    ]


def differences(model: Model) -> tuple[Difference, ...]:
    """Where the section's equations and words differ from what holds."""
    ratio = extremes(model, steering_of("Fig. 16")).ratio
    printed, right = _off_centre(model)
    return (
        Difference(
            "E17",
            "section 5, Figs. 16 to 19",
            "the impulse over all directions is an ellipse",
            "1/(nᵀ W n) is not the radius of an ellipse, 1/√(nᵀ W n) would be; with ρ = greatest/least it bulges over "
            "the ellipse with its half axes by (ρ + 1)/(2√ρ) − 1, and is dented for ρ > 2",
            f"Fig. 16, measured every half degree: {100 * _gap(model, 'Fig. 16'):.3f} % outside; by the formula "
            f"{100 * float(ellipse_gap(ratio)):.3f} %",
        ),
        Difference(
            "E16",
            "(57) to (60)",
            "the impulse acts along the surface normal n in the space of u̇, called the velocity of the contact point",
            "true if n is a vector of three, (C1): n = (n_x, n_y, P_x n_y − P_y n_x) at a point P; with a plain normal "
            "only if the line of impact passes C. The paper does not tell which n it means",
            f"Fig. 16, wall with n = (0, 1) met at P = (0.1 m, 0): {right:.2f} N s; by (60) {printed:.2f} N s",
            nature="reading",
        ),
    )


def _off_centre(model: Model) -> tuple[float, float]:
    """Impulse of Fig. 16 against a wall met at (0.1 m, 0): (60) with a plain normal, and as it is. [N s]"""
    normal, twist, steering = np.array([0.0, 1.0]), np.array([0.0, -SPEED, 0.0]), steering_of("Fig. 16")
    jump, _ = model.collide(steering, twist, [0.1, 0.0], normal, RESTITUTION)
    return float(printed_impulse(model, steering, twist, normal, RESTITUTION)), float(jump[0])


def _polar_angles(robot: Robot) -> Array:
    """Of the pivots, seen from C. [rad]"""
    return np.array([np.arctan2(caster.y, caster.x) for caster in robot.casters])


def _one_and(excess: float) -> str:
    return "1 to the last digit" if abs(excess) < 1e-14 else f"1 + {excess:.0e}"


def _gap(model: Model, name: str) -> float:
    """By what share the impulse of a figure exceeds the ellipse with its half axes, measured direction by direction."""
    shape, steering = extremes(model, steering_of(name)), steering_of(name)
    from_axis = ALL_ROUND - shape.along_greatest
    radius = 1.0 / np.hypot(np.cos(from_axis) / shape.greatest, np.sin(from_axis) / shape.least)
    return float((effective_mass(model, steering, ALL_ROUND) / radius).max() - 1.0)
