"""Which torques of the driven motors give a wanted wrench: least squares within the motors' limits.

    u       motor torques as shares of their greatest             [-]
    B       wrench at C of each motor at its greatest torque, moments divided by a length L    [N]
    F       wanted wrench, its moment divided by L                 [N]

minimise |B u − F|² + λ |u|² subject to low <= u <= high. With λ y = F − B u, the best u is Bᵀy cut off at the limits.
An active-set method finds which motors are at theirs: it is exact, and every sum is taken motor by motor, so a robot
gets the same torques alone and in a batch, to the last bit.
"""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array, Flags
from caster_gym.mechanics.linear import dot, extreme_eigenvalues, solve
from caster_gym.mechanics.scalars import Symmetric

WELL_CONDITIONED = 0.05  # σ_min / σ_max of B below which damping sets in
STRONGEST_DAMPING = 0.02  # of σ_max, at a singular configuration
REGULARISATION = 1e-5  # of σ_max, always: it picks the smallest of equally good torques
ROUNDING = 1e-14  # of σ_max², in the gradient of the cost
ROUNDS_PER_MOTOR = 8  # of the active-set method, which needs fewer than three; torques are within limits after any


def distribute(b: Array, wrench: Array, low: Array, high: Array) -> Array:
    """Torque shares u (robots, motors) for B (robots, 3, motors), F (robots, 3) and limits (robots, motors)."""
    low, high = np.ascontiguousarray(low.T), np.ascontiguousarray(np.maximum(high, low).T)
    columns, wanted = np.ascontiguousarray(b.transpose(2, 1, 0)), np.ascontiguousarray(wrench.T)
    problems = _Problems(columns, wanted, low, high, damping_of(b))
    wishes = problems.wishes(np.zeros_like(low), np.ones(low.shape, dtype=np.bool_))
    shares = np.clip(wishes, low, high)
    going = (shares != wishes).any(axis=0)
    left = np.flatnonzero(going)
    trial = _Trial(shares, (shares > low) & (shares < high)).of(going)
    problems = problems.of(going)
    for _ in range(ROUNDS_PER_MOTOR * len(low)):
        if not left.size:
            break
        trial, going = _improved(trial, problems)
        shares[:, left[~going]] = trial.shares[:, ~going]
        left, trial, problems = left[going], trial.of(going), problems.of(going)
    shares[:, left] = trial.shares
    return np.ascontiguousarray(shares.T)


def damping_of(b: Array) -> Array:
    """λ (robots,): grows as B comes near a singular configuration (Nakamura and Hanafusa, ASME JDSMC 108, 1986)."""
    least, greatest = extreme_eigenvalues(_gram(np.ascontiguousarray(b.transpose(2, 1, 0))))
    greatest = np.maximum(greatest, 1e-24)
    nearness = 1.0 - np.minimum(np.sqrt(np.maximum(least, 0.0) / greatest) / WELL_CONDITIONED, 1.0)
    damping: Array = ((STRONGEST_DAMPING * nearness) ** 2 + REGULARISATION**2) * greatest
    return damping


class _Trial(NamedTuple):
    """Torque shares (motors, robots) within limits, and which of them are free to change; the others are at a limit."""

    shares: Array
    free: Flags

    def of(self, robots: Flags) -> "_Trial":
        """Those of some robots."""
        return _Trial(self.shares[:, robots], self.free[:, robots])


class _Problems(NamedTuple):
    """Robots along the last axis, motors along the first."""

    columns: Array  # (motors, 3, robots) of B
    wanted: Array  # (3, robots) F
    low: Array  # (motors, robots)
    high: Array
    damping: Array  # (robots,) λ

    def of(self, robots: Flags) -> "_Problems":
        """The problems of some robots."""
        return _Problems(*(np.ascontiguousarray(part[..., robots]) for part in self))

    def wishes(self, shares: Array, free: Flags) -> Array:
        """Bᵀy for the best shares of the free motors while the others keep theirs."""
        x, y, z = self.wanted
        for column, share in zip(self.columns, np.where(free, 0.0, shares), strict=True):
            x, y, z = x - column[0] * share, y - column[1] * share, z - column[2] * share
        xx, xy, xz, yy, yz, zz = _gram(self.columns, free)
        damped = (xx + self.damping, xy, xz, yy + self.damping, yz, zz + self.damping)
        answer = solve(damped, (x, y, z))
        return np.stack([dot((column[0], column[1], column[2]), answer) for column in self.columns])


def _improved(trial: _Trial, problems: _Problems) -> tuple[_Trial, Flags]:
    """One round of the active-set method, and which robots need another one.

    Free motors go towards their wishes until the first one of a robot meets its limit and stays there. Where none
    does, the motor at a limit that most wishes to leave it is set free; where none wishes, the shares are the best.
    """
    shares, free = trial
    low, high = problems.low, problems.high
    wishes = problems.wishes(shares, free)
    way = np.where(free, wishes - shares, 0.0)
    limit = np.where(way > 0.0, high, low)
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.where(way == 0.0, np.inf, (limit - shares) / way)
    part = np.minimum(room.min(axis=0), 1.0)
    stopped = (room <= part) & (part < 1.0)
    shares = np.clip(np.where(stopped, limit, shares + part * way), low, high)
    free = free & ~stopped
    inwards = np.where(shares == high, high - wishes, wishes - low)
    inwards = np.where(free | (low == high), -np.inf, inwards * problems.damping)
    arrived = part == 1.0
    size = np.square(problems.columns).max(axis=(0, 1))
    wishing = inwards.max(axis=0) > ROUNDING * size
    released = np.flatnonzero(arrived & wishing)
    free[inwards[:, released].argmax(axis=0), released] = True
    return _Trial(shares, free), wishing | ~arrived


def _gram(columns: Array, chosen: Flags | None = None) -> Symmetric:
    """B Bᵀ of the chosen columns (motors, 3, robots)."""
    products = [
        _products(column, column if chosen is None else column * chosen[motor]) for motor, column in enumerate(columns)
    ]
    sums = products[0]
    for more in products[1:]:
        sums = [one + other for one, other in zip(sums, more, strict=True)]
    xx, xy, xz, yy, yz, zz = sums
    return xx, xy, xz, yy, yz, zz


def _products(a: Array, b: Array) -> list[Array]:
    return [a[0] * b[0], a[0] * b[1], a[0] * b[2], a[1] * b[1], a[1] * b[2], a[2] * b[2]]
