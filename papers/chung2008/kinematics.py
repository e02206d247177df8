"""Section 2 of chung2008, velocities: mobility and Jacobians as printed, beside the mechanics."""

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.design.joint_sets import JointSet
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.caster import link_mass_centre, rate_drifts, wheel_centre
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import load_robot
from papers.analysis import mobility
from papers.analysis.joint_kinematics import DELTA, ETA, THETA, forward_jacobian
from papers.analysis.joint_sets import classify_all, proved_brackets, rounded_down
from papers.jacobian_checks import (
    ROUNDING,
    check_inverse,
    check_matrix,
    compare,
    comparison_table,
    off_inverse,
)
from papers.notation import CHUNG2008, Lengths, in_letters, lengths_of
from papers.page import Check, Difference, Section
from papers.printed_jacobians import CHUNG2008_FORWARD, CHUNG2008_INVERSE

COUNT = 1000  # random configurations
ALL = (*CHUNG2008_FORWARD, *CHUNG2008_INVERSE)
MORE_THAN = 4  # motors that the robot "must use … to avoid singularity"

_K = np.array([0.0, 0.0, 1.0])


class Sample:
    """Random steering, twists and twist rates of the paper's robot, and what its joints do."""

    def __init__(self) -> None:
        rng = np.random.default_rng(2008)
        self.robot = load_robot("chung2008")
        self.lengths = lengths_of(self.robot)
        self.phi = rng.uniform(-np.pi, np.pi, (COUNT, 3))
        self.steering = CHUNG2008.steering(self.phi)
        self.twist, self.twist_rate = rng.uniform(-1.0, 1.0, (2, COUNT, 3))
        self.our_rates = np.stack(Model(self.robot).rates(self.steering, self.twist), -1)  # (COUNT, N, 3)
        self.rates = self.our_rates @ CHUNG2008.rates
        drifts = np.stack([np.stack(drift, -1) for drift in self._drifts()], -2) @ CHUNG2008.rates
        self.drifts = drifts
        self.accelerations = (
            np.einsum("...ijk,...k->...ij", CHUNG2008.inverse_jacobian(self.robot, self.phi), self.twist_rate) + drifts
        )

    def _drifts(self) -> list[tuple[Array, Array, Array]]:
        v = (self.twist[:, 0], self.twist[:, 1], self.twist[:, 2])
        return [
            rate_drifts(v, (np.cos(delta), np.sin(delta)), caster)
            for delta, caster in zip(self.steering.T, robot_parameters(self.robot).casters, strict=True)
        ]


def section() -> Section:
    """Mobility (1), velocities (3) to (8) and (35) to (38), Jacobians (12) to (17)."""
    sample = Sample()
    sets = classify_all(sample.robot)
    text = (
        "The paper counts the freedoms of the robot and writes each wheel as a chain from the ground to the platform. "
        "The printed matrices are set beside ours, translated by φ = π − δ and by the sign of θ̇, at "
        f"{COUNT} random configurations. One entry of (16) has a wrong sign: as printed, its first and third row do "
        "not add up to η̇ + φ̇ = ω.\n\n"
        "The rank of the loop closure shows that the three freedoms of Grübler's formula exist as motions at every "
        "configuration, since the determinant of each chain is d r. The paper's \"unless it is in singular "
        'configuration" never applies to the robot itself: singular can only be a choice of driven joints. How many '
        "motors the choice needs, the introduction says in one sentence twice: more than four, and two on two of the "
        "three wheels, which are four; kim2001 and our own search through all sets have the second."
    )
    return Section(
        "Kinematics (section 2)",
        text,
        checks=(_motor_check(sets), *_mobility_checks(sample), *_jacobian_checks(sample), *_body_checks(sample)),
        tables=(comparison_table(ALL, sample.robot, sample.phi),),
        differences=(_difference(sample), _motor_difference(sample, sets)),
    )


def _motor_check(sets: tuple[JointSet, ...]) -> Check:
    enough = _fewest(sets)
    return Check(
        "introduction, on Campion et al.: motors that three casters need to avoid singularity",
        "more than four",
        f"{len(enough[0].joints)}: " + ", ".join(in_letters(one.joints) for one in enough),
        len(enough[0].joints) > MORE_THAN,
        'E27: its own "two motors on two of the three wheels" are four',
    )


