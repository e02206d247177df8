"""Writes frames to a video file, .mp4 or .gif, which appears whole or not at all."""

import os
import zlib
from collections.abc import Generator, Iterator
from contextlib import ExitStack, contextmanager, suppress
from importlib.util import find_spec
from pathlib import Path
from typing import Protocol

import numpy as np
from gymnasium.error import DependencyNotInstalled

from caster_gym.arrays import Frame
from caster_gym.durable_files import move_file, remove_leftovers, scratch_folder

SUFFIXES = (".mp4", ".gif")
MOST_COLOURS = 160  # of a GIF, for the whole film
PALETTE_FRAMES = 8  # evenly spread over the film, from which they are taken
SHORTEST_DELAY = 40  # [ms] between a GIF's frames; browsers slow shorter ones down, and the files are large
QUALITY = 8.0  # of 0 … 10, for H.264


class Writer(Protocol):
    """Takes the frames of a film one after another."""

    def add(self, frame: Frame) -> None:
        """One more frame (height, width, 3)."""
        ...


def check_target(file: Path, overwrite: bool = False, size: tuple[int, int] = (2, 2)) -> None:
    """Refuse a name under which no film of that width and height [px] can be saved; to be called before anything runs.

    Raises ValueError, OSError or gymnasium.error.DependencyNotInstalled.
    """
    if file.suffix.lower() not in SUFFIXES:
        raise ValueError(f"a video must be saved as {' or '.join(SUFFIXES)}, got {file.name!r}")
    if file.suffix.lower() == ".mp4":
        _refuse_odd(*size)
    if not file.absolute().parent.is_dir():
        raise FileNotFoundError(f"there is no folder {str(file.absolute().parent)!r} to save {file.name} in")
    if file.is_dir() or (file.exists() and not overwrite):
        raise FileExistsError(f"{file} is there already; choose another name or give --overwrite")
    module = "imageio_ffmpeg" if file.suffix.lower() == ".mp4" else "PIL"
    if find_spec(module) is None:
        raise DependencyNotInstalled(f"saving {file.suffix} needs {module}: pip install 'caster_gym[render]'")
    with _scratch_folder(file):
        pass


@contextmanager
def recording(file: Path, fps: float, overwrite: bool = False) -> Iterator[Writer]:
    """A film that takes frames of one size, shown at `fps` a second, and appears when the block ends without error.

    A GIF leaves out frames where there are more than 25 a second. An .mp4 needs an even width and height.
    """
    check_target(file, overwrite)
    with _scratch_folder(file) as folder:
        unfinished = folder / f"film{file.suffix.lower()}"
        writer = _Mp4(unfinished, fps) if unfinished.suffix == ".mp4" else _Gif(unfinished, fps)
        try:
            yield writer
            writer.finish()
        except BaseException:
            writer.give_up()
            raise
        move_file(unfinished, file)


@contextmanager
def _scratch_folder(file: Path) -> Iterator[Path]:
    """A folder beside the file, so that what is finished there can be renamed."""
    home = Path(os.path.realpath(file)).parent
    with ExitStack() as stack:
        try:
            remove_leftovers(home)
            folder = stack.enter_context(scratch_folder(home))
        except OSError as error:
            raise OSError(f"cannot write to folder {str(home)!r}: {error.strerror}") from None
        yield folder


def _refuse_odd(width: int, height: int) -> None:
    """H.264 stores colours for squares of four pixels."""
    if width % 2 or height % 2:
        raise ValueError(f"an .mp4 needs an even width and height, got {width} × {height}")


class _Mp4:
    """H.264, encoded while frames come in."""

    def __init__(self, file: Path, fps: float) -> None:
        self._file, self._fps = file, fps
        self._sink: Generator[None, Frame | None, None] | None = None

    def add(self, frame: Frame) -> None:
        if self._sink is None:
            self._sink = self._open(frame)
        self._sink.send(np.ascontiguousarray(frame))

    def _open(self, frame: Frame) -> Generator[None, Frame | None, None]:
        import imageio_ffmpeg

        height, width = frame.shape[:2]
        _refuse_odd(width, height)
        sink: Generator[None, Frame | None, None] = imageio_ffmpeg.write_frames(
            str(self._file), (width, height), fps=self._fps, quality=QUALITY, codec="libx264", macro_block_size=2
        )
        sink.send(None)
        return sink

    def finish(self) -> None:
        if self._sink is None:
            raise ValueError("a video needs at least one frame")
        self._sink.close()

    def give_up(self) -> None:
        """Ctrl-C may have ended the encoder too, so that closing it fails."""
        with suppress(OSError):
            if self._sink is not None:
                self._sink.close()


class _Gif:
    """Frames kept small until the end, when the colours of the whole film are known."""

    def __init__(self, file: Path, fps: float) -> None:
        self._file = file
        self._stride = max(1, round(SHORTEST_DELAY * fps / 1000.0))
        self._delay = 10 * max(1, round(100.0 * self._stride / fps))  # [ms]; the format counts hundredths of a second
        self._count = 0
        self._shape: tuple[int, ...] = ()
        self._frames: list[bytes] = []

    def add(self, frame: Frame) -> None:
        if self._count % self._stride == 0:
            self._shape = frame.shape
            self._frames.append(zlib.compress(frame.tobytes(), 1))
        self._count += 1

    def finish(self) -> None:
        from PIL import Image

        if not self._frames:
            raise ValueError("a video needs at least one frame")
        chosen = self._frames[:: -(-len(self._frames) // PALETTE_FRAMES)]
        whole = Image.fromarray(np.concatenate([self._unpacked(frame) for frame in chosen]))
        palette = whole.quantize(MOST_COLOURS, Image.Quantize.MAXCOVERAGE)
        pictures = (
            Image.fromarray(self._unpacked(frame)).quantize(palette=palette, dither=Image.Dither.NONE)
            for frame in self._frames
        )
        first = next(pictures)
        first.save(self._file, save_all=True, append_images=pictures, duration=self._delay, loop=0, optimize=True)

    def _unpacked(self, frame: bytes) -> Frame:
        return np.frombuffer(zlib.decompress(frame), dtype=np.uint8).reshape(self._shape)

    def give_up(self) -> None:
        self._frames.clear()
