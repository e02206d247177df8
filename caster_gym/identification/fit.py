"""Estimates of a robot's numbers from a recording by maximum likelihood, with intervals, and what stays undetermined.

Measured quantities carry independent normal errors, of one standard deviation for each kind of quantity; torques are
taken as they stand in the recording. Windows of the recording are predicted by the simulator, initial states estimated
with the unknowns. See `caster_gym.identification.shooting` and `caster_gym.identification.window_fit`.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.identification.friction_allowance import Allowance, allow_for_friction
from caster_gym.identification.friction_shape import JOINTS, Shapes
from caster_gym.identification.mends import listed
from caster_gym.identification.noise_levels import LEAST_NOISE, Agreement, Levels, agreements_of
from caster_gym.identification.recording import Noise, Recording
from caster_gym.identification.recording_check import check_recording
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.unknowns import (
    CONFIDENCE,
    SIGNED,
    WINDOW,
    Unknown,
    check_alike,
    check_names,
    each_named,
    kind_of,
    robot_with,
    unknowns,
)
from caster_gym.identification.window_fit import Fit, fit
from caster_gym.mechanics.parameters import Dynamics
from caster_gym.robot import Robot

_CLOSE = 100.0  # squared distance to the optimum, in standard deviations, from which the last part of a fit goes on
_SHORT = 0.25  # [-] of a window, for a first fit that far starting values do not lead astray
_ENTANGLED = 0.98  # [-] correlation from which two estimates are said to be entangled
_SURE_GAIN = 3.0  # logarithm of a ratio of likelihoods; chance alone gives it in some 3 of 100 recordings
_SMALL_FRICTION = 1e-4  # [-] of a motor's greatest torque: a departure so small is that of time steps
_OF_FRICTION = ("roll_viscous", "roll_coulomb", "steer_viscous", "steer_coulomb", "scrub")  # rest on its law
_PART = 0.1  # [-] share of a direction from which an unknown takes part in it


@dataclass(frozen=True)
class Identification:
    """The result of a fit. Arrays are in the order of `unknowns`."""

    robot: Robot  # with the estimates
    unknowns: tuple[Unknown, ...]
    estimates: Array  # (P,)
    deviations: Array  # (P,) standard deviations; infinite where an unknown is not determined
    half_widths: Array  # (P,) of the intervals
    correlations: Array  # (P, P); NaN where an unknown is not determined
    confidence: float
    agreements: tuple[Agreement, ...]
    untold: tuple[str, ...]  # sentences: what the recording cannot tell
    warnings: tuple[str, ...]  # sentences: what the intervals do not cover
    doubted: tuple[str, ...]  # names of unknowns whose intervals the warnings call into question
    notes: tuple[str, ...]  # sentences: small contradictions, and what is told apart only just
    shooting: Shooting
    before: Array  # (W, S, observed) predicted with the starting values, from the same initial states
    after: Array  # (W, S, observed) predicted with the estimates
    steps: int

    @property
    def is_told(self) -> NDArray[np.bool_]:
        """Which unknowns the recording determines."""
        return np.isfinite(self.deviations)


def identify(
    robot: Robot,
    recording: Recording,
    names: Sequence[str],
    starts: Mapping[str, float] | None = None,
    bounds: Mapping[str, tuple[float, float]] | None = None,
    noise: Noise | None = None,
    window: float = WINDOW,
    confidence: float = CONFIDENCE,
    dynamics: Dynamics = "exact",
    report: Callable[[], None] = lambda: None,
    check: bool = True,
) -> Identification:
    """The named unknowns of a robot, from a recording of it.

    starts: values that differ from the robot file's, also of a payload that is known and not an unknown. noise:
    standard deviations that are known; the others are estimated. window [s]. report is called before each step.
    check: whether to look first for columns that contradict each other, see
    `caster_gym.identification.recording_check`.
    Raises ValueError for names that are not known, a recording of another number of casters, a window that is not
    positive and a confidence that does not lie between 0 and 1.
    """
    starts = dict(starts or {})
    _quantile(confidence)  # refused now and not after the fit
    if not window > 0.0:
        raise ValueError(f"the window must be positive, got {window:g} s")
    lasts = recording.time_step * (len(recording.pose) - 1)
    if window > max(lasts, WINDOW):
        raise ValueError(f"the window must be at most {lasts:g} s, as the recording lasts, got {window:g} s")
    names = each_named(robot, names)
    check_names([*starts, *(bounds or {})], robot)
    chosen = unknowns(robot, names, starts, bounds)
    check_alike(robot, [*names, *starts])
    if recording.steering.shape[1] != robot.caster_count:
        raise ValueError(
            f"the recording has {recording.steering.shape[1]} steering angles, but robot {robot.name!r} has "
            f"{robot.caster_count} casters"
        )
    notes = check_recording(recording, robot, names, starts) if check else ()
    scales = np.array([one.scale for one in chosen])
    limits = np.array([one.bounds for one in chosen], dtype=np.float64)
    first = np.array([one.start for one in chosen])
    levels = Levels(recording, noise or Noise())
    short, shooting = (Shooting(robot, recording, names, starts, share * window, dynamics) for share in (_SHORT, 1.0))
    rough = fit(short, short.first_guess(first), first, scales, limits, levels.at_first, levels.update, np.inf, report)
    nearer = short.starts_on(shooting, rough.point.path)
    found = fit(shooting, nearer, rough.point.values, scales, limits, rough.sigma, levels.update, _CLOSE, report)
    shapes = Shapes(robot)
    allowed = allow_for_friction(shooting, shapes, found, scales, limits, levels.update, levels.kinds, report)
    reached, untold = allowed.point.values, found.told.untold
    # what is not told goes back to where it started, which the recording does not notice
    values = reached + scales * (untold @ (untold.T @ ((first - reached) / scales)))
    agreements = agreements_of(allowed, shooting, levels, first)
    deviations, half_widths, correlations = _spread(found, allowed, scales, agreements, confidence)
    friction, doubted = _friction_words(allowed, shapes, shooting, names)
    if not all(one.explained for one in agreements):
        doubted = list(names)
    return Identification(
        robot=robot_with(robot, {**starts, **dict(zip(names, map(float, values), strict=True))}),
        unknowns=chosen,
        estimates=values,
        deviations=deviations,
        half_widths=half_widths,
        correlations=correlations,
        confidence=confidence,
        agreements=agreements,
        untold=tuple(_untold_words(found.told.untold, chosen)),
        warnings=(*_warning_words(found, allowed, chosen, agreements, half_widths), *friction),
        doubted=tuple(doubted),
        notes=(*notes, *_entangled_words(correlations, chosen)),
        shooting=shooting,
        before=shooting.at_samples(shooting.predict(allowed.point.starts, first), first),
        after=shooting.measured + allowed.point.errors,
        steps=rough.steps + found.steps + allowed.looks,
    )


def _spread(
    found: Fit, allowed: Allowance, scales: Array, agreements: Sequence[Agreement], confidence: float
) -> tuple[Array, Array, Array]:
    """Standard deviations, half widths of intervals and correlations of the estimates.

    Where noise does not explain the errors, these count instead of it. Errors that vary slowly are worth fewer samples:
    if the ratio of their variance to that between successive samples is r = 1 / (1 − ρ), as if each kept the share ρ of
    the one before, (1 + ρ) / (1 − ρ) = 2 r − 1 times fewer. How far apart the windows would have the estimates counts
    too, if it is more, and the intervals are then Student's for as many windows.
    """
    covariance = allowed.covariance
    unexplained = [one for one in agreements if not one.explained]
    ratios = [(one.left / max(one.noise, LEAST_NOISE)) ** 2 for one in unexplained]
    slow = max((r if one.given else 2.0 * r - 1.0 for one, r in zip(unexplained, ratios, strict=True)), default=1.0)
    variances, width = np.diag(covariance) * max(slow, 1.0), _quantile(confidence)
    if unexplained:
        pulls = allowed.spread @ allowed.normal.gradients.T
        windows = pulls.shape[1]
        variances = np.maximum(variances, (pulls**2).sum(axis=1) * windows / max(windows - 1, 1))
        width = _quantile(confidence, max(windows - 1, 1))
    known = ((found.told.untold**2).sum(axis=1) < _PART**2) & ~found.at_bounds
    deviations = np.where(known, scales * np.sqrt(variances), np.inf)
    own = np.sqrt(np.where(known, np.diag(covariance), np.nan))
    return deviations, deviations * width, covariance / np.outer(own, own)


def _quantile(confidence: float, freedom: int | None = None) -> float:
    """Half width of an interval in standard deviations: a normal quantile, or Student's of some freedom."""
    from scipy.special import ndtri, stdtrit  # scipy.stats has the same, and takes half a second to import

    if not 0.0 < confidence < 1.0:
        raise ValueError(f"the confidence must lie between 0 and 1, got {confidence:g}")
    share = 0.5 + 0.5 * confidence
    return float(ndtri(share) if freedom is None else stdtrit(freedom, share))


