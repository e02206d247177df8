"""The Jacobians that both papers print, entry by entry as printed, and with the errata E2, E4, E5 and (37) corrected.

Read them beside the paper: s_1, c_1 are sin φ_1, cos φ_1, and l, a, b, r, d are the papers' lengths [m]. Every function
takes φ (..., 3) [rad], which may be complex for derivatives, and `Lengths`.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.arrays import Array
from caster_gym.robot import Robot
from papers.notation import CHUNG2008, KIM2001, Lengths, Notation

Matrix = NDArray[Any]
Rows = tuple[tuple[Any, Any, Any], ...]


class Angles(NamedTuple):
    """Sines and cosines of φ_1, φ_2, φ_3."""

    s1: Any
    c1: Any
    s2: Any
    c2: Any
    s3: Any
    c3: Any


Entries = Callable[[Angles, Lengths], Rows]


class Printed(NamedTuple):
    """A matrix of a paper: between the twist u̇ and the joint rates that `joints` name."""

    equation: str
    notation: Notation
    joints: tuple[str, ...]  # as in η_1, θ_1, φ_1: the rows of an inverse Jacobian, the columns of a forward one
    forward: bool
    entries: Entries  # as printed
    correction: Entries | None = None
    tag: str = ""  # of the erratum

    def __call__(self, phi: ArrayLike, lengths: Lengths, corrected: bool = False) -> Matrix:
        """The matrix (..., rows, 3) at φ (..., 3), as printed or corrected. Raises ValueError for another last axis."""
        phi = np.asarray(phi)
        if phi.ndim == 0 or phi.shape[-1] != 3:
            raise ValueError(f"φ must have a last axis of 3, got shape {phi.shape}")
        turned = [function(phi[..., i]) for i in range(3) for function in (np.sin, np.cos)]
        entries = self.correction if corrected and self.correction is not None else self.entries
        rows = entries(Angles(*turned), lengths)
        flat = np.broadcast_arrays(*(entry for row in rows for entry in row))
        return np.stack(flat, -1).reshape(*phi.shape[:-1], len(rows), 3)

    def from_mechanics(self, robot: Robot, phi: ArrayLike) -> Array:
        """The same matrix from our mechanics, in the paper's letters."""
        letters, numbers = zip(*(joint.split("_") for joint in self.joints), strict=True)
        chosen, casters = ["ηθφ".index(letter) for letter in letters], [int(number) - 1 for number in numbers]
        if self.forward:
            return self.notation.forward_jacobian(robot, phi)[..., casters[0], :, :]
        return self.notation.inverse_jacobian(robot, phi)[..., casters, chosen, :]


def _over_dr(rows: Rows, p: Lengths) -> Rows:
    return tuple((x / (p.d * p.r), y / (p.d * p.r), z / (p.d * p.r)) for x, y, z in rows)


