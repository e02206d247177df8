"""Section 2 of chung2008, accelerations: the Hessians (18), (19) and appendix A.1, beside the mechanics."""

from typing import TYPE_CHECKING

import numpy as np

from caster_gym.analysis.frames import turn_planar
from caster_gym.arrays import Array
from caster_gym.report.figures import COLOURS, new_figure
from caster_gym.robot import Robot
from papers.analysis.joint_kinematics import DELTA, ETA, THETA, forward_jacobian
from papers.chung2008.kinematics import Sample
from papers.jacobian_checks import ROUNDING
from papers.notation import CHUNG2008
from papers.page import Check, Difference, Picture, Section, Table
from papers.printed_jacobians import CHUNG2008_FORWARD, CHUNG2008_INVERSE

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LOOP = 0.8  # [rad] of the drawn loops
STYLES = ("-", "--", ":")
STEERING = 150.0  # [°] δ of all casters where they start


def section() -> Section:
    """Accelerations (18), (19), the generalised product (A2) and the claims of appendix A.1 on the Hessian."""
    sample = Sample()
    text = (
        "The Hessian of (18) is the derivative of (12) to (14), whose entries depend on φ alone. So only derivatives "
        "with respect to φ are filled, and the array cannot be symmetric. For the acceleration of C over ground, where "
        "the body frame's own turning counts, all pairs of joints are symmetric but one, θ and η: turning and then "
        "rolling leads elsewhere than rolling and then turning. That is what non-holonomic means, and no frame or "
        "origin removes it.\n\n"
        "In (18) and (19) only the symmetric part matters, so their use in the paper is right. But the linkage with a "
        "slider for θ and a fixed ground, with which the paper compares the robot, is equivalent to first order only, "
        "as it says: the linkage has a symmetric array, and twice the Coriolis acceleration r θ̇ η̇ of the rolling "
        "wheel. In (A2) the subscripts of c are i, k and l; the sentence below it names i, j and k."
    )
    return Section(
        "Accelerations (section 2, appendices A.1 and A.2)",
        text,
        checks=_checks(sample),
        tables=(_table(sample.robot),),
        pictures=(_loop_picture(sample.robot),),
        differences=_differences(sample),
    )


def _checks(sample: Sample) -> tuple[Check, ...]:
    ours = CHUNG2008.forward_hessian(sample.robot, sample.phi)
    off = float(np.abs(_printed_hessian(sample) - ours).max())
    as_printed, mended = _second_order_errors(sample)
    backward = np.einsum("...m,...ijmn,...n->...ij", sample.twist, _printed_inverse_hessian(sample), sample.twist)
    scale = float(np.abs(sample.drifts).max())
    off_inverse = float(np.abs(backward - sample.drifts).max()) / scale
    ground = CHUNG2008.inertial_hessian(sample.robot, sample.phi)
    skew, over_ground = (0.5 * np.abs(h - np.swapaxes(h, -1, -2)) for h in (ours, ground))
    pair = float(over_ground[..., THETA, ETA].max())
    over_ground[..., THETA, ETA] = over_ground[..., ETA, THETA] = 0.0
    rest = float(over_ground.max())
    others = f"at most {rest:.0e} m of other pairs" if rest else "none of other pairs"
    symmetric = 0.5 * (ours + np.swapaxes(ours, -1, -2))
    form_off = float(np.abs(_quadratic(symmetric, sample.rates) - _quadratic(ours, sample.rates)).max())
    linkage, share = _linkage_error(sample)
    return (
        Check("definition below (18): H = ∂G/∂φ of (12)–(14)", "3 × 3 × 3", f"ours within {off:.0e}", off < ROUNDING),
        Check(
            "(18): ü = G φ̇ + φ̇ᵀ H φ̇",
            "φ̇ in the first term",
            f"off by up to {as_printed:.2g}; with φ̈ by {mended:.0e}",
            as_printed < ROUNDING,
            "E11: the first term needs φ̈; the text at hand may have lost a dot",
        ),
        Check(
            "(19): φ̈ = G ü + u̇ᵀ H u̇, with (A2)",
            "H = −Gᵀ (G ∘ H) G",
            f"drifts (K4) of the mechanics within {off_inverse:.0e} of the greatest",
            off_inverse < ROUNDING,
            "with the corrected (16)",
        ),
        Check(
            'A.1: "rotational Hessian matrix is always null in the plane"',
            "0",
            f"{np.abs(ours[..., 2, :, :]).max():.1g}",
            bool((ours[..., 2, :, :] == 0.0).all()),
        ),
        Check(
            'A.1: "Position Hessian matrix is symmetric"',
            "symmetric",
            f"skew up to {skew.max():.3g} m; over ground {pair:.3g} m (r/2) of θ and η, {others}",
            bool(skew.max() < ROUNDING),
            f"E12: its symmetric part would do as well in (18), within {form_off:.0e} m/s²; the "
            f"symmetric array of a linkage with a slider for θ would be wrong by up to {linkage:.2g} m/s², "
            f"{100 * share:.0f} % (rms) of the acceleration at constant joint rates",
        ),
    )