def _untold_words(untold: Array, chosen: Sequence[Unknown]) -> list[str]:
    """A sentence for each direction that is not determined, with as few unknowns in each as possible."""
    from scipy.linalg import qr

    if untold.shape[1] == 0:
        return []
    _, r, order = qr(untold.T, mode="economic", pivoting=True)
    rows = np.zeros_like(r)
    rows[:, order] = np.linalg.solve(r[:, : len(r)], r)
    sentences = []
    for row in rows:
        parts = [(one, change * one.scale) for one, change in zip(chosen, row, strict=True) if abs(change) > _PART]
        if len(parts) == 1:
            sentences.append(f"The recording does not determine {parts[0][0].name}.")
        else:
            changes = ", ".join(f"{one.name} {change:+.3g} {one.unit}" for one, change in parts)
            sentences.append(
                f"The recording cannot separate {' and '.join(one.name for one, _ in parts)}: it shows no "
                f"difference when they change together ({changes})."
            )
    return sentences


def _entangled_words(correlations: Array, chosen: Sequence[Unknown]) -> list[str]:
    """Pairs that the recording can hardly separate, each with its correlation."""
    sentences = []
    for i, one in enumerate(chosen):
        for j, other in enumerate(chosen[:i]):
            if abs(correlations[i, j]) > _ENTANGLED:
                wider = (1.0 - min(correlations[i, j] ** 2, 1.0 - 1e-12)) ** -0.5
                sentences.append(
                    f"{other.name} and {one.name} can hardly be separated: with a correlation of "
                    f"{correlations[i, j]:+.3f}, knowing one of them would make the interval of the other at least "
                    f"{wider:.0f} times narrower."
                )
    return sentences


