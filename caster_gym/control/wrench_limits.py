"""How much of a wrench the driven motors can give, all of its components in one ratio.

    u       motor torques as shares of their greatest, low <= u <= high                        [-]
    B       wrench at C of each motor at its greatest torque, moments divided by a length L    [N]
    F       wanted wrench, its moment divided by L                                             [N]

The wrenches B u fill a zonotope: every face lies along the columns of two motors, n = b_i × b_j, and F is inside where
±n · F <= Σ_k max(±n · b_k low_k, ±n · b_k high_k) for all of them. So the greatest share of a wrench is exact without a
linear programme. Every sum is taken in one order: a robot gets the same numbers alone and in a batch, to the last bit.
"""

from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array, Flags
from caster_gym.control.torque_distribution import distribute

_FLAT = 1e-6  # [-] sine of the angle between two columns that make no face
_SLACK = 1e-9  # [-] of the greatest column, for rounding


class Reach(NamedTuple):
    """What the motors of some robots can push, robots along the last axis."""

    pushable: Array  # (3, 3, robots) takes from a wrench what the motors, damped as `distribute` is, cannot give at all
    normals: Array  # (faces, 3, robots), unit vectors; zero for two columns that are parallel
    pushes: Array  # (faces, motors, robots) n · b_k
    slack: Array  # (robots,) for rounding

    def of(self, robots: Flags) -> "Reach":
        """That of some robots."""
        return Reach(*(part[..., robots] for part in self))

    def lack(self, wrench: Array, low: Array, high: Array) -> Array:
        """How far wrenches (robots, 3) lie beyond the nearest face (robots,); at most 0 where limits allow them."""
        return -np.asarray(self._room(self._given(wrench), low, high).min(axis=0, initial=np.inf))

    def greatest_share(self, start: Array, way: Array, low: Array, high: Array) -> Array:
        """Greatest share (robots,) up to 1 so that the motors can give start + share · way, both (robots, 3).

        1 where no share will do: then the motors are to do what they can.
        """
        room = self._room(self._given(start), low, high)
        speed = self._along(self._given(way))
        speed = np.concatenate([speed, -speed])
        with np.errstate(divide="ignore", invalid="ignore"):
            shares = room / speed
        most = np.where(speed > 0.0, shares, np.inf).min(axis=0, initial=1.0)
        least = np.where(speed < 0.0, shares, 0.0).max(axis=0, initial=0.0)
        stuck = ((speed == 0.0) & (room < 0.0)).any(axis=0)
        return np.where(stuck | (least > most), 1.0, np.maximum(most, 0.0))

    def _given(self, wrench: Array) -> Array:
        x, y, z = wrench.T
        return np.stack([row[0] * x + row[1] * y + row[2] * z for row in self.pushable])

    def _along(self, wrench: Array) -> Array:
        n = self.normals
        along: Array = n[:, 0] * wrench[0] + n[:, 1] * wrench[1] + n[:, 2] * wrench[2]
        return along

    def _room(self, wrench: Array, low: Array, high: Array) -> Array:
        """Distances (2 faces, robots) to the faces, for limits (robots, motors); below 0 outside."""
        along = self._along(wrench)
        above, below = self.slack - along, self.slack + along
        for k, (least, most) in enumerate(zip(low.T, high.T, strict=True)):
            one, other = self.pushes[:, k] * least, self.pushes[:, k] * most
            above, below = above + np.maximum(one, other), below - np.minimum(one, other)
        return np.concatenate([above, below])


def reach_of(b: Array) -> Reach:
    """What motors with B (robots, 3, motors) can push."""
    columns = np.ascontiguousarray(b.transpose(2, 1, 0))
    i, j = np.triu_indices(len(columns), 1)
    (px, py, pz), (qx, qy, qz) = columns[i].swapaxes(0, 1), columns[j].swapaxes(0, 1)
    normals = np.stack([py * qz - pz * qy, pz * qx - px * qz, px * qy - py * qx], axis=1)
    sizes = [np.sqrt(c[:, 0] * c[:, 0] + c[:, 1] * c[:, 1] + c[:, 2] * c[:, 2]) for c in (normals, columns)]
    flat = sizes[0] <= _FLAT * sizes[1][i] * sizes[1][j]
    normals = np.where(flat[:, None], 0.0, normals / np.where(flat, 1.0, sizes[0])[:, None])
    n, c = normals[:, None], columns[None]
    pushes = n[:, :, 0] * c[:, :, 0] + n[:, :, 1] * c[:, :, 1] + n[:, :, 2] * c[:, :, 2]
    return Reach(_pushable(b), normals, pushes, _SLACK * sizes[1].max(axis=0))


def _pushable(b: Array) -> Array:
    """B u of the best u without limits, for unit wrenches (3, 3, robots)."""
    free = np.full((len(b), b.shape[2]), np.inf)
    given = []
    for unit in np.eye(3):
        shares = distribute(b, np.broadcast_to(unit, (len(b), 3)), -free, free)
        wrench = b[:, :, 0] * shares[:, None, 0]
        for k in range(1, b.shape[2]):
            wrench = wrench + b[:, :, k] * shares[:, None, k]
        given.append(wrench.T)
    return np.stack(given, axis=1)
