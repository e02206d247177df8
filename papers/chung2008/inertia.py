"""chung2008, (34)–(51) and Table 2: what the printed inertia matrices say about the masses that they were made with."""

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.dynamics import caster_inertias
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import Link, Robot, load_robot
from papers.analysis.driven_motion import steady_steering
from papers.notation import CHUNG2008
from papers.page import Check, Difference, Table, check_number

ENTRIES = ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2))
WITH_WHEELS = ("5.4329", "0.0537", "-0.00078", "7.5379", "0.0107", "0.0397")
WITHOUT_WHEELS = ("5", "0", "0", "5", "0", "0.025")
HALF_UNITS = np.array([5e-5, 5e-5, 5e-6, 5e-5, 5e-5, 5e-5])  # of the last printed digits
LAST_DIGITS = 2e-4  # two units of the fourth decimal
LINK_TENSOR = ("8.438", "11.042", "2.604")  # [1e-6 kg m²]
WHEEL_TENSOR = ("0.7813", "1.5625", "0.7813")  # [1e-4 kg m²]
PRINTED_LINK, PRINTED_PLATFORM = "0.025", "0.025"  # [kg]
HEIGHT = 0.045  # [m] of Table 1, column H
BASE = 0.1  # [m] radius b of the platform
RODS = 0.05  # [kg] each of the two that the printed tensor of the link is made of


class Guess(NamedTuple):
    """Numbers of which one robot can be made."""

    platform_mass: float  # [kg]
    link_mass: float  # [kg]
    before_axle: float  # p [m] from the wheel's centre to the link's mass centre
    link_inertia: float = 2.604e-6  # [kg m²]


def guessed(robot: Robot, guess: Guess) -> Robot:
    """The robot with the masses of a guess; the platform is a disc of radius b, as in (50)."""
    casters = tuple(
        caster.model_copy(
            update={
                "link": Link(
                    mass=guess.link_mass, inertia=guess.link_inertia, com=(caster.trail - guess.before_axle, 0.0)
                )
            }
        )
        for caster in robot.casters
    )
    mass = guess.platform_mass
    platform = robot.platform.model_copy(update={"mass": mass, "inertia": 0.5 * mass * BASE**2})
    return robot.model_copy(update={"casters": casters, "platform": platform})


def configuration(robot: Robot) -> Array:
    """δ (N) on the circle of 1 m about the world's origin, body x-axis radial, casters trailing. [rad]"""
    return steady_steering(robot, (0.0, 1.0, 1.0))


def in_units(inertia: Array) -> Array:
    """The six entries (..., 6) of inertia matrices (..., 3, 3) less the printed ones, in half units of their digits."""
    rows, columns = zip(*ENTRIES, strict=True)
    apart: Array = (inertia[..., rows, columns] - np.array([float(word) for word in WITH_WHEELS])) / HALF_UNITS
    return apart


def fitted(robot: Robot) -> tuple[Guess, float]:
    """Link mass and p, and a turn of all casters [rad], of which the six printed entries come out best: least squares.

    The platform keeps its mass, which the matrix without wheels prints.
    """
    from scipy.optimize import least_squares

    steering, trail, mass = configuration(robot), robot.casters[0].trail, robot.platform.mass

    def apart(values: Array) -> Array:
        link, share, turn = values
        return in_units(Model(guessed(robot, Guess(mass, link, share * trail))).inertia(steering + turn))

    link, share, turn = least_squares(apart, (0.05, 0.5, 0.0), x_scale=(0.1, 0.1, 1e-4)).x
    return Guess(mass, float(link), float(share * trail)), float(turn)


def two_rods(d: float, h: float, mass: float) -> Array:
    """Tensor (3) of a rod along x and one upright, each about its own mass centre, added. [kg m²]"""
    flat, upright = mass * d**2 / 12.0, mass * h**2 / 12.0
    return np.array([upright, flat + upright, flat])


def kinetic_coefficients(robot: Robot) -> tuple[float, float, float]:
    """Diagonal (η, θ, φ) of (43), from the velocities (35)–(38) in the kinetic energy (39)–(41)."""
    caster, phi = robot.casters[0], 0.3  # any φ
    axle = np.array([np.sin(phi), np.cos(phi), 0.0])
    before = (caster.trail - caster.link.com[0]) * np.array([-np.cos(phi), np.sin(phi), 0.0])

    def doubled_energy(eta: float, theta: float) -> float:
        centre = theta * np.cross(axle, [0.0, 0.0, caster.radius])  # (35), as (3)–(5) say it
        link = centre + eta * np.cross([0.0, 0.0, 1.0], before)
        moving = caster.wheel.mass * centre @ centre + caster.link.mass * link @ link
        turning = (caster.wheel.yaw_inertia + caster.link.inertia) * eta**2 + caster.wheel.spin_inertia * theta**2
        return float(moving + turning)

    return doubled_energy(1.0, 0.0), doubled_energy(0.0, 1.0), 0.0


