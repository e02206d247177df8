"""kim2001, III: the determinant (27), and Figs. 2 to 4 drawn and measured."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.design.joint_sets import turned_parallel, turned_towards
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import new_figure
from papers.analysis.action_lines import action_lines, meeting, smallest_singular_value
from papers.line_drawing import LEGEND, draw_lines
from papers.notation import KIM2001, Lengths, in_letters, in_words, kim2001_robot, lengths_of
from papers.page import Check, Difference, Picture, Section
from papers.printed_jacobians import KIM2001_THREE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Configuration: TypeAlias = tuple[tuple[str, ...], tuple[float, ...]]  # driven joints, and steering angles δ [rad]

ROBOT = kim2001_robot(radius=0.22, trail=0.55)  # the paper's figures are drawn without numbers
LENGTHS = lengths_of(ROBOT)
JOINTS_2, JOINTS_3 = in_words("θ_1 θ_2 φ_3"), in_words("θ_1 φ_2 θ_3")  # of Figs. 2 and 3
FOUR_JOINTS = ("θ_1 φ_1 θ_2 θ_3", "θ_1 φ_1 θ_2 φ_3", "θ_1 φ_1 φ_2 θ_3", "θ_1 φ_1 φ_2 φ_3")  # of Fig. 4
ROUNDING = 1e-12  # of determinants of up to some hundred, and of singular values of lines of order 1


def determinant_27(lengths: Lengths, phi: ArrayLike, corrected: bool = False) -> Array:
    """(27): the determinant (...) of (24) at φ (..., 3) [rad], as printed or corrected."""
    p1, p2, p3 = np.moveaxis(np.asarray(phi, dtype=np.float64), -1, 0)
    l, a, b, r, d = lengths  # noqa: E741 - the papers' letters
    first = np.sin(p1 - p2) if corrected else np.sin(p2 - p1)  # E6
    others = l / 2 * np.cos(p1) * np.cos(p3 - p2) + l / 2 * np.cos(p2) * np.cos(p3 - p1)
    value: Array = (first * (d - (a + b) * np.cos(p3)) + others) / (d * r**2)
    return value


def section() -> Section:
    """The determinant (27) and Figs. 2 to 4 of kim2001."""
    phi = np.random.default_rng(3).uniform(-np.pi, np.pi, (1000, 3))
    return Section(
        "Singularities: the determinant (27) and Figs. 2 to 4",
        _TEXT,
        (*_determinant_checks(phi), *_figure_checks()),
        pictures=(
            _picture(2, f"(θ_1, θ_2, φ_3): {_MEET} {LEGEND}", _figure_2()),
            _picture(3, f"(θ_1, φ_2, θ_3), drawn alike: {_MEET}", _figure_3()),
            _picture(4, f"four joints, drawn alike. {_WHEEL_1}", _figure_4()),
        ),
        differences=_differences(phi),
    )


_TEXT = """
The determinant (27) of the joints (θ_1, θ_2, φ_3) is set beside that of the rows that the mechanics give, at random
angles. As printed, the sign of its first term is wrong (E6); corrected, it agrees to rounding. The Jacobian (24) itself
stands in the section on kinematics.

Section III then says where (27) is zero: where the lines through the steering links of casters 1 and 2 and the axle of
caster 3 meet in a point, about which these joints then cannot turn the robot, or are parallel, across which they
cannot move it. So it is, also for the other sets of Figs. 3 and 4. The pictures are made by choosing the point or the
direction and turning each caster until its line is there; their titles give the smallest singular value σ of the rows,
each scaled to a unit line, and the paper's angles. The paper's own figures are drawn without numbers.

