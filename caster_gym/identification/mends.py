"""Common mistakes in recordings, each with its message and the recording without it."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence, Sized
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from caster_gym.analysis.frames import turn_planar
from caster_gym.arrays import Array
from caster_gym.identification.recording import Recording
from caster_gym.robot import Robot

_DEGREE = math.pi / 180.0
_LONGEST_SHIFT = 10  # samples
_SMALLER = {1e2: "cm", 1e3: "mm"}
_ONE_TURN = 2.0 * math.pi + 0.1  # [rad] and some noise
_ONE_RATIO = 0.02  # [-] by which ratios of casters differ that are one
_ALL_ORDERS = 4  # casters, beyond which columns are only swapped in pairs


class Mend(NamedTuple):
    """One mistake and its mend."""

    wrong: str  # what seems wrong, as the end of "it looks as if …"
    advice: str  # what to do in the file
    mended: Callable[[Recording], Recording]
    of: str = "pose"  # which columns: pose, steering, rolling, twist or time


def mends(recording: Recording, robot: Robot) -> Iterator[Mend]:
    """Mistakes that may have been made in a recording."""
    yield from _headings()
    yield from _positions()
    for name in ("steering", "rolling"):
        if getattr(recording, name) is not None:
            yield from _columns(name, robot.caster_count)
    yield from _whole_casters(recording)
    yield from _rolling_units(recording, robot)
    yield from _twists(recording)
    yield from _times()
    yield from _shifts(recording)


def _changed(name: str, wrong: str, advice: str, change: Callable[[Recording, Array], Array]) -> Mend:
    """The mend of the columns (K, n) of one field."""
    return Mend(wrong, advice, lambda r: r.change_columns(lambda k, own: change(r, own) if k == name else own), name)


def negated(name: str, which: Sequence[int]) -> Mend:
    """Columns of casters (from 0) with the other sign."""
    columns = listed(f"{name}_{i + 1}" for i in which)
    return _scaled(name, f"{columns} {_have(which)} the other sign", f"negate {columns}", dict.fromkeys(which, -1.0))


def turned(zeros: dict[int, float]) -> Mend:
    """Steering angles of casters (from 0) less their zeros [rad]."""
    columns = listed(f"steering_{i + 1}" for i in zeros)
    values = listed(f"{zero:.4g}" for zero in zeros.values())
    return _changed(
        "steering",
        f"{columns} {_have(zeros)} a zero of {values} rad: they are to be the angles of the rolling directions "
        "from the body's x-axis",
        f"subtract {values} rad from {columns}",
        lambda r, steering: steering - np.array([zeros.get(i, 0.0) for i in range(steering.shape[1])]),
    )


def _headings() -> Iterator[Mend]:
    def of(wrong: str, advice: str, change: Callable[[Array], Array]) -> Mend:
        return _changed("pose", wrong, advice, lambda _, pose: np.column_stack([pose[:, :2], change(pose[:, 2])]))

    yield of("heading has the other sign (it is to grow counter-clockwise)", "negate heading", lambda b: -b)
    clockwise = "heading is measured clockwise from the y-axis (from north)"
    yield of(clockwise, "write 'pi/2 - heading' instead of heading", lambda b: 0.5 * np.pi - b)
    yield of("heading is in degrees", _in_header(["heading"], "deg"), lambda b: b * _DEGREE)
    radians = "heading is in radians, though its header says degrees"
    yield of(radians, _in_header(["heading"], "rad"), lambda b: b / _DEGREE)
    for degrees in (90, -90, 180):
        yield of(
            f"heading is {degrees}° ahead of the body's x-axis",
            f"subtract {degrees}° from heading",
            lambda b, ahead=degrees * _DEGREE: b - ahead,  # type: ignore[misc]  # mypy does not follow defaults
        )


def _positions() -> Iterator[Mend]:
    def of(wrong: str, advice: str, matrix: Iterable[Iterable[float]]) -> Mend:
        turn = np.array([*matrix])
        return _changed("pose", wrong, advice, lambda _, pose: np.column_stack([pose[:, :2] @ turn.T, pose[:, 2]]))

    yield of("x and y are swapped", "swap the columns x and y", [[0, 1], [1, 0]])
    yield of("y has the other sign", "negate y", [[1, 0], [0, -1]])
    yield of("x has the other sign", "negate x", [[-1, 0], [0, 1]])
    yield of("x and y have the other sign", "negate x and y", [[-1, 0], [0, -1]])
    for factor, unit in ((1e-3, "mm"), (1e-2, "cm"), (0.3048, "feet"), (0.0254, "inches")):
        advice = f"multiply x and y by {factor}" if len(unit) > 2 else _in_header(["x", "y"], unit)
        yield of(f"x and y are in {unit}", advice, [[factor, 0], [0, factor]])
    for factor, unit in _SMALLER.items():
        words = f"x and y are {factor:g} times too small, as metres are that were read as {unit}"
        yield of(words, _in_header(["x", "y"], "m"), [[factor, 0], [0, factor]])


def _columns(name: str, count: int) -> Iterator[Mend]:
    """Signs, units and orders of the casters' columns."""
    everyone = range(count)
    for size in range(1, count + 1):
        for which in itertools.combinations(everyone, size):
            if size in (1, count) or count <= _ALL_ORDERS:
                yield negated(name, which)
    for which in (*((i,) for i in everyone), tuple(everyone)):
        columns = [f"{name}_{i + 1}" for i in which]
        for unit, units in (("deg", "degrees, not in radians"), ("rad", "radians, not in degrees")):
            factor = _DEGREE if unit == "deg" else 1.0 / _DEGREE
            words = f"{listed(columns)} {_are(columns)} in {units}"
            yield _scaled(name, words, _in_header(columns, unit), dict.fromkeys(which, factor))
    yield from (_reordered((name,), order) for order in _orders(count))
    for degrees in (90, -90, 180) if name == "steering" else ():
        yield turned(dict.fromkeys(everyone, degrees * _DEGREE))
        for i in everyone:
            yield turned({i: degrees * _DEGREE})


