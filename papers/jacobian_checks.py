"""Printed Jacobians beside the mechanics: verdicts, and a table of which entries are wrong."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.robot import Robot
from papers.notation import lengths_of
from papers.page import Check, Table
from papers.printed_jacobians import Printed

ROUNDING = 1e-12  # [-] of the greatest entry: a few dozen roundings of 1e-16


class Comparison(NamedTuple):
    """A printed matrix beside the mechanics; deviations are shares of the greatest entry."""

    as_printed: float
    corrected: float
    wrong: tuple[tuple[int, int], ...]  # row and column, from 1, of the entries that differ as printed
    by: float  # greatest deviation of an entry, in its own unit

    @property
    def places(self) -> str:
        """The wrong entries in words, whole rows as such; empty if there are none."""
        rows = {row: [column for at, column in self.wrong if at == row] for row, _ in self.wrong}
        return "; ".join(
            f"row {row}" if len(columns) == 3 else f"row {row}, column {', '.join(map(str, columns))}"
            for row, columns in rows.items()
        )


def compare(matrix: Printed, robot: Robot, phi: ArrayLike) -> Comparison:
    """A printed matrix beside the mechanics of a robot at many φ (..., 3). Raises ValueError as `lengths_of`."""
    lengths = lengths_of(robot)
    ours = matrix.from_mechanics(robot, phi)
    greatest = np.abs(ours).max()
    off = np.abs(matrix(phi, lengths) - ours).reshape(-1, *ours.shape[-2:]).max(axis=0)
    mended = np.abs(matrix(phi, lengths, corrected=True) - ours).max()
    wrong = tuple((int(row) + 1, int(column) + 1) for row, column in np.argwhere(off > ROUNDING * greatest))
    return Comparison(float(off.max() / greatest), float(mended / greatest), wrong, float(off.max()))


def check_matrix(matrix: Printed, robot: Robot, phi: ArrayLike) -> Check:
    """The verdict on a printed matrix, whose remark names the wrong entries and the erratum."""
    found = compare(matrix, robot, phi)
    what = f"{matrix.equation}: matrix of ({', '.join(matrix.joints)})"
    if not found.wrong:
        return Check(what, "as printed", f"equal within {found.as_printed:.0e} of its greatest entry", True)
    ours = f"differs in {found.places}, by up to {found.by:.3g}"
    remark = f"{matrix.tag}; corrected it agrees within {found.corrected:.0e} of its greatest entry"
    return Check(what, "as printed", ours, False, remark)


def off_inverse(forward: Printed, inverse: Printed, robot: Robot, phi: ArrayLike, corrected: bool = False) -> float:
    """How far the product of two printed matrices is from the unit matrix, at most, as printed or corrected."""
    lengths = lengths_of(robot)
    product = forward(phi, lengths) @ inverse(phi, lengths, corrected)
    return float(np.abs(product - np.eye(3)).max())


def check_inverse(forward: Printed, inverse: Printed, robot: Robot, phi: ArrayLike) -> Check:
    """The verdict on two printed matrices that are said to be each other's inverse."""
    printed, corrected = (off_inverse(forward, inverse, robot, phi, mended) for mended in (False, True))
    remark = f"{inverse.tag}; corrected, within {corrected:.0e}" if inverse.tag else ""
    what = f"{inverse.equation} is the inverse of {forward.equation}"
    return Check(what, "identity", f"within {printed:.1g}", printed < ROUNDING, remark)


def comparison_table(matrices: Sequence[Printed], robot: Robot, phi: ArrayLike) -> Table:
    """All printed matrices beside ours at many φ (..., 3)."""
    rows = []
    for matrix in matrices:
        found = compare(matrix, robot, phi)
        kind = "forward" if matrix.forward else "inverse"
        rows.append((matrix.equation, kind, found.as_printed, found.corrected, found.places, found.by, matrix.tag))
    return Table(
        "kinematics_matrices",
        f"Printed Jacobians beside ours at {len(np.asarray(phi))} random configurations; deviations as shares of the "
        "greatest entry, and the greatest in the entry's own unit.",
        ("equation", "kind", "as printed", "corrected", "wrong entries", "by up to", "erratum"),
        rows,
    )
