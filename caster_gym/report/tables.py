"""Tables for readers, in Markdown, and for programs, as CSV files."""

import csv
import io
from collections.abc import Iterable, Sequence
from pathlib import Path

from caster_gym.durable_files import write_file


def markdown_table(columns: Sequence[str], rows: Iterable[Sequence[object]], padded: bool = False) -> str:
    """A table in Markdown; floats with four significant digits. padded: columns also line up in the plain text."""
    lines = [[_cell(cell) for cell in row] for row in (columns, *rows)]
    widths = [max(len(line[i]) for line in lines) if padded else 0 for i in range(len(columns))]
    lines.insert(1, ["---".ljust(width, "-") for width in widths])
    return "\n".join(
        "| " + " | ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)) + " |" for line in lines
    )


def write_csv(path: Path, columns: Iterable[str], rows: Iterable[Iterable[object]]) -> None:
    """A table as a CSV file in UTF-8, its first line the names of the columns; floats with all their digits."""
    text = io.StringIO(newline="")
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows(rows)
    write_file(path, text.getvalue())


def _cell(cell: object) -> str:
    text = f"{cell:.4g}" if isinstance(cell, float) else str(cell)
    return text.replace("|", "\\|")
