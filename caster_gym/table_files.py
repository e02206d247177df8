"""Reads files of tables in the forms that programs write them.

The columns may be separated by commas, semicolons, tabs or blanks. A line that begins with #, % or // is a comment; the
last one before the numbers may be the header. A unit stands behind the name of its column, as in `x [mm]`, `x (mm)` or
`x_mm`, or in a line of its own below the header. Numbers have decimal points.
"""

import csv
import re
from pathlib import Path

from caster_gym.bounded_files import TABLE_BYTES, read_bytes
from caster_gym.tables import DECIMAL_COMMA, Column, Table, refuse_decimal_comma
from caster_gym.units import is_unit

TABLE_SUFFIXES = (".csv", ".txt", ".tsv", ".tum", ".dat")
MOST_LINES, LONGEST_LINE = 60_000, 5000  # ten minutes at 100 Hz; characters
_REMEDY = "; keep every tenth row, or a part of it"
_SEPARATORS = {",": "commas", ";": "semicolons", "\t": "tabs", " ": "blanks"}
_COMMENT = re.compile(r"\s*(#|%|//)")
_OF_SYMBOLS = frozenset("°µ·²³º")  # the only ones in Western one-byte encodings that headers need
_TUM = ("timestamp", "tx", "ty", "tz", "qx", "qy", "qz", "qw")  # what a .tum file holds, which has no header


def read_table(path: Path) -> Table:
    """The table in a file. Raises ValueError that names file, line and value, and says what to change."""
    lines = [(number, line) for number, line in enumerate(read_lines(path), start=1) if line.strip()]
    if lines and (told := re.fullmatch(r"sep=(.)", lines[0][1].strip())):  # of spreadsheets
        lines = lines[1:] if told[1] in _SEPARATORS else lines
    first = next((i for i, (_, line) in enumerate(lines) if not _COMMENT.match(line)), len(lines))
    body = [(number, line) for number, line in lines[first:] if not _COMMENT.match(line)]
    if not lines:
        raise ValueError(f"{path} is empty; it needs a header such as x,y and a row for each point")
    if body and not _is_of_numbers(body[0][1]):
        separator = _separator(body[0][1])
        header = _header(body[0][1], separator)
        start, end = body[0][0], body[1][0] if len(body) > 1 else 0  # lines of the header and of the first row
        below = [line for number, line in lines if start < number < end]
        body = body[1:]
        header = next(filter(None, (_with_units_of(line, header) for line in below)), header)
    else:
        header, separator = _commented_header(path, [line for _, line in lines[:first]], body)
    while header and not header[-1].name:
        header = header[:-1]
    cells = [(number, _cells(line, separator)) for number, line in body]
    if cells and (units := _units_below(cells[0][1], header)) is not None:
        header = [Column(c.name, unit or c.unit) for c, unit in zip(header, units, strict=True)]
        cells = cells[1:]
    rows = [_whole(path, number, row, len(header), separator) for number, row in cells]
    return Table(str(path), tuple(header), rows, [number for number, _ in cells])


def read_lines(path: Path) -> list[str]:
    """Lines of a file as `read_text` reads it, not too many of them and none too long."""
    text = read_text(path)
    ends = max(text.count("\n"), text.count("\r"))
    lines = text.splitlines() if ends <= MOST_LINES else []
    if max(ends, len(lines)) > MOST_LINES:
        raise ValueError(f"{path} has {max(ends, len(lines))} lines, at most {MOST_LINES} are read{_REMEDY}")
    for number, line in enumerate(lines, start=1):
        if len(line) > LONGEST_LINE:
            raise ValueError(f"{path}, line {number}: it has {len(line)} characters, at most {LONGEST_LINE} are read")
    return lines


def read_text(path: Path, most: int = TABLE_BYTES) -> str:
    """Text of a file of at most so many bytes.

    It is in UTF-8, UTF-16 with a byte-order mark, or the one-byte encoding of Western spreadsheets."""
    content = read_bytes(path, most, _REMEDY)
    marks = {b"\xff\xfe": "utf-16", b"\xfe\xff": "utf-16"}
    try:
        text = content.decode(marks.get(content[:2], "utf-8-sig"))
    except UnicodeDecodeError as error:
        text = content.decode("cp1252", errors="replace")
        if any(sign not in _OF_SYMBOLS for sign in text if ord(sign) > 127):
            if b"\0" not in content:
                raise ValueError(f"{path} cannot be read as CSV: {error}; save it as UTF-8") from error
            text = content.decode("latin-1")
    if "\0" in text:
        raise ValueError(f"{path} holds zero bytes, as no table in UTF-8 does; export it as CSV in UTF-8")
    return text


def _separator(line: str) -> str:
    bare = re.sub(r"[\[(][^\])]*[\])]", "", line)
    return next((sign for sign in (";", "\t", ",") if sign in bare), " ")


def _cells(line: str, separator: str) -> list[str]:
    return line.split() if separator == " " else next(csv.reader([line], delimiter=separator), [])


