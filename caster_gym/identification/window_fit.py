"""Least squares over windows: Gauss–Newton for shared unknowns, with the windows' initial states eliminated.

Errors e of all samples, each over its noise σ, are linear near a point: e + A dx + B du, with A (W, m, n) for the state
dx that each window starts from and B (W, m, P) for the shared unknowns du, counted in their scales. For each window the
best dx leaves the part of e + B du across the columns of A. So what the windows tell of du is the information matrix
H = Σ B⊥ᵀ B⊥, and its covariance, with the windows' states estimated too, is H⁻¹.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.identification.shooting import Shooting

MOST_STEPS = 30
_LEAST_RANK = 1e-12  # [-] of the greatest eigenvalue of H, below which rounding decides
_WIDEST_STEP = 3.0  # scales that an unknown changes at most in one step
_SHORTEST = 2.0**-12  # of a step that is tried
SETTLED = 1e-2  # squared distance to the optimum, in standard deviations, at which a fit ends
_SAME_NOISE = 0.02  # [-] relative change of a standard deviation that no longer matters


class Normal(NamedTuple):
    """Normal equations of the shared unknowns and what is needed to go back to the windows."""

    q: Array  # (W, m, n) orthonormal columns that span those of A
    r: Array  # (W, n, n) so that A = q r
    across: Array  # B⊥ (W, m, P)
    errors: Array  # (W, m)
    b: Array  # (W, m, P)

    @property
    def information(self) -> Array:
        """H (P, P)."""
        information: Array = np.einsum("wmp,wmq->pq", self.across, self.across)
        return information

    @property
    def gradients(self) -> Array:
        """Each window's part (W, P) of the gradient of half the sum of squares."""
        gradients: Array = np.einsum("wmp,wm->wp", self.across, self.errors)
        return gradients

    @property
    def own_distance(self) -> float:
        """Squared distance of all windows' initial states from their best, in standard deviations."""
        return float((np.einsum("wmn,wm->wn", self.q, self.errors) ** 2).sum())

    def starts_step(self, step: Array) -> Array:
        """Best change (W, n) of the windows' initial states for a change of the shared unknowns."""
        rest = np.einsum("wmn,wm->wn", self.q, self.errors + self.b @ step)
        return -np.linalg.solve(self.r, rest[..., None])[..., 0]


def normal(errors: Array, a: Array, b: Array) -> Normal:
    """Eliminate the windows' initial states."""
    q, r = np.linalg.qr(a)
    return Normal(q, r, b - q @ (q.swapaxes(1, 2) @ b), errors, b)


class Told(NamedTuple):
    """Directions of the shared unknowns, in scales, that the windows tell, and those that they do not."""

    directions: Array  # (P, told)
    strengths: Array  # (told,) eigenvalues of H
    untold: Array  # (P, rest)


def told(information: Array, free: NDArray[np.bool_]) -> Told:
    """Split the directions of the free unknowns: told is what is known to one scale or better."""
    count = len(free)
    basis = np.eye(count)[:, free]
    strengths, vectors = np.linalg.eigh(basis.T @ information @ basis)
    enough = strengths > max(1.0, _LEAST_RANK * float(strengths.max(initial=0.0)))
    directions = basis @ vectors
    return Told(directions[:, enough], strengths[enough], directions[:, ~enough])


class Point(NamedTuple):
    """Where a fit is."""

    starts: Array  # (W, n)
    values: Array  # (P,) in their units
    path: Array  # predicted, see `Shooting`
    errors: Array  # (W, S, observed) predicted minus measured


class Fit(NamedTuple):
    """Where a fit ended."""

    point: Point
    sigma: Array  # (observed,) standard deviations that errors were weighted with
    normal: Normal  # of the last step, which was too small to matter
    told: Told
    at_bounds: NDArray[np.bool_]  # (P,)
    steps: int
    converged: bool


NoiseUpdate: TypeAlias = Callable[[Normal, Told, Array], Array]


