"""What chung2008 prints of the natural orthogonal complement, (20) to (30) and (A3) to (A10), beside ours."""

import numpy as np
from numpy.typing import ArrayLike, NDArray

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.robot import load_robot
from papers.analysis.action_lines import action_lines
from papers.analysis.joint_kinematics import forward_jacobian
from papers.analysis.orthogonal_complement import OrthogonalComplement
from papers.chung2008.complement_runs import DISTANCES, PERIOD, Approach, relative
from papers.notation import CHUNG2008, Lengths, in_words, lengths_of
from papers.page import Check, Difference
from papers.printed_jacobians import CHUNG2008_FORWARD

PAPER_SET = in_words("θ_1 θ_2 φ_3")  # (A9)
LIMIT = 100.0  # of the condition number, over which the independent joints are changed
FREQUENT = 0.2  # [1/s] changes from which on we call them frequent
ROUNDING = 1e-9  # relative: what J_p with a condition number up to LIMIT loses of double precision, with a margin


def printed_loops(phi: ArrayLike, lengths: Lengths) -> tuple[Array, Array]:
    """J_p (6, 6) and J_a (6, 3) of (A7), their columns from (12) to (14), of steering angles φ (3,) [rad]."""
    g = np.array([np.transpose(matrix(phi, lengths)) for matrix in CHUNG2008_FORWARD])  # [chain, column]
    (g_11, g_12, g_13), (g_21, g_22, g_23), (g_31, g_32, g_33) = g
    o = np.zeros(3)
    j_p = np.block([[g_11, g_11], [g_13, g_13], [-g_21, o], [-g_23, o], [o, -g_31], [o, -g_32]])
    j_a = np.block([[-g_12, -g_12], [g_22, o], [o, g_33]])
    return j_p.T, j_a.T


def constraints(complements: tuple[OrthogonalComplement, ...], paper: OrthogonalComplement) -> tuple[Check, ...]:
    """(20), (22), (A7), (A9)."""
    shapes = {one.loops(np.zeros(3))[0].shape for one in complements}
    four = OrthogonalComplement(load_robot("tidybot2"), PAPER_SET).loops(np.zeros(4))[0].shape
    square = all(rows == columns for rows, columns in (*shapes, four))
    letters = {"yaw": "η", "roll": "θ", "steer": "φ"}
    order = " ".join(f"{letters[kind]}_{number}" for kind, number in (joint.split("_") for joint in paper.dependent))
    signs = dict(zip(("yaw", "roll", "steer"), np.diag(CHUNG2008.rates), strict=True))
    lengths = lengths_of(paper.robot)
    apart = 0.0
    for steering in np.random.default_rng(3).uniform(-np.pi, np.pi, (100, 3)):
        for ours, theirs, joints in zip(
            paper.loops(steering),
            printed_loops(CHUNG2008.steering(steering), lengths),
            (paper.dependent, paper.independent),
            strict=True,
        ):
            turned = ours * [signs[joint.split("_")[0]] for joint in joints]
            apart = max(apart, float(np.abs(turned - theirs).max()))
    sizes = ", ".join(f"{rows}×{columns}" for rows, columns in (*shapes, four))
    printed = "η_1 φ_1 η_2 φ_2 η_3 θ_3"
    return (
        Check(
            "(20): the shape of J_p",
            "always a square matrix",
            sizes,
            square,
            "every three joints; three and four casters",
        ),
        Check("(A9): order of the dependent rates", printed, order, order == printed),
        Check(
            "(A7) with (12) to (14): J_p and J_a, largest difference [m]",
            "0",
            f"{apart:.1e}",
            apart < 1e-12,
            "no sign is wrong",
        ),
    )


