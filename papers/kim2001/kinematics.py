"""Section II of kim2001, and (37): Jacobians as printed, beside the mechanics; and what φ is in both papers."""

from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.report.figures import COLOURS, new_figure
from papers.jacobian_checks import (
    ROUNDING,
    check_inverse,
    check_matrix,
    compare,
    comparison_table,
    off_inverse,
)
from papers.notation import CHUNG2008, KIM2001, Lengths, Notation, kim2001_robot, lengths_of
from papers.page import Check, Difference, Picture, Section, check_number
from papers.printed_jacobians import (
    KIM2001_FORWARD,
    KIM2001_FOUR,
    KIM2001_GENERAL,
    KIM2001_INVERSE,
    KIM2001_THREE,
    Printed,
)
from papers.robot_drawing import draw_robot

if TYPE_CHECKING:
    from matplotlib.axes import Axes

COUNT = 1000  # random configurations
RADIUS, TRAIL = 0.3, 0.7  # [a] of the compared robot: neither equal nor equal to another length
GRID = 5.0  # [°] of Table 2's averages
ALL = (*KIM2001_GENERAL, *KIM2001_FORWARD, *KIM2001_INVERSE, KIM2001_THREE, KIM2001_FOUR)

_Z = np.array([0.0, 0.0, 1.0])


class Cell(NamedTuple):
    """A cell of Table 2."""

    steering: float  # φ̇_max/θ̇_max [-]
    yaw: float  # ω_max/v_max [1/a], see E8
    r: float  # [a]
    d: float  # [a]
    printed: str


CELLS = (
    Cell(0.1, 0.5, 0.1, 0.9, "0.526"),
    Cell(0.5, 1.0, 0.1, 0.2, "0.401"),
    Cell(1.0, 0.1, 7.9, 10.0, "0.453"),
    Cell(10.0, 0.1, 10.0, 1.0, "0.178"),
)


class Sample:
    """Random angles and twists of a robot of the paper's geometry."""

    def __init__(self) -> None:
        rng = np.random.default_rng(2001)
        self.robot = kim2001_robot(RADIUS, TRAIL)
        self.lengths = lengths_of(self.robot)
        self.phi = rng.uniform(-np.pi, np.pi, (COUNT, 3))
        self.twist = rng.uniform(-1.0, 1.0, (COUNT, 3))
        rates = Model(self.robot).rates(KIM2001.steering(self.phi), self.twist)
        self.rates = np.stack(rates, -1) @ KIM2001.rates  # (COUNT, N, 3): η̇, θ̇, φ̇


def section() -> Section:
    """The vector equations (2) to (9), the Jacobians (11) to (24) and (37), and the determinant −d r."""
    sample = Sample()
    four = compare(KIM2001_FOUR, sample.robot, sample.phi)
    text = (
        "The paper writes each wheel as a chain of three joints, η, θ and φ, inverts its Jacobian and picks the rows "
        f"of the driven joints. The printed matrices are set beside ours, translated by φ = π/2 − δ, at {COUNT} "
        f"random configurations of a robot with r = {RADIUS} a and d = {TRAIL} a. The paper introduces φ as the "
        "relative angular velocity between the steering link and the body's x-axis; by (6) it is an angle that counts "
        "clockwise from the y-axis to the link as it points from wheel to pivot. chung2008 counts it clockwise from "
        "the negative x-axis.\n\n"
        "Three matrices are wrong as printed: one sign in (22), one letter in (24), and two whole rows of (37). The "
        "text of section V asks for the rows of θ₁, φ₁, θ₂, φ₂; printed are those of η₁, θ₁, η₂, θ₂, and η is passive. "
        "The index of Table 2 comes out of the rows that the text asks for, so the paper computed with these: a slip "
        "in print only. (19) prints the same matrix on both sides, and (26) likewise: nothing to compare."
    )
    return Section(
        "Kinematics (section II)",
        text,
        checks=(*_vector_checks(sample), *_matrix_checks(sample), *_table_2_checks()),
        tables=(comparison_table(ALL, sample.robot, sample.phi),),
        pictures=(_convention_picture(),),
        differences=_differences(sample, four.places),
    )


def _vector_checks(sample: Sample) -> tuple[Check, ...]:
    by_vectors = _velocity_of_body(sample.lengths, sample.phi, sample.rates)
    off = float(np.abs(by_vectors - sample.twist[:, None]).max())
    matrices = np.stack([matrix(sample.phi, sample.lengths) for matrix in KIM2001_GENERAL[:3]], -3)
    same = float(np.abs(by_vectors - np.einsum("...ijk,...ik->...ij", matrices, sample.rates)).max())
    return (
        Check("(2) to (7), the vector equations", "the twist", f"ours within {off:.0e}", off < ROUNDING),
        Check("(10), (11) rewrite them", "the same", f"within {same:.0e}", same < ROUNDING),
    )