def point_at(shooting: Shooting, starts: Array, values: Array) -> Point:
    """The prediction from initial states and values."""
    path = shooting.predict(starts, values)
    return Point(starts, values, path, shooting.errors(path, values))


def fit(
    shooting: Shooting,
    starts: Array,
    values: Array,
    scales: Array,
    bounds: Array,
    sigma: Array,
    update: NoiseUpdate = lambda equations, known, sigma: sigma,
    enough: float = SETTLED,
    report: Callable[[], None] = lambda: None,
) -> Fit:
    """Least squares from a first guess; bounds (P, 2). update tells new standard deviations from those before, once
    the fit is near; enough is the squared distance to the optimum, in standard deviations, at which it ends.

    Unknowns move along told directions only, so what is not told stays as near as it can to where it was. Raises
    ValueError if the simulation runs away from the first guess.
    """
    here = point_at(shooting, starts, values)
    if not np.isfinite(here.errors).all():
        raise ValueError(
            "the simulation runs away from where it starts; give starting values nearer to the truth, or shorter "
            "windows"
        )
    size = here.starts.size + len(values)
    there: Point | None = here
    steps, settled = 0, False
    while steps < MOST_STEPS and there is not None and not settled:
        report()
        steps, here = steps + 1, there
        slopes = shooting.derivatives(here.path, here.values)
        system = _linearised(here, slopes, sigma, scales, bounds)
        newer = update(system.normal, system.told, sigma) if system.distance < size else sigma
        quiet = bool(np.abs(np.log(newer / sigma)).max() < _SAME_NOISE) and system.distance < size
        if not quiet and newer is not sigma:
            sigma = newer
            system = _linearised(here, slopes, sigma, scales, bounds)
        step = system.step / max(1.0, float(np.abs(system.step).max(initial=0.0)) / _WIDEST_STEP)
        step = (np.clip(here.values + scales * step, *bounds.T) - here.values) / scales
        settled = quiet and system.distance < enough
        shortest = 1.0 if system.distance < SETTLED else _SHORTEST
        there = _descend(shooting, here, scales * step, system.normal.starts_step(step), sigma, shortest)
    here = here if there is None else there
    at_bounds = (here.values <= bounds[:, 0]) | (here.values >= bounds[:, 1])
    converged = settled or (there is None and system.distance < 1.0)
    return Fit(here, sigma, system.normal, system.told, at_bounds, steps, converged)


class _System(NamedTuple):
    normal: Normal
    told: Told
    step: Array  # (P,) to the optimum along told directions, in scales
    distance: float  # squared, of unknowns and initial states from the optimum, in standard deviations


def _linearised(here: Point, slopes: tuple[Array, Array], sigma: Array, scales: Array, bounds: Array) -> _System:
    """Normal equations at a point; unknowns that press against a bound are held."""
    windows = len(here.errors)
    a, b = ((slope / sigma[:, None]).reshape(windows, -1, slope.shape[-1]) for slope in slopes)
    equations = normal((here.errors / sigma).reshape(windows, -1), a, b * scales)
    gradient = equations.gradients.sum(axis=0)
    held = (here.values <= bounds[:, 0]) & (gradient > 0.0) | (here.values >= bounds[:, 1]) & (gradient < 0.0)
    known = told(equations.information, ~held)
    along = known.directions.T @ gradient
    distance = float((along**2 / known.strengths).sum()) + equations.own_distance
    return _System(equations, known, -known.directions @ (along / known.strengths), distance)


def _descend(
    shooting: Shooting, here: Point, values: Array, starts: Array, sigma: Array, shortest: float
) -> Point | None:
    """The point after the longest of a step's halves that brings the prediction nearer; none if none does."""
    cost, share = ((here.errors / sigma) ** 2).sum(), 1.0
    while share >= shortest:
        there = point_at(shooting, here.starts + share * starts, here.values + share * values)
        if ((there.errors / sigma) ** 2).sum() < cost:
            return there
        share *= 0.5
    return None
