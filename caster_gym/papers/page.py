"""A page that puts what a paper prints beside what we compute: numbers with verdicts, tables, figures, differences.

A paper's page is made of sections, each built by a function of its own. The files are

    NAME.md                  the page
    NAME/*.png, *.csv        its figures and tables, and checks.csv: every verdict, own = True where it is our own
    NAME/differences.csv     where the paper and we differ, with the evidence
    differences.md           all differences of all papers whose folders are there
"""

import csv
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

if TYPE_CHECKING:
    from matplotlib.figure import Figure

LONGEST_TABLE = 40  # rows that a page shows; a longer table is a file only
DOTS_PER_INCH = 110


class Check(NamedTuple):
    """One thing that a paper prints, beside ours; or one of our own, beside what it must be."""

    what: str
    printed: str  # or expected, if the check is our own
    ours: str
    agrees: bool
    remark: str = ""  # why they differ, or what the agreement rests on
    own: bool = False  # nothing that the paper prints: it stands and counts apart


class Table(NamedTuple):
    """Rows of words and numbers; always a file, and on the page if it is short."""

    name: str  # of its file, without .csv; unique in a paper
    caption: str
    columns: tuple[str, ...]
    rows: Sequence[Sequence[str | float]]


class Picture(NamedTuple):
    """A drawn figure."""

    name: str  # of its file, without .png; unique in a paper
    title: str  # a few words for who cannot see it
    caption: str
    figure: "Figure"


class Difference(NamedTuple):
    """A place where a paper and we differ."""

    tag: str  # E1, E2, …
    where: str
    printed: str
    ours: str
    evidence: str  # what was measured that decides


class Section(NamedTuple):
    """A part of a page."""

    title: str
    text: str  # Markdown
    checks: tuple[Check, ...] = ()
    tables: tuple[Table, ...] = ()
    pictures: tuple[Picture, ...] = ()
    differences: tuple[Difference, ...] = ()


def printed_checks(sections: Iterable[Section]) -> tuple[Check, ...]:
    """The checks of what the paper prints, without those of our own."""
    return tuple(check for section in sections for check in section.checks if not check.own)


def unexplained(sections: Sequence[Section]) -> tuple[str, ...]:
    """What the checks say that fail without naming, in their remark, a difference of these sections."""
    tags = {difference.tag for section in sections for difference in section.differences}
    failed = (check for section in sections for check in section.checks if not check.agrees)
    return tuple(check.what for check in failed if tags.isdisjoint(re.findall(r"E\d+", check.remark)))


def check_number(what: str, printed: str, ours: float, tolerance: float | None = None, remark: str = "") -> Check:
    """Compare a number with its printed digits; agreement is within half a unit of the last, or a given tolerance."""
    allowed = _half_unit(printed) if tolerance is None else tolerance
    agrees = math.isfinite(ours) and abs(ours - float(printed)) <= allowed * (1.0 + 1e-9)
    digits = max(0, -math.floor(math.log10(2.0 * _half_unit(printed)) + 0.5)) + 1
    return Check(what, printed, f"{ours:.{digits}f}", agrees, remark)


def write_page(name: str, title: str, reference: str, sections: Sequence[Section], folder: Path) -> str:
    """Put figures and tables of a paper in a folder; returns the page that stands beside the folder.

    Raises ValueError if two tables or two figures have the same name.
    """
    for names in ([t.name for s in sections for t in s.tables], [p.name for s in sections for p in s.pictures]):
        twice = sorted({name for name in names if names.count(name) > 1})
        if twice:
            raise ValueError(f"two tables or figures of {name} are called {twice[0]!r}")
    for section in sections:
        for table in section.tables:
            _write_csv(folder / f"{table.name}.csv", table.columns, table.rows)
        for picture in section.pictures:
            picture.figure.savefig(folder / f"{picture.name}.png", dpi=DOTS_PER_INCH)
    _write_csv(folder / "checks.csv", Check._fields, [check for section in sections for check in section.checks])
    _write_csv(folder / "differences.csv", Difference._fields, [d for s in sections for d in s.differences])
    return _page(name, title, reference, sections)


def differences_page(out: Path, names: Sequence[str]) -> str:
    """The page of all differences, of all papers whose folders are there."""
    parts = [
        "# Where the papers and we differ",
        "Each with the evidence that decides, as measured by `caster-gym reproduce`.",
    ]
    for name in names:
        file = out / name / "differences.csv"
        if file.is_file():
            with file.open(encoding="utf-8", newline="") as lines:
                _, *rows = csv.reader(lines)
            rows.sort(key=lambda row: int(row[0].removeprefix("E")))
            columns = ("", "where", "as printed", "correct", "evidence")
            parts += [f"## [{name}]({name}.md)", markdown_table(columns, rows)]
    return "\n\n".join(parts) + "\n"


def _page(name: str, title: str, reference: str, sections: Sequence[Section]) -> str:
    printed = printed_checks(sections)
    own = [check for section in sections for check in section.checks if check.own]
    summary = (
        f"{sum(check.agrees for check in printed)} of {len(printed)} printed numbers and statements agree; the reason "
        f"stands beside each other, and [differences.md](differences.md) lists them with the evidence."
    )
    if own:
        summary += f" Checks of our own stand apart; {sum(check.agrees for check in own)} of {len(own)} hold."
    summary += f" Made by `caster-gym reproduce {name}`."
    parts = [f"# {title}", reference, summary]
    for section in sections:
        parts += [f"## {section.title}", section.text.strip()]
        parts += _verdicts([check for check in section.checks if not check.own], ("what", "printed", "ours"))
        own = [check for check in section.checks if check.own]
        parts += ["Checks of our own:"] * bool(own) + _verdicts(own, ("what", "expected", "found"))
        for table in section.tables:
            parts.append(f"{table.caption} ([{table.name}.csv]({name}/{table.name}.csv))")
            if len(table.rows) <= LONGEST_TABLE:
                parts.append(markdown_table(table.columns, table.rows))
        for picture in section.pictures:
            parts += [f"![{picture.title}]({name}/{picture.name}.png)", f"*{picture.caption}*"]
    return "\n\n".join(parts) + "\n"


def _verdicts(checks: Sequence[Check], columns: tuple[str, str, str]) -> list[str]:
    """A table of checks, if there are any."""
    rows = [(c.what, c.printed, c.ours, "pass" if c.agrees else "**fail**", c.remark) for c in checks]
    return [markdown_table((*columns, "verdict", "remark"), rows)] if rows else []


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[str | float]]) -> str:
    """A table in Markdown; numbers with four significant digits."""
    lines = [[*columns], ["---"] * len(columns)]
    lines += [[f"{cell:.4g}" if isinstance(cell, float) else str(cell) for cell in row] for row in rows]
    return "\n".join("| " + " | ".join(cell.replace("|", "\\|") for cell in line) + " |" for line in lines)


def _half_unit(printed: str) -> float:
    """Half a unit of the last printed digit of a number."""
    mantissa, _, exponent = printed.lower().partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def _write_csv(path: Path, columns: Sequence[str], rows: Iterable[Sequence[object]]) -> None:
    with path.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(columns)
        writer.writerows(rows)
