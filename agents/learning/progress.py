"""progress.csv: what a training run records as it goes on, one row at a time; and how it goes on after a kill.

Stable-Baselines3's own writer begins with an empty file, and the order of its columns differs from process to process.
"""

import csv
import io
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import torch
from stable_baselines3.common.logger import KVWriter, TensorBoardOutputFormat, filter_excluded_keys
from torch.utils.tensorboard.writer import SummaryWriter

from caster_gym.durable_files import write_file


class ProgressTable(KVWriter):
    """A CSV file with a column for each quantity, in the order in which they first came.

    columns, rows: how much of the file that is there counts; the rest was written after the state that is gone on from.
    """

    def __init__(self, path: Path, columns: Sequence[str] = (), rows: int = 0) -> None:
        self._path, self.columns, self.rows = path, list(columns), rows
        kept = self._read()[1 : rows + 1] if columns and path.exists() else []
        if len(kept) < rows:
            raise ValueError(
                f"{path} has {len(kept)} rows, and had {rows} when the training's state was saved: put it back, or "
                f"delete {path.parent / 'state'} to begin anew"
            )
        self._begin([row[: len(columns)] for row in kept])

    def write(self, key_values: dict[str, Any], key_excluded: dict[str, tuple[str, ...]], step: int = 0) -> None:
        """Add a row."""
        values = filter_excluded_keys(key_values, key_excluded, "csv")
        if new := [name for name in values if name not in self.columns]:
            self.columns += new
            self._file.close()
            self._begin(self._read()[1 : self.rows + 1])
        csv.writer(self._file, lineterminator="\n").writerow(plain(values.get(name, "")) for name in self.columns)
        self._file.flush()
        self.rows += 1

    def close(self) -> None:
        """Close the file."""
        self._file.close()

    def _begin(self, rows: Sequence[Sequence[str]]) -> None:
        """Write the rows that there are below all columns, and be ready for more."""
        text = io.StringIO()
        writer = csv.writer(text, lineterminator="\n")
        if self.columns:
            writer.writerow(self.columns)
        writer.writerows([*row, *[""] * (len(self.columns) - len(row))] for row in rows)
        write_file(self._path, text.getvalue())
        self._file = self._path.open("a", encoding="utf-8", newline="")

    def _read(self) -> list[list[str]]:
        with self._path.open(encoding="utf-8", newline="") as file:
            return list(csv.reader(file))


def plain(value: Any) -> Any:
    """A number as Python has it, so that it reads the same before and after it was kept in a file of numbers."""
    return value.item() if isinstance(value, np.generic | np.ndarray | torch.Tensor) else value


class Events(TensorBoardOutputFormat):
    """TensorBoard's events, of which those beyond a number of steps no longer count where a run goes on from there."""

    def __init__(self, folder: Path, steps: int | None) -> None:
        self.writer = SummaryWriter(str(folder), purge_step=None if steps is None else steps + 1)
        self._is_closed = False
