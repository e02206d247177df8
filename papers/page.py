"""A page that puts what a paper prints beside what we compute: numbers with verdicts, tables, figures, differences.

A paper's page is made of sections, each built by a function of its own. The files are

    NAME.md                  the page
    NAME/*.png, *.csv        its figures and tables, and checks.csv: every verdict, own = True where it is our own
    NAME/differences.csv     where the paper and we differ, of which nature that is, with the evidence
    differences.md           all differences of all papers whose folders are there, and what was repaired in the scans
"""

import csv
import math
import re
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal, NamedTuple, TypeAlias, get_args

from caster_gym.report.figures import save_figure
from caster_gym.report.pages import join_parts
from caster_gym.report.tables import markdown_table, write_csv
from papers.scans import REPAIRS

if TYPE_CHECKING:
    from matplotlib.figure import Figure

Nature: TypeAlias = Literal["print", "scan, probably", "scan, possibly", "reading"]

LONGEST_TABLE = 40  # rows that a page shows; a longer table is a file only


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
    """A place where a paper and we differ.

    nature: "print" if mathematics shows that the statement itself is wrong, however well it was scanned; "scan, …" if
    one lost or changed character of the scanned text would explain it; "reading" if the statement holds in one
    sense and fails in another, so that it is no error of the paper.
    """

    tag: str  # E1, E2, …
    where: str
    printed: str
    ours: str
    evidence: str  # what was measured that decides
    nature: Nature = "print"


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


def named(check: Check) -> tuple[str, ...]:
    """Tags of the differences that a check's remark names."""
    return tuple(re.findall(r"E\d+", check.remark))


def depends_on_reading(check: Check, sections: Iterable[Section]) -> bool:
    """Does a check fail only in one reading of what the paper says?"""
    readings = {d.tag for section in sections for d in section.differences if d.nature == "reading"}
    return not check.agrees and not check.own and bool(readings.intersection(named(check)))


def summary(sections: Sequence[Section]) -> str:
    """How many printed numbers and statements agree, and to how many differences the others come down."""
    printed = printed_checks(sections)
    tags = {d.tag for section in sections for d in section.differences}
    unclear = [check for check in printed if depends_on_reading(check, sections)]
    failed = [check for check in printed if not check.agrees and check not in unclear]
    words = f"{sum(check.agrees for check in printed)} of {len(printed)} printed numbers and statements agree"
    for checks, one, several in (
        (failed, "differs", "differ"),
        (unclear, "depends on the reading", "depend on the reading"),
    ):
        if checks:
            causes = sorted({tag for check in checks for tag in named(check) if tag in tags}, key=_number)
            reasons = f"{len(causes)} reason{'s' if len(causes) > 1 else ''} ({', '.join(causes)})"
            words += f"; {len(checks)} {one if len(checks) == 1 else several}, for {reasons}"
    return words


def _number(tag: str) -> int:
    return int(tag.removeprefix("E"))


def unexplained(sections: Sequence[Section]) -> tuple[str, ...]:
    """What the checks say that fail without naming, in their remark, a difference of these sections."""
    tags = {difference.tag for section in sections for difference in section.differences}
    failed = (check for section in sections for check in section.checks if not check.agrees)
    return tuple(check.what for check in failed if tags.isdisjoint(named(check)))


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
            write_csv(folder / f"{table.name}.csv", table.columns, table.rows)
        for picture in section.pictures:
            save_figure(picture.figure, folder / f"{picture.name}.png")
    write_csv(folder / "checks.csv", Check._fields, [check for section in sections for check in section.checks])
    write_csv(folder / "differences.csv", Difference._fields, [d for s in sections for d in s.differences])
    return _page(name, title, reference, sections)


