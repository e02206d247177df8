"""Files and folders are whole at every instant, and what a killed process leaves is removed."""

import ast
import errno
import os
import re
import shutil
import subprocess
import sys
import threading
from pathlib import Path

import pytest

from caster_gym import durable_files
from caster_gym.durable_files import (
    MARK,
    FolderInUseError,
    FolderLock,
    is_temporary,
    move_file,
    remove_leftovers,
    replace_folder,
    scratch_folder,
    temporary_name,
    write_file,
)
from tests.kills import killed_at_each_line

ROOT = Path(__file__).resolve().parents[1]
WRITERS = {"write_text", "write_bytes", "savefig", "savetxt", "save_file", "to_csv", "mkdtemp", "NamedTemporaryFile"}
OTHERWISE = {
    "caster_gym/durable_files.py": "writes the files of all others",
    "caster_gym/report/figures.py": "draws into memory",
    "agents/learning/progress.py": "appends rows, and the saved state says how many of them count",
    "caster_gym/engines/native/compiled_files.py": "has checksums; what is lost is compiled again",
    "caster_gym/engines/tensor/compiler.py": "makes a folder that goes with the process",
}  # how modules write that call these, or open a file for writing, themselves
OLD, NEW = "old " * 4000, "new " * 5000  # longer than a buffer


def names(folder):
    return sorted(one.name for one in folder.iterdir())


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "place"
    made.mkdir()
    return made


def two_folders(place):
    """One that is there, and a complete one that is to take its place."""
    for folder, text in ((place / "best", OLD), (place / temporary_name(), NEW)):
        (folder / "deep").mkdir(parents=True)
        (folder / "one.txt").write_text(text)
        (folder / "deep" / "two.txt").write_text(text)
    return folder, place / "best"


@pytest.fixture(params=[True, False], ids=["exchanged", "renamed"])
def exchange(request, monkeypatch):
    """File systems that can exchange two folders, and others."""
    if not request.param:
        monkeypatch.setattr(durable_files, "_exchange", lambda one, other: False)
    return request.param


@pytest.mark.parametrize("old", [None, OLD])
def test_a_file_is_the_old_or_the_new_one_at_every_instant(folder, old, monkeypatch):
    file = folder / "a.txt"
    if old is not None:
        write_file(file, old)
    left = killed_at_each_line([durable_files], folder, lambda: write_file(file, NEW))
    found = [(one / "a.txt").read_text() if (one / "a.txt").exists() else None for one in left]
    assert found[0] == old and found[-1] == NEW and len(found) >= 3
    assert set(found) == {old, NEW}
    monkeypatch.setattr(durable_files, "_PROCESS", "0" * 8)  # the next one, with the same number
    for one in left:
        remove_leftovers(one)
        assert names(one) in (["a.txt"], [] if old is None else ["a.txt"])
    assert names(folder) == ["a.txt"]


def test_a_folder_is_the_old_or_the_new_one_at_every_instant(folder, exchange, monkeypatch):
    fresh, best = two_folders(folder)
    left = killed_at_each_line([durable_files], folder, lambda: replace_folder(fresh, best))
    if exchange:  # else there are instants without one, after which the old one gets its name back
        assert all((one / "best").exists() for one in left)
    monkeypatch.setattr(durable_files, "_PROCESS", "0" * 8)
    found = []
    for one in left:
        remove_leftovers(one)
        assert names(one) == ["best"]
        found.append((one / "best" / "one.txt").read_text())
        assert (one / "best" / "deep" / "two.txt").read_text() == found[-1]
    assert found[0] == OLD and found[-1] == NEW and set(found) == {OLD, NEW}
    assert names(folder) == ["best"]


def test_a_folder_takes_a_free_place(folder):
    fresh, best = two_folders(folder)
    shutil.rmtree(best)
    replace_folder(fresh, best)
    assert names(folder) == ["best"] and names(best) == ["deep", "one.txt"]


@pytest.mark.parametrize("number", [errno.ENOSPC, errno.EIO])
@pytest.mark.parametrize("call", ["open", "fsync", "replace"])
def test_a_write_that_fails_leaves_the_old_file_and_nothing_else(folder, monkeypatch, number, call):
    file = folder / "a.txt"
    write_file(file, OLD)

    def fail(*_, **__):
        raise OSError(number, os.strerror(number))

    with monkeypatch.context() as patch:
        patch.setattr(os, call, fail)
        if call == "replace":
            patch.setattr(Path, "replace", fail)
        with pytest.raises(OSError, match=os.strerror(number)):
            write_file(file, NEW)
    assert file.read_text() == OLD and names(folder) == ["a.txt"]


def test_a_folder_that_cannot_take_its_place_leaves_the_old_one(folder, monkeypatch):
    """Also where the file system cannot exchange folders, and the second of the two renames fails."""
    monkeypatch.setattr(durable_files, "_exchange", lambda one, other: False)
    fresh, best = two_folders(folder)
    rename = Path.rename

    def fail(source, target):
        if source == fresh:
            raise OSError(errno.EIO, "Input/output error")
        return rename(source, target)

    monkeypatch.setattr(Path, "rename", fail)
    with pytest.raises(OSError, match="Input/output error"):
        replace_folder(fresh, best)
    assert (best / "one.txt").read_text() == OLD and names(folder) == sorted(["best", fresh.name])


def test_an_exchange_that_fails_for_a_reason_says_it(folder):
    with pytest.raises(OSError, match="No such file"):
        durable_files._exchange(folder / "a", folder / "b")


