"""Extends a fit by deviations of friction from the model's law, and how certain they are.

Factors of friction's shapes (`caster_gym.identification.friction_shape`) join the unknowns of a fit. Their torques are
those of the path that was predicted last, so that they are known inputs while a step is taken, and are looked at again
after it. Where the law explains the recording, one look is all it takes and the estimates stay as they are.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.identification.friction_shape import Believed, Shapes, likeliest_deviations
from caster_gym.identification.recording import FINER
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.window_fit import Fit, NoiseUpdate, Normal, Point, Told, normal, point_at

_MOST_LOOKS = 8
_NEAR = 4.0  # squared distance to the optimum, in standard deviations, over which a fit is linear: one step ends it
_SHORTEST = 2.0**-4  # of a step that is tried
_SAME_NOISE = 0.005  # [-] relative change of a standard deviation that no longer matters
_LEAST_RANK = 1e-14  # [-] of the greatest eigenvalue, below which rounding decides
_UNSURE = FINER**-2.0  # [-] of what errors of steps add up to: what is left, where dry friction changes within a step
_MOST_UPDATES = 4  # of the noise in one look


class Allowance(NamedTuple):
    """Where a fit ends that allows for another friction. Unknowns are counted in scales."""

    point: Point  # its values (P,) are those of the unknowns alone
    sigma: Array  # (observed,)
    normal: Normal  # of directions (T) that the recording tells, and factors (K)
    told: Told  # its directions (T + K, T + K) and strengths, what is believed of factors included
    spread: Array  # (P, T + K) from a gradient of these to the unknowns, in scales
    covariance: Array  # (P, P) in scales
    factors: Array  # (K,)
    believed: Believed
    looks: int
    settled: bool


class _Look(NamedTuple):
    """What is known near a point, of directions and factors together."""

    equations: Normal
    believed: Believed
    sigma: Array
    step: Array  # (T + K,) to the optimum
    posterior: Told
    distance: float  # squared, of the optimum, in standard deviations


def allow_for_friction(
    shooting: Shooting,
    shapes: Shapes,
    found: Fit,
    scales: Array,
    bounds: Array,
    update: NoiseUpdate,
    kinds: Sequence[str],
    report: Callable[[], None] = lambda: None,
) -> Allowance:
    """Go on from a fit with shapes of friction.

    update as in `window_fit.fit`; kinds (observed) of quantities; report is called before each look.
    """
    directions, count = found.told.directions, len(scales)
    told, shaped = directions.shape[1], len(shapes.units)
    here, factors, sigma, looks, settled = found.point, np.zeros(shaped), found.sigma, 0, False
    while True:
        report()
        looks += 1
        wider = shooting.with_pushes(shapes.pushes(shooting, here.path, here.values))
        if looks > 1:
            here = _at(wider, here.starts, here.values, factors)
        both = np.concatenate([here.values, factors])
        a, b, drift = wider.derivatives_and_drift(here.path, both, wider.step_errors(here.path, both))
        columns = np.concatenate([b[..., :count] * scales @ directions, b[..., count:]], axis=-1)
        least = shapes.least(shooting, here.values)
        unsure = _UNSURE * _by_kind(drift, kinds)

        def known_noise(equations: Normal, known: Told, sigma: Array, unsure: Array = unsure) -> Array:
            return np.maximum(update(equations, known, sigma), unsure)

        look = _look(here.errors + drift, (a, columns), shapes.groups, least, factors, sigma, known_noise)
        sigma, step = look.sigma, look.step
        along = scales * (directions @ step[:told])
        starts_step = look.equations.starts_step(step)
        share, cost = 1.0, _cost(here.errors + drift, factors, look)
        while share >= _SHORTEST:
            values, moved = np.clip(here.values + share * along, *bounds.T), factors + share * step[told:]
            there = _at(wider, here.starts + share * starts_step, values, moved)
            if _cost(there.errors + drift, moved, look) < cost:
                here, factors = there, moved
                break
            share *= 0.5
        if look.distance < _NEAR or looks == _MOST_LOOKS or share < _SHORTEST:
            settled = look.distance < _NEAR
            break
    vectors, strengths = look.posterior.directions, look.posterior.strengths
    onto = np.concatenate([directions, np.zeros((count, shaped))], axis=1)
    spread = onto @ (vectors / strengths @ vectors.T)
    return Allowance(
        point=here._replace(errors=here.errors + drift),
        sigma=sigma,
        normal=look.equations,
        told=look.posterior,
        spread=spread,
        covariance=spread @ onto.T,
        factors=factors,
        believed=look.believed,
        looks=looks,
        settled=settled,
    )


def _by_kind(drift: Array, kinds: Sequence[str]) -> Array:
    """Root mean squares (observed,) of what errors of steps add up to, over each kind of quantity."""
    of = np.array(kinds)
    return np.array([np.sqrt((drift[..., of == kind] ** 2).mean()) for kind in kinds])


def _at(wider: Shooting, starts: Array, values: Array, factors: Array) -> Point:
    point = point_at(wider, starts, np.concatenate([values, factors]))
    return point._replace(values=values)


def _cost(errors: Array, factors: Array, look: _Look) -> float:
    """Squared errors over noise, and factors over what is believed of them."""
    believed = look.believed.deviations
    beside = (factors[believed > 0.0] / believed[believed > 0.0]) ** 2
    cost = float(((errors / look.sigma) ** 2).sum() + beside.sum())
    return cost if np.isfinite(cost) else np.inf


def _look(
    errors: Array,
    slopes: tuple[Array, Array],
    groups: NDArray[np.int64],
    least: Array,
    factors: Array,
    sigma: Array,
    update: NoiseUpdate,
) -> _Look:
    """The optimum of directions and factors, with the noise and the deviations of factors that suit it."""
    windows, kinds = len(errors), len(factors)
    for _ in range(_MOST_UPDATES):
        a, b = ((slope / sigma[:, None]).reshape(windows, -1, slope.shape[-1]) for slope in slopes)
        equations = normal((errors / sigma).reshape(windows, -1), a, b)
        information, gradient = equations.information, equations.gradients.sum(axis=0)
        told = len(information) - kinds
        gradient = gradient - information[:, told:] @ factors  # as it is without any factor
        own, cross, theirs = information[:told, :told], information[:told, told:], information[told:, told:]
        shares = np.linalg.solve(own, np.column_stack([cross, gradient[:told]]))
        rest = theirs - cross.T @ shares[:, :kinds]
        believed = likeliest_deviations(rest, cross.T @ shares[:, kinds] - gradient[told:], groups, least)
        posterior, optimum = _optimum(information, gradient, believed.deviations)
        step = optimum - np.concatenate([np.zeros(told), factors])
        left = equations.errors + equations.across @ step
        left = left - np.einsum("wmn,wn->wm", equations.q, np.einsum("wmn,wm->wn", equations.q, equations.errors))
        newer = update(equations._replace(errors=left), posterior, sigma)
        same = bool(np.abs(np.log(newer / sigma)).max() < _SAME_NOISE)
        if same:
            break
        sigma = newer
    distance = float(step @ information @ step) + equations.own_distance
    return _Look(equations, believed, sigma, step, posterior, distance)


def _optimum(information: Array, gradient: Array, deviations: Array) -> tuple[Told, Array]:
    """Posterior directions with strengths, and the optimum (T + K,): factors without deviation stay zero."""
    told = len(information) - len(deviations)
    free = np.concatenate([np.ones(told, dtype=bool), deviations > 0.0])
    sizes = np.concatenate([np.ones(told), deviations])[free]
    whole = sizes[:, None] * information[np.ix_(free, free)] * sizes
    whole[told:, told:] += np.eye(len(whole) - told)
    strengths, vectors = np.linalg.eigh(whole)
    strengths = np.maximum(strengths, _LEAST_RANK * strengths.max(initial=1.0))
    directions = np.zeros((len(information), len(strengths)))
    directions[free] = sizes[:, None] * vectors
    return Told(directions, strengths, np.zeros((len(information), 0))), -directions @ (
        (directions.T @ gradient) / strengths
    )