def _table(robot: Robot) -> Table:
    """All entries that are not zero, of the first caster, at φ = 30°."""
    phi = np.radians([30.0, 0.0, 0.0])
    body, ground = CHUNG2008.forward_hessian(robot, phi)[0], CHUNG2008.inertial_hessian(robot, phi)[0]
    letters, planes = ("η", "θ", "φ"), ("v_x", "v_y")
    rows = [
        (planes[k], letters[j], letters[m], float(body[k, j, m]), float(ground[k, j, m]))
        for k in range(2)
        for j in range(3)
        for m in range(3)
        if max(abs(body[k, j, m]), abs(ground[k, j, m])) > ROUNDING
    ]
    return Table(
        "kinematics_hessian",
        "The Hessian of (18) for the first caster at φ = 30°, entries that are not zero: derivative of the column of "
        "one joint with respect to another, of the components in the body frame (as the paper defines it) and of the "
        "velocity over ground. [m]",
        ("plane", "column of", "with respect to", "body frame", "over ground"),
        rows,
    )


def _differences(sample: Sample) -> tuple[Difference, ...]:
    ours = CHUNG2008.forward_hessian(sample.robot, sample.phi)
    skew = 0.5 * float(np.abs(ours - np.swapaxes(ours, -1, -2)).max())
    as_printed, mended = _second_order_errors(sample)
    linkage, share = _linkage_error(sample)
    return (
        Difference(
            "E11",
            "(18), first term",
            "[G] φ̇",
            "[G] φ̈",
            f"a velocity cannot be added to accelerations: off by up to {as_printed:.2g} at |u̇| ≈ 1; with φ̈ the "
            f"equation holds for the joint accelerations of the mechanics within {mended:.0e}",
            nature="scan, probably",
        ),
        Difference(
            "E12",
            "appendix A.1",
            "position Hessian matrix is symmetric",
            "not that of a rolling wheel: over ground the pair (θ, η) has r f⊥ and 0, all other pairs are symmetric",
            f"skew part up to {skew:.3g} m in the body frame and r/2 over ground; the symmetric Hessian of a linkage "
            f"with a slider would be off by up to {linkage:.2g} m/s² at |u̇| ≈ 1, {100 * share:.0f} % (rms)",
        ),
    )


def _second_order_errors(sample: Sample) -> tuple[float, float]:
    """Greatest errors of (18), with φ̇ in its first term as printed and with φ̈; of ü in SI units."""
    jacobian = CHUNG2008.forward_jacobian(sample.robot, sample.phi)
    rest = _quadratic(_printed_hessian(sample), sample.rates) - sample.twist_rate[:, None]
    terms = (np.einsum("...ij,...j->...i", jacobian, joints) for joints in (sample.rates, sample.accelerations))
    as_printed, mended = (float(np.abs(term + rest).max()) for term in terms)
    return as_printed, mended


def _quadratic(hessian: Array, rates: Array) -> Array:
    """φ̇ᵀ H φ̇ (..., 3), plane by plane."""
    form: Array = np.einsum("...j,...kjl,...l->...k", rates, hessian, rates)
    return form


def _printed_hessian(sample: Sample) -> Array:
    """∂G/∂φ (COUNT, 3, 3, 3, 3) of the printed (12) to (14), by a complex step: exact but for rounding."""
    step = 1e-30
    hessian = np.zeros((*sample.phi.shape, 3, 3, 3))
    for i, matrix in enumerate(CHUNG2008_FORWARD):
        hessian[:, i, :, :, DELTA] = matrix(sample.phi + 1j * step, sample.lengths).imag / step
    return hessian