def _friction_words(
    allowed: Allowance, shapes: Shapes, shooting: Shooting, names: Sequence[str]
) -> tuple[list[str], list[str]]:
    """A sentence if friction surely departs from the law, and the names of what rests on the law.

    Those are of all joints: where the law is wrong in some, a part that shows less may hide in the others' numbers.
    """
    parts = []
    for joint, (kind, rates) in enumerate(zip(JOINTS, shapes.rates(shooting, allowed.point), strict=True)):
        extra = shapes.torque(joint, rates, allowed.factors)
        worst = int(np.abs(extra).argmax())
        small = abs(extra[worst]) < _SMALL_FRICTION * shapes.greatest[joint]
        if small or allowed.believed.gains[2 * joint : 2 * joint + 2].max() < _SURE_GAIN:
            continue
        more = "greater" if extra[worst] > 0.0 else "less"
        parts.append(f"in the {kind} joints it is {abs(extra[worst]):.2g} N m {more} at {rates[worst]:.2g} rad/s")
    if not parts:
        return [], []
    own = [name for name in names if kind_of(name) in _OF_FRICTION]
    rest = "The other estimates and their intervals allow for that" if own else "Estimates and intervals allow for that"
    trusted = f", but {listed(own)} {'is' if len(own) == 1 else 'are'} not to be trusted" if own else ""
    return [f"Friction does not follow the model's law: {listed(parts)}. {rest}{trusted}."], own


def _warning_words(
    found: Fit, allowed: Allowance, chosen: Sequence[Unknown], agreements: Sequence[Agreement], half_widths: Array
) -> list[str]:
    sentences, steps, point = [], found.steps + allowed.looks, allowed.point
    if not (found.converged and allowed.settled):
        sentences.append(f"The fit did not settle within {steps} steps; the numbers are where it stopped.")
    for one, value, at_bound in zip(chosen, point.values, found.at_bounds, strict=True):
        if at_bound:
            sentences.append(
                f"{one.name} went to its bound of {value:.4g} {one.unit}; beyond it the fit would be better."
            )
    unexplained = [
        f"{kind.kind} ({kind.left:.3g} instead of {kind.noise:.3g} {kind.unit})"
        for kind in agreements
        if not kind.explained
    ]
    if unexplained:
        sentences.append(
            f"The model does not explain the recording: more errors are left than noise in {', '.join(unexplained)}. "
            "Something that is not among the unknowns differs. The intervals are widened, by how slowly errors vary "
            "and by how much the windows disagree, but no estimate is to be trusted to within its interval."
        )
    for one, value, half in zip(chosen, point.values, half_widths, strict=True):
        if value + 2.0 * half < 0.0 and kind_of(one.name) not in SIGNED:
            sentences.append(f"{one.name} comes out negative, which no robot has: the model misses something else.")
    return sentences