def singularities(complements: tuple[OrthogonalComplement, ...], near: Approach) -> tuple[Check, ...]:
    """(21) and the statements after (30) and (52)."""
    robot = complements[0].robot
    steering = np.random.default_rng(4).uniform(-np.pi, np.pi, (200, 3))
    product = np.prod([caster.trail * caster.radius for caster in robot.casters])
    law = 0.0
    for one in complements:
        arms = [
            getattr(robot.casters[int(number) - 1], {"roll": "radius", "steer": "trail"}[kind])
            for kind, number in (joint.split("_") for joint in one.independent)
        ]
        by_lines = product / np.prod(arms) * np.abs(np.linalg.det(action_lines(robot, steering, one.independent)))
        by_loops = np.abs(np.linalg.det(one.loops(steering)[0]))
        law = max(law, float(np.abs(by_loops - by_lines).max() / np.max(by_lines)))
    forward = np.abs(np.linalg.det(forward_jacobian(robot, steering)))
    expected = np.array([caster.trail * caster.radius for caster in robot.casters])
    chain = float(np.abs(forward / expected - 1.0).max())
    meeting = float(np.abs(near.line_determinants).max())
    close = near.errors[:, DISTANCES < 1e-10]
    return (
        Check(
            "after (30): singular when the three lines meet at a point or at infinity",
            "if",
            f"|det J_p| is the lines' determinant times a constant, to {law:.0e}",
            law < 1e-10 and meeting < 1e-10,
            f"and only then: at {len(near.line_determinants)} singular configurations the lines' determinant is at "
            f"most {meeting:.0e} m",
        ),
        Check(
            "after (30): the kinematic singularity propagates to dynamics",
            "yes",
            f"no digit of the twist rate is right within 1e-10 rad in {100.0 * np.mean(close == 1.0):.0f} % of cases",
            bool(np.median(close) == 1.0),
        ),
        Check(
            "after (52): (15) to (17) are not singular unless d or r is zero",
            "yes",
            f"|det| of (12) to (14) is d r, to {chain:.0e}; condition number of the inertia at most "
            f"{near.inertia_numbers.max():.2g}",
            chain < 1e-10,
        ),
    )


def agreement(complements: tuple[OrthogonalComplement, ...]) -> tuple[tuple[Check, ...], Difference]:
    """Both formulations of the paper at random configurations, twists of size 1, and torques."""
    model = complements[0].model
    rng = np.random.default_rng(2)
    steering, twist, torque = (rng.normal(size=(400, last)) for last in (3, 3, 6))
    steering, twist, torque = np.pi * steering, twist / np.linalg.norm(twist, axis=-1, keepdims=True), 0.1 * torque
    numbers = np.stack([one.condition_number(steering) for one in complements], -1)
    ours = np.stack([one.forward_dynamics(steering, twist, torque) for one in complements], -2)
    sound = numbers <= LIMIT
    exact = float(relative(ours, model.forward_dynamics(steering, twist, torque)[:, None])[sound].max())
    printed_model = Model(model.robot, dynamics="chung2008")
    best = np.take_along_axis(ours, numbers.argmin(-1)[:, None, None], 1)[:, 0]
    apart = best - printed_model.forward_dynamics(steering, twist, torque)
    unit = np.array([1.0, 1.0, 1.0 / model.characteristic_length])
    lacking = np.linalg.norm(np.einsum("nij,nj->ni", model.inertia(steering), apart) * unit, axis=-1)
    share = lacking / np.linalg.norm(model.bias(steering, twist) * unit, axis=-1)
    low, middle, high = np.quantile(share, (0.1, 0.5, 0.9))
    found = f"{100.0 * middle:.1f} % of the Coriolis and centrifugal force ({100.0 * low:.1f} to {100.0 * high:.1f} %)"
    checks = (
        Check(
            "(27) gives the dynamics, by every three joints",
            "yes",
            f"relative difference to the operational-space model at most {exact:.0e}",
            exact < ROUNDING,
            f"{np.count_nonzero(sound)} cases with condition numbers up to {LIMIT:g}",
        ),
        Check(
            "(27) and (47) are two ways to the same model: force by which they differ",
            "0",
            found,
            bool(high < ROUNDING),
            "E3: (47) with the printed P* = 0; with (D1) they agree to rounding",
        ),
    )
    return checks, Difference(
        "E3",
        "(27) and after (43)",
        "P*_φφφ becomes a zero array",
        "off-axis term (D1)",
        f"the paper's own complement (27), with true twists, agrees with (D1) to {exact:.0e} and differs from the "
        f"printed model by {found}, median and middle 80 % of {len(share)} random motions with vx² + vy² + ω² = 1 "
        "in SI units; the size of a force is the root of F_x² + F_y² + (M_z/L)², with L the root mean square "
        "distance of the pivots from C",
    )


def frequency(numbers: Array, chosen: NDArray[np.int64]) -> Check:
    """The remedy named after (30): condition numbers (T, sets) along a path, and which of them are in use."""
    changes = int(np.count_nonzero(np.diff(chosen)))
    alone, changing = numbers.max(axis=0).min(), numbers[np.arange(len(chosen)), chosen].max()
    return Check(
        "after (30): the independent coordinates need to be updated frequently",
        "yes",
        f"{changes} changes in {PERIOD:g} s of driving",
        bool(alone > LIMIT) and changes >= FREQUENT * PERIOD,
        f"frequently: {FREQUENT * PERIOD:g} times or more; the condition number of every single set passes "
        f"{alone:.2g}, of changing sets it stays below {changing:.3g}",
    )
