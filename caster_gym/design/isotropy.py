"""How evenly a set of joints moves the platform: the kinematic isotropy of kim2001. docs/analysis.md, section Q.

Rates are taken as shares of their greatest, twists as well. The index is the ratio of least to greatest singular value
of the Jacobian between these shares: 1 moves equally well in every direction, 0 cannot move in one. Its mean over every
combination of steering angles is compiled, and combinations that give the same number are computed once.

    top_twist   greatest vx, vy, ω of the platform              (3,) [m/s, m/s, rad/s]
    top_rates   greatest rates of the joints, in their order    (J,) [rad/s]
    grams       what each caster at each of its angles adds to J*ᵀ J*, a row for each entry of the symmetric 3×3
                matrix                                          (C, 6, A)
    weights     for how many angles of the circle an angle stands                                 (A,)
    ends        caster k of the m that enter has the columns ends[k] … ends[k + 1]                (m + 1,)
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numba.extending import register_jitable
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import INLINE, compiled
from caster_gym.engines.native.threads import over_blocks
from caster_gym.mechanics.caster import rate_rows
from caster_gym.mechanics.linear import extreme_eigenvalues
from caster_gym.mechanics.parameters import CasterParameters, RobotParameters, robot_parameters
from caster_gym.mechanics.scalars import maximum, sqrt
from caster_gym.robot import Robot, check_joints

INTERVAL = float(np.radians(5.0))  # [rad] between the steering angles of kim2001's grid
SAME = 1e-9  # relative; quotients and places that differ by less are the same up to rounding
BATCH = 256  # designs whose tables are in memory at once


def global_isotropies(
    robot: Robot,
    joints: Sequence[str],
    top_twist: ArrayLike,
    top_rates: ArrayLike,
    radius: ArrayLike | None = None,
    trail: ArrayLike | None = None,
    interval: float = INTERVAL,
) -> Array:
    """Mean index (C,) over a grid of the steering angles that enter, every `interval` [rad], of C designs and demands.

    top_twist (C, 3) and top_rates (C, J); radius and trail (C,) [m] replace those of every caster, unless they are
    None. What is given once, without the axis C, holds for all. Raises ValueError for unknown joints, for fewer than
    three, for sizes that are not positive, and for an interval that does not divide the circle.
    """
    names = three_or_more(robot, joints)
    twist, rates = tops_of("top_twist", top_twist, 3, many=True), tops_of("top_rates", top_rates, len(names), many=True)
    given = {"radius": radius, "trail": trail}
    sizes = {name: np.atleast_1d(positive(name, size)) for name, size in given.items() if size is not None}
    lengths = {len(part) for part in (*sizes.values(), twist, rates)} - {1}
    if any(size.ndim > 1 for size in sizes.values()) or len(lengths) > 1:
        shapes = {**sizes, "top_twist": twist, "top_rates": rates}
        raise ValueError(
            f"{', '.join(shapes)} must be given once or be equally many along their first axis, got shapes "
            f"{', '.join(str(part.shape) for part in shapes.values())}"
        )
    parameters = robot_parameters(robot)
    changed = {name: size[:, None] for name, size in sizes.items()}
    casters = tuple(caster._replace(**changed) for caster in parameters.casters)
    return _mean_isotropy(parameters._replace(casters=casters), names, twist, rates, _angle_count(interval))


class _Entering(NamedTuple):
    """A caster with at least one of the joints; numbers of several designs are arrays (C, 1)."""

    caster: CasterParameters
    roll: Any  # greatest rate (C, 1) of its rolling joint [rad/s], or None if that is not among the joints
    steer: Any  # and of its steering joint


def _mean_isotropy(
    robot: RobotParameters, joints: Sequence[str], top_twist: Array, top_rates: Array, count: int
) -> Array:
    """Mean index (C,) over `count` angles of every caster that enters, for C designs and demands. (Q3)

    top_twist (C, 3), top_rates (C, J), radii and trails (C, 1); each may be one for all.
    """
    casters = _entering(robot, joints, top_rates)
    sizes = [part for one in casters for part in (one.caster.radius, one.caster.trail, one.roll, one.steer)]
    designs = max(len(top_twist), *(np.size(size) for size in sizes))
    _, chosen, same = np.unique(
        np.round(_signature(casters, top_twist, designs), 10), axis=0, return_index=True, return_inverse=True
    )
    grids = _grids(casters, top_twist, count)
    weights = np.concatenate([weight for _, weight in grids])
    ends = np.cumsum([0, *(len(weight) for _, weight in grids)])
    means = np.empty(len(chosen))
    for start in range(0, len(chosen), BATCH):
        some = chosen[start : start + BATCH]
        twist = _of(top_twist, some)
        tables = [_gram(_pick(one, some), angles, twist) for one, (angles, _) in zip(casters, grids, strict=True)]
        part = means[start : start + BATCH]
        over_blocks(_compiled_means, len(some), np.concatenate(tables, axis=2), weights, ends, part)
    shared: Array = means[same.ravel()]
    return shared


def _entering(robot: RobotParameters, joints: Sequence[str], top_rates: Array) -> list[_Entering]:
    rates = {joint: top_rates[:, j : j + 1] for j, joint in enumerate(joints)}
    every = [
        _Entering(caster, rates.get(f"roll_{i}"), rates.get(f"steer_{i}")) for i, caster in enumerate(robot.casters, 1)
    ]
    return [one for one in every if one.roll is not None or one.steer is not None]


def _signature(casters: Sequence[_Entering], top_twist: Array, designs: int) -> Array:
    """(C, …): designs and demands with the same row have the same index, at every steering.

    Common factors of all rates and of all twists drop out. Row by row, g_θ is 1/r and g_δ is 1/d times a row without r:
    only the trails and the quotients of r θ̇_max and d δ̇_max count. (Q4)
    """
    ways = [top for one in casters for top in _ways(one) if top is not None]
    turned = [one.caster.trail for one in casters if one.steer is not None or one.caster.offset != 0.0]
    columns = [part / ways[0] for part in ways[1:]] + [top_twist[:, i : i + 1] / top_twist[:, :1] for i in (1, 2)]
    rows: Array = np.hstack([np.broadcast_to(np.reshape(part, (-1, 1)), (designs, 1)) for part in columns + turned])
    return np.log(rows)


def _ways(one: _Entering) -> tuple[Any, Any]:
    """Greatest r θ̇ and d δ̇ [m/s], None for a joint that does not enter."""
    return (
        None if one.roll is None else one.caster.radius * one.roll,
        None if one.steer is None else one.caster.trail * one.steer,
    )


def _grids(casters: Sequence[_Entering], top_twist: Array, count: int) -> list[tuple[Array, Array]]:
    """Angles of every caster that have to be looked at, and how many of the circle each stands for."""
    axis = _mirror_axis(casters, top_twist, count)
    grids: list[tuple[Array, Array]] = []
    for k, one in enumerate(casters):
        period = count // 2 if one.steer is None and count % 2 == 0 else count  # (Q5)
        numbers, weights = np.arange(period, dtype=np.float64), np.full(period, count / period)
        if axis is not None and axis[0] == k:
            partners = (axis[1] - numbers) % period  # (Q6)
            weights = np.where(numbers == partners, 1.0, 2.0)[numbers <= partners] * count / period
            numbers = numbers[numbers <= partners]
        grids.append((np.asarray(2.0 * np.pi / count * numbers), weights))
    return grids


def _mirror_axis(casters: Sequence[_Entering], top_twist: Array, count: int) -> tuple[int, int] | None:
    """A caster through whose pivot and C a mirror line of the whole robot goes, and the mirror's sum of angles.

    The image of number j of the grid is number sum − j.
    """
    if not np.allclose(top_twist[:, 0], top_twist[:, 1], rtol=SAME, atol=0.0):
        return None
    for k, one in enumerate(casters):
        twice = 2.0 * np.arctan2(one.caster.y, one.caster.x)
        steps = twice / (2.0 * np.pi) * count
        on_grid = abs(steps - round(steps)) < SAME * count
        if on_grid and all(any(_is_image(a, b, twice) for b in casters) for a in casters):
            return k, round(steps)
    return None


def _is_image(a: _Entering, b: _Entering, twice: float) -> bool:
    """Is b the mirror image of a, about the line through C at half the angle?"""
    c, s = np.cos(twice), np.sin(twice)
    place = c * a.caster.x + s * a.caster.y, s * a.caster.x - c * a.caster.y
    numbers = [(one.caster.radius, one.caster.trail, one.roll, one.steer) for one in (a, b)]
    return (
        bool(np.hypot(place[0] - b.caster.x, place[1] - b.caster.y) <= SAME * np.hypot(*place))
        and a.caster.offset == -b.caster.offset
        and all(
            (x is None) == (y is None) and (x is None or np.allclose(x, y, rtol=SAME, atol=0.0))
            for x, y in zip(*numbers, strict=True)
        )
    )


def _pick(one: _Entering, some: Any) -> _Entering:
    """The numbers of some designs."""
    caster = one.caster._replace(radius=_of(one.caster.radius, some), trail=_of(one.caster.trail, some))
    return _Entering(caster, _of(one.roll, some), _of(one.steer, some))


def _of(numbers: Any, some: Any) -> Any:
    """Those of some designs, if each has its own."""
    return numbers[some] if np.ndim(numbers) and len(numbers) > 1 else numbers


def _gram(one: _Entering, angles: Array, top_twist: Array) -> Array:
    """(C, 6, angles): Σ w wᵀ over the normalised rows w of a caster's joints."""
    _, theta, delta = rate_rows((np.cos(angles), np.sin(angles)), one.caster)
    parts = []
    for row, top in ((theta, one.roll), (delta, one.steer)):
        if top is not None:
            x, y, z = (row[i] * (top_twist[:, i : i + 1] / top) for i in range(3))  # (Q1)
            parts.append(np.stack((x * x, x * y, x * z, y * y, y * z, z * z), axis=1))
    return sum(parts[1:], parts[0])


