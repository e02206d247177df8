"""bounded_files: only regular files of a bounded size are read, and nothing that is none is waited for."""

import ast
import os
import socket
import sys
from pathlib import Path

import pytest

from caster_gym.bounded_files import expanded, read_bytes

OWN = {  # who reads files elsewhere, and which
    "caster_gym/engines/native": "what the system and Python know, and what was compiled here",
    "caster_gym/durable_files.py": "locks of our own",
    "agents/control/protocol.py": "the source of a class that is loaded already",
    "agents/learning/saved_state.py": "the state of a training of one's own",
    "agents/learning/replay_files.py": "the state of a training of one's own",
    "agents/learning/progress.py": "the state of a training of one's own",
}

needs_posix = pytest.mark.skipif(sys.platform == "win32", reason="Windows has no such files")


def test_a_file_is_read_whole_up_to_the_limit(tmp_path):
    file = tmp_path / "ten"
    file.write_bytes(b"0123456789")
    assert read_bytes(file, 10) == b"0123456789"
    (tmp_path / "link").symlink_to(file)
    assert read_bytes(tmp_path / "link", 10) == b"0123456789"


def test_a_file_above_the_limit_is_refused_with_its_size_and_what_to_do(tmp_path):
    file = tmp_path / "large"
    file.write_bytes(bytes(3 << 20))
    with pytest.raises(ValueError, match=r"large is too large: 3 MiB, at most 2 are read; keep a part"):
        read_bytes(file, 2 << 20, "; keep a part of it")


@needs_posix
def test_a_file_that_says_nothing_of_its_size_is_bounded_too():
    """Those of /proc have none and hold something."""
    if not Path("/proc/self/maps").exists():
        pytest.skip("there is no /proc")
    with pytest.raises(ValueError, match="too large"):
        read_bytes("/proc/self/maps", 10)


@needs_posix
def test_a_pipe_is_refused_at_once_although_nobody_writes_to_it(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    with pytest.raises(ValueError, match=r"pipe is a pipe, not a file"):
        read_bytes(tmp_path / "pipe", 10)


@needs_posix
def test_folders_sockets_and_devices_are_refused(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # names of sockets are short
    with socket.socket(socket.AF_UNIX) as listening:
        listening.bind("socket")
        for name, kind in ((".", "a folder"), ("socket", "a socket"), (os.devnull, "a device")):
            with pytest.raises(ValueError, match=f"is {kind}, not a file"):
                read_bytes(name, 10)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("nowhere.yaml", "there is no file 'nowhere.yaml'"),
        ("a\0b", "no name of a file"),
        ("n" * 5000, "^'n{30,60}.*n' is no name of a file: it is too long$"),
        (f"{'n' * 300}.yaml", "is no name of a file: it is too long"),
        ("~nobody-of-that-name/x", "home of a user that is not known"),
    ],
)
def test_names_that_lead_nowhere_are_told(name, said):
    with pytest.raises(ValueError, match=said):
        read_bytes(name, 10)


def test_homes_are_expanded(monkeypatch, tmp_path):
    monkeypatch.setenv("HOME", str(tmp_path))
    monkeypatch.setenv("USERPROFILE", str(tmp_path))
    assert expanded("~/runs") == tmp_path / "runs"


def test_all_other_files_are_read_here():
    root, found = Path(__file__).parents[1], set()
    for folder in ("caster_gym", "agents"):
        for file in sorted((root / folder).rglob("*.py")):  # which does not follow the links in caster_gym
            name = file.relative_to(root).as_posix()
            for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
                if isinstance(node, ast.Call) and _reads(node) and not name.startswith(tuple(OWN)):
                    found.add(name)
    assert found == set()


def _reads(call):
    """Whether a call reads a file, or opens one without saying that it is to be written."""
    name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
    modes = {one.value for one in [*call.args, *(one.value for one in call.keywords)] if isinstance(one, ast.Constant)}
    module = getattr(getattr(call.func, "value", None), "id", "")
    opened = name == "open" and module not in ("os", "Image") and not modes & {"w", "a", "x", "wb", "ab", "xb"}
    method = isinstance(call.func, ast.Attribute) and name in {"read_text", "read_bytes"}
    return method or opened or name in {"loadtxt", "genfromtxt", "load_file", "safe_open"}
