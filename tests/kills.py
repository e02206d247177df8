"""What a process that is killed leaves: its files, copied before each line that runs, and other processes."""

import shutil
import sys
import time
from collections.abc import Callable, Collection
from pathlib import Path
from types import ModuleType

import pytest

LONGEST = 300.0  # [s] that a busy machine may take to do what is asked; nothing waits for so long unless it fails
on_linux = pytest.mark.skipif(not Path("/proc/self/stat").exists(), reason="without /proc nobody knows the processes")


def killed_at_each_line(modules: Collection[ModuleType], folder: Path, call: Callable[[], object]) -> list[Path]:
    """Call something; copies of a folder as it stood before lines of the modules, and at the end, wherever it differs.

    A process that is killed leaves its files as they stand at that instant.
    """
    files = {module.__file__ for module in modules}
    copies: list[Path] = []
    last = None

    def copy():
        nonlocal last
        now = {one: one.read_bytes() if one.is_file() else None for one in folder.rglob("*")}
        if now == last:
            return
        last = now
        copies.append(folder.parent / f"killed-{len(copies)}")
        shutil.copytree(folder, copies[-1], symlinks=True)

    def trace(frame, event, argument):
        if frame.f_code.co_filename not in files:
            return None
        if event == "line":
            copy()
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        call()
    finally:
        sys.settrace(before)
    copy()
    return copies


def session_of(process):
    """Numbers of all processes of a session that have not ended; /proc knows them, also without their parents."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = stat.read_text().rpartition(")")[2].split()[:4]
        except OSError:  # it has ended meanwhile
            continue
        if int(session) == process.pid and state not in "ZX":
            found.append(int(stat.parent.name))
    return found


def wait_until(condition):
    end = time.monotonic() + LONGEST
    while not condition():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)