@register_jitable(**INLINE)
def index(gram: Any) -> Any:
    """σ_min/σ_max of the matrix whose Gram matrix is given. (Q2)"""
    least, greatest = extreme_eigenvalues(gram)
    return sqrt(maximum(least, 0.0 * greatest) / maximum(greatest, 1e-300))


def _mean(gram: Any, weights: Any, ends: Any) -> float:
    """Mean index over every combination of the casters' angles. The last caster's run innermost, side by side."""
    others = len(ends) - 2
    last = ends[others]
    count = len(weights) - last
    xx, xy, xz = gram[0, last:], gram[1, last:], gram[2, last:]
    yy, yz, zz = gram[3, last:], gram[4, last:], gram[5, last:]
    combinations = 1
    for k in range(others):
        combinations *= ends[k + 1] - ends[k]
    sums, part, total = np.zeros(count), np.zeros(6), 0.0
    for number in range(combinations):
        part[:] = 0.0
        weight, rest = 1.0, number
        for k in range(others):
            column = ends[k] + rest % (ends[k + 1] - ends[k])
            rest //= ends[k + 1] - ends[k]
            weight *= weights[column]
            for entry in range(6):
                part[entry] += gram[entry, column]
        a, b, c, d, e, f = part[0], part[1], part[2], part[3], part[4], part[5]
        total += weight
        for j in range(count):
            sums[j] += weight * index((a + xx[j], b + xy[j], c + xz[j], d + yy[j], e + yz[j], f + zz[j]))
    weighted, of_last = 0.0, 0.0
    for j in range(count):
        weighted += weights[last + j] * sums[j]
        of_last += weights[last + j]
    return weighted / (total * of_last)


