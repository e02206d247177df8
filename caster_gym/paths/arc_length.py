"""The geometry of a path by its arc length instead of by time.

s        arc length from the start                                  [m]
tangent  dp/ds, unit complex number, in W                           [-]
bend     dψ/ds of the heading ψ                                     [rad/m]
"""

from typing import NamedTuple, TypeVar

import numpy as np

from caster_gym.arrays import Array, Plane
from caster_gym.paths.trajectory import Trajectory, rounded_down, unit

Values = TypeVar("Values", Array, Plane)

LINE_COLUMNS = ("x", "y", "tx", "ty", "curvature", "cos", "sin", "bend", "bend_slope")
MOST_ROW_TURN = 0.5  # [rad] of the tangent or the heading within one row: what lies between rows is interpolated
_MOST_ROWS = 100_000  # a line that needs more has a corner
LEAST_ROWS = 5  # fewer do not show a way that is started and ended at rest
_LONGEST = 500_000  # rows of a line; they take half a minute for each 100,000
_LIMIT_WAY = 1e-3  # [-] of the spacing: nearer to an end, at rest, quotients by the speed give way to their limits


class Line(NamedTuple):
    """A path at equal distances.

    rows (K + 1, 9) with columns LINE_COLUMNS: point [m], unit tangent, curvature, positive to the left [1/m], heading
    as a unit vector, its slope [rad/m] and the slope of that [rad/m²], at the arc lengths 0, spacing, … K · spacing.
    """

    name: str
    spacing: float  # [m]
    rows: Array
    description: str = ""  # what was made of the path


class _Nodes(NamedTuple):
    """A path at any distances: arc length [m] and what belongs to it."""

    s: Array
    point: Plane
    tangent: Plane
    curvature: Array
    heading: Plane
    bend: Array
    bend_slope: Array


class NoLineError(ValueError):
    """A path that stands still, stops or turns back on its way: its arc length does not tell where it is."""


class CoarseSpacingError(ValueError):
    """A path that is too short or turns too sharply for a spacing."""

    def __init__(self, what: str, spacing: float) -> None:
        super().__init__(f"{what}; a spacing of {spacing:g} m would suffice")
        self.what, self.spacing = what, spacing  # [m] one that would suffice


def line_along(trajectory: Trajectory, spacing: float, free_heading: bool) -> Line:
    """The line of a trajectory that rests at its ends only; its spacing [m] is changed so that it divides the length.

    A free heading stays what it is at the start. Raises NoLineError, and CoarseSpacingError that says where the path
    turns too sharply.
    """
    nodes = _nodes(trajectory, spacing)
    if free_heading:
        still = np.zeros_like(nodes.s)
        nodes = nodes._replace(heading=np.full_like(nodes.heading, nodes.heading[0]), bend=still, bend_slope=still)
    length = float(nodes.s[-1])
    count = round(length / spacing)
    if count < LEAST_ROWS:
        what = f"it is {length:.3g} m long, less than {LEAST_ROWS} rows of {spacing:g} m"
        raise CoarseSpacingError(what, _finer(nodes, LEAST_ROWS))
    if count > _LONGEST:
        raise NoLineError(f"it is {length:.4g} m long, over {_LONGEST} rows of {spacing:g} m; its unit must be metres")
    _refuse_sharp_turns(nodes, count)
    s = np.linspace(0.0, length, count + 1)
    tangent = unit(hermite(nodes.s, nodes.tangent, 1j * nodes.curvature * nodes.tangent, s))
    heading = unit(hermite(nodes.s, nodes.heading, 1j * nodes.bend * nodes.heading, s))
    point = hermite(nodes.s, nodes.point, nodes.tangent, s)
    curvature, bend, slope = (np.interp(s, nodes.s, c) for c in (nodes.curvature, nodes.bend, nodes.bend_slope))
    slope[0], slope[-1] = _first_slope(bend[:3], s[1]), _first_slope(bend[:-4:-1], -s[1])
    columns = (point.real, point.imag, tangent.real, tangent.imag, curvature, heading.real, heading.imag, bend, slope)
    return Line(trajectory.name, length / count, np.stack(columns, axis=1), trajectory.description)


