"""The motion of a robot at the samples of trajectories, and between them wherever it may be harder than at all samples.

Between two samples the platform moves as `in_between` says, and casters trail. Spans between samples are
divided, and so are their parts, while something may be greater in them than what is known to be the greatest of its
trajectory.

    P, K     trajectories, spans of each
    Q        spans of any trajectories
    R        quantities at each moment, of which the greatest is sought
"""

from collections.abc import Callable, Iterator, Sequence
from itertools import groupby
from typing import NamedTuple, TypeAlias

import numpy as np

from caster_gym.arrays import Array, Flags, Indices, Plane
from caster_gym.mechanics.caster import joint_rates
from caster_gym.mechanics.dynamics import joint_friction
from caster_gym.mechanics.parameters import CasterParameters, robot_parameters
from caster_gym.mechanics.scalars import Direction, Vector, each, flatten
from caster_gym.paths.in_between import motion_between, room_for
from caster_gym.paths.trailing import trailing_directions, trailing_on
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

FRICTION_TURN = 2e-3  # [-] of a motor's torque: a joint's dry friction that changes by more is changing its sign
_BLOCK = 16_384  # samples that are worked on at once
_PARTS = 8  # of a span that is looked at closer
_LEVELS = 4  # of division: 20 ms are divided down to 5 µs
_CLOSE = 1e-4  # [-] by which the greatest value may be missed
_ROOM = 0.25  # [-] of a second difference: a parabola rises by 1/8 of it between points, twice that if it still grows
_SWIFT = 0.2  # [rad] of steering in a span: its ends do not show what happens in between
_FELT = 2.0  # [-] of the torque that dry friction takes: what it may add to a use, with half left at the speed
_SHOWN = 2  # levels from which on steering and friction are resolved


class Motion(NamedTuple):
    """Twists in B, the rates of their components, and the rolling directions in B."""

    v: Vector
    rate: Vector
    directions: tuple[Direction, ...]


class Block(NamedTuple):
    """All samples of some trajectories."""

    path: Indices  # (P,) which ones
    time_step: float  # [s]
    rows: Array  # (P, K + 1, 10)
    psi: Plane  # (P, K + 1, N) rolling directions in W
    motion: Motion  # of arrays (P, K + 1)


class Moments(NamedTuple):
    """Moments between samples."""

    path: Indices  # (Q,) which trajectory
    time: Array  # (Q,) [s]
    rows: Array  # (Q, 10) as samples
    psi: Plane  # (Q, N) rolling directions in W
    values: Array  # (R, Q)


class Spans(NamedTuple):
    """What lies between two samples in succession, or a part of it."""

    path: Indices  # (Q,) which trajectory
    time: Array  # (Q,) [s] of the sample before
    step: Array  # (Q,) [s] from that sample to the next
    start: Array  # (Q, 10) that sample
    end: Array  # (Q, 10) the next
    room: Array  # (Q, 3) of the accelerations between them
    share: Array  # (Q,) [-] of the step at which the part begins
    width: Array  # (Q,) [-] of the step that it takes
    psi: Plane  # (Q, N) rolling directions in W at its start
    before: Array  # (R, Q) values there
    after: Array  # (R, Q) values at its end


Measure: TypeAlias = Callable[[Motion], Array]


def motion_at(rows: Array, psi: Plane) -> Motion:
    """The motion at samples (..., 10), with rolling directions (..., N) in W."""
    back = rows[..., 2] - 1j * rows[..., 3]
    velocity, acceleration = (back * (rows[..., i] + 1j * rows[..., i + 1]) for i in (4, 7))
    omega, alpha = rows[..., 6].copy(), rows[..., 9].copy()
    turning = acceleration - 1j * omega * velocity  # derivative of the components of the velocity in B
    directions = tuple((f.real.copy(), f.imag.copy()) for f in np.moveaxis(psi * back[..., None], -1, 0))
    return Motion(
        (velocity.real.copy(), velocity.imag.copy(), omega),
        (turning.real.copy(), turning.imag.copy(), alpha),
        directions,
    )


