"""Common mistakes in recordings, each with its message and the recording without it."""

import itertools
import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.identification.recording import Recording
from caster_gym.robot import Robot

_DEGREE = math.pi / 180.0
_LONGEST_SHIFT = 10  # samples
_SMALLER = {1e2: "cm", 1e3: "mm"}
_ONE_TURN = 2.0 * math.pi + 0.1  # [rad] and some noise
_ONE_RATIO = 0.02  # [-] by which ratios of casters differ that are one
_TORQUES_TOO = " (the torques with them, if those are in the same order)"
_ALL_ORDERS = 4  # casters, beyond which columns are only swapped in pairs

# Suppressions below: mypy follows neither the fields that `replace` is given by name nor defaults of lambdas.


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


def negated(name: str, which: Sequence[int]) -> Mend:
    """Columns of casters (from 0) with the other sign."""
    columns = listed(f"{name}_{i + 1}" for i in which)
    factors = dict.fromkeys(which, -1.0)
    return Mend(
        f"{columns} {_have(which)} the other sign",
        f"negate {columns}",
        lambda r: _scaled(r, name, factors),
        name,
    )


def turned(zeros: dict[int, float]) -> Mend:
    """Steering angles of casters (from 0) less their zeros [rad]."""
    columns = listed(f"steering_{i + 1}" for i in zeros)
    values = listed(f"{zero:.4g}" for zero in zeros.values())
    return Mend(
        f"{columns} {_have(list(zeros))} a zero of {values} rad: they are to be the angles of the rolling directions "
        "from the body's x-axis",
        f"subtract {values} rad from {columns}",
        lambda r: replace(r, steering=r.steering - np.array([zeros.get(i, 0.0) for i in range(r.steering.shape[1])])),
        "steering",
    )


def _headings() -> Iterator[Mend]:
    def of(change: Callable[[Array], Array]) -> Callable[[Recording], Recording]:
        return lambda r: replace(r, pose=np.column_stack([r.pose[:, :2], change(r.pose[:, 2])]))

    yield Mend("heading has the other sign (it is to grow counter-clockwise)", "negate heading", of(lambda b: -b))
    yield Mend(
        "heading is measured clockwise from the y-axis (from north)",
        "write 'pi/2 - heading' instead of heading",
        of(lambda b: 0.5 * np.pi - b),
    )
    yield Mend("heading is in degrees", "write heading [deg] into the header", of(lambda b: b * _DEGREE))
    yield Mend(
        "heading is in radians, though its header says degrees",
        "write heading [rad] into the header",
        of(lambda b: b / _DEGREE),
    )
    for degrees in (90, -90, 180):
        yield Mend(
            f"heading is {degrees}° ahead of the body's x-axis",
            f"subtract {degrees}° from heading",
            of(lambda b, ahead=degrees * _DEGREE: b - ahead),  # type: ignore[misc]
        )


def _positions() -> Iterator[Mend]:
    def of(matrix: Iterable[Iterable[float]]) -> Callable[[Recording], Recording]:
        turn = np.array([*matrix])
        return lambda r: replace(r, pose=np.column_stack([r.pose[:, :2] @ turn.T, r.pose[:, 2]]))

    yield Mend("x and y are swapped", "swap the columns x and y", of([[0, 1], [1, 0]]))
    yield Mend("y has the other sign", "negate y", of([[1, 0], [0, -1]]))
    yield Mend("x has the other sign", "negate x", of([[-1, 0], [0, 1]]))
    yield Mend("x and y have the other sign", "negate x and y", of([[-1, 0], [0, -1]]))
    for factor, unit in ((1e-3, "mm"), (1e-2, "cm"), (0.3048, "feet"), (0.0254, "inches")):
        advice = f"multiply x and y by {factor}" if len(unit) > 2 else _in_header(["x", "y"], unit)
        yield Mend(f"x and y are in {unit}", advice, of([[factor, 0], [0, factor]]))
    for factor, unit in _SMALLER.items():
        words = f"x and y are {factor:g} times too small, as metres are that were read as {unit}"
        yield Mend(words, _in_header(["x", "y"], "m"), of([[factor, 0], [0, factor]]))


def _columns(name: str, count: int) -> Iterator[Mend]:
    """Signs, units and orders of the casters' columns."""
    everyone = range(count)
    for size in range(1, count + 1):
        for which in itertools.combinations(everyone, size):
            if size in (1, count) or count <= _ALL_ORDERS:
                yield negated(name, which)
    for which in (*((i,) for i in everyone), tuple(everyone)):
        columns = [f"{name}_{i + 1}" for i in which]
        for factor, unit, wrongly in ((_DEGREE, "deg", "rad"), (1.0 / _DEGREE, "rad", "deg")):
            yield Mend(
                f"{listed(columns)} {_are(columns)} in {_UNIT_WORDS[unit]}, not in {_UNIT_WORDS[wrongly]}",
                _in_header(columns, unit),
                lambda r, which=which, factor=factor: _scaled(r, name, dict.fromkeys(which, factor)),  # type: ignore[misc, arg-type]
                name,
            )
    yield from (_reordered((name,), order) for order in _orders(count))
    if name == "rolling":
        return
    for degrees in (90, -90, 180):
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
        f"call {calls}{_TORQUES_TOO}",
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
    everyone = range(robot.caster_count)
    columns = listed(f"rolling_{i + 1}" for i in everyone)
    radii = {i: 1.0 / caster.radius for i, caster in enumerate(robot.casters)}
    yield Mend(
        f"{columns} are ways in metres, not angles",
        f"divide {columns} by the wheels' radii",
        lambda r: _scaled(r, "rolling", radii),
        "rolling",
    )
    yield Mend(
        f"{columns} are in turns, not in radians",
        f"multiply {columns} by 2 pi",
        lambda r: _scaled(r, "rolling", dict.fromkeys(everyone, 2.0 * math.pi)),
        "rolling",
    )
    yield Mend(
        f"{columns} are rates in rad/s, not angles",
        f"write the sum of rate times time step into {columns}",
        lambda r: replace(r, rolling=_summed(r.rolling, r.time_step)),
        "rolling",
    )

    if float(np.ptp(recording.rolling, axis=0).max()) <= _ONE_TURN:
        yield Mend(
            f"{columns} start again after each turn, as encoders of a single turn do",
            f"add 2 pi to {columns}, or subtract it, from each jump on, as numpy.unwrap does",
            lambda r: replace(r, rolling=None if r.rolling is None else np.unwrap(r.rolling, axis=0)),
            "rolling",
        )