def _motor_difference(sample: Sample, sets: tuple[JointSet, ...]) -> Difference:
    enough = _fewest(sets)
    bounds = [bracket.lower for bracket in proved_brackets(sample.robot, enough).values()]
    every = [s.singular for s in sets if len(s.joints) == MORE_THAN + 1]
    return Difference(
        "E27",
        "introduction, on Campion et al. [1]",
        "must use more than four motors to avoid singularity",
        "four are enough, two on each of two wheels, as the same sentence goes on and kim2001, III says",
        f"of all {len(sets)} sets of joints the smallest without singularity have {len(enough[0].joints)}: "
        f"{', '.join(in_letters(s.joints) for s in enough)}, smallest singular value of unit lines at least "
        f"{rounded_down(min(bounds))} everywhere (L7); {every.count('never')} of {len(every)} sets of five have none "
        "either",
    )


def _fewest(sets: tuple[JointSet, ...]) -> list[JointSet]:
    """The smallest sets that are never singular."""
    never = [one for one in sets if one.singular == "never"]
    return [one for one in never if len(one.joints) == min(len(each.joints) for each in never)]


def _mobility_checks(sample: Sample) -> tuple[Check, ...]:
    counts = {mobility.counted_mobility(n) for n in range(2, 9)}
    found = mobility.mobility(sample.robot, sample.steering)
    ranks = np.linalg.matrix_rank(CHUNG2008.inverse_jacobian(sample.robot, sample.phi).reshape(COUNT, 9, 3))
    ours = f"{mobility.counted_mobility(3)}; for 2 to 8 casters {_span(np.array(list(counts)))}"
    determinant = np.linalg.det(forward_jacobian(sample.robot, sample.steering)) / (sample.lengths.d * sample.lengths.r)
    off = float(np.abs(determinant - 1.0).max())
    return (
        Check("(1): mobility by Grübler's formula", "3", ours, counts == {3}),
        Check(
            "mobility seen at the velocities of a configuration",
            "3, unless singular",
            f"{_span(found)} at {COUNT} configurations",
            bool((found == 3).all()),
            "no configuration is singular for the robot itself",
        ),
        Check(
            "independent among the nine joint variables of (15)–(17)",
            "3",
            _span(ranks),
            bool((ranks == 3).all()),
            "with the corrected (16)",
        ),
        Check(
            "section 3.3: (15)–(17) are singular only if d or r is zero",
            "not singular",
            f"det of each chain = d r within {off:.0e}",
            off < ROUNDING,
        ),
    )


def _jacobian_checks(sample: Sample) -> tuple[Check, ...]:
    checks = [check_matrix(matrix, sample.robot, sample.phi) for matrix in ALL]
    for forward, inverse in zip(CHUNG2008_FORWARD, CHUNG2008_INVERSE, strict=True):
        checks.append(check_inverse(forward, inverse, sample.robot, sample.phi))
    by_vectors = _velocity_of_c(sample.lengths, sample.phi, sample.rates)
    matrices = np.stack([matrix(sample.phi, sample.lengths) for matrix in CHUNG2008_FORWARD], -3)
    off = float(np.abs(by_vectors - np.einsum("...ijk,...ik->...ij", matrices, sample.rates)).max())
    checks.append(Check("(3)–(11), the vector equations", "give (12)–(14)", f"within {off:.0e}", off < ROUNDING))
    return tuple(checks)


