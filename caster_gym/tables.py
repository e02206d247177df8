"""Tables whose columns are found by name, in any units; for paths and recordings alike."""

import math
import re
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from decimal import Decimal, InvalidOperation
from typing import NamedTuple

import numpy as np

from caster_gym.arrays import Array
from caster_gym.brief import brief, cut
from caster_gym.configuration import GREATEST
from caster_gym.units import UNITS, read_unit

LATEST_SECONDS = 10**11  # [s] a stamp beyond the year 5000 is one in ms, us or ns
SPARSEST = 5.0  # [s] between many samples, from which on their times are hardly seconds
_LATEST = 1e22  # of stamps in whatever unit, the year 300,000 in ns
_MANY = 20  # samples
_LONGEST_HEADER = 400  # characters in a message
DECIMAL_COMMA = re.compile(r"\s*[-+]?(\d+|\d{1,3}(\.\d{3})+),\d+([eE][-+]?\d+)?\s*")


class TableNote(UserWarning):
    """What a reader made of a table that its author may want to know: columns left out, times made even."""


class Quantity(NamedTuple):
    """What a column may hold: its kind, as in `UNITS`, and the names it goes by, the first of which is ours."""

    kind: str
    names: tuple[str, ...]


class Column(NamedTuple):
    """A column as it is written: its name and, if there is one, its unit."""

    name: str
    unit: str | None


class Found(NamedTuple):
    """The column that holds a quantity."""

    place: int
    kind: str
    factor: float  # SI units in one of the column's
    declared: bool  # whether its unit was written


@dataclass(frozen=True)
class Table:
    """Cells of a file, with the number of the line of each row."""

    source: str
    columns: tuple[Column, ...]
    rows: list[list[str]]
    lines: list[int]
    found: dict[str, Found] = field(default_factory=dict)

    @property
    def header(self) -> str:
        """Names of the columns, of very many the first ones."""
        return cut(", ".join(column.name for column in self.columns), _LONGEST_HEADER)

    def matched(self, quantities: Mapping[str, Quantity]) -> "Table":
        """The same table, with the columns found that hold the quantities.

        Raises ValueError for a column that stands twice and for a unit that its quantity cannot have.
        """
        found: dict[str, Found] = {}
        for key, quantity in quantities.items():
            best: tuple[int, int] | None = None
            for place, column in enumerate(self.columns):
                rank = _rank(column, quantity)
                if rank is None:
                    continue
                if best is not None and best[0] == rank:
                    both = self.columns[best[1]].name, column.name
                    twice = f"the column {both[0]!r} stands twice" if both[0] == both[1] else f"{both} are both {key!r}"
                    raise ValueError(f"{self.source}: {twice}; name it once")
                if best is None or rank < best[0]:
                    best = rank, place
            if best is not None:
                found[key] = self._located(best[1], quantity)
        return Table(self.source, self.columns, self.rows, self.lines, found)

    def _located(self, place: int, quantity: Quantity) -> Found:
        column, units = self.columns[place], UNITS[quantity.kind]
        if column.unit is not None:
            unit = read_unit(column.unit, quantity.kind)
            if unit is None:
                known = ", ".join(units)
                raise ValueError(f"{self.source}: column {column.name!r} must be in {known}, got [{column.unit}]")
            return Found(place, quantity.kind, units[unit], True)
        unit = _suffix(column.name, quantity)
        return Found(place, quantity.kind, units[unit] if unit else 1.0, unit is not None)

    def left_out(self, used: Iterable[str]) -> list[str]:
        """Names of the columns that hold none of the quantities that are used."""
        places = {self.found[name].place for name in used if name in self.found}
        return [column.name for place, column in enumerate(self.columns) if place not in places]

    def numbers(self, names: Sequence[str]) -> Array:
        """Quantities (rows, names) in SI units."""
        return np.stack([self._numbers(name) for name in names], axis=1).reshape(len(self.rows), len(names))

    def _numbers(self, name: str) -> Array:
        place, _, factor, _ = self.found[name]
        try:
            values = np.array([row[place] for row in self.rows], dtype=np.float64)
        except ValueError:
            values = np.full(len(self.rows), np.nan)
        if not (np.abs(values) <= GREATEST).all():
            values = np.array([self._number(row, place) for row in range(len(self.rows))])
        return np.asarray(factor * values, dtype=np.float64)

    def _number(self, row: int, place: int, most: float = GREATEST) -> float:
        cell = self.rows[row][place]
        where = f"{self.source}, line {self.lines[row]}"
        refuse_decimal_comma(cell, where)
        try:
            number = float(cell.replace("−", "-"))
        except ValueError:
            number = math.nan
        if not abs(number) <= most:
            clock = "; write times in seconds" if re.search(r"\d:\d", cell) else ""
            name = self.columns[place].name
            wanted = f"a number up to {most:g}" if math.isfinite(number) else "a finite number"
            raise ValueError(f"{where}: {brief(name)} must be {wanted}, got {brief(cell.strip())}{clock}")
        return number

    def times(self) -> tuple[Array, float]:
        """Times since the first row [s], which keep every digit of long stamps, and that of the first row [s].

        Where no unit is written, stamps since 1970 tell theirs by their size. Raises ValueError that names the line of
        a time that is not later than the one before, and for many times that are too far apart for seconds.
        """
        place, _, factor, declared = self.found["time"]
        try:
            stamps = [Decimal(row[place].strip()) for row in self.rows]
        except InvalidOperation:
            stamps = []
        if not stamps or not all(stamp.is_finite() and stamp.copy_abs() <= _LATEST for stamp in stamps):
            stamps = [Decimal(self._number(row, place, _LATEST)) for row in range(len(self.rows))]
        name = self.columns[place].name
        if not declared and stamps and stamps[0] > LATEST_SECONDS:
            unit = "ns" if stamps[0] > LATEST_SECONDS * 10**6 else "us" if stamps[0] > LATEST_SECONDS * 10**3 else "ms"
            factor, declared = UNITS["time"][unit], True
            note(f"{self.source}: {name!r} is taken to be in {unit}, as stamps of {float(stamps[0]):.3g} are")
        since = np.array([factor * float(stamp - stamps[0]) for stamp in stamps])
        steps = np.diff(since)
        if (steps <= 0.0).any():
            row = int((steps <= 0.0).argmax()) + 1
            same = "leave one of the two lines out, or write more digits"
            raise ValueError(
                f"{self.source}, line {self.lines[row]}: {name!r} must grow from line to line, got "
                f"{self.rows[row][place].strip()} after {self.rows[row - 1][place].strip()}; "
                f"{same if steps[row - 1] == 0.0 else 'sort the lines by it'}"
            )
        if not declared and len(steps) >= _MANY and float(np.median(steps)) >= SPARSEST:
            raise ValueError(
                f"{self.source}: {name!r} grows by {np.median(steps):g} from line to line, which can hardly be "
                f"seconds; call the column 'time [ms]' or 'time [us]', whichever is its unit, or 'time [s]'"
            )
        return since, factor * float(stamps[0]) if stamps else 0.0