def scaled_up(ratios: dict[int, float]) -> Mend:
    """Rolling angles of casters (from 0) that are so many times too large."""
    columns, values = [f"rolling_{i + 1}" for i in ratios], list(ratios.values())
    middle = sorted(values)[len(values) // 2]
    if all(abs(value / middle - 1.0) < _ONE_RATIO for value in values):
        values, ratios = [middle], dict.fromkeys(ratios, middle)
    sizes, factors = ([f"{value:.4g}" for value in some] for some in (values, [1.0 / value for value in values]))
    return Mend(
        f"{listed(columns)} {_are(columns)} {listed(sizes)} times the wheels' angles in radians, such as the counts of "
        "an encoder or the angle of a motor before its gears",
        f"multiply {listed(columns)} by {listed(factors)}",
        lambda r: _scaled(r, "rolling", {i: 1.0 / ratio for i, ratio in ratios.items()}),
        "rolling",
    )


def _summed(rates: Array | None, time_step: float) -> Array | None:
    if rates is None:
        return None
    return np.concatenate([np.zeros_like(rates[:1]), np.cumsum(0.5 * time_step * (rates[1:] + rates[:-1]), axis=0)])


def _twists(recording: Recording) -> Iterator[Mend]:
    if recording.twist is None:
        return

    def of(wrong: str, advice: str, change: Callable[[Recording, Array], Array]) -> Mend:
        return Mend(wrong, advice, lambda r: replace(r, twist=None if r.twist is None else change(r, r.twist)), "twist")

    def times(wrong: str, advice: str, *factors: float) -> Mend:
        return of(wrong, advice, lambda r, twist: twist * np.array(factors))

    yield of(
        "vx and vy are in the world's frame, not in the body's",
        "turn (vx, vy) by minus the heading",
        lambda r, twist: _into_body(twist, r.pose[:, 2]),
    )
    yield of("vx and vy are swapped", "swap the columns vx and vy", lambda r, twist: twist[:, [1, 0, 2]])
    yield times("vx has the other sign", "negate vx", -1, 1, 1)
    yield times("vy has the other sign (it is to grow to the left)", "negate vy", 1, -1, 1)
    yield times("vx and vy have the other sign", "negate vx and vy", -1, -1, 1)
    yield times("yaw_rate has the other sign (counter-clockwise is positive)", "negate yaw_rate", 1, 1, -1)
    yield times("yaw_rate is in deg/s", _in_header(["yaw_rate"], "deg/s"), 1, 1, _DEGREE)
    yield times("yaw_rate is in rad/s", _in_header(["yaw_rate"], "rad/s"), 1, 1, 1.0 / _DEGREE)
    for factor, unit in ((1e-3, "mm/s"), (1e-2, "cm/s")):
        yield times(f"vx and vy are in {unit}", _in_header(["vx", "vy"], unit), factor, factor, 1)
    yield times("vx and vy are in km/h", "divide vx and vy by 3.6", 1 / 3.6, 1 / 3.6, 1)
    for factor in (1e2, 1e3):
        words = f"vx and vy are {factor:g} times too small, as m/s are that were read as {_SMALLER[factor]}/s"
        yield times(words, _in_header(["vx", "vy"], "m/s"), factor, factor, 1)


def _into_body(twist: Array, heading: Array) -> Array:
    c, s = np.cos(heading), np.sin(heading)
    return np.column_stack([c * twist[:, 0] + s * twist[:, 1], c * twist[:, 1] - s * twist[:, 0], twist[:, 2]])


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
    groups = {
        "steering": listed(f"steering_{i + 1}" for i in range(recording.steering.shape[1])),
        "rolling": listed(f"rolling_{i + 1}" for i in range(recording.steering.shape[1])),
        "twist": "vx, vy and yaw_rate",
        "position": "x and y",
        "heading": "heading",
        "pose": "x, y and heading",
    }
    for name, columns in groups.items():
        held = None if name in ("position", "heading") else getattr(recording, name)
        if held is None and name not in ("position", "heading"):
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
                "pose" if name in ("position", "heading") else name,
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


def _scaled(recording: Recording, name: str, factors: dict[int, float]) -> Recording:
    array = getattr(recording, name)
    return replace(recording, **{name: array * np.array([factors.get(i, 1.0) for i in range(array.shape[1])])})


_UNIT_WORDS = {"deg": "degrees", "rad": "radians"}


def _in_header(columns: Sequence[str], unit: str) -> str:
    return f"write {listed(f'{column} [{unit}]' for column in columns)} into the header"


def _have(which: Sequence[object]) -> str:
    return "have" if len(which) > 1 else "has"


def _are(which: Sequence[object]) -> str:
    return "are" if len(which) > 1 else "is"


def listed(names: Iterable[str]) -> str:
    """a, b and c."""
    *first, last = names
    return f"{', '.join(first)} and {last}" if first else last
