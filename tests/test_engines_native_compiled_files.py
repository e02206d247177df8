"""caster_gym.engines.native.compiled_files and .turns: compiled code on disk, shared by environments and processes."""

import errno
import os
import stat
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import pytest

from caster_gym.engines import cache_folders
from caster_gym.engines.native import compiled_files, turns
from caster_gym.engines.native.turns import take_turn

DAY = 86400.0
ROOT = Path(__file__).resolve().parent.parent
LEAVE_UNFINISHED = """
import sys
from pathlib import Path
from caster_gym.durable_files import temporary_name
(Path(sys.argv[1]) / temporary_name()).write_bytes(b"half")
"""


@pytest.fixture
def root(tmp_path, monkeypatch):
    """The folder chosen for compiled code, and a temporary one of its own."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setattr(compiled_files._SETTINGS, "CACHE_DIR", str(tmp_path / "chosen"))
    monkeypatch.setattr(cache_folders, "_said", set())
    return tmp_path / "chosen"


@pytest.fixture
def package(tmp_path, monkeypatch):
    """A package with the folders of caster_gym and one file in each."""
    for folder in ("mechanics", "engines", "envs", "envs/tensor", "tasks", "paths"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "one.py").write_text("x = 1\n")
    monkeypatch.setattr(compiled_files, "_PACKAGE", tmp_path)
    return tmp_path


@pytest.mark.parametrize("folder", ["mechanics", "engines", "envs", "tasks"])
def test_a_changed_source_is_another_version(package, folder):
    """Compiled code depends on functions that it calls, in other files."""
    before = compiled_files.source_digest()
    assert compiled_files.source_digest() == before
    (package / folder / "one.py").write_text("x = 2\n")
    changed = compiled_files.source_digest()
    (package / folder / "one.py").rename(package / folder / "two.py")
    assert len({before, changed, compiled_files.source_digest()}) == 3


@pytest.mark.parametrize("file", ["paths/one.py", "envs/tensor/one.py", "tasks/tensor.py"])
def test_sources_that_are_not_compiled_do_not_count(package, file):
    before = compiled_files.source_digest()
    (package / file).write_text("x = 2\n")
    assert compiled_files.source_digest() == before


def test_what_is_kept_is_read(root):
    assert compiled_files.read("step.nbc") is None
    compiled_files.keep("step.nbc", b"code")
    assert compiled_files.read("step.nbc") == b"code"
    assert [file.name for file in (root / compiled_files.version()).iterdir()] == ["step.nbc"]


@pytest.mark.parametrize("damage", [b"", b"short", None])
def test_a_damaged_file_is_removed_and_one_line_says_so(root, damage, capsys):
    """As after a crash or on a full disk: half of a function would take the process down."""
    for name in ("step.nbc", "look.nbc"):
        compiled_files.keep(name, b"code")
        file = root / compiled_files.version() / name
        file.write_bytes(file.read_bytes()[:-1] if damage is None else damage)
        assert compiled_files.read(name) is None
        assert not file.exists()
    told = capsys.readouterr().err
    assert told.count("\n") == 1 and "step.nbc is damaged" in told and "compiled again" in told


def test_code_that_others_can_have_written_is_removed_unread(root):
    """Its content would be right, which anybody can see to who can write it."""
    compiled_files.keep("step.nbc", b"code")
    file = root / compiled_files.version() / "step.nbc"
    file.chmod(0o666)
    assert compiled_files.read("step.nbc") is None
    assert not file.exists()


def test_a_link_to_code_is_not_followed(root, tmp_path):
    compiled_files.keep("step.nbc", b"code")
    file = root / compiled_files.version() / "step.nbc"
    file.rename(tmp_path / "elsewhere.nbc")
    file.symlink_to(tmp_path / "elsewhere.nbc")
    assert compiled_files.read("step.nbc") is None
    assert not file.is_symlink() and (tmp_path / "elsewhere.nbc").exists()


def test_what_a_killed_process_has_left_unfinished_goes(root):
    folder = root / compiled_files.version()
    folder.mkdir(parents=True)
    gone = subprocess.run([sys.executable, "-c", LEAVE_UNFINISHED, str(folder)], check=True, cwd=ROOT)
    assert gone.returncode == 0 and len(list(folder.iterdir())) == 1
    compiled_files.keep("step.nbc", b"code")
    assert [file.name for file in folder.iterdir()] == ["step.nbc"]


def full(*_):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))


def test_on_a_full_disk_nothing_is_kept_and_nothing_is_left(root, tmp_path, monkeypatch):
    """Of the file that was begun no piece stays, in neither folder."""
    monkeypatch.setattr(Path, "replace", full)
    with pytest.raises(OSError, match="No space left"):
        compiled_files.keep("step.nbc", b"code")
    assert [file for file in tmp_path.rglob("*") if file.is_file()] == []
    assert compiled_files.read("step.nbc") is None


def test_folders_in_their_order(root, tmp_path, monkeypatch):
    """Chosen, else the user's, then a temporary one that is his alone."""
    temporary = tmp_path / "temporary" / f"caster_gym-{os.getuid()}"
    assert list(compiled_files.roots()) == [root, temporary]
    monkeypatch.setattr(compiled_files._SETTINGS, "CACHE_DIR", "")
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "user"))
    assert next(compiled_files.roots()) == tmp_path / "user" / "caster_gym"
    monkeypatch.delenv("XDG_CACHE_HOME")
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    assert next(compiled_files.roots()) == tmp_path / "home" / ".cache" / "caster_gym"
    assert stat.S_IMODE(temporary.stat().st_mode) == 0o700


