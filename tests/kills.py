"""What a process leaves that is killed: copies of a folder before each line that runs."""

import shutil
import sys
from collections.abc import Callable, Collection
from pathlib import Path
from types import ModuleType


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
