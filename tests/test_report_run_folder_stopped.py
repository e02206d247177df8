"""Folders of results whose run was killed, is still going on, or goes on."""

import subprocess
import sys

import pytest

from caster_gym import durable_files
from caster_gym.durable_files import MARK, FolderInUseError, FolderLock, temporary_name, write_file
from caster_gym.report import run_folder
from caster_gym.report.run_folder import begun, staged
from tests.kills import killed_at_each_line
from tests.test_report_run_folder import OURS, content, run_with_results


def overwrite_with_results(folder, fails):
    with begun(folder, overwrite=True, result="best/policy.yaml", ours=OURS):
        write_file(folder / "events", "new")
        if fails:
            raise ValueError("no such robot")
        (folder / "best").mkdir()
        write_file(folder / "best" / "policy.yaml", "new")


@pytest.mark.parametrize("fails", [False, True])
def test_a_run_that_is_killed_loses_neither_old_nor_new_results(tmp_path, fails):
    """Killed before any line, what the next start finds is the old run, whole, or the results of the new one."""
    (tmp_path / "place").mkdir()
    folder = tmp_path / "place" / "run"
    run_with_results(folder, "old")

    def overwrite():
        try:
            overwrite_with_results(folder, fails)
        except ValueError:
            assert fails

    left = killed_at_each_line([run_folder, durable_files], tmp_path / "place", overwrite)
    found = []
    for one in left:
        with pytest.raises(KeyboardInterrupt), begun(one / "run", True, "best/policy.yaml", ours=OURS):
            raise KeyboardInterrupt
        assert content(one / "run") == [MARK, "best", "events"]
        found.append((one / "run" / "best" / "policy.yaml").read_text())
        assert (one / "run" / "events").read_text() == found[-1]
    assert len(found) > 15 and found[0] == "old"
    assert set(found) == ({"old"} if fails else {"old", "new"})


def test_what_was_set_aside_is_not_lost_to_another_command(tmp_path):
    """A run of one kind was killed as it began to overwrite; a command of another kind must not delete the old one."""
    run_with_results(tmp_path / "run", "old")
    (tmp_path / "run" / run_folder.BEFORE).mkdir()
    for name in ("events", "best"):
        (tmp_path / "run" / name).rename(tmp_path / "run" / run_folder.BEFORE / name)
    for overwrite, why in ((False, "is not empty"), (True, "is not a file that this command writes")):
        with pytest.raises(ValueError, match=why), staged(tmp_path / "run", overwrite, ("*.csv",)):
            pass
    assert (tmp_path / "run" / run_folder.BEFORE / "best" / "policy.yaml").read_text() == "old"


HOLD = """
import sys
from pathlib import Path
from caster_gym.report.run_folder import begun
with begun(Path(sys.argv[1]), False, "*.txt"):
    (Path(sys.argv[1]) / "a.txt").touch()
    print("begun", flush=True)
    sys.stdin.read()
"""


def test_a_run_in_use_is_neither_joined_nor_overwritten_nor_resumed(tmp_path, monkeypatch):
    monkeypatch.setattr(FolderLock.__init__, "__defaults__", (0.0,))  # nobody ends
    folder = tmp_path / "run"
    command = [sys.executable, "-c", HOLD, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None and other.stdout.readline() == b"begun\n"
        for opened in (
            begun(folder, True, "*", ours=OURS),
            begun(folder, False, "*", ours=OURS, resume=True),
            staged(folder, True, OURS),
        ):
            with pytest.raises(FolderInUseError, match=f"{folder} is in use by process {other.pid}"), opened:
                pass
        other.kill()
    assert content(folder) == [MARK, "a.txt"]
    with FolderLock(folder, patience=10.0), begun(folder, True, "*", ours=OURS):
        assert content(folder) == [MARK, run_folder.BEFORE]
    assert content(folder) == [MARK]


def test_going_on_and_overwriting_are_not_asked_for_together(tmp_path):
    run_with_results(tmp_path / "run", "old")
    before = content(tmp_path / "run")
    with (
        pytest.raises(ValueError, match="give one of the two"),
        begun(tmp_path / "run", True, "best/*", ours=OURS, resume=True),
    ):
        raise AssertionError("it begins")
    assert content(tmp_path / "run") == before


def test_a_resumed_run_finds_what_is_there_and_leaves_it(tmp_path):
    folder = tmp_path / "run"
    with pytest.raises(ValueError, match="no such robot"), begun(folder, False, "best/*", ours=OURS, resume=True):
        (folder / "events").write_text("a new one")
        raise ValueError("no such robot")
    assert not folder.exists()  # there was nothing to resume
    run_with_results(folder, "old")
    (folder / "best").rename(folder / "unfinished")
    (folder / "unfinished" / temporary_name()).mkdir()  # as a killed process leaves it
    for error in (ValueError, KeyboardInterrupt):
        with pytest.raises(error), begun(folder, False, "best/*", ours=OURS, resume=True):
            assert content(folder) == [MARK, "events", "unfinished"]
            raise error
    assert content(folder) == [MARK, "events", "unfinished"]
    assert content(folder / "unfinished") == ["policy.yaml"]


def test_only_folders_of_ours_are_resumed(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    with pytest.raises(ValueError, match="is not empty"), begun(tmp_path, False, "*", ours=OURS, resume=True):
        pass
    assert content(tmp_path) == ["thesis.txt"]


def test_the_next_start_removes_what_killed_ones_left(tmp_path, monkeypatch):
    """Beside the folder, where results were staged, and in it."""
    (tmp_path / temporary_name()).mkdir()
    (tmp_path / "run" / "best").mkdir(parents=True)
    for place in ("run", "run/best"):
        (tmp_path / place / temporary_name()).touch()
    (tmp_path / "run" / MARK).touch()
    monkeypatch.setattr(durable_files, "_PROCESS", "0" * 8)  # another process, with the same number
    with staged(tmp_path / "run", True, OURS) as fresh:
        (fresh / "a.txt").touch()
    assert content(tmp_path) == ["run"] and content(tmp_path / "run") == [MARK, "a.txt"]