def test_a_cache_that_cannot_be_written_serves_all_the_same(root, tmp_path):
    """As in a container's image: what is new goes to the temporary folder. (Root writes everywhere, so a file is in the
    way of what would be new.)"""
    compiled_files.keep("old.nbc", b"old")
    (root / compiled_files.version() / "new.nbc").mkdir()
    compiled_files.keep("new.nbc", b"new")
    assert compiled_files.read("old.nbc") == b"old"
    assert compiled_files.read("new.nbc") == b"new"
    (kept,) = (tmp_path / "temporary").rglob("*.nbc")
    assert kept.name == "new.nbc"


def test_without_any_folder_nothing_is_kept(tmp_path, root, monkeypatch):
    root.write_text("no folder can be made in a file")
    monkeypatch.setattr(tempfile, "tempdir", str(root))
    with pytest.raises(OSError, match="there is no folder that only this user can write to"):
        compiled_files.keep("step.nbc", b"code")
    assert compiled_files.read("step.nbc") is None


def test_code_of_sources_that_have_changed_since_is_not_kept(root, monkeypatch):
    """It would be taken for what the new sources say."""
    monkeypatch.setattr(compiled_files, "SOURCES", "those that were read")
    compiled_files.keep("step.nbc", b"code")
    assert compiled_files.read("step.nbc") is None


def aged(folder, days):
    folder.mkdir(parents=True)
    (folder / "step.nbc").touch()
    os.utime(folder, (time.time() - days * DAY,) * 2)
    return folder


def test_versions_that_nobody_uses_go(root):
    """Old ones, and the longest unused of too many; nothing else that lies there."""
    young = [aged(root / f"cpython-311-{i:016x}", 1.0 + i / 100.0) for i in range(compiled_files.KEPT_VERSIONS + 2)]
    old = [aged(root / f"cpython-311-{'f' * 16}", 61.0), aged(root / ("0123456789abcdef"), 61.0)]
    foreign = [aged(root / "of_numba_0123456789abcdef", 99.0), aged(root / "cpython-311", 99.0)]
    compiled_files.keep("step.nbc", b"code")
    assert all(folder.exists() for folder in (*young[: compiled_files.KEPT_VERSIONS], *foreign))
    assert not any(folder.exists() for folder in (*young[compiled_files.KEPT_VERSIONS :], *old))
    assert compiled_files.read("step.nbc") == b"code"


def test_a_version_that_is_read_stays_young(root):
    compiled_files.keep("step.nbc", b"code")
    folder = root / compiled_files.version()
    os.utime(folder, (time.time() - 50 * DAY,) * 2)
    compiled_files.read("step.nbc")
    assert time.time() - folder.stat().st_mtime < DAY


def test_a_turn_waits_for_the_one_before(tmp_path):
    """on_waiting ends the first one, without which the second would never come."""
    first = take_turn(tmp_path / "turn", pytest.fail)
    assert first is not None
    waited = []

    def on_waiting():
        waited.append(True)
        first.end()

    second = take_turn(tmp_path / "turn", on_waiting)
    assert waited == [True] and second is not None
    second.end()
    third = take_turn(tmp_path / "turn", pytest.fail)
    assert third is not None
    third.end()
    assert list(tmp_path.iterdir()) == []


def test_whoever_is_stuck_does_not_stop_others_for_ever(tmp_path, monkeypatch):
    first = take_turn(tmp_path / "turn", pytest.fail)
    assert first is not None
    monkeypatch.setattr(turns, "LONGEST_WAIT", 0.0)
    assert take_turn(tmp_path / "turn", lambda: None) is None
    first.end()


def test_no_turn_where_no_file_can_be_made(tmp_path):
    (tmp_path / "file").touch()
    assert take_turn(Path(tmp_path / "file" / "turn"), pytest.fail) is None