def _header(line: str, separator: str) -> list[Column]:
    if separator == " ":  # a unit may stand behind a blank
        return [_column(cell) for cell in re.findall(r"[^\s\[(]+(?:\s*[\[(][^\])]*[\])])?", line)]
    return [_column(cell) for cell in next(csv.reader([line], delimiter=separator), [])]


def _column(cell: str) -> Column:
    text = cell.strip().strip("\"'")
    match = re.fullmatch(r"(.*?)\s*[\[(]\s*(.*?)\s*[\])]", text) or re.fullmatch(r"(.+?)\s+(?:/|in)\s+(\S+)", text)
    return Column(match[1].strip(), match[2]) if match else Column(text, None)


def _has_numbers(cells: list[str], within: bool = True) -> bool:
    """Whether cells of a line hold numbers, be their decimals behind commas, rather than names alone.

    within: also where a number is only a part of a cell that blanks separate.
    """
    parts = [part for cell in cells for part in re.split(r"[;,\s]+" if within else r"[;,]", cell.strip())]
    return any(re.fullmatch(r"[-+−]?(\d[\d.]*|\.\d+)([eE][-+]?\d+)?|[-+]?(nan|inf)", part, re.I) for part in parts)


def _is_of_numbers(line: str) -> bool:
    """Whether some cell of a line is a number, rather than a name that has one in it, as in `wheel 1`."""
    return _has_numbers([cell.strip() for cell in _cells(line, _separator(line))], within=False)


def _with_units_of(comment: str, header: list[Column]) -> list[Column] | None:
    """The header with the units of a comment below it, or None if these are none."""
    line = _COMMENT.sub("", comment, count=1).strip()
    units = _units_below(_cells(line, _separator(line)), header)
    if units is None or not all(unit is None or is_unit(unit.strip("[]()")) for unit in units):
        return None
    return [Column(c.name, unit or c.unit) for c, unit in zip(header, units, strict=True)]


def _commented_header(path: Path, comments: list[str], body: list[tuple[int, str]]) -> tuple[list[Column], str]:
    """Header and separator of a table whose first line that is no comment holds numbers."""
    separator = _separator(body[0][1]) if body else ","
    count = len([cell for cell in _cells(body[0][1], separator) if cell.strip()]) if body else 0
    likely = []
    for number, comment in enumerate(comments):
        line = _COMMENT.sub("", comment, count=1).strip()
        header = _header(line, _separator(line))
        if (len(header) == count or not body) and len(header) > 1 and not _is_of_numbers(line):
            likely.append((number, header))
    if likely:
        for number, header in likely:  # that has its units in a line of their own
            if number + 1 < len(comments) and (known := _with_units_of(comments[number + 1], header)) is not None:
                return known, separator
        return next((one for _, one in reversed(likely) if _names_axes(one)), likely[-1][1]), separator
    if path.suffix.lower() == ".tum" and count == len(_TUM):
        return [Column(name, "s" if name == "timestamp" else None) for name in _TUM], separator
    if body and len(body[0][1].split()) == count == 1 and DECIMAL_COMMA.fullmatch(body[0][1]):
        refuse_decimal_comma(body[0][1], f"{path}, line {body[0][0]}")
    shown = body[0][1].strip() if body else comments[-1].strip()
    raise ValueError(
        f"{path}, line {body[0][0] if body else 1}: the header that names the columns is missing, got {shown[:60]!r}; "
        f"put a line such as x,y or x,y,heading or time,x,y,heading above the numbers"
    )


def _names_axes(header: list[Column]) -> bool:
    """Whether some name of a header begins or ends as that of a coordinate does."""
    return any(re.search(r"(^|[_./\s])[pt]?x([_./\s]|$)", column.name.casefold()) for column in header)


def _units_below(cells: list[str], header: list[Column]) -> list[str | None] | None:
    """Units in a line below the header, or None if that line is none of units."""
    texts = [cell.strip().strip("[]()").strip() for cell in cells]
    if len(texts) != len(header) or not any(texts) or _has_numbers(cells):
        return None
    if not any(is_unit(text) for text in texts):
        return None
    return [text if text not in ("", "-", "–") else None for text in texts]


def _whole(path: Path, number: int, row: list[str], count: int, separator: str) -> list[str]:
    """A row with as many cells as the header names columns."""
    if len(row) > count and not any(cell.strip() for cell in row[count:]):
        return row[:count]
    if len(row) != count:
        where = f"{path}, line {number}"
        if separator == "," and len(row) > count and all(re.fullmatch(r"\s*[-+]?\d+\s*", cell) for cell in row):
            raise ValueError(
                f"{where}: the header names {count} columns, separated by commas, got {len(row)} cells: "
                f"{','.join(row)[:60]!r}; if these are decimal commas, write decimal points, as in 1.5"
            )
        raise ValueError(
            f"{where}: the header names {count} columns, separated by {_SEPARATORS[separator]}, got {len(row)} cells: "
            f"{separator.join(row)[:60]!r}"
        )
    return row