def _body_checks(sample: Sample) -> tuple[Check, ...]:
    """(35) to (38) beside the motion of points of wheel and link."""
    wheel_off = link_off = slip = yaw = 0.0
    p = sample.robot.casters[0].trail - sample.robot.casters[0].link.com[0]
    for i, caster in enumerate(robot_parameters(sample.robot).casters):
        s, c = np.sin(sample.phi[:, i]), np.cos(sample.phi[:, i])
        eta, theta = sample.rates[:, i, ETA, None], sample.rates[:, i, THETA, None]
        f = np.stack((-c, s, 0.0 * c), -1)  # of the paper: from O to A
        axle = np.stack((s, c, 0.0 * c), -1)
        v_wheel = caster.radius * np.stack((c, -s, 0.0 * c), -1) * theta  # (35) of the paper
        spin = eta * _K + theta * axle  # (36)
        v_link = v_wheel + eta * np.cross(_K, p * f)  # (37)
        direction = (np.cos(sample.steering[:, i]), np.sin(sample.steering[:, i]))
        for point, printed in ((wheel_centre, v_wheel), (link_mass_centre, v_link)):
            off = float(np.abs(_velocity_of_link_point(sample, i, point(direction, caster)) - printed).max())
            wheel_off, link_off = (off, link_off) if point is wheel_centre else (wheel_off, off)
        slip = max(slip, float(np.abs(v_wheel + np.cross(spin, -caster.radius * _K)).max()))
        yaw = max(yaw, float(np.abs(sample.twist[:, 2] + sample.our_rates[:, i, DELTA] - eta[:, 0]).max()))
    return tuple(
        Check(what, printed, f"{ours} within {off:.0e}", off < ROUNDING)
        for what, printed, ours, off in (
            ("(35): velocity of a wheel's centre", "r θ̇ (cos φ i − sin φ j)", "as the link carries it", wheel_off),
            ("(36): angular velocity of a wheel", "η̇ k + θ̇ (sin φ i + cos φ j)", "contact at rest", slip),
            ("(37): velocity of a link's mass centre", "v_O + η̇ k × …", "as the link carries it", link_off),
            ("(38): angular velocity of a link", "η̇ k", "ω + δ̇", yaw),
        )
    )


def _difference(sample: Sample) -> Difference:
    inverse = CHUNG2008_INVERSE[1]
    found = compare(inverse, sample.robot, sample.phi)
    printed = inverse(sample.phi, sample.lengths)
    broken = float(np.abs(printed[..., 0, :] + printed[..., 2, :] - [0.0, 0.0, 1.0]).max())
    corrected = off_inverse(CHUNG2008_FORWARD[1], inverse, sample.robot, sample.phi, corrected=True)
    return Difference(
        inverse.tag,
        "(16), row 1, column 3",
        "+ (l/2) r cos φ₂",
        "− (l/2) r cos φ₂",
        f"as printed η̇₂ is off by up to {found.by:.3g} rad/s per rad/s of ω, and the rows break η̇ + φ̇ = ω by as much "
        f"({broken:.3g}); corrected it is the inverse of (13) within {corrected:.0e}",
        "scan, possibly",
    )


def _velocity_of_c(p: Lengths, phi: Array, rates: Array) -> Array:
    """u̇ (COUNT, 3, 3) from each caster's rates by the vector equations (3) to (11), as printed."""
    legs = ((0.5 * p.l, p.a, 0.0), (-0.5 * p.l, p.a, 0.0), (0.0, -p.b, 0.0))  # from A_i to C
    found = []
    for i, leg in enumerate(legs):
        s, c, zero = np.sin(phi[:, i]), np.cos(phi[:, i]), np.zeros(len(phi))
        eta, theta, steer = (rates[:, i, j, None] for j in range(3))
        wheel = theta * np.cross(np.stack((s, c, zero), -1), p.r * _K)  # (3) to (5)
        omega = eta + steer  # (9) to (11)
        arm = np.cross(_K, np.stack((-p.d * c, p.d * s, zero), -1))
        velocity = wheel + eta * arm + omega * np.cross(_K, leg)  # (6) to (8)
        found.append(np.concatenate((velocity[:, :2], omega), -1))
    return np.stack(found, -2)


def _velocity_of_link_point(sample: Sample, number: int, point: tuple[Array, Array]) -> Array:
    """Velocity (COUNT, 3) over ground, in B, of a point (in B) that a caster's steering link carries."""
    caster = sample.robot.casters[number]
    omega, yaw = sample.twist[:, 2], sample.our_rates[:, number, ETA]
    pivot = sample.twist[:, :2] + omega[:, None] * np.array([-caster.y, caster.x])
    x, y = point[0] - caster.x, point[1] - caster.y
    return np.stack((pivot[:, 0] - yaw * y, pivot[:, 1] + yaw * x, 0.0 * yaw), -1)


def _span(values: ArrayLike) -> str:
    low, high = np.min(values), np.max(values)
    return f"{low}" if low == high else f"{low} … {high}"