def between(rows: Array, spacing: Array | float, share: Array | float, first: Array | slice) -> Array:
    """Rows (..., 9) at a share 0 … 1 of the way from the `first` rows (..., K + 1, 9) to the ones after them.

    The point follows the cubic with the tangents of both rows; everything else is linear, directions made unit again.
    """
    shifted = slice(1, None) if isinstance(first, slice) else first + 1
    low, high = rows[..., first, :], rows[..., shifted, :]
    w, h = np.asarray(share)[..., None], np.asarray(spacing)[..., None]
    mixed = np.asarray(low + w * (high - low))
    mixed[..., 0:2] = _cubic(low[..., 0:2], high[..., 0:2], h * low[..., 2:4], h * high[..., 2:4], w)
    for x in (2, 5):
        mixed[..., x : x + 2] /= np.hypot(mixed[..., x], mixed[..., x + 1])[..., None]
    return mixed


def hermite(at: Array, values: Plane, slopes: Plane, s: Array) -> Plane:
    """The piecewise cubic through values with slopes at ascending places, at s; its error falls with distance⁴."""
    first = np.clip(np.searchsorted(at, s, side="right") - 1, 0, len(at) - 2)
    h = at[first + 1] - at[first]
    rise, end_rise = h * slopes[first], h * slopes[first + 1]
    return _cubic(values[first], values[first + 1], rise, end_rise, (s - at[first]) / h)


def _cubic(low: Values, high: Values, rise: Values, end_rise: Values, w: Array) -> Values:
    """The cubic from low to high with given slopes, at a share w between them."""
    step = high - low
    return low + w * (rise + w * (3.0 * step - 2.0 * rise - end_rise + w * (rise + end_rise - 2.0 * step)))


def _nodes(trajectory: Trajectory, spacing: float) -> _Nodes:
    """The trajectory's own samples by arc length, but those that crowd where it starts and ends."""
    t, h = trajectory.samples, trajectory.time_step
    p, heading, v, a = (t[:, i] + 1j * t[:, i + 1] for i in (0, 2, 4, 7))
    speed = np.abs(v)
    _refuse_rest(t, h)
    rate = np.zeros_like(speed)
    rate[1:-1] = (v.conj() * a).real[1:-1] / speed[1:-1]
    s = _ways(speed, rate, h)
    inside = (s > _LIMIT_WAY * spacing) & (s < s[-1] - _LIMIT_WAY * spacing)
    if inside.sum() < 2:
        raise NoLineError(f"it is only {s[-1]:.3g} m long")
    v, a, speed, rate = v[inside], a[inside], speed[inside], rate[inside]
    tangent = v / speed
    curvature = (v.conj() * a).imag / speed**3
    bend = t[inside, 6] / speed
    bend_slope = (t[inside, 9] - bend * rate) / speed**2
    nodes, ends = s[inside], s[[0, -1]]
    at = np.concatenate([ends[:1], nodes, ends[1:]])
    curvature, bend, bend_slope = (_with_ends(at, column) for column in (curvature, bend, bend_slope))
    first = tangent[0] * np.exp(1j * curvature[0] * (at[0] - at[1]))
    last = tangent[-1] * np.exp(1j * curvature[-1] * (at[-1] - at[-2]))
    chosen = np.concatenate([[0], np.flatnonzero(inside), [len(s) - 1]])
    tangent = np.concatenate([[first], tangent, [last]])
    return _Nodes(at, p[chosen], tangent, curvature, heading[chosen], bend, bend_slope)


def _ways(speed: Array, rate: Array, h: float) -> Array:
    """Arc length from 0 of speeds with rates, by the trapezoidal rule with end corrections."""
    steps = 0.5 * h * (speed[1:] + speed[:-1]) + h * h / 12.0 * (rate[:-1] - rate[1:])
    return np.concatenate([[0.0], np.cumsum(steps)])


