"""A replay buffer on disk: transitions are appended to files of equal length, of which those that are too old go.

What a saved state counts on is never written again, so that a process may be killed at any instant. The state keeps
how many transitions there have been, and the checksum of each file as far as it counts.
"""

import os
import zlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from stable_baselines3.common.buffers import ReplayBuffer

from caster_gym.configuration import ConfigurationError

ARRAYS = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts")
ROWS = 1024  # control periods of all robots in a file


class ReplayFiles:
    """The transitions of a buffer in a folder.

    kept: what `save` returned for the state that a run goes on from, if it does; then the buffer is filled.
    """

    def __init__(self, folder: Path, buffer: ReplayBuffer, kept: Mapping[str, Any] | None = None) -> None:
        self._folder, self._buffer = folder, buffer
        self._arrays: dict[str, NDArray[Any]] = {name: getattr(buffer, name) for name in ARRAYS}
        self._kind = np.dtype([(name, one.dtype, one.shape[1:]) for name, one in self._arrays.items()])
        self._rows, self._checksums = 0, dict[int, int]()
        if kept is not None:
            self._rows = kept["rows"]
            self._checksums = {int(number): checksum for number, checksum in kept["checksums"].items()}
            self._fill()

    def save(self, rows: int) -> dict[str, Any]:
        """Append what is new since the last time. rows: control periods of all robots that were added so far."""
        self._folder.mkdir(parents=True, exist_ok=True)
        self._rows = max(self._rows, (rows - self._size) // ROWS * ROWS)  # older ones are overwritten already
        while self._rows < rows:
            number, first = divmod(self._rows, ROWS)
            last = min(ROWS, rows - number * ROWS)
            self._append(number, first, self._records(np.arange(number * ROWS + first, number * ROWS + last)))
            self._rows = number * ROWS + last
        oldest = max(0, rows - self._size) // ROWS
        self._checksums = {number: one for number, one in self._checksums.items() if number >= oldest}
        return {"rows": rows, "checksums": {str(number): one for number, one in self._checksums.items()}}

    def remove_old(self) -> None:
        """Remove files of which nothing is in the buffer any more, once a state without them has been saved."""
        for path in self._folder.glob("replay-*.bin"):
            if path not in {self._path(number) for number in self._checksums}:
                path.unlink(missing_ok=True)

    @property
    def _size(self) -> int:
        return int(self._buffer.buffer_size)  # control periods of all robots

    def _path(self, number: int) -> Path:
        return self._folder / f"replay-{number:08d}.bin"

    def _records(self, rows: NDArray[np.int64]) -> NDArray[Any]:
        """Transitions of some rows, counted from the first of all, as they are written."""
        records = np.empty(len(rows), dtype=self._kind)
        for name, one in self._arrays.items():
            records[name] = one[rows % self._size]
        return records

    def _append(self, number: int, first: int, records: NDArray[Any]) -> None:
        content = records.tobytes()
        handle = os.open(self._path(number), os.O_RDWR | os.O_CREAT | getattr(os, "O_BINARY", 0), 0o666)
        with os.fdopen(handle, "r+b") as file:
            file.truncate(first * self._kind.itemsize)  # what a killed process had written beyond
            file.seek(0, os.SEEK_END)
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        self._checksums[number] = zlib.crc32(content, self._checksums[number] if first else 0)

    def _fill(self) -> None:
        """Put the transitions that still count where they were in the buffer."""
        for number, checksum in self._checksums.items():
            length = min(ROWS, self._rows - number * ROWS)
            path = self._path(number)
            try:
                with path.open("rb") as file:
                    content = file.read(length * self._kind.itemsize)
            except FileNotFoundError:
                content = b""
            if len(content) < length * self._kind.itemsize or zlib.crc32(content) != checksum:
                raise ConfigurationError(
                    f"{path} is not the part of a replay buffer that was saved: its training cannot go on, start anew"
                )
            rows = np.arange(number * ROWS, number * ROWS + length)
            counted = rows >= self._rows - self._size
            records = np.frombuffer(content, dtype=self._kind)[counted]
            for name, one in self._arrays.items():
                one[rows[counted] % self._size] = records[name]
        self._buffer.pos = self._rows % self._size
        self._buffer.full = self._rows >= self._size
