"""Where over the steering angles a robot is hit alike in all directions, and where most unevenly.

The elongation ε of docs/analysis.md, section U, is one complex number: its zeros, the circles, are points for two free
steering angles, curves for three and surfaces for four.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.robot import Robot, check_joints
from papers.analysis.impulse_shape import CENTRE, ComplexArray, elongation

STRIDE = 0.05  # [rad] between neighbouring points of a traced curve
SLICES, CELLS = 12, 64  # planes in which circles are looked for, and cells along each side of them

_DIFFERENCE = 1e-5  # [rad] of central differences of ε: truncation and rounding both near 1e-11
_ROUNDS = 12  # of Newton's method, which doubles its digits in each
_LONGEST = 5000  # strides of a curve
_PARTS = 8  # along each side, into which a cell with a root and half of its neighbours are cut to part close roots
_SAME = 1e-7  # [rad] between two finds of one root
_CIRCLE = 1e-12  # |ε| that rounding leaves at a root
_ROUND = 1e-9  # |ε| far above rounding, far below what any wheel makes
_DESCENT: Any = {"gtol": 1e-7}
_SAMPLES, _STARTS = 4096, 8  # of the search for the greatest elongation: the best few samples start a descent


class CircleCurve(NamedTuple):
    """A closed curve of steering angles at which every direction is hit alike."""

    steering: Array  # (K, N) [rad], continuous; the first point follows the last, up to `windings`
    windings: tuple[int, int, int]  # how often the curve goes round in each of the three free angles, in periods
    period: float  # [rad] π where half a turn of a caster changes nothing, else 2 π

    @property
    def copies(self) -> int:
        """Number of closed curves over whole turns of the three casters that this one stands for."""
        if self.period > 1.5 * np.pi:
            return 1
        return 4 if any(turns % 2 for turns in self.windings) else 8

    def holds(self, steering: ArrayLike) -> bool:
        """Whether a circle (N,) is one of this curve's: chords of a stride keep within a stride squared of it."""
        offset = _wrapped(np.asarray(steering, dtype=np.float64) - self.steering, self.period)
        chord = _wrapped(np.roll(self.steering, -1, 0) - self.steering, self.period)
        share = np.clip((offset * chord).sum(-1) / (chord * chord).sum(-1), 0.0, 1.0)
        return bool(np.linalg.norm(offset - share[:, None] * chord, axis=-1).min() < STRIDE**2)


def greatest_elongation(model: Model, point: ArrayLike = CENTRE) -> tuple[float, Array]:
    """The greatest |ε| over all steering angles, and angles (N,) [rad] in [0, 2π) where it stands.

    The search is global by sampling with a fixed seed and local by descent: the value is attained at the angles.
    """
    from scipy.optimize import minimize

    samples = np.random.default_rng(0).uniform(0.0, 2.0 * np.pi, (_SAMPLES, model.robot.caster_count))
    values = np.abs(elongation(model, samples, point))

    def downhill(steering: Array) -> tuple[float, Array]:
        value, slopes = _with_slopes(model, steering, range(len(steering)), point)
        return -(abs(value) ** 2), -2.0 * (np.conj(value) * slopes).real

    ends = [
        minimize(downhill, samples[i], jac=True, method="BFGS", options=_DESCENT).x
        for i in np.argsort(values)[-_STARTS:]
    ]
    reached = np.abs(elongation(model, ends, point))
    best = int(reached.argmax())
    return float(reached[best]), np.asarray(ends[best] % (2.0 * np.pi))


def circles(
    model: Model, steering: ArrayLike, joints: Sequence[str], point: ArrayLike = CENTRE, cells: int = CELLS
) -> Array:
    """All angles (R, N) of two steering joints at which the curve is a circle, the others as in steering (N,).

    ε turns once about zero round every simple root, so the cells of a grid that it turns round hold the roots, and
    Newton's method ends there. Two roots of opposite turn in one cell are missed: refine `cells` to see. Raises
    ValueError if not just two steering joints are named, or if the curve is a circle everywhere; RuntimeError if two
    roots all but coincide.
    """
    free, given = _free(model, steering, joints, 2)
    if cells < 8:
        raise ValueError(f"cells must be 8 or more along each side, got {cells}")
    period = _period(model.robot)
    size = period / cells
    origin = np.full((1, 2), 0.37 * size)  # off the round angles, where roots like to lie
    coarse = _cells_with_roots(model, given, free, point, origin, period, cells)
    fine = _cells_with_roots(model, given, free, point, coarse - 0.5 * size, 2.0 * size, _PARTS)
    roots: list[Array] = []
    for corner in fine:
        start = given.copy()
        start[free] = corner + size / _PARTS
        root = _newton(model, start, free, point)
        root[free] %= period
        if all(np.abs(_wrapped(root - other, period)).max() > _SAME for other in roots):
            roots.append(root)
    return np.array(roots).reshape(-1, given.size)


