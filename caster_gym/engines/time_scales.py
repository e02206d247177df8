"""How fast the linearised robots of a batch can change: the rates that bound a time step of RK4.

Worked out are friction at rest in the stiffest posture, friction and trailing together at top speed, casters that turn,
and motors, whose torque is that of the speed at a step's start. Equations: `caster_gym.mechanics.stability`.
"""

from collections.abc import Callable
from typing import NamedTuple, TypeAlias

import numpy as np

from caster_gym.arrays import Array
from caster_gym.mechanics import stability
from caster_gym.mechanics.caster import rates
from caster_gym.mechanics.dynamics import caster_inertia, forward_dynamics, platform_inertia
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, unpack_parameters
from caster_gym.mechanics.scalars import Direction, Symmetric, each

Share: TypeAlias = Callable[[Direction, CasterParameters], Symmetric]

_REAL, _COMPLEX = 2.785, 2.61  # least |h λ| at which RK4 is unstable, for λ on the negative real axis and beside it
STEPS_TO_TOP = 2.0  # in which full torque may reach a motor's top speed: in fewer, it swings beyond and pumps others up
_POSTURES = 32  # directions of each caster that are tried
_ROUNDS = 5  # of the search for the stiffest posture, which then changes no more
FRICTION = ("roll_viscous", "roll_coulomb", "steer_viscous", "steer_coulomb", "scrub")
MOTORS = ("roll_max_torque", "steer_max_torque")
_NUDGE = 1e-30  # imaginary step: a derivative by it has no rounding of a difference
_STARTS = np.array(
    [(1, 0, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 0, -1), (0, 1, 1), (0, 1, -1), (1, 1, 0), (1, -1, 0)], dtype=float
)  # twists of unit length, ω over the reach of the pivots


class Limits(NamedTuple):
    """Greatest rates of robots (R,). [1/s]"""

    turning: Array  # of casters at top speed
    friction: Array  # of friction at rest
    motors: Array  # at which full torque reaches the motors' top speed
    driving: Array  # of friction and trailing together, at top speed; 0 where the others are known to say more

    @property
    def needed(self) -> Array:
        """Least rates of time steps that each of the four asks for (4, R). [1/s]"""
        return np.stack([self.turning, self.friction / _REAL, STEPS_TO_TOP * self.motors, self.driving / _REAL])

    @property
    def longest(self) -> Array:
        """Longest time steps (R,) that follow the robots. [s]"""
        return np.asarray(1.0 / self.needed.max(axis=0))


def limits(rows: Array) -> Limits:
    """The rates of robots of given numbers (R, fields)."""
    robots = _columns(rows)
    top = np.max([stability.caster_top_speed(caster) for caster in robots.casters], axis=0)
    least = np.min([caster.trail for caster in robots.casters], axis=0)
    turning = np.max([stability.caster_turning(top, caster._replace(trail=least)) for caster in robots.casters], axis=0)
    friction = _stiffest(robots, _damping(robots)).rate
    motors = _stiffest(robots, stability.caster_falloff).rate
    turning, known = turning[:, 0], np.maximum(turning[:, 0], STEPS_TO_TOP * motors)
    driving = np.zeros(len(rows))
    doubtful = (turning + friction) / _REAL > np.maximum(known, friction / _REAL)
    if doubtful.any():
        driving[doubtful] = _driving(rows[doubtful])
    return Limits(turning, friction, motors, driving)


def greatest_part(rows: Array, of: str) -> tuple[int, str]:
    """Caster (from 1) and field of the number that contributes most to a robot's greatest rate, of one row (1, fields).

    of: "friction" or "motors".
    """
    robots = _columns(rows)
    share, fields = (stability.caster_falloff, MOTORS) if of == "motors" else (_damping(robots), FRICTION)
    found = _stiffest(robots, share)
    parts = {}
    for i, caster in enumerate(robots.casters):
        f = np.cos(found.angles[:, i : i + 1]), np.sin(found.angles[:, i : i + 1])
        for field in fields:
            alone = caster._replace(**{other: 0.0 * caster.x for other in fields if other != field})
            parts[i + 1, field] = float(_along(_matrices(share(f, alone), 1), found.twist[:, None])[0, 0, 0])
    return max(parts, key=lambda place: parts[place])


def _columns(rows: Array) -> RobotParameters:
    """Robots whose numbers are columns (R, 1)."""
    return unpack_parameters(tuple(rows.T[..., None]))


def _damping(robots: RobotParameters) -> Share:
    def damping(f: Direction, caster: CasterParameters) -> Symmetric:
        return stability.caster_damping(robots.platform.coulomb_speed, f, caster)

    return damping


class _Stiffest(NamedTuple):
    rate: Array  # (R,) [1/s]
    twist: Array  # (R, 3)
    angles: Array  # (R, N) of the casters [rad]