def _matrix_checks(sample: Sample) -> tuple[Check, ...]:
    checks = [check_matrix(matrix, sample.robot, sample.phi) for matrix in ALL]
    pairs = (*zip(KIM2001_GENERAL[:3], KIM2001_GENERAL[3:], strict=True), *_pairs())
    for forward, inverse in pairs:
        checks.append(check_inverse(forward, inverse, sample.robot, sample.phi))
    determinants = [np.linalg.det(matrix(sample.phi, sample.lengths)) for matrix in KIM2001_FORWARD]
    off = float(np.abs(np.stack(determinants) + sample.lengths.d * sample.lengths.r).max())
    ours = f"−d r within {off:.0e} a²; + d r in chung2008, whose θ̇ has the opposite sign"
    checks.append(Check("determinants of (15), (16), (17)", "−d r", ours, off < ROUNDING))
    rows = [KIM2001_INVERSE[i](sample.phi, sample.lengths)[:, row] for i, row in ((0, 1), (1, 1), (2, 2))]
    gap = np.abs(np.stack(rows, -2) - KIM2001_THREE(sample.phi, sample.lengths)).max(axis=(0, 2))
    found = f"rows 1 and 2 within {gap[:2].max():.0e}, row 3 is off by up to {gap[2]:.2g}"
    what = '(24): "the second equation from (20) and from (21), and the third equation from (22)"'
    checks.append(Check(what, "these rows", found, bool((gap < ROUNDING).all()), "E5: the paper contradicts itself"))
    return tuple(checks)


def _table_2_checks() -> tuple[Check, ...]:
    """Cells of Table 2, whose digits tell the rows of (37) as printed from those of the text."""
    return tuple(
        check_number(
            f"Table 2, φ̇/θ̇ = {cell.steering:g}, ω/v = {cell.yaw:g} at r = {cell.r:g}, d = {cell.d:g}, "
            "by rows θ₁, φ₁, θ₂, φ₂",
            cell.printed,
            global_index(cell, corrected=True),
            remark=f"by the rows of (37) as printed {global_index(cell, corrected=False):.4f}",
        )._replace(own=True)  # the section on four joints has the numbers themselves
        for cell in CELLS
    )


def global_index(cell: Cell, corrected: bool) -> float:
    """Mean σ_min/σ_max of the normalised (37) over a grid of φ_1 and φ_2, corrected or with the rows as printed.

    As printed, the rows that should be those of φ are normalised as such, although they are those of η.
    """
    angles = np.radians(np.arange(0.0, 360.0, GRID))
    phi = np.stack(np.meshgrid(angles, angles, [0.0], indexing="ij"), -1).reshape(-1, 3)
    matrix = KIM2001_FOUR(phi, lengths_of(kim2001_robot(cell.r, cell.d)), corrected)
    greatest = np.tile((1.0, cell.steering) if corrected else (cell.steering, 1.0), 2)
    values = np.linalg.svd(matrix / greatest[:, None] * [1.0, 1.0, cell.yaw], compute_uv=False)
    return float((values[:, -1] / values[:, 0]).mean())


def _differences(sample: Sample, rows_of_37: str) -> tuple[Difference, ...]:
    third = compare(KIM2001_INVERSE[2], sample.robot, sample.phi)
    printed = KIM2001_INVERSE[2](sample.phi, sample.lengths)
    broken = float(np.abs(printed[:, 0] + printed[:, 2] - [0.0, 0.0, 1.0]).max())
    mended = off_inverse(KIM2001_FORWARD[2], KIM2001_INVERSE[2], sample.robot, sample.phi, corrected=True)
    three = compare(KIM2001_THREE, sample.robot, sample.phi)
    four = KIM2001_FOUR(sample.phi, sample.lengths)
    passive = KIM2001.inverse_jacobian(sample.robot, sample.phi)[:, :2, :2].reshape(COUNT, 4, 3)
    is_eta = float(np.abs(four - passive).max())
    cells = "; ".join(
        f"{cell.printed} printed, {global_index(cell, True):.4f} by φ, {global_index(cell, False):.4f} by η"
        for cell in CELLS
    )
    return (
        Difference(
            KIM2001_INVERSE[2].tag,
            "(22), row 1, column 3",
            "−b r cos φ₃",
            "b r cos φ₃",
            f"as printed η̇₃ is off by up to {third.by:.3g} per unit of ω, and the rows break η̇ + φ̇ = ω by as much "
            f"({broken:.3g}); corrected it is the inverse of (17) within {mended:.0e}",
            "scan, possibly",
        ),
        Difference(
            KIM2001_THREE.tag,
            "(24), row 3, column 3",
            "d r − d r cos φ₃",
            "d r − b r cos φ₃",
            f"the text takes the third row of (22), where b stands; as printed φ̇₃ is off by up to {three.by:.3g} per "
            "unit of ω",
            "scan, possibly",
        ),
        Difference(
            KIM2001_FOUR.tag,
            "(37), rows",
            "rows of η₁, θ₁, η₂, θ₂",
            "rows of θ₁, φ₁, θ₂, φ₂, as the text above (36) says: the second and third of (20) and (21)",
            f"the printed rows are those of η and θ within {is_eta:.0e}; beside the joints of the text they differ in "
            f"{rows_of_37}. Cells of Table 2: {cells}",
        ),
    )