What "cannot" means: the motion is left to the robot even if these joints are locked, and no torque at them drives it.
"""
_MEET = "the three lines meet in a point (left), or are parallel (right)."
_WHEEL_1 = (
    "The two lines of caster 1 meet in the centre of its wheel, and the line of each other caster can be turned "
    "through that point, whichever joint is driven."
)


def _determinant_checks(phi: Array) -> tuple[Check, ...]:
    return (
        _zero("(27) as printed, from the determinant of our Jacobian", _off(phi, corrected=False), "E6"),
        _zero("(27) with sin(φ_1 − φ_2), from the same", _off(phi, corrected=True), own=True),
        _zero("(27) so corrected, from 0 where the three lines meet or are parallel", _worst(_on_lines()), own=True),
    )


def _figure_checks() -> tuple[Check, ...]:
    fourth = [f"Fig. 4 {in_letters(in_words(letters))}" for letters in FOUR_JOINTS]
    names = ("Fig. 2 (a)", "Fig. 2 (b)", "Fig. 3 (a)", "Fig. 3 (b)", *fourth)
    return tuple(map(_figure_check, names, (*_figure_2(), *_figure_3(), *_figure_4())))


def _figure_check(name: str, configuration: Configuration) -> Check:
    joints, steering = configuration
    met = meeting(action_lines(ROBOT, steering, joints), Model(ROBOT).characteristic_length)
    felt = _worst(Model(ROBOT).jacobian(steering, joints) @ met.twist)
    motion = "the translation across the lines" if met.parallel else "the turn about the common point"
    value = float(smallest_singular_value(ROBOT, steering, joints))
    remark = f"fastest driven joint in the unit motion drawn: {felt:.0e} rad/s"
    return Check(f"{name}: {motion}", "not possible", f"σ = {value:.0e}", max(value, felt) < ROUNDING, remark)


def _differences(phi: Array) -> tuple[Difference, ...]:
    ours = KIM2001_THREE.from_mechanics(ROBOT, phi)
    printed, corrected = _off(phi, corrected=False), _off(phi, corrected=True)
    of_printed_24 = _worst(determinant_27(LENGTHS, phi) - np.linalg.det(KIM2001_THREE(phi, LENGTHS)))
    identity = _worst(ours @ np.linalg.inv(KIM2001_THREE(phi, LENGTHS, corrected=True)) - np.eye(3))
    return (
        Difference(
            "E6",
            "(27), first term",
            "sin(φ_2 − φ_1){d − (a + b) cos φ_3}",
            "sin(φ_1 − φ_2){d − (a + b) cos φ_3}",
            f"off by up to {printed:.0f} at {len(phi)} random configurations, where the determinant reaches "
            f"{_worst(np.linalg.det(ours)):.0f}; by {corrected:.0e} corrected. It is not the determinant of (24) as "
            f"printed either, off by up to {of_printed_24:.0f}",
            nature="scan, possibly",
        ),
        Difference(
            "E19",
            "(23)",
            "u̇ = [G_a^u] φ̇_a with (24)",
            "φ̇_a = [G_u^a] u̇ with (24), as in (36); then (25) is its inverse",
            f"our map from twist to joint rates times the inverse of (24), corrected, is 1 to {identity:.0e}",
            nature="scan, probably",
        ),
        Difference(
            "E20",
            "section III, procedure, second kind of line",
            "the wheel axis when θ_i is an input",
            "the wheel axis when φ_j is an input; θ_i belongs to the first kind, the line of the steering link",
            f"with axles for φ_j the determinant is {_worst(_on_lines()):.0e} on lines that meet or are parallel",
            nature="scan, probably",
        ),
        Difference(
            "E21",
            "section III, sets of Fig. 4",
            "(θ_1, φ_1, θ_2, θ_3) twice",
            "(θ_1, φ_1, φ_2, θ_3) the second time",
            "the four kinds listed before it have θθ, θφ, φθ and φφ on the other two casters",
            nature="scan, probably",
        ),
    )


def _figure_2() -> list[Configuration]:
    return [
        (JOINTS_2, turned_towards(ROBOT, JOINTS_2, (-0.2, 0.3))),
        (JOINTS_2, turned_parallel(ROBOT, JOINTS_2, np.radians(40.0))),
    ]


def _figure_3() -> list[Configuration]:
    return [
        (JOINTS_3, turned_towards(ROBOT, JOINTS_3, (0.4, 0.3))),
        (JOINTS_3, turned_parallel(ROBOT, JOINTS_3, np.radians(20.0))),
    ]


def _figure_4() -> list[Configuration]:
    first, way = ROBOT.casters[0], np.radians(215.0)
    wheel = (first.x + first.trail * np.cos(way), first.y + first.trail * np.sin(way))
    return [(in_words(letters), turned_towards(ROBOT, in_words(letters), wheel)) for letters in FOUR_JOINTS]


def _picture(number: int, what: str, configurations: Sequence[Configuration]) -> Picture:
    title = f"Lines that meet or are parallel, Fig. {number}"
    return Picture(f"singularity_figure_{number}", title, f"Fig. {number}, {what}", _figure_of(configurations))


def _figure_of(configurations: Sequence[Configuration]) -> "Figure":
    figure = new_figure(len(configurations) // 2, 2, size=(4.4, 4.9))
    for axis, (joints, steering) in zip(figure.axes, configurations, strict=True):
        draw_lines(axis, ROBOT, steering, joints, reach=3.0)
        axis.set(xlabel="x [a]", ylabel="y [a]")
        value = float(smallest_singular_value(ROBOT, steering, joints))
        angles = ", ".join(f"{np.degrees(angle) % 360.0:.0f}°" for angle in KIM2001.steering(steering))
        axis.set_title(f"{in_letters(joints)}: σ = {value:.0e}\nφ = ({angles})", fontsize=10)
    return figure


def _zero(what: str, error: float, remark: str = "", own: bool = False) -> Check:
    return Check(what, "no difference", f"{error:.1e}", error < ROUNDING, remark, own)


def _off(phi: Array, corrected: bool) -> float:
    """How far (27) is from the determinant of the mechanics' Jacobian, at most."""
    ours = np.linalg.det(KIM2001_THREE.from_mechanics(ROBOT, phi))
    return _worst(determinant_27(LENGTHS, phi, corrected) - ours)


def _on_lines() -> Array:
    """(27), corrected, at 100 configurations with the three lines through a point and 100 with parallel lines."""
    rng = np.random.default_rng(4)
    ways = rng.uniform(-np.pi, np.pi, 100)
    points = rng.uniform(3.0, 9.0, (100, 1)) * np.stack([np.cos(ways), np.sin(ways)], axis=-1)
    steering = [turned_towards(ROBOT, JOINTS_2, point) for point in points]
    steering += [turned_parallel(ROBOT, JOINTS_2, way) for way in ways]
    return determinant_27(LENGTHS, KIM2001.steering(steering), corrected=True)


def _worst(values: ArrayLike) -> float:
    return float(np.abs(values).max())