def printed_force(robot: Robot, phi: ArrayLike, twist: ArrayLike, twist_rate: ArrayLike) -> Array:
    """The force (3,) of (47)–(51) at the paper's steering angles φ (3,), with P*_φφφ the zero array as printed.

    The platform's own array, which the paper does not print, is m_pl ω × v_c.
    """
    u, u_rate = (np.asarray(value, dtype=np.float64) for value in (twist, twist_rate))
    inertia, mass = np.diag(kinetic_coefficients(robot)), robot.platform.mass
    total, array = np.diag([mass, mass, robot.platform.inertia]), np.zeros((3, 3, 3))
    for g, hessian in zip(CHUNG2008.inverse_jacobian(robot, phi), CHUNG2008.forward_hessian(robot, phi), strict=True):
        referred = g.T @ inertia @ g  # (51)
        total = total + referred  # (48)
        array -= g.T @ np.einsum("ij,jkl->ikl", referred, hessian) @ g  # (49)
    own = mass * u[2] * np.array([-u[1], u[0], 0.0])
    force: Array = total @ u_rate + np.einsum("k,ikl,l->i", u, array, u) + own  # (47)
    return force


def matrix_checks(robot: Robot) -> tuple[Check, ...]:
    """Both printed matrices, entry by entry, and where the rest of the last digits is."""
    steering = configuration(robot)
    bare, full = Model(robot.without_wheels()).inertia(steering), Model(robot).inertia(steering)
    checks = [
        check_number(f"I*_uu without wheels, row {i + 1}, column {k + 1}", word, float(bare[i, k]), 1e-9)
        for (i, k), word in zip(ENTRIES, WITHOUT_WHEELS, strict=True)
    ]
    for (i, k), word, apart in zip(ENTRIES, WITH_WHEELS, in_units(full), strict=True):
        remark = "" if abs(apart) <= 1.0 else f"{abs(apart):.1f} half units of the last digit; see the turn below"
        what = f"I*_uu with wheels, row {i + 1}, column {k + 1}"
        checks.append(check_number(what, word, float(full[i, k]), LAST_DIGITS, remark))
    _, turn = fitted(robot)
    worst = float(np.abs(in_units(Model(robot).inertia(steering + turn))).max())
    checks.append(
        Check(
            "I*_uu with wheels, all casters turned a little further",
            "all six entries to the last digit",
            f"at most {worst:.2f} half units apart, turned by {np.degrees(turn):.4f}°",
            worst <= 1.0,
            "so small a turn is what an integrated angle of the paper may well be off by",
        )
    )
    return tuple(checks)


def formula_checks(robot: Robot) -> tuple[Check, ...]:
    """(43), (50), the tensors of Table 2, and the model (47)–(51) as a whole."""
    caster = robot.casters[0]
    wheel, link, r = caster.wheel, caster.link, caster.radius
    eta, theta, _ = kinetic_coefficients(robot)
    rolling, coupling, yaw = (float(value) for value in caster_inertias(robot_parameters(robot).casters[0]))
    p = caster.trail - link.com[0]
    printed_eta = link.mass * p**2 + wheel.yaw_inertia + link.inertia
    printed_theta = 1.5 * wheel.mass * r**2 + link.mass * r**2
    disc = wheel.mass * r**2 * np.array([0.25, 0.5, 0.25])
    rods = two_rods(caster.trail, HEIGHT, RODS)
    checks = [
        Check(
            f"(43), {name}: as printed, from (35)–(41), and ours [1e-4 kg m²]",
            f"{printed * 1e4:.4f}",
            f"{energy * 1e4:.4f}, {ours * 1e4:.4f}",
            np.allclose([energy, ours], printed, rtol=1e-4, atol=0.0),
            remark,
        )
        for name, printed, energy, ours, remark in (
            ("η", printed_eta, eta, yaw, ""),
            ("θ", printed_theta, theta, rolling, "(3/2) m_1 r² is m_1 r² and the spin inertia of a solid disc"),
        )
    ]
    checks.append(Check("(43), coupling of η and θ", "0", f"{coupling:g}", coupling == 0.0, "no lateral offset"))
    for i, (axis, word) in enumerate(zip("xyz", WHEEL_TENSOR, strict=True)):
        what = f"Table 2, wheel, {axis}: a solid disc of {wheel.mass:g} kg [1e-4 kg m²]"
        checks.append(check_number(what, word, float(disc[i] * 1e4)))
    for i, (axis, word) in enumerate(zip("xyz", LINK_TENSOR, strict=True)):
        what = f"Table 2, link, {axis}: two rods of {RODS:g} kg, d and H long [1e-6 kg m²]"
        checks.append(check_number(what, word, float(rods[i] * 1e6)))
    checks.append(check_number("(50), ½ m_pl b² [kg m²]", "0.025", 0.5 * robot.platform.mass * BASE**2))
    rng, apart, size = np.random.default_rng(0), 0.0, 0.0
    printed_model = Model(robot, "chung2008")
    for phi, u, u_rate in rng.uniform(-1.0, 1.0, (20, 3, 3)) * np.array([[np.pi], [1.0], [1.0]]):
        ours = printed_model.inverse_dynamics(CHUNG2008.steering(phi), u, u_rate)
        apart = max(apart, float(np.abs(printed_force(robot, phi, u, u_rate) - ours).max()))
        size = max(size, float(np.abs(ours).max()))
    checks.append(
        Check(
            'the force (47)–(51), P*_φφφ = 0 as printed: dynamics="chung2008"',
            "equal",
            f"{apart / size:.1e} of the greatest, at 20 random states",
            apart < 1e-12 * size,
            "the exact model has the term of E3 besides",
        )
    )
    return tuple(checks)