def sample_paths(trajectories: Sequence[Trajectory], robot: Robot) -> Iterator[Block]:
    """All samples of trajectories, casters trailing, in blocks whose arrays stay in the processor's cache."""
    first = 0
    for (steps, time_step), group in groupby(trajectories, key=lambda t: (len(t.samples) - 1, t.time_step)):
        samples = np.stack([trajectory.samples for trajectory in group])
        count = max(1, _BLOCK // (steps + 1))
        for rows in (samples[i : i + count] for i in range(0, len(samples), count)):
            psi = trailing_directions(rows, time_step, robot)
            yield Block(np.arange(first, first + len(rows)), time_step, rows, psi, motion_at(rows, psi))
            first += len(rows)


def hard_spans(block: Block, values: Array, best: Array, robot: Robot) -> Spans:
    """The spans of samples that must be looked at closer, by values (R, P, K + 1) there and the best known (P,)."""
    p, k = np.nonzero(_may_be_harder(values, block.motion, best[block.path, None], robot, 0))
    return Spans(
        path=block.path[p],
        time=np.asarray(k * block.time_step, dtype=np.float64),
        step=np.full(len(p), block.time_step),
        start=block.rows[p, k],
        end=block.rows[p, k + 1],
        room=_room(block.rows[..., 7:], p, k),
        share=np.zeros(len(p)),
        width=np.ones(len(p)),
        psi=block.psi[p, k],
        before=values[:, p, k],
        after=values[:, p, k + 1],
    )


def _room(acceleration: Array, p: Indices, k: Indices) -> Array:
    """Room (Q, 3) of the accelerations (P, K + 1, 3) after samples k of trajectories p."""
    last = acceleration.shape[1] - 2
    if last < 1:
        return np.full((len(p), 3), np.inf)
    around = (np.clip(k + i, 1, last) for i in (0, 1))
    bent = (acceleration[p, i + 1] - 2.0 * acceleration[p, i] + acceleration[p, i - 1] for i in around)
    return room_for(*bent)


def moments_within(spans: Spans, best: Array, measure: Measure, robot: Robot) -> Iterator[Moments]:
    """Moments within spans, closer and closer, until none can be harder than what is known.

    best (P,) is the greatest value that is known of each trajectory; it is kept up to date.
    """
    for level in range(1, _LEVELS + 1):
        if not len(spans.path):
            return
        share = spans.share + np.arange(_PARTS + 1)[:, None] / _PARTS * spans.width
        rows = _rows(spans, share)
        psi = trailing_on(spans.psi, rows, spans.step * spans.width / _PARTS, robot)
        motion = motion_at(np.moveaxis(rows, 0, 1), np.moveaxis(psi, 0, 1))  # (Q, parts + 1)
        inside = measure(_without_ends(motion))
        values = np.concatenate([spans.before[..., None], inside, spans.after[..., None]], axis=2)
        np.maximum.at(best, spans.path, inside.max(axis=(0, 2)))
        yield Moments(
            path=np.tile(spans.path, _PARTS - 1),
            time=(spans.time + share[1:-1] * spans.step).ravel(),
            rows=rows[1:-1].reshape(-1, rows.shape[-1]),
            psi=psi[1:-1].reshape(-1, psi.shape[-1]),
            values=np.moveaxis(inside, 2, 1).reshape(len(inside), -1),
        )
        q, k = np.nonzero(_may_be_harder(values, motion, best[spans.path, None], robot, level))
        spans = Spans(
            path=spans.path[q],
            time=spans.time[q],
            step=spans.step[q],
            start=spans.start[q],
            end=spans.end[q],
            room=spans.room[q],
            share=share[k, q],
            width=spans.width[q] / _PARTS,
            psi=psi[k, q],
            before=values[:, q, k],
            after=values[:, q, k + 1],
        )


def join_spans(spans: list[Spans]) -> Spans:
    """All spans of several sets."""
    parts = list(zip(*spans, strict=True))
    return Spans(*map(np.concatenate, parts[:9]), *(np.concatenate(values, axis=1) for values in parts[9:]))


def dry_friction(v: Vector, coulomb_speed: float, f: Direction, caster: CasterParameters) -> tuple[Array, Array]:
    """Dry friction of a caster's two joints. [N m]"""
    roll, steer = joint_rates(v, f, caster)
    return (
        joint_friction(roll, 0.0, caster.roll_coulomb, coulomb_speed),
        joint_friction(steer, 0.0, caster.steer_coulomb, coulomb_speed),
    )


def greatest_torques(caster: CasterParameters) -> tuple[float, float]:
    """Greatest torques of a caster's two motors. [N m]"""
    return caster.roll_max_torque, caster.steer_max_torque


def _may_be_harder(values: Array, motion: Motion, best: Array, robot: Robot, level: int) -> Flags:
    """Which spans (Q, S) between values (R, Q, S + 1) at points in a row may hold more than the best, (Q, 1)."""
    bent = np.zeros_like(values)
    inner = values[..., 1:-1]
    np.maximum(2.0 * inner - values[..., :-2] - values[..., 2:], 0.0, out=bent[..., 1:-1])
    bent[..., 0], bent[..., -1] = bent[..., 1], bent[..., -2]
    ends = np.maximum(values[..., :-1], values[..., 1:])
    bound = ends + _ROOM * np.maximum(bent[..., :-1], bent[..., 1:])
    harder: Flags = bound.max(axis=0) > (1.0 + _CLOSE) * best
    if level < _SHOWN:
        for cos, sin in motion.directions:
            harder |= np.abs(cos[:, 1:] * sin[:, :-1] - sin[:, 1:] * cos[:, :-1]) > _SWIFT
            harder |= cos[:, 1:] * cos[:, :-1] + sin[:, 1:] * sin[:, :-1] < 0.0
        turned = _friction_turned(motion, robot)
        harder |= (turned > 0.0) & (ends.max(axis=0) + _FELT * turned > best)
    return harder


def _friction_turned(motion: Motion, robot: Robot) -> Array:
    """By how much the dry friction of joints changes in spans (Q, S), in shares of motors' torques, if that is fast."""
    numbers = robot_parameters(robot)
    turned = np.zeros((motion.v[2].shape[0], motion.v[2].shape[1] - 1))
    if not any(caster.roll_coulomb or caster.steer_coulomb for caster in numbers.casters):
        return turned
    dry = flatten(each(dry_friction, (motion.v, numbers.platform.coulomb_speed), motion.directions, numbers.casters))
    for torque, size in zip(dry, flatten(each(greatest_torques, (), numbers.casters)), strict=True):
        change = np.abs(np.diff(torque)) / size
        turned += np.where(change > FRICTION_TURN, change, 0.0)
    return turned


def _rows(spans: Spans, share: Array) -> Array:
    """Rows (S, Q, 10) as samples at shares (S, Q) of the steps in which spans lie."""
    heading, last = (row[:, 2] + 1j * row[:, 3] for row in (spans.start, spans.end))
    turn = np.angle(last / heading)
    start, end = (
        (np.stack([row[:, 0], row[:, 1], angle], axis=1), row[:, 4:7], row[:, 7:])
        for row, angle in ((spans.start, 0.0 * turn), (spans.end, turn))
    )
    place, rate, acceleration = motion_between(start, end, spans.step[:, None], share[..., None], spans.room)
    heading = heading * np.exp(1j * place[..., 2])
    turned = np.stack([heading.real, heading.imag], axis=-1)
    return np.concatenate([place[..., :2], turned, rate, acceleration], axis=-1)


def _without_ends(motion: Motion) -> Motion:
    """A motion of (Q, S + 1) without its first moment and its last."""
    v, rate, directions = (
        [tuple(x[:, 1:-1] for x in one) for one in part] for part in ((motion.v,), (motion.rate,), motion.directions)
    )
    return Motion(v[0], rate[0], tuple(directions))