def _stiffest(robots: RobotParameters, share: Share) -> _Stiffest:
    """Greatest eigenvalue of Σ share beside the inertia over all postures, and where it is.

    For a twist and a rate, each caster's best direction can be found alone; for their posture, twist and rate are an
    eigenvalue problem. In turn they rise until nothing does.
    """
    angles = 2.0 * np.pi * np.arange(_POSTURES) / _POSTURES
    f = np.cos(angles), np.sin(angles)
    shares = [_matrices(share(f, caster), 1) for caster in robots.casters]  # (R, postures, 3, 3) each
    inertias = [_matrices(caster_inertia(f, caster), 1) for caster in robots.casters]
    body = _matrices(platform_inertia(robots.platform), 0)
    reach = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in robots.casters], axis=0))
    twists = _STARTS / np.concatenate([np.ones_like(reach), np.ones_like(reach), reach], axis=1)[:, None]  # (R, S, 3)
    lanes = np.arange(len(reach))[:, None]
    found = np.zeros(twists.shape[:2])
    for _ in range(_ROUNDS):
        chosen = []
        for mine, inertia in zip(shares, inertias, strict=True):
            gain = _along(mine, twists) - found[..., None] * _along(inertia, twists)
            chosen.append(np.argmax(gain, axis=-1))
        d = sum(mine[lanes, k] for mine, k in zip(shares, chosen, strict=True))
        m = body[:, 0][:, None] + sum(mine[lanes, k] for mine, k in zip(inertias, chosen, strict=True))
        found, twists = _greatest(d, m)
    best = np.argmax(found, axis=1)
    one = lanes[:, 0]
    postures = np.stack([angles[k[one, best]] for k in chosen], axis=1)
    return _Stiffest(found[one, best], twists[one, best], postures)


def _matrices(packed: Symmetric, axes: int) -> Array:
    """(R, …, 3, 3) from columns that may not have all lanes."""
    xx, xy, xz, yy, yz, zz = np.broadcast_arrays(*packed)
    return np.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], axis=-1).reshape(*xx.shape, 3, 3)


def _along(matrices: Array, twists: Array) -> Array:
    """νᵀ D ν (R, S, postures) of D (R, postures, 3, 3) and ν (R, S, 3)."""
    products = twists[..., :, None] * twists[..., None, :]
    return products.reshape(*twists.shape[:2], 9) @ matrices.reshape(*matrices.shape[:2], 9).swapaxes(1, 2)


def _greatest(d: Array, m: Array) -> tuple[Array, Array]:
    """Greatest λ (…) of D ν = λ M ν and its ν (…, 3) of unit energy, for matrices (…, 3, 3)."""
    whitening = np.linalg.inv(np.linalg.cholesky(m))
    values, vectors = np.linalg.eigh(whitening @ d @ whitening.swapaxes(-1, -2))
    return values[..., -1], (whitening.swapaxes(-1, -2) @ vectors[..., -1:])[..., 0]


def _driving(rows: Array) -> Array:
    """Greatest rate (R,) at which robots come to rest in their trailing posture at top speed, in units of RK4's bound.

    Robots move straight ahead in eight directions, and turn at the same time. Rates that grow are physics, not a step
    that is too long; rates beside the real axis count for more, as RK4 bears less of them.
    """
    robots = unpack_parameters(tuple(rows.T[..., None, None]))  # (R, motions, columns of the Jacobian)
    twists = _motions(robots)
    directions, speeds = _trailing(robots, twists)
    top = np.max([stability.caster_top_speed(caster) for caster in robots.casters], axis=0)
    twists = twists * (top[..., 0] / speeds)[..., None]
    size = 3 + len(robots.casters)
    nudges = 1j * _NUDGE * np.eye(size)
    v = tuple(twists[..., None, k] + nudges[:, k] for k in range(3))
    turned = each(_nudged, (), directions, tuple(nudges[:, 3:].T))
    nothing = tuple((0.0, 0.0) for _ in robots.casters)
    bodies = forward_dynamics((v[0], v[1], v[2]), turned, nothing, (0.0, 0.0, 0.0), robots)
    links = [delta for _, _, delta in each(rates, ((v[0], v[1], v[2]),), turned, robots.casters)]
    columns = np.broadcast_arrays(*bodies, *links)
    jacobian = np.stack([column.imag / _NUDGE for column in columns], axis=-2)  # (R, motions, size, size)
    values = np.linalg.eigvals(jacobian)
    sizes = np.abs(values)
    beside = np.abs(values.imag) > 1e-6 * sizes
    weighed = np.where(values.real < 0.0, np.where(beside, _REAL / _COMPLEX, 1.0) * sizes, 0.0)
    return np.asarray(weighed.max(axis=(1, 2)))


def _motions(robots: RobotParameters) -> Array:
    """Twists (R, motions, 3) in eight directions, each without turning and turning either way, and on the spot."""
    reach = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in robots.casters], axis=0))[:, 0, 0]
    ways = 0.25 * np.pi * np.arange(8)
    straight = np.stack([np.cos(ways), np.sin(ways), 0.0 * ways], axis=1)
    turns = [straight + np.array((0.0, 0.0, turn)) for turn in (-1.0, 0.0, 1.0)]
    spot = np.array([(0.0, 0.0, 1.0), (0.0, 0.0, -1.0)])
    scale = np.stack([np.ones_like(reach), np.ones_like(reach), reach], axis=1)
    twists = np.concatenate([*turns, spot]) / scale[:, None]
    return np.asarray(twists)


def _trailing(robots: RobotParameters, twists: Array) -> tuple[tuple[tuple[Array, Array], ...], Array]:
    """Directions of all casters behind their pivots, each a pair (R, motions, 1), and the fastest pivot's speed."""
    directions, fastest = [], np.zeros(twists.shape[:2])
    for caster in robots.casters:
        x = twists[..., 0] - twists[..., 2] * caster.y[..., 0]
        y = twists[..., 1] + twists[..., 2] * caster.x[..., 0]
        speed = np.hypot(x, y)
        still = speed < 1e-9
        around = np.where(still, 1.0, speed)
        directions.append((np.where(still, 1.0, x / around)[..., None], np.where(still, 0.0, y / around)[..., None]))
        fastest = np.maximum(fastest, speed)
    return tuple(directions), fastest


def _nudged(f: tuple[Array, Array], nudge: Array) -> tuple[Array, Array]:
    """A direction turned by a step so small that its square is nothing."""
    return f[0] - nudge * f[1], f[1] + nudge * f[0]