def contact_check() -> Check:
    """What a force at the contact point of a rolling wheel works, by (35) and (36)."""
    moved = 0.0
    for phi in np.linspace(-np.pi, np.pi, 25):
        axle = np.array([np.sin(phi), np.cos(phi), 0.0])
        for centre, spin in ((np.cross(axle, [0.0, 0.0, 1.0]), axle), (np.zeros(3), np.array([0.0, 0.0, 1.0]))):
            moved = max(moved, float(np.abs(centre + np.cross(spin, [0.0, 0.0, -1.0])).max()))  # at r = 1
    return Check(
        "(44): a force at the contact point enters the equations",
        "(O_iA_i − r k) × F_ext",
        f"moves by {moved:.1e} r per unit of η̇, θ̇, φ̇: it does no work",
        False,
        "E13: (35) and (36) hold the contact point at rest, so the generalised force of whatever acts there is zero",
    )


def mass_evidence(robot: Robot) -> tuple[Table, tuple[Check, ...], tuple[Difference, ...]]:
    """E1: which masses make the printed matrix come out; the wheel's leading position too."""
    d, steering = robot.casters[0].trail, configuration(robot)
    leading = np.pi + steady_steering(robot, (0.0, -1.0, -1.0))
    compact = float(two_rods(d, HEIGHT, RODS)[2] + 2.0 * RODS * (0.25 * d) ** 2)  # the same L about its mass centre
    best, turn = fitted(robot)
    cases = (
        ("platform 0.025 kg, link 0.025 kg, as Table 2 prints", Guess(0.025, 0.025, d / 3.0), steering),
        ("platform 5 kg, link 0.025 kg", Guess(5.0, 0.025, d / 3.0), steering),
        ("platform 5 kg, link 0.1 kg, p = d/3 (used here)", Guess(5.0, 0.1, d / 3.0), steering),
        ("the same, p = d/4", Guess(5.0, 0.1, d / 4.0), steering),
        ("the same, p = d/2", Guess(5.0, 0.1, d / 2.0), steering),
        ("the same, an L about its own mass centre, p = d/4", Guess(5.0, 0.1, d / 4.0, compact), steering),
        ("platform 5 kg, best fit of link, p and a turn", best, steering + turn),
        ("as used here, casters leading", Guess(5.0, 0.1, d / 3.0), leading),
    )
    rows: list[tuple[str | float, ...]] = []
    for what, guess, angles in cases:
        inertia = Model(guessed(robot, guess)).inertia(angles)
        entries = [f"{inertia[i, k]:.5f}" for i, k in ENTRIES]
        rows.append((what, *entries, float(np.abs(in_units(inertia)).max())))
    columns = ("masses", "xx", "xy", "xz", "yy", "yz", "zz", "worst entry [half units]")
    rows.insert(0, ("printed in the paper", *WITH_WHEELS, 0.0))
    table = Table("masses", "Which masses make the printed matrix come out", columns, rows)
    checks = (
        check_number("Table 2, mass of the platform [kg]", PRINTED_PLATFORM, robot.platform.mass, None, "E1"),
        check_number("Table 2, mass of a link [kg]", PRINTED_LINK, best.link_mass, None, "E1"),
    )
    own = two_rods(d, HEIGHT, RODS) * 1e6
    evidence = (
        f"The printed matrix without wheels is the platform's and begins with {WITHOUT_WHEELS[0]} kg. The six entries "
        f"of the other, fitted by the links' mass, p and a turn of all casters, give {best.link_mass:.4f} kg, "
        f"{best.before_axle / d:.3f} d and {np.degrees(turn):.4f}°. The printed tensor of a link is the sum of two "
        f"rods of {RODS:g} kg, {d:g} m and {HEIGHT:g} m long, each about its own mass centre, "
        f"({own[0]:.3f}, {own[1]:.3f}, {own[2]:.3f})e-6 kg m²: together {2.0 * RODS:g} kg."
    )
    difference = Difference(
        "E1",
        "Table 2",
        "link 0.025 kg, platform 0.025 kg",
        "link 0.1 kg, platform 5 kg; 0.025 is ½ m_pl b² of the platform in kg m²",
        evidence,
    )
    contact = Difference(
        "E13",
        "(44), (52)",
        "forces at the contact of wheel and floor enter as (O_iA_i − r k) × F_ext",
        "they do not enter: the contact point is at rest and a force on it does no work",
        "By (35) and (36) the velocity of the contact point is zero for every η̇, θ̇ and φ̇; see the check of (44).",
    )
    return table, checks, (difference, contact)


def load() -> Robot:
    """The robot of the paper, as corrected."""
    return load_robot("chung2008")