def _means(first: int, end: int, grams: Any, weights: Any, ends: Any, means: Any) -> None:
    for i in range(first, end):
        means[i] = _compiled_mean(grams[i], weights, ends)


def _described(_types: tuple[Any, ...]) -> Work:
    return Work("means of the isotropy index", 2.0)


_compiled_mean = compiled(_mean)
_compiled_means = compiled(_means, _described)


def three_or_more(robot: Robot, joints: Sequence[str]) -> tuple[str, ...]:
    names = check_joints(tuple(joints), robot.caster_count)
    if len(names) < 3:
        raise ValueError(f"a platform has three degrees of freedom: name three joints or more, got {', '.join(names)}")
    return names


def tops_of(name: str, value: ArrayLike, last: int, many: bool = False) -> Array:
    """Greatest twists (C, 3) or rates (C, J)."""
    array = positive(name, value)
    if array.ndim not in ((1, 2) if many else (1,)) or array.shape[-1] != last:
        kind = "vx, vy and ω" if name == "top_twist" else "one for each joint"
        raise ValueError(f"{name} must have {last} numbers, {kind}, got shape {array.shape}")
    return np.atleast_2d(array)


def positive(name: str, value: ArrayLike) -> Array:
    array = np.asarray(value, dtype=np.float64)
    wrong = ~(np.isfinite(array) & (array > 0.0))
    if wrong.any():
        raise ValueError(f"{name} must be positive and finite, got {array[wrong].flat[0]:g}")
    return array


def _angle_count(interval: float) -> int:
    """How many intervals the circle has."""
    count = 2.0 * np.pi / interval if np.isfinite(interval) and interval > 0.0 else 0.5
    if abs(count - round(count)) > 1e-6 * count:
        raise ValueError(
            f"the interval must divide the circle into whole parts, as 5° = {INTERVAL:.6f} does, got {interval:g} rad"
        )
    return round(count)