def circle_curves(
    model: Model,
    steering: ArrayLike,
    joints: Sequence[str],
    point: ArrayLike = CENTRE,
    slices: int = SLICES,
    cells: int = CELLS,
) -> list[CircleCurve]:
    """The closed curves of angles of three steering joints at which the curve is a circle, the others as in steering.

    Every curve that meets one of the slices (planes of constant third angle) is found and followed all round. Raises
    ValueError as `circles` does, RuntimeError where two curves all but meet and neither can be followed.
    """
    free, given = _free(model, steering, joints, 3)
    if slices < 1:
        raise ValueError(f"slices must be 1 or more, got {slices}")
    period = _period(model.robot)
    curves: list[CircleCurve] = []
    for third in (np.arange(slices) + 0.5) * period / slices:
        given[free[2]] = third
        for root in circles(model, given, joints[:2], point, cells):
            if not any(curve.holds(root) for curve in curves):
                curves.append(_follow(model, root, free, period, point))
    return curves


def _cells_with_roots(
    model: Model, given: Array, free: list[int], point: ArrayLike, corners: Array, size: float, parts: int
) -> Array:
    """Corners (R, 2) of the cells round which ε turns about zero; parts × parts cells make a square patch."""
    ticks = np.arange(parts + 1) * size / parts
    grid = np.broadcast_to(given, (len(corners), parts + 1, parts + 1, given.size)).copy()
    grid[..., free[0]] = corners[:, 0, None, None] + ticks[:, None]
    grid[..., free[1]] = corners[:, 1, None, None] + ticks
    values = elongation(model, grid, point)
    if values.size and np.abs(values).max() < _ROUND:
        raise ValueError(f"robot {model.robot.name!r} is hit alike in all directions whatever its steering angles")
    phase = np.angle(values)
    up, across = _wrapped(np.diff(phase, axis=1)), _wrapped(np.diff(phase, axis=2))
    turns = np.rint((up[:, :, :-1] + across[:, 1:] - up[:, :, 1:] - across[:, :-1]) / (2.0 * np.pi))
    corner: Array = grid[:, :-1, :-1][turns != 0.0][:, free]
    return corner


def _follow(model: Model, start: Array, free: list[int], period: float, point: ArrayLike) -> CircleCurve:
    """The closed curve through a circle, by steps along it that Newton's method brings back."""
    points = [start]
    last = np.zeros(3)
    while len(points) < _LONGEST:
        here = points[-1]
        _, slopes = _with_slopes(model, here, free, point)
        along = np.cross(slopes.real, slopes.imag)  # the two gradients' normal keeps its sense all along the curve
        if along @ last < 0.0:
            raise RuntimeError(f"curves of circles all but meet near the steering angles {here.tolist()} rad")
        step = np.zeros_like(here)
        step[free] = STRIDE * along / np.linalg.norm(along)
        ahead = _newton(model, here + step, free, point)
        gap = _wrapped(start - ahead, period)
        if len(points) > 2 and np.linalg.norm(gap) < STRIDE:
            turns = np.rint((ahead + gap - start)[free] / period).astype(int)
            rest = [ahead] if np.linalg.norm(gap) > 0.1 * STRIDE else []
            return CircleCurve(np.array(points + rest), (int(turns[0]), int(turns[1]), int(turns[2])), period)
        points.append(ahead)
        last = along
    raise RuntimeError(f"the circles from {start.tolist()} rad on do not close within {_LONGEST} strides")


def _newton(model: Model, start: Array, free: list[int], point: ArrayLike) -> Array:
    """The circle nearest to a start, moving the free angles."""
    here = start.copy()
    for _ in range(_ROUNDS):
        value, slopes = _with_slopes(model, here, free, point)
        move = np.linalg.pinv(np.stack((slopes.real, slopes.imag))) @ (value.real, value.imag)
        here[free] -= move
        if np.abs(move).max() < 1e-13:  # [rad] rounding
            break
    if np.abs(elongation(model, here, point)) > _CIRCLE:
        raise RuntimeError(f"no circle was found next to the steering angles {start.tolist()} rad")
    return here


def _with_slopes(model: Model, here: Array, free: Sequence[int], point: ArrayLike) -> tuple[complex, ComplexArray]:
    """ε and its derivatives with respect to the free angles."""
    steps = _DIFFERENCE * np.eye(here.size)[list(free)]
    values = elongation(model, np.concatenate(([here], here + steps, here - steps)), point)
    forward, backward = np.split(values[1:], 2)
    return complex(values[0]), (forward - backward) / (2.0 * _DIFFERENCE)


def _wrapped(angle: Array, period: float = 2.0 * np.pi) -> Array:
    return np.asarray((angle + 0.5 * period) % period - 0.5 * period)


def _period(robot: Robot) -> float:
    """Half a turn of a caster changes the signs of its g_θ and g_η, which M does not feel; an armature's g_δ tells."""
    casters = robot_parameters(robot).casters
    felt = any(caster.steer_armature or caster.cross_armature for caster in casters)
    return 2.0 * np.pi if felt else np.pi


def _free(model: Model, steering: ArrayLike, joints: Sequence[str], count: int) -> tuple[list[int], Array]:
    """Numbers of the casters whose steering joints are named, and a copy of the steering angles."""
    robot = model.robot
    names = check_joints(list(joints), robot.caster_count)
    if len(names) != count or not all(name.startswith("steer_") for name in names):
        raise ValueError(f"joints must name {count} steering joints such as steer_1, got {list(joints)}")
    given = np.array(steering, dtype=np.float64)
    if given.shape != (robot.caster_count,) or not np.isfinite(given).all():
        raise ValueError(f"steering must be {robot.caster_count} finite angles [rad], got {steering!r}")
    return [robot.joints.index(name) // 2 for name in names], given