def differences_page(out: Path, names: Sequence[str]) -> str:
    """The page of all differences, of all papers whose folders are there, sorted by their nature."""
    rows: list[list[str]] = []
    there = [name for name in names if (out / name / "differences.csv").is_file()]
    for name in there:
        with (out / name / "differences.csv").open(encoding="utf-8", newline="") as lines:
            rows += [[row["tag"], f"[{name}]({name}.md)", *list(row.values())[1:]] for row in csv.DictReader(lines)]
    rows.sort(key=lambda row: _number(row[0]))
    columns = ("", "paper", "where", "as printed", "correct", "evidence")
    parts = ["# Where the papers and caster_gym differ", _ABOUT_SCANS]
    for title, text, natures in _PARTS:
        chosen = [row for row in rows if row[-1] in natures]
        if chosen:
            count = len({row[0] for row in chosen})
            both = len(natures) > 1
            table = [[*row[:-1], row[-1].removeprefix("scan, ")] if both else row[:-1] for row in chosen]
            parts += [
                f"## {title} ({count})",
                text,
                markdown_table((*columns, "scan at fault") if both else columns, table),
            ]
    repairs = [(f"[{name}]({name}.md)", *repair) for name in there for repair in REPAIRS.get(name, ())]
    if repairs:
        text = "Places that can be read in one way only were repaired, and do not count as differences."
        parts += [
            "## Repairs that do not count",
            text,
            markdown_table(("paper", "where", "as scanned", "read as"), repairs),
        ]
    return join_parts(parts)


_ABOUT_SCANS = """\
This page lists where the two papers differ from caster_gym, and why. Both papers were read from scanned text. Character
recognition loses signs, dots and indices, so the print may be right where the scan is wrong; the list is therefore
divided by what the scan allows us to know. Each entry has the evidence that decides, as measured by `python -m papers`.
An entry with several rows was measured in several ways and counts once."""
_PARTS: tuple[tuple[str, str, tuple[Nature, ...]], ...] = (
    (
        "Errors of the print",
        "Mathematics shows that the statement is wrong, and no single misread character explains it.",
        ("print",),
    ),
    (
        "Possible errors of the scan",
        "One lost or changed character would explain the difference, so the print may well be right. The scan is "
        "probably at fault if the text around it says the right thing, or if characters of that kind are often lost. "
        "It is possibly at fault if a wrong sign or letter makes a formula that looks complete.",
        ("scan, probably", "scan, possibly"),
    ),
    (
        "What depends on the reading",
        "These statements are true in one sense and false in another. They are not errors of the papers.",
        ("reading",),
    ),
)
assert {nature for _, _, natures in _PARTS for nature in natures} == set(get_args(Nature))


def _page(name: str, title: str, reference: str, sections: Sequence[Section]) -> str:
    own = [check for section in sections for check in section.checks if check.own]
    text = (
        f"{summary(sections)}. The tables give the reason for each, and [differences.md](differences.md) lists all "
        "reasons with the evidence. The paper was read from scanned text; the list says where the scan may be wrong."
    )
    if own:
        text += (
            f" Checks of our own, some of them on other robots than the paper's, are counted separately; "
            f"{sum(check.agrees for check in own)} of {len(own)} hold."
        )
    text += f" `python -m papers {name}` makes this page."
    parts = [f"# {title}", reference, text]
    for section in sections:
        parts += [f"## {section.title}", section.text.strip()]
        parts += _verdicts([check for check in section.checks if not check.own], ("what", "printed", "ours"), sections)
        own = [check for check in section.checks if check.own]
        parts += ["Checks of our own:"] * bool(own) + _verdicts(own, ("what", "expected", "found"), sections)
        for table in section.tables:
            parts.append(f"{table.caption} ([{table.name}.csv]({name}/{table.name}.csv))")
            if len(table.rows) <= LONGEST_TABLE:
                parts.append(markdown_table(table.columns, table.rows))
        for picture in section.pictures:
            parts += [f"![{picture.title}]({name}/{picture.name}.png)", f"*{picture.caption}*"]
    return join_parts(parts)


def _verdicts(checks: Sequence[Check], columns: tuple[str, str, str], sections: Sequence[Section]) -> list[str]:
    """A table of checks, if there are any."""
    rows = [(c.what, c.printed, c.ours, _verdict(c, sections), c.remark) for c in checks]
    return [markdown_table((*columns, "verdict", "remark"), rows)] if rows else []


def _verdict(check: Check, sections: Sequence[Section]) -> str:
    if check.agrees:
        return "pass"
    return "depends on the reading" if depends_on_reading(check, sections) else "**fail**"


def _half_unit(printed: str) -> float:
    """Half a unit of the last printed digit of a number."""
    mantissa, _, exponent = printed.lower().partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
