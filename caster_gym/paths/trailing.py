"""How casters steer when their pivots are led along a line: they trail, whatever the speed.

    psi      rolling direction of a caster in W, unit complex number         [-]
    V        velocity of its pivot, in W
    D        way of the pivot during one step, in W                          [m]
    d        trail                                                           [m]

psi′ = (V − V̄ psi²) / 2d moves by Möbius maps of the unit circle, psi → (a psi + b) / (b̄ psi + ā), stable for every
step. For a straight way D a map is exact; the error falls with the square of the turn of D in one step. Magnus's next
term, with V linear during the step, makes that the fourth power (Blanes et al., Physics Reports 470, 2009):

    δ = D / 2d      α = −Im(D · conj(change of V)) · step / 24d²      κ² = |δ|² − α²
    a = 1 + iα tanh(κ) / κ      b = δ tanh(κ) / κ
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from caster_gym.paths.trajectory import Array, Plane
from caster_gym.robot import Robot

Pair: TypeAlias = tuple[Array, Array]

_LEAST_WAY = 1e-12  # [m] a pivot that moves less in a step does not tell a direction
_LEAST_KAPPA = 1e-12  # [-] below which tanh(κ) / κ is 1


def trailing_directions(samples: Array, robot: Robot) -> Plane:
    """Rolling directions (P, K + 1, N) in W, as unit complex numbers, along samples (P, K + 1, 10).

    They start in the direction of each pivot's first motion.
    """
    heading = samples[..., 2] + 1j * samples[..., 3]
    way = np.moveaxis(np.diff(_pivots(samples[..., 0] + 1j * samples[..., 1], heading, robot), axis=1), 1, 0)
    psi = np.empty((len(way) + 1, *way.shape[1:]), dtype=np.complex128)
    psi[0] = _first(way, heading[:, 0])
    for k, m in enumerate(_shifts(way, robot)):
        psi[k + 1] = _unit((psi[k] + m) / (1.0 + m.conj() * psi[k]))
    return np.moveaxis(psi, 0, 1)


def directions_at_rows(point: Plane, heading: Plane, robot: Robot) -> Plane:
    """The same (N, S + 1, K, P) at S + 1 points of each of K intervals of P lines, S at least 2.

    point [m] and heading are (S + 1, K, P), the last point of an interval being the first of the next.
    Maps of one interval make one map, so that only whole intervals wait for each other.
    """
    places = _pivots(point, heading, robot)
    way = np.diff(places, axis=0)
    change = np.gradient(way, axis=0)
    a, b = _maps(way, change, robot)
    whole_a, whole_b = a[0], b[0]
    for one_a, one_b in zip(a[1:], b[1:], strict=True):
        whole_a, whole_b = one_a * whole_a + one_b * whole_b.conj(), one_a * whole_b + one_b * whole_a.conj()
        size = np.abs(whole_a)
        whole_a, whole_b = whole_a / size, whole_b / size
    psi = np.empty(places.shape, dtype=np.complex128)
    psi[0, 0] = _first(np.concatenate([way[:1, 0] - 0.5 * change[:1, 0], way[:, 0]]), heading[0, 0])
    for k in range(len(whole_a) - 1):
        psi[0, k + 1] = _moved(psi[0, k], whole_a[k], whole_b[k])
    for j in range(len(a)):
        psi[j + 1] = _moved(psi[j], a[j], b[j])
    return np.moveaxis(psi, -1, 0)


def steered(direction: Pair, way: Pair, change: Pair, trails: Array) -> Pair:
    """Rolling directions after ways (..., N) of the pivots [m], all in one frame; V changes by `change` over the time.

    In real numbers: rounding then does not depend on the place in an array, as that of NumPy's complex ones does.
    """
    (c, s), (x, y) = direction, way
    d_x, d_y = x / (2.0 * trails), y / (2.0 * trails)
    alpha = (x * change[1] - y * change[0]) / (24.0 * trails * trails)
    kappa = np.sqrt(np.maximum(d_x * d_x + d_y * d_y - alpha * alpha, _LEAST_KAPPA**2))
    pull = np.minimum(np.tanh(kappa), 1.0 - 1e-12) / kappa
    b_x, b_y, turn = d_x * pull, d_y * pull, alpha * pull
    p, q = c - turn * s + b_x, s + turn * c + b_y  # a psi + b
    u, v = b_x * c + b_y * s + 1.0, b_x * s - b_y * c - turn  # b̄ psi + ā
    cos, sin = p * u + q * v, q * u - p * v
    size = np.sqrt(cos * cos + sin * sin)
    return cos / size, sin / size


def _maps(way: Plane, change: Plane, robot: Robot) -> tuple[Plane, Plane]:
    """a and b of ways D [m] in which the velocity times the step changes by so much [m], both (..., N)."""
    trails = np.array([caster.trail for caster in robot.casters])
    delta, alpha = way / (2.0 * trails), -(way * change.conj()).imag / (24.0 * trails**2)
    kappa = np.sqrt(np.maximum(np.square(delta.real) + np.square(delta.imag) - alpha**2, _LEAST_KAPPA**2))
    pull = np.minimum(np.tanh(kappa), 1.0 - 1e-12) / kappa  # short of 1, where the map would be singular
    return np.asarray(1.0 + 1j * alpha * pull, dtype=np.complex128), np.asarray(delta * pull, dtype=np.complex128)


def _moved(psi: Plane, a: Plane, b: Plane) -> Plane:
    return _unit(np.asarray((a * psi + b) / (b.conj() * psi + a.conj())))


def _pivots(point: Plane, heading: Plane, robot: Robot) -> Plane:
    """Places (..., N) of the steering axes in W. [m]"""
    pivots = np.array([complex(caster.x, caster.y) for caster in robot.casters])
    return np.asarray(point[..., None] + heading[..., None] * pivots)


def _first(way: Plane, heading: Plane) -> Plane:
    """Direction (P, N) of the first motion in ways (K, P, N); the heading (P,) where there is none."""
    moving = np.abs(way) > _LEAST_WAY
    first = np.take_along_axis(way, moving.argmax(axis=0)[None], axis=0)[0]
    return _unit(np.where(moving.any(axis=0), first, heading[:, None]))


def _shifts(way: Plane, robot: Robot) -> Plane:
    """m of ways (K, P, N)."""
    length = np.abs(way)
    pull = np.tanh(0.5 * length / np.array([caster.trail for caster in robot.casters]))
    short: NDArray[np.float64] = np.minimum(pull, 1.0 - 1e-12)  # of 1, where the map would be singular
    return np.asarray(way * (short / np.maximum(length, _LEAST_WAY)), dtype=np.complex128)


def _unit(direction: Plane) -> Plane:
    return np.asarray(direction / np.abs(direction), dtype=np.complex128)