def _with_ends(at: Array, inner: Array) -> Array:
    """A column with its limits at both ends, along the lines through the two nearest values."""
    first = inner[0] + (inner[1] - inner[0]) * (at[0] - at[1]) / (at[2] - at[1])
    last = inner[-1] + (inner[-1] - inner[-2]) * (at[-1] - at[-2]) / (at[-2] - at[-3])
    return np.concatenate([[first], inner, [last]])


def _first_slope(values: Array, h: float) -> float:
    """Slope at the first of three values at distances h, of the parabola through them.

    At rest the slope of the bend itself may have no limit: random paths change with time, there the cube root of way.
    """
    return float((4.0 * values[1] - 3.0 * values[0] - values[2]) / (2.0 * h))


def _refuse_rest(samples: Array, h: float) -> None:
    """Refuse samples (K + 1, 10) at time steps h [s] that stop anywhere but at their ends."""
    p, v = samples[:, 0] + 1j * samples[:, 1], samples[:, 4] + 1j * samples[:, 5]
    speed = np.abs(v)
    if not speed.any():
        raise NoLineError(f"it {'turns on the spot' if samples[:, 6].any() else 'stands still'} and leads nowhere")
    back = (v[1:-2].conj() * v[2:-1]).real <= 0.0
    if not back.any():
        return
    k = int(back.argmax()) + 1
    place = _where(_ways(speed, 0.0 * speed, h), p, k)
    if speed[k] == 0.0 or speed[k + 1] == 0.0:
        still = np.flatnonzero(speed[k + 1 :])
        rest = samples[k : k + 1 + (int(still[0]) if len(still) else len(samples)), 6]
        raise NoLineError(f"it {'turns on the spot' if np.abs(rest).any() else 'stops'} {place}")
    raise NoLineError(f"it turns back on the spot {place}")


def _turns(direction: Plane, nodes: _Nodes, count: int) -> Array:
    """Turn (count,) of a direction within each of so many equal rows. [rad]"""
    turned = np.concatenate([[0.0], np.cumsum(np.abs(np.angle(direction[1:] / direction[:-1])))])
    return np.diff(np.interp(np.linspace(0.0, nodes.s[-1], count + 1), nodes.s, turned))


def _refuse_sharp_turns(nodes: _Nodes, count: int) -> None:
    """Refuse a line that turns too much within one of so many equal rows."""
    row = nodes.s[-1] / count
    for what, direction in (("tangent", nodes.tangent), ("heading", nodes.heading)):
        turn = _turns(direction, nodes, count)
        k = int(turn.argmax())
        if turn[k] > MOST_ROW_TURN:
            place = _where(nodes.s, nodes.point, int(np.searchsorted(nodes.s, (k + 0.5) * row)))
            sharp = f"its {what} turns by {turn[k]:.2g} rad within {row:.3g} m {place}, more than {MOST_ROW_TURN:g} rad"
            raise CoarseSpacingError(sharp, _finer(nodes, count))


def _finer(nodes: _Nodes, count: int) -> float:
    """A spacing [m], to two digits, of at least so many rows that each turn little."""
    length = float(nodes.s[-1])
    while True:
        spacing = rounded_down(length / count)
        rows = round(length / spacing)
        turn = max(float(_turns(direction, nodes, rows).max()) for direction in (nodes.tangent, nodes.heading))
        if turn <= MOST_ROW_TURN or rows > _MOST_ROWS:
            return spacing
        count = int(np.ceil(rows * max(1.02, min(turn / MOST_ROW_TURN, 2.0)))) + 1


def _where(s: Array, point: Plane, k: int) -> str:
    return f"at s = {s[k]:.3g} m, (x, y) = ({point[k].real:.3g}, {point[k].imag:.3g}) m"