def test_bytes_text_and_permissions_are_those_of_plain_writing(folder):
    for name, content in (("a", "Größe × 2\n"), ("b", b"\x00\r\n")):
        write_file(folder / name, content)
        assert (folder / name).read_bytes() == (content.encode() if isinstance(content, str) else content)
    (folder / "plain").write_text("")
    assert (folder / "a").stat().st_mode == (folder / "plain").stat().st_mode


def test_a_link_stays_and_a_device_is_not_replaced(folder):
    (folder / "link").symlink_to(folder / "a.txt")
    for text in ("first", "second"):  # to a file that is not there, and to one that is
        write_file(folder / "link", text)
        assert (folder / "link").is_symlink() and (folder / "a.txt").read_text() == text
    os.mkfifo(folder / "pipe")
    for place, why in ((folder / "pipe", "is not a regular file"), (folder, "is a folder")):
        for call in (lambda place=place: write_file(place, ""), lambda place=place: move_file(folder / "a.txt", place)):
            with pytest.raises(OSError, match=why):
                call()
    assert (folder / "pipe").is_fifo() and names(folder) == ["a.txt", "link", "pipe"]


def test_a_finished_file_is_moved(folder):
    with scratch_folder(folder) as scratch:
        (scratch / "film").write_text(NEW)
        move_file(scratch / "film", folder / "film.gif")
    assert (folder / "film.gif").read_text() == NEW and names(folder) == ["film.gif"]


def test_only_what_dead_processes_left_is_removed(folder):
    ended = subprocess.run([sys.executable, "-c", "import os; print(os.getpid())"], capture_output=True, text=True)
    ours = temporary_name()
    dead, parent, elsewhere = (
        ours.replace(f"-{os.getpid()}-", f"-{int(pid)}-").replace(durable_files._HOST, host)
        for pid, host in (
            (ended.stdout, durable_files._HOST),
            (os.getppid(), durable_files._HOST),
            (ended.stdout, "another-machine"),
        )
    )
    kept = sorted([ours, parent, elsewhere, MARK, ".hidden", "a.txt"])
    for name in (*kept, dead):
        (folder / name).touch()
    remove_leftovers(folder)
    assert names(folder) == kept
    remove_leftovers(folder, locked=True)
    assert names(folder) == [MARK, ".hidden", "a.txt"]
    assert [is_temporary(name) for name in (ours, elsewhere, MARK, "a.txt")] == [True, True, False, False]


HOLD = """
import sys
from pathlib import Path
from caster_gym.durable_files import FolderLock
with FolderLock(Path(sys.argv[1])):
    print("locked", flush=True)
    sys.stdin.read()
"""


def test_a_lock_keeps_others_out_and_ends_with_its_process(folder):
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None and other.stdout.readline() == b"locked\n"
        with (
            pytest.raises(FolderInUseError, match=f"{folder} is in use by process {other.pid}: "),
            FolderLock(folder, 0.0),
        ):
            pass
        other.kill()
    with FolderLock(folder, patience=10.0):  # the system may still be at the dead process
        pass
    assert names(folder) == [MARK] and (folder / MARK).read_text() == ""


def test_one_thread_may_lock_a_folder_again_and_another_may_not(folder):
    refused = []

    def attempt():
        try:
            with FolderLock(folder, patience=0.0):
                pass
        except FolderInUseError as error:
            refused.append(str(error))

    with FolderLock(folder):
        with FolderLock(folder):
            pass
        thread = threading.Thread(target=attempt)
        thread.start()
        thread.join()
        assert len(refused) == 1
    attempt()
    assert len(refused) == 1


def test_a_lock_is_on_the_folder_that_stands_there(folder):
    """Whoever waits for a folder that is replaced meanwhile locks the new one."""
    fresh, best = two_folders(folder)
    with FolderLock(best):
        replace_folder(fresh, best)
        with FolderLock(best):
            inode = (best / MARK).stat().st_ino
            assert inode in {key[1] for key in FolderLock._holders}
    assert not FolderLock._holders


def test_a_mark_that_is_a_link_is_not_followed(folder):
    (folder / "thesis.txt").write_text("mine")
    (folder / MARK).symlink_to(folder / "thesis.txt")
    with pytest.raises(OSError), FolderLock(folder):
        pass
    assert (folder / "thesis.txt").read_text() == "mine"


def writes(tree):
    """Calls that write a file."""
    for node in ast.walk(tree):
        if isinstance(node, ast.Call):
            name = getattr(node.func, "attr", getattr(node.func, "id", ""))
            words = [
                one.value for one in ast.walk(node) if isinstance(one, ast.Constant) and isinstance(one.value, str)
            ]
            if name in WRITERS or (name == "open" and any(re.fullmatch("[rbt]*[wax+][bt+]*", word) for word in words)):
                yield f"line {node.lineno}: {ast.unparse(node)}"


def test_all_files_are_written_through_this_module():
    found = {}
    for file in (*ROOT.glob("caster_gym/**/*.py"), *ROOT.glob("agents/**/*.py"), *ROOT.glob("papers/**/*.py")):
        if calls := list(writes(ast.parse(file.read_text(encoding="utf-8")))):
            found[file.relative_to(ROOT).as_posix()] = calls
    assert {name: calls for name, calls in found.items() if name not in OTHERWISE} == {}
    assert "caster_gym/report/figures.py" in found  # the search finds some
    assert len(list(writes(ast.parse("open('a', 'w'); path.open(mode='ab'); path.open('rb'); figure.savefig(x)")))) == 3
