"""Analysis of waypoints: where they move, where they rest, and how finely they are rounded.

A path through waypoints is a sequence of legs, each from rest to rest: curves, and turns on the spot between them.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import numpy as np

from caster_gym.arrays import Array, Flags, Indices
from caster_gym.paths.rounding import HEADING_UNITS, headings_note, is_coarse, rounding, zigzag

Turns = Literal["auto", "nearest", "as_written"]

SAME_PLACE = 1e-9  # [m] two waypoints are one
_NEARLY = 1e-3  # [-] of the median spacing: below, two waypoints are one as well
_JITTER = 0.05  # [-] of the spacings on both sides: a step that is shorter and leads elsewhere is a repeated waypoint
_SIDEWAYS = 0.5**0.5  # cosine of the angle from which on a step leads elsewhere
_NEAR_END = 2e-3  # [m] a closed path whose last waypoint is nearer to its first repeats it
_MORE = 2.0  # [-] of a tolerance that rounding explains: a greater zigzag is noise, and told
_GROUP = 3.0  # [-] of the tolerance: waypoints this near to the first of them are seen as one place, at their mean
_LEAST_SPOT_TURN = 1e-6  # [rad] on exact waypoints
_SPOT = 50.0  # [rad/m] a turn that is sharper over the little way between waypoints of one place is one on the spot
_LEAST_NOISY_SPOT_TURN = 0.5  # [rad] on rounded or noisy ones, which may stay at a place for some rows on their way


class Leg(NamedTuple):
    """A piece of the path from rest to rest: n places, of which a turn on the spot has equal ones."""

    points: Array  # (n, 2) [m]
    headings: Array | None  # (n,) [rad], counted on over full turns
    weights: Array  # (n,) waypoints that each place stands for
    closed: bool  # the last place is the first again, and the curve goes on smoothly there


class Track(NamedTuple):
    """The legs of a path, how far they may pass beside the waypoints, and what to tell about it."""

    legs: tuple[Leg, ...]
    tolerance: float  # [m] root mean square
    heading_tolerance: float  # [rad] root mean square
    derived: bool  # the tolerance follows from the rounding of the waypoints
    notes: tuple[str, ...]


def read_track(
    waypoints: Sequence[Sequence[float]],
    closed: bool,
    laps: int,
    tolerance: float | None,
    heading_tolerance: float | None,
    turns: Turns,
) -> Track:
    """The legs through waypoints (x, y) or (x, y, heading) [m, rad]."""
    rows = np.array(waypoints, dtype=np.float64)
    notes: list[str] = []
    if rows.shape[1] == 3:
        rows[:, 2], note = continue_headings(rows[:, 2], turns)
        notes += [note] if note else []
    lap_turn = 0.0
    if closed and np.ptp(rows[:, :2], axis=0).max() >= SAME_PLACE:
        rows, lap_turn, note = _without_repeated_start(rows)
        notes += [note] if note else []
    derived, step = rounding(rows[:, :2])
    allowed = derived if tolerance is None else tolerance
    turn_derived, turn_step = rounding(rows[:, 2:], HEADING_UNITS) if rows.shape[1] == 3 else (0.0, 0.0)
    turn_allowed = turn_derived if heading_tolerance is None else heading_tolerance
    legs, told = _legs(rows, closed, laps, lap_turn, allowed)
    notes += told
    if not closed:
        notes += _nearly_closed(rows)
    if allowed > 0.0:
        why = f"as they are rounded to {step:g} m" if tolerance is None else "as its tolerance allows"
        notes.insert(0, f"smoothed, at {allowed:.2g} m from the waypoints (root mean square), {why}")
    if tolerance is None and (noise := zigzag(rows[:, :2])) > _MORE * allowed:
        notes.insert(0, f"its waypoints zigzag by about {noise:.1g} m: a tolerance of that would smooth it")
    elif tolerance is None and allowed == 0.0 and is_coarse(rows[:, :2]):
        notes.insert(0, "led through waypoints on a coarse grid; if that is rounding, a tolerance would smooth it")
    if turn_allowed > 0.0:
        notes.append(headings_note(turn_allowed, turn_step if heading_tolerance is None else None))
    return Track(legs, allowed, turn_allowed, tolerance is None, tuple(notes))


def continue_headings(headings: Array, turns: Turns) -> tuple[Array, str]:
    """Headings [rad] counted on from the first, and what was decided about them.

    auto: as they were written if some is beyond half a turn, unless they only jump where a turn from 0 to 2π ends;
    otherwise each on the turn nearest to the one before.
    """
    nearest = np.unwrap(headings)
    if turns == "nearest" or np.array_equal(nearest, headings):
        return nearest, ""
    if turns == "as_written":
        return headings, ""
    if np.abs(headings).max() <= np.pi + 1e-4:  # headings in degrees may have been rounded up from π
        return nearest, ""
    if _wraps_at_full_turns(headings, nearest):
        return (
            nearest,
            "headings wrap after a full turn and are taken on; with turns 'as_written' they would turn back there",
        )
    return headings, "headings turn as they are written, more than half a turn between two; with turns 'nearest' less"


def _wraps_at_full_turns(headings: Array, nearest: Array) -> bool:
    """Do headings within a full turn, such as 0 … 2π, jump only where going on as before would leave it?"""
    if np.ptp(headings) > 2.0 * np.pi or len(headings) < 4:
        return False
    written, taken = np.diff(headings), np.diff(nearest)
    jumps = np.flatnonzero(np.abs(written) > np.pi)
    for i in jumps:
        beside = [taken[j] for j in (i - 1, i + 1) if 0 <= j < len(taken) and j not in jumps]
        if not any(step * taken[i] > 0.0 and abs(taken[i]) <= 2.5 * abs(step) for step in beside):
            return False
    return True


def _without_repeated_start(rows: Array) -> tuple[Array, float, str]:
    """Rows of a closed path without those at its end that repeat the first; the turn of a lap; what was left out."""
    count, turn, seen = len(rows), 0.0, False
    spacing = float(np.median(np.hypot(*np.diff(rows[:, :2], axis=0).T))) if len(rows) > 1 else 0.0
    while len(rows) > 2:
        gap = float(np.hypot(*(rows[-1, :2] - rows[0, :2])))
        if gap >= SAME_PLACE and not (gap < _NEAR_END and gap < 0.5 * spacing) and not _is_jitter(rows, spacing):
            break
        if rows.shape[1] == 3 and not seen:
            turn, seen = 2.0 * np.pi * round((rows[-1, 2] - rows[0, 2]) / (2.0 * np.pi)), True
        rows = rows[:-1]
    if rows.shape[1] == 3 and not seen:
        turn = float(np.unwrap([rows[-1, 2], rows[0, 2]])[1] - rows[0, 2])
    left_out = count - len(rows)
    last = "the last waypoint repeats" if left_out == 1 else f"the last {left_out} waypoints repeat"
    return rows, turn, f"{last} the first and is left out" if left_out == 1 else f"{last} the first" * (left_out > 1)


def _is_jitter(rows: Array, spacing: float) -> bool:
    """Is the step from the last row to the first far shorter than those beside it, and does it lead elsewhere?"""
    ring = np.array([rows[-2, :2], rows[-1, :2], rows[0, :2], rows[1, :2]])
    return bool(_jittering(ring, spacing)[1])


def _jittering(points: Array, spacing: float) -> Flags:
    """Which steps (n - 1,) between points only repeat a point, but for its rounding."""
    steps = np.diff(points[:, 0] + 1j * points[:, 1])
    lengths = np.abs(steps)
    small = (lengths < SAME_PLACE) | (lengths < _NEARLY * spacing)
    inner = np.arange(1, len(steps) - 1)
    beside = np.minimum(lengths[inner - 1], lengths[inner + 1])
    across = steps[inner - 1] + steps[inner + 1]
    along = (steps[inner] * across.conj()).real
    elsewhere = along < _SIDEWAYS * lengths[inner] * np.abs(across)
    small[inner] |= (lengths[inner] < _JITTER * beside) & elsewhere
    return small


def _places(rows: Array, tolerance: float) -> Indices:
    """First row of each place, for rows (n, 2 or 3) of which neighbours may be the same place."""
    points = rows[:, 0] + 1j * rows[:, 1]
    if tolerance > 0.0:
        firsts = [0]
        for i, point in enumerate(points.tolist()):
            if abs(point - points[firsts[-1]]) > _GROUP * tolerance:
                firsts.append(i)
        return np.array(firsts)
    lengths = np.abs(np.diff(points))
    moving = lengths[lengths >= SAME_PLACE]
    spacing = float(np.median(moving)) if len(moving) else 0.0
    return np.flatnonzero(np.concatenate([[True], ~_jittering(rows, spacing)]))


def _legs(rows: Array, closed: bool, laps: int, lap_turn: float, tolerance: float) -> tuple[tuple[Leg, ...], list[str]]:
    """Curves from rest to rest, turns on the spot between them, and how many waypoints were not told apart."""
    firsts = _places(rows, tolerance)
    ends = np.append(firsts[1:], len(rows))
    if len(firsts) == 1:
        return _legs_of_one_place(rows, closed, laps)
    spots = np.zeros(len(firsts), dtype=bool)
    if rows.shape[1] == 3:
        turns = np.maximum.reduceat(rows[:, 2], firsts) - np.minimum.reduceat(rows[:, 2], firsts)
        steps = np.concatenate([[0.0], np.hypot(*np.diff(rows[:, :2], axis=0).T)])
        steps[firsts] = 0.0  # they lead from place to place
        least = np.maximum(_LEAST_SPOT_TURN, _SPOT * np.add.reduceat(steps, firsts))
        spots = turns > (_LEAST_NOISY_SPOT_TURN if tolerance > 0.0 else least)
    merged = int((ends - firsts - 1)[~spots].sum())
    notes = [f"{merged} waypoint{' repeats' if merged == 1 else 's repeat'} the place before"] if merged else []
    places, weights = rows[firsts], np.ones(len(firsts))
    if tolerance > 0.0:
        places = np.add.reduceat(rows, firsts) / (ends - firsts)[:, None]
        apart = np.concatenate([[True], np.diff(rows[:, 0] + 1j * rows[:, 1]) != 0.0])
        weights = np.add.reduceat(apart.astype(np.float64), firsts).clip(min=1.0)
    if closed:
        places, weights = np.vstack([places, places[:1]]), np.append(weights, weights[0])
        places[-1, 2:] += lap_turn
    if not spots.any():
        return (Leg(places[:, :2], places[:, 2] if rows.shape[1] == 3 else None, weights, closed),), notes
    times = "once" if spots.sum() == 1 else f"{spots.sum()} times"
    notes.append(f"turns on the spot {times}, at rest")
    legs: list[Leg] = []
    start, leaving = 0, rows[0, 2]
    for k in np.flatnonzero(spots).tolist():
        turned = rows[firsts[k] : ends[k], 2]
        legs += _curve(places, weights, start, k, leaving, turned[0])
        legs.append(Leg(np.repeat(places[k : k + 1, :2], len(turned), axis=0), turned, np.ones(len(turned)), False))
        start, leaving = k, turned[-1]
    legs += _curve(places, weights, start, len(places) - 1, leaving, places[-1, 2])
    return tuple(legs) * laps, notes


def _legs_of_one_place(rows: Array, closed: bool, laps: int) -> tuple[tuple[Leg, ...], list[str]]:
    """A stay, or a turn on the spot; a closed one turns on or back to its first heading, on every lap."""
    if rows.shape[1] == 2:
        return (Leg(rows[:1], None, np.ones(1), False),), ["it stands still"]
    headings = rows[:, 2]
    if closed:
        whole = round((headings[-1] - headings[0]) / (2.0 * np.pi))
        headings = np.append(headings, headings[0] + 2.0 * np.pi * whole)
    turns = bool(np.ptp(headings) > 0.0)
    leg = Leg(np.repeat(rows[:1, :2], len(headings), axis=0), headings, np.ones(len(headings)), False)
    return (leg,) * (laps if turns else 1), ["it turns on the spot" if turns else "it stands still"]


def _curve(places: Array, weights: Array, first: int, last: int, heading: float, end_heading: float) -> list[Leg]:
    """The curve between two places, if they are not the same, from one heading to another."""
    if first == last:
        return []
    chosen = places[first : last + 1].copy()
    chosen[0, 2], chosen[-1, 2] = heading, end_heading
    return [Leg(chosen[:, :2], chosen[:, 2], weights[first : last + 1], False)]


def _nearly_closed(rows: Array) -> list[str]:
    """A remark on an open path that ends almost where it starts."""
    lengths = np.hypot(*np.diff(rows[:, :2], axis=0).T)
    moving = lengths[lengths >= SAME_PLACE]
    gap = float(np.hypot(*(rows[-1, :2] - rows[0, :2])))
    if len(moving) < 3 or gap > max(_NEAR_END, 0.05 * float(np.median(moving))) or gap > 0.1 * moving.sum():
        return []
    return [f"ends {gap:.2g} m from its start, not closed: 'closed' would make it a round course"]
