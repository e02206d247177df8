"""Steering angles of casters whose pivots move along a line: they trail, at any speed.

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

from caster_gym.arrays import Array, Plane
from caster_gym.paths.trajectory import unit
from caster_gym.robot import Robot

Pair: TypeAlias = tuple[Array, Array]

_LEAST_WAY = 1e-12  # [m] a pivot that moves less in a step does not tell a direction
_SHARP = 0.9  # cosine of the turn of a velocity in a step, below which it is not taken for an arc
_LEAST_KAPPA = 1e-12  # [-] below which tanh(κ) / κ is 1


def trailing_directions(samples: Array, time_step: float, robot: Robot) -> Plane:
    """Rolling directions (P, K + 1, N) in W, as unit complex numbers, along samples (P, K + 1, 10) every time step [s].

    They start in the direction of each pivot's first motion.
    """
    rows = np.moveaxis(samples, 1, 0)
    way, velocity = _pivot_motion(rows, robot)
    a, b = _arcs(way, time_step * velocity, robot)
    first = _first(np.concatenate([time_step * velocity[:1], way]), rows[0, :, 2] + 1j * rows[0, :, 3])
    steps = len(way)
    size = int(np.ceil((steps / len(samples)) ** 0.5))  # as many paths wait together as one has intervals
    count = -(-steps // size)
    spare = ((0, size * count - steps), (0, 0), (0, 0))
    a, b = np.pad(a, spare, constant_values=1.0), np.pad(b, spare)  # maps that move nothing
    shape = (count, size, *a.shape[1:])
    psi = _led(first, a.reshape(shape).swapaxes(0, 1), b.reshape(shape).swapaxes(0, 1))
    psi = psi.swapaxes(0, 1).reshape(-1, *first.shape)[: steps + 1]
    if len(psi) <= steps:
        psi = np.concatenate([psi, _moved(psi[-1:], a[-1:], b[-1:])])
    return np.moveaxis(psi, 0, 1)


def trailing_on(psi: Plane, rows: Array, step: Array, robot: Robot) -> Plane:
    """The same (S + 1, Q, N) along rows (S + 1, Q, 10) of Q motions, every step (Q,) [s], from directions (Q, N)."""
    way, velocity = _pivot_motion(rows, robot)
    directions = [psi]
    for a, b in zip(*_arcs(way, step[:, None] * velocity, robot), strict=True):
        directions.append(_moved(directions[-1], a, b))
    return np.stack(directions)


def directions_at_rows(point: Plane, heading: Plane, robot: Robot) -> Plane:
    """The same (N, S + 1, K, P) at S + 1 points of each of K intervals of P lines, S at least 2.

    point [m] and heading are (S + 1, K, P), the last point of an interval being the first of the next.
    """
    places = _pivots(point, heading, robot)
    way = np.diff(places, axis=0)
    change = np.gradient(way, axis=0)
    first = _first(np.concatenate([way[:1, 0] - 0.5 * change[:1, 0], way[:, 0]]), heading[0, 0])
    a, b = _maps(way, change, robot)
    psi = _led(first, a, b)
    return np.moveaxis(np.concatenate([psi, _moved(psi[-1:], a[-1:], b[-1:])]), -1, 0)


def steer(direction: Pair, way: Pair, change: Pair, trails: Array) -> Pair:
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


def _led(first: Plane, a: Plane, b: Plane) -> Plane:
    """psi (S, K, …) at the points of K intervals in a row, each of S maps a, b (S, K, …), from `first` on.

    Maps of one interval make one map, so that only whole intervals wait for each other.
    """
    whole_a, whole_b = a[0], b[0]
    for one_a, one_b in zip(a[1:], b[1:], strict=True):
        whole_a, whole_b = one_a * whole_a + one_b * whole_b.conj(), one_a * whole_b + one_b * whole_a.conj()
        size = np.abs(whole_a)
        whole_a, whole_b = whole_a / size, whole_b / size
    psi = np.empty(a.shape, dtype=np.complex128)
    psi[0, 0] = first
    for k in range(len(whole_a) - 1):
        psi[0, k + 1] = _moved(psi[0, k], whole_a[k], whole_b[k])
    for j in range(len(a) - 1):
        psi[j + 1] = _moved(psi[j], a[j], b[j])
    return psi


def _arcs(way: Plane, velocity: Plane, robot: Robot) -> tuple[Plane, Plane]:
    """a and b of ways D (S, Q, N) [m] at whose ends (S + 1, Q, N) the velocity times the step is known. [m]"""
    trails = np.array([caster.trail for caster in robot.casters])
    before, after = velocity[:-1], velocity[1:]
    half = before.conj() * after
    half /= np.maximum(np.abs(half), 1e-300)
    half[half.real < _SHARP] = 1.0  # also where a pivot is at rest
    half += 1.0
    half /= np.abs(half)
    sine = half.imag
    square = sine * sine
    ratio = 1.0 + square * (1.0 / 6.0 + square * (0.075 + square * (5.0 / 112.0)))  # of the angle γ / 2 and its sine
    angle = ratio * sine
    change = after * half.conj() - before * half
    bent = change * (1j / 6.0 * angle)
    mean = (way - bent) * ratio
    beta = (mean + bent) * (0.5 / trails)
    alpha = (mean.real * change.imag - mean.imag * change.real) / (24.0 * trails**2) - angle
    square = beta.real**2 + beta.imag**2 - alpha**2
    kappa = np.sqrt(np.maximum(square, _LEAST_KAPPA**2))
    pull = np.minimum(np.tanh(kappa), 1.0 - 1e-12) / kappa  # short of 1, where the map would be singular
    slow = np.minimum(square, 0.0)
    pull *= 1.0 - slow * (1.0 / 3.0 - 2.0 / 15.0 * slow)  # tan(|κ|) / |κ|, where a pivot hardly moves
    half *= 1.0 + 1j * (alpha * pull)
    beta *= pull
    return half, beta


def _moved(psi: Plane, a: Plane, b: Plane) -> Plane:
    """psi after maps: the denominator b̄ psi + ā is psi times the conjugate of the numerator."""
    end = unit(a * psi + b)
    end *= end
    end *= psi.conj()
    return end


def _pivots(point: Plane, heading: Plane, robot: Robot) -> Plane:
    """Places (..., N) of the steering axes in W. [m]"""
    pivots = np.array([complex(caster.x, caster.y) for caster in robot.casters])
    return np.asarray(point[..., None] + heading[..., None] * pivots)


def _pivot_motion(rows: Array, robot: Robot) -> tuple[Plane, Plane]:
    """Ways (S, Q, N) of the pivots between rows (S + 1, Q, 10) [m], and velocities (S + 1, Q, N) there, in W [m/s]."""
    heading = rows[..., 2] + 1j * rows[..., 3]
    arms = _pivots(np.zeros((), dtype=np.complex128), heading, robot)
    velocity = (rows[..., 4] + 1j * rows[..., 5])[..., None] + 1j * rows[..., 6, None] * arms
    return np.diff((rows[..., 0] + 1j * rows[..., 1])[..., None] + arms, axis=0), velocity


def _first(way: Plane, heading: Plane) -> Plane:
    """Direction (P, N) of the first motion in ways (K, P, N); the heading (P,) where there is none."""
    moving = np.abs(way) > _LEAST_WAY
    first = np.take_along_axis(way, moving.argmax(axis=0)[None], axis=0)[0]
    return unit(np.where(moving.any(axis=0), first, heading[:, None]))