def _chung_12(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    return (-d * t.s1 - a, r * t.c1, -a), (-d * t.c1 + l / 2, -r * t.s1, l / 2), (1.0, 0.0, 1.0)


def _chung_13(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    return (-d * t.s2 - a, r * t.c2, -a), (-d * t.c2 - l / 2, -r * t.s2, -l / 2), (1.0, 0.0, 1.0)


def _chung_14(t: Angles, p: Lengths) -> Rows:
    _, _, b, r, d = p
    return (-d * t.s3 + b, r * t.c3, b), (-d * t.c3, -r * t.s3, 0.0), (1.0, 0.0, 1.0)


def _chung_15(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    eta = (-r * t.s1, -r * t.c1, l / 2 * r * t.c1 - a * r * t.s1)
    theta = (d * t.c1, -d * t.s1, l / 2 * d * t.s1 + a * d * t.c1)
    phi = (r * t.s1, r * t.c1, d * r + a * r * t.s1 - l / 2 * r * t.c1)
    return _over_dr((eta, theta, phi), p)


def _chung_16_below(t: Angles, p: Lengths) -> Rows:
    """The second and third row of (16)."""
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    theta = (d * t.c2, -d * t.s2, -l / 2 * d * t.s2 + a * d * t.c2)
    return theta, (r * t.s2, r * t.c2, d * r + a * r * t.s2 + l / 2 * r * t.c2)


def _chung_16(t: Angles, p: Lengths) -> Rows:
    eta = (-p.r * t.s2, -p.r * t.c2, p.l / 2 * p.r * t.c2 - p.a * p.r * t.s2)
    return _over_dr((eta, *_chung_16_below(t, p)), p)


def _chung_16_corrected(t: Angles, p: Lengths) -> Rows:
    eta = (-p.r * t.s2, -p.r * t.c2, -p.l / 2 * p.r * t.c2 - p.a * p.r * t.s2)  # E2
    return _over_dr((eta, *_chung_16_below(t, p)), p)


def _chung_17(t: Angles, p: Lengths) -> Rows:
    _, _, b, r, d = p
    eta = (-r * t.s3, -r * t.c3, b * r * t.s3)
    theta = (d * t.c3, -d * t.s3, -b * d * t.c3)
    return _over_dr((eta, theta, (r * t.s3, r * t.c3, d * r - b * r * t.s3)), p)


def _kim_11(number: int) -> Entries:
    """(11) at the pivot of a caster."""

    def entries(t: Angles, p: Lengths) -> Rows:
        (x, y), (s, c) = p.pivots[number - 1], t[2 * number - 2 : 2 * number]
        return (-p.d * c + y, p.r * s, y), (p.d * s - x, p.r * c, -x), (1.0, 0.0, 1.0)

    return entries


def _kim_13(number: int) -> Entries:
    """(13) at the pivot of a caster."""

    def entries(t: Angles, p: Lengths) -> Rows:
        (x, y), (s, c), r, d = p.pivots[number - 1], t[2 * number - 2 : 2 * number], p.r, p.d
        eta = (-r * c, r * s, r * x * s + r * y * c)
        theta = (d * s, d * c, d * x * c - d * y * s)
        return _over_dr((eta, theta, (r * c, -r * s, d * r - r * x * s - r * y * c)), p)

    return entries


def _kim_15(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    return (-d * t.c1 - a, r * t.s1, -a), (d * t.s1 + l / 2, r * t.c1, l / 2), (1.0, 0.0, 1.0)


def _kim_16(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    return (-d * t.c2 - a, r * t.s2, -a), (d * t.s2 - l / 2, r * t.c2, -l / 2), (1.0, 0.0, 1.0)


def _kim_17(t: Angles, p: Lengths) -> Rows:
    _, _, b, r, d = p
    return (-d * t.c3 + b, r * t.s3, b), (d * t.s3, r * t.c3, 0.0), (1.0, 0.0, 1.0)


def _kim_20(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    eta = (-r * t.c1, r * t.s1, -l * r / 2 * t.s1 - a * r * t.c1)
    theta = (d * t.s1, d * t.c1, -d * l / 2 * t.c1 + a * d * t.s1)
    return _over_dr((eta, theta, (r * t.c1, -r * t.s1, d * r + l * r / 2 * t.s1 + a * r * t.c1)), p)


def _kim_21(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    eta = (-r * t.c2, r * t.s2, l * r / 2 * t.s2 - a * r * t.c2)
    theta = (d * t.s2, d * t.c2, d * l / 2 * t.c2 + a * d * t.s2)
    return _over_dr((eta, theta, (r * t.c2, -r * t.s2, d * r - l * r / 2 * t.s2 + a * r * t.c2)), p)


def _kim_22_below(t: Angles, p: Lengths) -> Rows:
    """The second and third row of (22)."""
    _, _, b, r, d = p
    return (d * t.s3, d * t.c3, -b * d * t.s3), (r * t.c3, -r * t.s3, d * r - b * r * t.c3)


def _kim_22(t: Angles, p: Lengths) -> Rows:
    return _over_dr(((-p.r * t.c3, p.r * t.s3, -p.b * p.r * t.c3), *_kim_22_below(t, p)), p)


def _kim_22_corrected(t: Angles, p: Lengths) -> Rows:
    return _over_dr(((-p.r * t.c3, p.r * t.s3, p.b * p.r * t.c3), *_kim_22_below(t, p)), p)  # E4


def _kim_24_above(t: Angles, p: Lengths) -> Rows:
    """The first and second row of (24)."""
    l, a, _, _, d = p  # noqa: E741 - the papers' letters
    first = (d * t.s1, d * t.c1, -d * l / 2 * t.c1 + a * d * t.s1)
    return first, (d * t.s2, d * t.c2, d * l / 2 * t.c2 + a * d * t.s2)


def _kim_24(t: Angles, p: Lengths) -> Rows:
    third = (p.r * t.c3, -p.r * t.s3, p.d * p.r - p.d * p.r * t.c3)
    return _over_dr((*_kim_24_above(t, p), third), p)


def _kim_24_corrected(t: Angles, p: Lengths) -> Rows:
    third = (p.r * t.c3, -p.r * t.s3, p.d * p.r - p.b * p.r * t.c3)  # E5
    return _over_dr((*_kim_24_above(t, p), third), p)


def _kim_37(t: Angles, p: Lengths) -> Rows:
    l, a, _, r, d = p  # noqa: E741 - the papers' letters
    rows = (
        (-r * t.c1, r * t.s1, -l * r / 2 * t.s1 - a * r * t.c1),
        (d * t.s1, d * t.c1, -d * l / 2 * t.c1 + a * d * t.s1),
        (-r * t.c2, r * t.s2, l * r / 2 * t.s2 - a * r * t.c2),
        (d * t.s2, d * t.c2, d * l / 2 * t.c2 + a * d * t.s2),
    )
    return _over_dr(rows, p)


def _kim_37_corrected(t: Angles, p: Lengths) -> Rows:
    """The second and third row of (20) and of (21), which is what the text says."""
    return _kim_20(t, p)[1:] + _kim_21(t, p)[1:]


def _chain(number: int) -> tuple[str, ...]:
    return f"η_{number}", f"θ_{number}", f"φ_{number}"


CHUNG2008_FORWARD = (
    Printed("(12)", CHUNG2008, _chain(1), True, _chung_12),
    Printed("(13)", CHUNG2008, _chain(2), True, _chung_13),
    Printed("(14)", CHUNG2008, _chain(3), True, _chung_14),
)
CHUNG2008_INVERSE = (
    Printed("(15)", CHUNG2008, _chain(1), False, _chung_15),
    Printed("(16)", CHUNG2008, _chain(2), False, _chung_16, _chung_16_corrected, "E2"),
    Printed("(17)", CHUNG2008, _chain(3), False, _chung_17),
)
KIM2001_FORWARD = (
    Printed("(15)", KIM2001, _chain(1), True, _kim_15),
    Printed("(16)", KIM2001, _chain(2), True, _kim_16),
    Printed("(17)", KIM2001, _chain(3), True, _kim_17),
)
KIM2001_INVERSE = (
    Printed("(20)", KIM2001, _chain(1), False, _kim_20),
    Printed("(21)", KIM2001, _chain(2), False, _kim_21),
    Printed("(22)", KIM2001, _chain(3), False, _kim_22, _kim_22_corrected, "E4"),
)
KIM2001_GENERAL = (
    *(Printed(f"(11), pivot {i}", KIM2001, _chain(i), True, _kim_11(i)) for i in (1, 2, 3)),
    *(Printed(f"(13), pivot {i}", KIM2001, _chain(i), False, _kim_13(i)) for i in (1, 2, 3)),
)
KIM2001_THREE = Printed("(24)", KIM2001, ("θ_1", "θ_2", "φ_3"), False, _kim_24, _kim_24_corrected, "E5")
KIM2001_FOUR = Printed("(37)", KIM2001, ("θ_1", "φ_1", "θ_2", "φ_2"), False, _kim_37, _kim_37_corrected, "E18")
