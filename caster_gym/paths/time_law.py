"""The fastest motion along a line, from rest to rest, within the limits of a robot's motors.

Every interval between rows has one s̈. Half-planes (`motor_limits`) are kept at PARTS + 1 points of it, so that they
hold at both of its rows. A backward pass finds the greatest ṡ² from which the end can still be reached, a forward pass
takes the greatest s̈ that stays below it: Pham and Pham, "A new approach to time-optimal path parameterization based on
reachability analysis", IEEE Transactions on Robotics, 2018. Where the law then asks more of a motor than the margin,
between these points, the half-planes of the interval are drawn in by as much, and the law is found anew.

    u, x     s̈ [m/s²] and ṡ² [m²/s²]
"""

from collections.abc import Sequence
from itertools import groupby
from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array, Indices
from caster_gym.paths.arc_length import Line
from caster_gym.paths.motor_limits import LEAST_LEFT, PARTS, Limits, excess, limits_along, steps_between, ways_along
from caster_gym.robot import Robot

_PASSES = 2  # each takes the tangents of c √x at the law before; a third would save 0.1 % of the time
_BLOCK = 128  # lines that are worked on at once, fewer if they are long
_MOST_ROWS = 40_000  # of a block, for its memory
_SMALL_BLOCK = 16  # lines whose limits are worked out at once, so that their arrays stay in the processor's cache
_SLOWEST = 1e-3  # [m/s] least speed of a tangent of c √x
_FLAT = 1e-9  # [1/(m/s²)] a limit that depends on u by less bounds x alone
_CLOSE = (
    3e-4  # [-] of the margin that a law may go beyond; where it goes farther, limits are drawn in by twice that more
)
_SHARES = np.linspace(0.0, 1.0, PARTS + 1)[:, None, None]  # [-] of an interval, where its limits stand
_ROUNDS = 30  # of drawing limits in; most lines need one, the hardest of those tried needed six


def row_times(square_speed: Array, spacing: float) -> Array:
    """Time at each row of a law (K + 1,): s̈ is constant in between. [s]"""
    speed = np.sqrt(square_speed)
    return np.concatenate([[0.0], np.cumsum(2.0 * spacing / (speed[1:] + speed[:-1]))])