def note_left_out(source: str, names: Sequence[str], why: str = "not needed") -> None:
    """Tell which columns are left out."""
    if names:
        one = len(names) == 1
        columns = ", ".join(name or "without a name" for name in names)
        note(f"{source}: the column{'' if one else 's'} {columns} {'is' if one else 'are'} left out, {why}")


def note(text: str) -> None:
    """Tell whoever reads a table what was made of it."""
    warnings.warn(text, TableNote, stacklevel=2)


def _rank(column: Column, quantity: Quantity) -> int | None:
    """Place of a column's name among those of a quantity, or None if it has another name."""
    name = _clean(column.name)
    for spelled in (name, _tail(column.name), _without_suffix(column.name, quantity)):
        if spelled in quantity.names:
            return quantity.names.index(spelled)
    return None


def _clean(name: str) -> str:
    plain = name.strip().strip("\"'").casefold()
    return re.sub(r"[\s/.\-]+", "_", plain.lstrip("/").removeprefix("field."))


def _tail(name: str) -> str:
    """The last two parts of a field's name in a message, as in /odom/pose/pose/position/x, or nothing."""
    parts = re.split(r"[/.]", name.strip())
    return _clean("_".join(parts[-2:])) if len(parts) > 2 else ""


def _suffix(name: str, quantity: Quantity) -> str | None:
    """Unit at the end of a column's name, as in x_mm."""
    plain = _clean(name)
    if plain in quantity.names or "_" not in plain:
        return None
    return read_unit(plain.rsplit("_", 1)[1], quantity.kind)


def _without_suffix(name: str, quantity: Quantity) -> str:
    plain = _clean(name)
    return plain.rsplit("_", 1)[0] if _suffix(name, quantity) is not None else plain


def refuse_decimal_comma(cell: str, where: str) -> None:
    """Refuse a number whose decimals stand behind a comma."""
    if DECIMAL_COMMA.fullmatch(cell):
        raise ValueError(
            f"{where}: {brief(cell.strip())} has a decimal comma; write decimal points, as in "
            f"{cell.strip().replace('.', '').replace(',', '.')}"
        )
