"""Noise levels of each kind of quantity, and whether noise explains the errors that a fit leaves."""

from collections.abc import Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arrays import Array
from caster_gym.identification.friction_allowance import Allowance
from caster_gym.identification.recording import KIND_UNITS, Noise, Recording
from caster_gym.identification.shooting import Shooting
from caster_gym.identification.window_fit import Normal, Told, point_at

LEAST_NOISE = 1e-9  # [m, rad, …] standard deviation below which rounding and time steps decide
_EXACT = 1e-5  # [-] of a quantity's own variation: errors so small are those of time steps, not of a sensor
_SURE = 4.0  # standard deviations beyond which chance no longer explains a misfit


class Agreement(NamedTuple):
    """How the errors that are left compare with noise, for one kind of quantity."""

    kind: str
    unit: str
    before: float  # root mean square error with the starting values, from the initial states of the estimates
    left: float  # standard deviation of the errors that are left, for the freedom that was used
    noise: float  # standard deviation of the noise: as given, else from one sample to the next
    given: bool
    explained: bool  # the errors are noise, or too small to be that of a sensor


class _Left(NamedTuple):
    """Errors that a fit leaves in each kind of quantity, over the standard deviations it was weighted with."""

    variance: dict[str, float]  # for the freedom that was used
    between: dict[str, float]  # the same from successive samples, in whose difference slow errors do not show
    freedom: dict[str, float]


class Levels:
    """Standard deviations of what a recording measured, given or estimated, one for each kind of quantity."""

    def __init__(self, recording: Recording, given: Noise) -> None:
        kinds = recording.kinds
        self.kinds = [kinds[i] for i in recording.observed]
        self.given = {kind: float(level) for kind, level in given if level is not None}
        signals, angles = recording.measured.copy(), self.of("heading") | self.of("steering")
        signals[:, angles] = np.unwrap(signals[:, angles], axis=0)
        self.variation = {kind: float(signals[:, self.of(kind)].std(axis=0).max()) for kind in self.kinds}
        # third differences: smooth motion adds little to them, white noise 20 times its variance
        thirds = (np.diff(signals, 3, axis=0) ** 2).mean(axis=0) / 20.0
        self.at_first = self._filled({kind: float(thirds[self.of(kind)].mean()) for kind in self.kinds})

    def of(self, kind: str) -> NDArray[np.bool_]:
        """Which observed components are of a kind."""
        return np.array([own == kind for own in self.kinds])

    def update(self, equations: Normal, known: Told, sigma: Array) -> Array:
        """Standard deviations from the errors of a fit."""
        left = self.left(equations, known).variance
        weights = dict(zip(self.kinds, sigma, strict=True))
        return self._filled({kind: left[kind] * weights[kind] ** 2 for kind in left})

    def left(self, equations: Normal, known: Told) -> _Left:
        """What a fit leaves. The fit bends errors towards zero along the columns of an orthonormal basis."""
        windows, width = len(equations.errors), len(self.kinds)
        shared = equations.across @ (known.directions / np.sqrt(known.strengths))
        basis = np.concatenate([equations.q, shared], axis=2).reshape(
            windows, -1, width, equations.q.shape[2] + shared.shape[2]
        )
        errors = equations.errors.reshape(windows, -1, width)
        steps, bent = np.diff(errors, axis=1), np.diff(basis, axis=1)
        found = _Left({}, {}, {})
        for kind in dict.fromkeys(self.kinds):
            of = self.of(kind)
            free = errors[..., of].size - (basis[:, :, of] ** 2).sum()
            found.freedom[kind] = float(free)
            found.variance[kind] = float((errors[..., of] ** 2).sum() / free)
            found.between[kind] = float(
                (steps[..., of] ** 2).sum() / (2.0 * steps[..., of].size - (bent[:, :, of] ** 2).sum())
            )
        return found

    def _filled(self, variances: Mapping[str, float]) -> Array:
        levels = {kind: self.given.get(kind, variance**0.5) for kind, variance in variances.items()}
        return np.array([max(levels[kind], LEAST_NOISE) for kind in self.kinds])


def agreements_of(found: Allowance, shooting: Shooting, levels: Levels, first: Array) -> tuple[Agreement, ...]:
    """Of each kind of quantity; first (P,): the starting values."""
    left = levels.left(found.normal, found.told)
    before = point_at(shooting, found.point.starts, first).errors
    agreements = []
    for kind in left.variance:
        of, given = levels.of(kind), kind in levels.given
        sigma = float(found.sigma[of][0])
        size = left.variance[kind] ** 0.5 * sigma
        noise = sigma if given else left.between[kind] ** 0.5 * sigma
        # variances of white noise scatter by 2/freedom; the logarithm of von Neumann's ratio by 1/freedom
        excess = (
            left.variance[kind] - 1.0
            if given
            else np.log(max(left.variance[kind], 1e-300) / max(left.between[kind], 1e-300))
        )
        chance = _SURE * ((2.0 if given else 1.0) / left.freedom[kind]) ** 0.5
        explained = bool(excess < chance) or size < max(_EXACT * levels.variation[kind], LEAST_NOISE)
        rms = float(np.sqrt((before[..., of] ** 2).mean()))
        agreements.append(Agreement(kind, KIND_UNITS[kind], rms, size, noise, given, explained))
    return tuple(agreements)