def fastest_laws(lines: Sequence[Line], robot: Robot, speed_limit: float, margin: float) -> list[Array]:
    """ṡ² (K + 1,) at the rows of each line [m²/s²], linear in s between them.

    speed_limit [m/s] bounds ṡ; margin is the share used of each motor's torque at its speed, and of its top speed.
    Raises ValueError where friction alone is more than that.
    """
    laws: dict[int, Array] = {}
    by_length = sorted(range(len(lines)), key=lambda i: (steps_between(lines[i], robot), len(lines[i].rows)))
    for steps, group in groupby(by_length, key=lambda i: steps_between(lines[i], robot)):
        left = list(group)
        while left:
            count = min(_BLOCK, max(1, _MOST_ROWS // len(lines[left[-1]].rows)))
            chosen, left = left[-count:], left[:-count]
            square = _block([lines[i] for i in chosen], steps, robot, speed_limit, margin)
            laws.update({i: square[: len(lines[i].rows), k] for k, i in enumerate(chosen)})
    return [laws[i] for i in range(len(lines))]


def _block(lines: Sequence[Line], steps: int, robot: Robot, speed_limit: float, margin: float) -> Array:
    """ṡ² (K + 1, P) of lines in ascending order of their lengths."""
    last = len(lines[-1].rows) - 1
    slices = [slice(i, i + _SMALL_BLOCK) for i in range(0, len(lines), _SMALL_BLOCK)]
    ways = [ways_along(lines[part], last, steps, robot) for part in slices]
    pieces = [limits_along(w, lines[part], robot, speed_limit, margin) for w, part in zip(ways, slices, strict=True)]
    limits = Limits(*(np.concatenate(column, axis=-1) for column in zip(*pieces, strict=True)))
    spacing = np.array([line.spacing for line in lines])
    ends = np.array([len(line.rows) - 1 for line in lines])
    square = _laws(limits, spacing, ends)
    going = np.arange(len(lines))
    for attempt in range(_ROUNDS):
        parts = [going[going // _SMALL_BLOCK == i] for i in range(len(ways))]
        over = [
            excess(w.of(part % _SMALL_BLOCK), square[:, part], spacing[part], robot, (1.0 + _CLOSE) * margin)
            for w, part in zip(ways, parts, strict=True)
            if len(part)
        ]
        beyond = np.concatenate(over, axis=-1)
        chosen = np.asarray((beyond > 0.0).any(axis=(0, 1)))
        going, beyond = going[chosen], beyond[..., chosen]
        if not going.size:
            return square
        # more from round to round, for intervals in which another limit gives way to the one that is drawn in
        less = np.where(beyond > 0.0, (1.0 + 0.5 * attempt) * beyond + 2.0 * _CLOSE * margin, 0.0)
        before = limits.of(chosen)
        limits = before.drawn_in(less, LEAST_LEFT * margin)
        if np.array_equal(limits.d, before.d):
            break  # nothing is left to draw in
        square[:, going] = _laws(limits, spacing[going], ends[going])
    line, k = lines[going[0]], int(beyond[..., 0].max(axis=1).argmax())
    raise ValueError(
        f"the robot cannot move along path {line.name!r} at s = {k * line.spacing:.3g} m, "
        f"(x, y) = ({line.rows[k, 0]:.3g}, {line.rows[k, 1]:.3g}) m, with a margin of {margin:g}: a caster flips or "
        f"friction changes its sign there; less friction or stronger motors may help"
    )


def _laws(limits: Limits, spacing: Array, ends: Indices) -> Array:
    """ṡ² (K + 1, P) of lines that end at the rows `ends`."""
    rows = limits.top[::PARTS]
    cap = np.where((np.arange(len(rows))[:, None] >= ends) | (np.arange(len(rows)) == 0)[:, None], 0.0, rows**2)
    around = limits.top
    for _ in range(_PASSES):
        # c √x lies below each of its tangents; the one at rest's limit d / c at the latest leaves rest allowed
        tangent = np.minimum(around[:, None], limits.d / np.maximum(limits.c, 1e-300))
        planes = limits.a, limits.b + 0.5 * limits.c / tangent, limits.d - 0.5 * limits.c * tangent
        square = _forward(planes, _backward(planes, cap, spacing), spacing)
        around = np.sqrt(np.maximum(_refined(square), _SLOWEST**2))
    return square


def _refined(square: Array) -> Array:
    """Values (F, P) at all points of what is linear between rows (K + 1, P)."""
    fine = np.empty((PARTS * (len(square) - 1) + 1, square.shape[1]))
    fine[::PARTS] = square
    for part in range(1, PARTS):
        fine[part::PARTS] = square[:-1] + part / PARTS * (square[1:] - square[:-1])
    return fine


class _Bounds(NamedTuple):
    """Bounds low + low_slope x <= u <= high + high_slope x (C, P) of one interval, and x <= most (P,)."""

    high: Array
    high_slope: Array
    low: Array
    low_slope: Array
    most: Array


def _bounds(planes: tuple[Array, Array, Array], k: int, end: Array, spacing: Array) -> _Bounds:
    """Bounds of u in interval k by x at its start, so that all limits are kept and x at its end lies in 0 … end."""
    points = slice(k * PARTS, (k + 1) * PARTS + 1)
    a, b, d = (plane[points] for plane in planes)
    ahead = 2.0 * spacing * _SHARES  # x there is x + ahead u
    a = (a + ahead * b).reshape(-1, len(spacing))
    b, d = b.reshape(a.shape), d.reshape(a.shape)
    bound = np.abs(a) > _FLAT
    slope = np.where(bound, a, 1.0)
    at, by = d / slope, -b / slope
    up, down = a > _FLAT, a < -_FLAT
    most = np.where(~bound & (b > 0.0), d / np.where(b > 0.0, b, 1.0), np.inf).min(axis=0)
    fall = (-0.5 / spacing)[None]
    return _Bounds(
        np.concatenate([np.where(up, at, np.inf), 0.5 * end[None] / spacing]),
        np.concatenate([np.where(up, by, 0.0), fall]),
        np.concatenate([np.where(down, at, -np.inf), 0.0 * fall]),
        np.concatenate([np.where(down, by, 0.0), fall]),
        most,
    )


def _backward(planes: tuple[Array, Array, Array], cap: Array, spacing: Array) -> Array:
    """Greatest x (K + 1, P) at each row from which the end can be reached."""
    reach = cap.copy()
    for k in range(len(cap) - 2, -1, -1):
        bounds = _bounds(planes, k, reach[k + 1], spacing)
        reach[k] = _greatest(bounds, np.minimum(cap[k], bounds.most))
    return reach


def _greatest(bounds: _Bounds, x: Array) -> Array:
    """Greatest x (P,), at most the given one, that leaves u a choice.

    The room for u is concave in x and there is some at 0, so that Newton's steps from above end at the answer.
    """
    lines = np.arange(len(x))
    while True:
        high, low = bounds.high + bounds.high_slope * x, bounds.low + bounds.low_slope * x
        i, j = high.argmin(axis=0), low.argmax(axis=0)
        room = high[i, lines] - low[j, lines]
        slope = bounds.high_slope[i, lines] - bounds.low_slope[j, lines]
        short = (room < 0.0) & (slope < 0.0)
        lower = np.where(short, np.maximum(x - room / np.where(short, slope, -1.0), 0.0), x)
        if not (lower < x).any():
            return x
        x = np.minimum(lower, x)


def _forward(planes: tuple[Array, Array, Array], reach: Array, spacing: Array) -> Array:
    """x (K + 1, P) at the greatest u everywhere that stays within reach of the end."""
    square = np.zeros_like(reach)
    for k in range(len(reach) - 1):
        bounds = _bounds(planes, k, reach[k + 1], spacing)
        u = (bounds.high + bounds.high_slope * square[k]).min(axis=0)
        square[k + 1] = np.clip(square[k] + 2.0 * spacing * u, 0.0, reach[k + 1])
    return square