def _whole_casters(recording: Recording) -> Iterator[Mend]:
    """Casters that are counted in another order, in all of their columns."""
    if recording.rolling is None:
        return
    ring = list(range(recording.steering.shape[1]))
    turns = [tuple(some[i:] + some[:i]) for some in (ring, ring[::-1]) for i in ring]
    pairs = (order for order in _orders(len(ring)) if sum(i != j for i, j in enumerate(order)) == 2)
    for order in dict.fromkeys((*pairs, *turns)):  # the other way round, or from another caster on
        if order != tuple(ring):
            yield _reordered(("steering", "rolling"), order)


def _reordered(names: tuple[str, ...], order: tuple[int, ...]) -> Mend:
    """Columns that are those of other casters: the columns of caster i are called by the number order[i]."""
    moved = [(i, j) for i, j in enumerate(order) if i != j]
    columns = listed(f"{name}_{i + 1}" for name in names for i, _ in moved)
    calls = listed(f"{name}_{j + 1} {name}_{i + 1}" for name in names for i, j in moved)
    return Mend(
        f"{columns} are columns of other casters",
        f"call {calls} (the torques with them, if those are in the same order)",
        lambda r: r.change_columns(lambda name, own: own[:, list(order)] if name in names else own),
        names[0],
    )


def _orders(count: int) -> Iterator[tuple[int, ...]]:
    if count <= _ALL_ORDERS:
        yield from (order for order in itertools.permutations(range(count)) if order != tuple(range(count)))
        return
    for i, j in itertools.combinations(range(count), 2):
        order = list(range(count))
        order[i], order[j] = j, i
        yield tuple(order)


def _rolling_units(recording: Recording, robot: Robot) -> Iterator[Mend]:
    if recording.rolling is None:
        return
    columns = listed(f"rolling_{i + 1}" for i in range(robot.caster_count))

    def of(wrong: str, advice: str, change: Callable[[Recording, Array], Array]) -> Mend:
        return _changed("rolling", f"{columns} {wrong}", advice, change)

    radii = np.array([1.0 / caster.radius for caster in robot.casters])
    yield of("are ways in metres, not angles", f"divide {columns} by the wheels' radii", lambda _, ways: ways * radii)
    in_turns = f"multiply {columns} by 2 pi"
    yield of("are in turns, not in radians", in_turns, lambda _, turns: turns * (2.0 * math.pi))
    summed = f"write the sum of rate times time step into {columns}"
    yield of("are rates in rad/s, not angles", summed, lambda r, rates: _summed(rates, r.time_step))
    if float(np.ptp(recording.rolling, axis=0).max()) <= _ONE_TURN:
        yield of(
            "start again after each turn, as encoders of a single turn do",
            f"add 2 pi to {columns}, or subtract it, from each jump on, as numpy.unwrap does",
            lambda _, angles: np.unwrap(angles, axis=0),
        )