def _printed_inverse_hessian(sample: Sample) -> Array:
    """−Gᵀ (G ∘ H) G, plane by plane, of the printed (15), (16) corrected, (17); the product ∘ is (A2)."""
    g = np.stack([matrix(sample.phi, sample.lengths, corrected=True) for matrix in CHUNG2008_INVERSE], -3)
    planes = np.einsum("...ij,...jkl->...ikl", g, _printed_hessian(sample))  # (A2)
    inverse: Array = -np.swapaxes(g, -1, -2)[..., None, :, :] @ planes @ g[..., None, :, :]
    return inverse


def _linkage_error(sample: Sample) -> tuple[float, float]:
    """Greatest error [m/s²] of C's acceleration if θ were a slider; and its share (rms) of φ̇ᵀ H° φ̇."""
    hessian = CHUNG2008.inertial_hessian(sample.robot, sample.phi)
    linkage = hessian.copy()
    linkage[..., ETA, THETA] = hessian[..., THETA, ETA]
    true = _quadratic(hessian, sample.rates)
    error = _quadratic(linkage, sample.rates) - true
    return float(np.linalg.norm(error, axis=-1).max()), float(np.sqrt((error**2).mean() / (true**2).mean()))


def _loop_picture(robot: Robot) -> Picture:
    figure = _draw_loops(robot)
    gap = np.linalg.norm(_loop(robot, THETA, ETA, LOOP)[-1, :2])
    caption = (
        f"Two joints of the first caster turned forth one after the other by {LOOP} rad, then back in the same order "
        "(the third is at rest). Left: path of C over ground, from the cross to the dot. Rolling and turning do not "
        f"lead back, C is {1000 * gap:.1f} mm off: the pair without symmetry. Steering leads back with either. "
        "Right: the gap over the square of the turn tends to r, the skew entry of the Hessian."
    )
    return Picture("kinematics_loops", "Joints turned forth and back", caption, figure)


def _draw_loops(robot: Robot) -> "Figure":
    figure = new_figure(columns=2, size=(4.8, 3.8))
    paths, gaps = figure.axes
    sizes = np.linspace(0.05, 1.5, 15)
    pairs = (
        (THETA, ETA, "rolling θ, yaw η"),
        (ETA, DELTA, "yaw η, steering φ"),
        (THETA, DELTA, "rolling θ, steering φ"),
    )
    for (first, second, label), colour, style in zip(pairs, (COLOURS[0], COLOURS[2], COLOURS[4]), STYLES, strict=True):
        path = 1000.0 * _loop(robot, first, second, LOOP)
        paths.plot(path[:, 0], path[:, 1], style, color=colour, label=label, linewidth=2.0)
        paths.plot(*path[-1, :2], "o", color=colour, markersize=7, zorder=4)
        ends = [np.linalg.norm(_loop(robot, first, second, size)[-1, :2]) for size in sizes]
        gaps.plot(sizes, 1000.0 * np.array(ends) / sizes**2, style, color=colour, label=label, linewidth=2.0)
    paths.plot(0.0, 0.0, "kx", markersize=9, zorder=5)
    paths.set(xlabel="x of C [mm]", ylabel="y of C [mm]", aspect="equal", title="path of C over ground")
    radius = 1000.0 * robot.casters[0].radius
    gaps.axhline(radius, color="0.4", linewidth=1.0)
    gaps.annotate("r", (sizes[-1], radius), xytext=(0, 4), textcoords="offset points")
    gaps.legend(loc="center left", title="joints turned forth and back")
    gaps.set(xlabel="turn of each joint [rad]", ylabel="gap / turn² [mm/rad²]", title="does the loop close?")
    gaps.set_ylim(-1.0, 1.15 * radius)
    return figure


def _loop(robot: Robot, first: int, second: int, size: float, steps: int = 30) -> Array:
    """Poses (…, 3) of the platform [m, m, rad] while two joints of caster 1 go forth one by one, and back likewise."""
    pose, delta = np.zeros(3), np.radians(STEERING)
    poses = [pose]
    for joint, sign in ((first, 1.0), (second, 1.0), (first, -1.0), (second, -1.0)):
        change = np.zeros(3)
        change[joint] = sign * size / steps
        for _ in range(steps):
            midway = np.full(robot.caster_count, delta + 0.5 * change[DELTA])
            way = forward_jacobian(robot, midway)[0] @ change
            pose = pose + turn_planar(way, np.exp(1j * (pose[2] + 0.5 * way[2])))
            delta += change[DELTA]
            poses.append(pose)
    return np.array(poses)