def _velocity_of_body(p: Lengths, phi: Array, rates: Array) -> Array:
    """u̇ (COUNT, 3, 3) from each caster's rates by the vector equations (2) to (7), as printed."""
    found = []
    for i, (x, y) in enumerate(p.pivots):
        s, c, zero = np.sin(phi[:, i]), np.cos(phi[:, i]), np.zeros(len(phi))
        eta, theta, steer = (rates[:, i, j, None] for j in range(3))
        omega = eta + steer  # (3)
        axle = np.stack((-c, s, zero), -1)  # (5)
        wheel = theta * np.cross(axle, p.r * _Z)  # (4)
        arm = np.stack((p.d * s, p.d * c, zero), -1)  # (6)
        leg = -np.array([x, y, 0.0])  # (7)
        velocity = wheel + eta * np.cross(_Z, arm) + omega * np.cross(_Z, leg)  # (2)
        found.append(np.concatenate((velocity[:, :2], omega), -1))
    return np.stack(found, -2)


def _pairs() -> tuple[tuple[Printed, Printed], ...]:
    return tuple(zip(KIM2001_FORWARD, KIM2001_INVERSE, strict=True))


def _convention_picture() -> Picture:
    delta = 0.6
    figure = new_figure(columns=3, size=(3.6, 3.9))
    ours = Notation("here: δ", straight=0.0, rolling=1.0)
    for axis, notation in zip(figure.axes, (ours, CHUNG2008, KIM2001), strict=True):
        _draw_convention(axis, notation, delta)
    phi = ", ".join(f"{np.degrees(n.steering(delta)):.1f}° in {n.name}" for n in (CHUNG2008, KIM2001))
    caption = (
        f"One robot, every caster at the steering angle δ = {np.degrees(delta):.1f}°: φ is {phi}. The arc leads from "
        "the dashed line, where the angle is zero, to the black arrow, which points from wheel to pivot. θ̇ > 0 moves "
        "the wheel along the blue arrow: as the black one here and in kim2001, against it in chung2008. In both papers "
        "φ counts clockwise, in the opposite sense to δ."
    )
    return Picture("kinematics_conventions", "How three notations count angles", caption, figure)


def _draw_convention(axis: "Axes", notation: Notation, delta: float) -> None:
    """The robot with the angle of its third caster in a notation; δ itself if its `straight` is zero."""
    draw_robot(axis, kim2001_robot(radius=0.35, trail=0.8), [delta] * 3)
    pivot, f = np.array([0.0, 2.0]), _along(delta)
    wheel, angle = pivot - 0.8 * f, "φ" if notation.straight else "δ"
    sweep = np.linspace(notation.straight, delta, 60)
    axis.plot(*np.array([pivot, pivot + 1.9 * _along(notation.straight)]).T, "--", color="0.4", linewidth=1.2)
    axis.plot(*(pivot[:, None] + 1.1 * _along(sweep[:-4])), color=COLOURS[3], linewidth=2.0)
    _draw_arrow(axis, pivot + 1.1 * _along(sweep[-6]), pivot + 1.1 * _along(sweep[-1]), COLOURS[3])
    _draw_arrow(axis, pivot, pivot + 1.9 * f, "black")
    _draw_arrow(axis, wheel, wheel + 0.9 * notation.rolling * f, COLOURS[0])
    for letter, place, colour in (
        (angle, pivot + 1.45 * _along(float(sweep.mean())), COLOURS[3]),
        ("θ̇", wheel + 0.9 * notation.rolling * f + 0.35 * _along(delta - 0.5 * np.pi), COLOURS[0]),
    ):
        axis.text(float(place[0]), float(place[1]), letter, color=colour, ha="center", va="center", fontsize=13)
    axis.set(xlabel="x [a]", ylabel="y [a]", title=notation.name, xlim=(-2.8, 2.8), ylim=(-2.2, 4.1))


def _draw_arrow(axis: "Axes", start: Array, end: Array, colour: str) -> None:
    tail, head = (float(start[0]), float(start[1])), (float(end[0]), float(end[1]))
    shape = {"arrowstyle": "-|>", "linewidth": 1.8, "color": colour, "shrinkA": 0.0, "shrinkB": 0.0}
    axis.annotate("", head, tail, arrowprops=shape, zorder=6)


def _along(angle: float | Array) -> Array:
    """Unit vector, first axis x and y."""
    return np.array([np.cos(angle), np.sin(angle)])