def scaled_up(ratios: dict[int, float]) -> Mend:
    """Rolling angles of casters (from 0) that are so many times too large."""
    columns, values = [f"rolling_{i + 1}" for i in ratios], list(ratios.values())
    middle = sorted(values)[len(values) // 2]
    if all(abs(value / middle - 1.0) < _ONE_RATIO for value in values):
        values, ratios = [middle], dict.fromkeys(ratios, middle)
    sizes, factors = ([f"{value:.4g}" for value in some] for some in (values, [1.0 / value for value in values]))
    return _scaled(
        "rolling",
        f"{listed(columns)} {_are(columns)} {listed(sizes)} times the wheels' angles in radians, such as the counts of "
        "an encoder or the angle of a motor before its gears",
        f"multiply {listed(columns)} by {listed(factors)}",
        {i: 1.0 / ratio for i, ratio in ratios.items()},
    )


def _summed(rates: Array, time_step: float) -> Array:
    return np.concatenate([np.zeros_like(rates[:1]), np.cumsum(0.5 * time_step * (rates[1:] + rates[:-1]), axis=0)])


def _twists(recording: Recording) -> Iterator[Mend]:
    if recording.twist is None:
        return

    def times(wrong: str, advice: str, *factors: float) -> Mend:
        return _changed("twist", wrong, advice, lambda _, twist: twist * np.array(factors))

    yield _changed(
        "twist",
        "vx and vy are in the world's frame, not in the body's",
        "turn (vx, vy) by minus the heading",
        lambda r, twist: turn_planar(twist, np.exp(-1j * r.pose[:, 2])),
    )
    swapped = "vx and vy are swapped"
    yield _changed("twist", swapped, "swap the columns vx and vy", lambda _, twist: twist[:, [1, 0, 2]])
    yield times("vx has the other sign", "negate vx", -1, 1, 1)
    yield times("vy has the other sign (it is to grow to the left)", "negate vy", 1, -1, 1)
    yield times("vx and vy have the other sign", "negate vx and vy", -1, -1, 1)
    yield times("yaw_rate has the other sign (counter-clockwise is positive)", "negate yaw_rate", 1, 1, -1)
    yield times("yaw_rate is in deg/s", _in_header(["yaw_rate"], "deg/s"), 1, 1, _DEGREE)
    yield times("yaw_rate is in rad/s", _in_header(["yaw_rate"], "rad/s"), 1, 1, 1.0 / _DEGREE)
    for factor, unit in ((1e-3, "mm/s"), (1e-2, "cm/s")):
        yield times(f"vx and vy are in {unit}", _in_header(["vx", "vy"], unit), factor, factor, 1)
    yield times("vx and vy are in km/h", "divide vx and vy by 3.6", 1 / 3.6, 1 / 3.6, 1)
    for factor, unit in _SMALLER.items():
        words = f"vx and vy are {factor:g} times too small, as m/s are that were read as {unit}/s"
        yield times(words, _in_header(["vx", "vy"], "m/s"), factor, factor, 1)


def _times() -> Iterator[Mend]:
    def of(factor: float) -> Callable[[Recording], Recording]:
        return lambda r: replace(r, time_step=factor * r.time_step)

    for factor, unit in ((1e-3, "ms"), (1e-6, "µs"), (1e-9, "ns")):
        advice = _in_header(["time"], unit) if factor == 1e-3 else f"multiply time by {factor:g}, to have seconds"
        yield Mend(f"time is in {unit}", advice, of(factor), "time")
    short = "time is 1000 times too short, as seconds are that were read as ms"
    yield Mend(short, _in_header(["time"], "s"), of(1e3), "time")
    yield Mend("time is in minutes", "multiply time by 60, to have seconds", of(60.0), "time")


def _shifts(recording: Recording) -> Iterator[Mend]:
    """Columns from an earlier or a later moment than the others of their row."""
    casters = range(1, recording.steering.shape[1] + 1)
    groups = {name: listed(f"{name}_{i}" for i in casters) for name in ("steering", "rolling")}
    groups |= {"twist": "vx, vy and yaw_rate", "position": "x and y", "heading": "heading", "pose": "x, y and heading"}
    for name, columns in groups.items():
        field = "pose" if name in ("position", "heading") else name
        if getattr(recording, field) is None:
            continue
        longest = min(_LONGEST_SHIFT, len(recording.pose) // 4)
        for rows in (*range(-longest, 0), *range(1, longest + 1)):
            count, late = abs(rows), rows > 0
            verb = "comes" if name == "heading" else "come"
            way, moved = f"{count} row{'s' * (count > 1)}", "up" if late else "down"
            yield Mend(
                f"{columns} {verb} {way} {'late' if late else 'early'}",
                f"move {columns} {moved} by {way} against the other columns",
                lambda r, name=name, rows=rows: _shifted(r, name, rows),  # type: ignore[misc]
                field,
            )


def _shifted(recording: Recording, name: str, rows: int) -> Recording:
    """Some columns `rows` later than they came, the ends left out."""
    count = len(recording.pose) - abs(rows)
    theirs, others = (slice(rows, None), slice(count)) if rows > 0 else (slice(count), slice(-rows, None))
    cut = recording.change_columns(lambda key, columns: columns[theirs if key == name else others])
    if name not in ("position", "heading"):
        return cut
    place, turn = (theirs, others) if name == "position" else (others, theirs)
    return replace(cut, pose=np.column_stack([recording.pose[place, :2], recording.pose[turn, 2]]))


def _scaled(name: str, wrong: str, advice: str, factors: dict[int, float]) -> Mend:
    """Columns of casters (from 0), each times its factor."""
    return _changed(
        name, wrong, advice, lambda _, own: own * np.array([factors.get(i, 1.0) for i in range(own.shape[1])])
    )


def _in_header(columns: Sequence[str], unit: str) -> str:
    return f"write {listed(f'{column} [{unit}]' for column in columns)} into the header"


def _have(which: Sized) -> str:
    return "have" if len(which) > 1 else "has"


def _are(which: Sized) -> str:
    return "are" if len(which) > 1 else "is"


def listed(names: Iterable[str]) -> str:
    """a, b and c."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
