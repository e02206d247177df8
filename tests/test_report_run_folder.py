"""Folders of results never take the place of anything but results."""

import errno
import tempfile
from pathlib import Path
from typing import Any

import pytest

from caster_gym.report.run_folder import MARK, begun, check_file, check_free, replace_file, staged


def test_a_folder_of_somebody_else_stays(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    for overwrite, complaint in ((False, "is not empty"), (True, "does not hold results of caster-gym alone")):
        with pytest.raises(ValueError, match=complaint), begun(tmp_path, overwrite, "*.txt"):
            pass
        with pytest.raises(ValueError, match=complaint), staged(tmp_path, overwrite):
            pass
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_a_policy_that_is_to_be_read_is_not_deleted(tmp_path):
    (tmp_path / MARK).touch()
    (tmp_path / "best").mkdir()
    with pytest.raises(ValueError, match="lies in it"):
        check_free(tmp_path, overwrite=True, kept=tmp_path / "best")


def test_staged_results_replace_the_old_ones_at_once(tmp_path):
    folder = tmp_path / "results"
    for text in ("first", "second"):
        with staged(folder, overwrite=True) as fresh:
            (fresh / f"{text}.txt").write_text(text)
    assert sorted(path.name for path in folder.iterdir()) == [MARK, "second.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_results_that_cannot_take_their_place_leave_the_old_ones(tmp_path, monkeypatch):
    folder = tmp_path / "results"
    with staged(folder, overwrite=False) as fresh:
        (fresh / "old.txt").touch()
    rename = Path.rename

    def interrupted(source, target):
        if source.name == "results" and source != folder:
            raise KeyboardInterrupt
        return rename(source, target)

    monkeypatch.setattr(Path, "rename", interrupted)
    with pytest.raises(KeyboardInterrupt), staged(folder, overwrite=True) as fresh:
        (fresh / "new.txt").touch()
    assert sorted(path.name for path in folder.iterdir()) == [MARK, "old.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_a_file_is_replaced_whole(tmp_path):
    file = tmp_path / "page.md"
    for text in ("first", "second"):
        replace_file(file, text)
    assert file.read_text(encoding="utf-8") == "second"
    assert file.stat().st_mode & 0o777 == 0o644
    assert list(tmp_path.iterdir()) == [file]


def test_staged_results_that_fail_leave_the_old_ones(tmp_path):
    folder = tmp_path / "results"
    with staged(folder, overwrite=False) as fresh:
        (fresh / "old.txt").touch()
    with pytest.raises(KeyboardInterrupt), staged(folder, overwrite=True) as fresh:
        (fresh / "new.txt").touch()
        raise KeyboardInterrupt
    assert sorted(path.name for path in folder.iterdir()) == [MARK, "old.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def content(folder):
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
@pytest.mark.parametrize("there", [False, True], ids=["new", "empty"])
def test_a_start_that_fails_leaves_nothing_in_the_way_of_the_next(tmp_path, error, there):
    folder = tmp_path / "runs" / "first"
    if there:
        folder.mkdir(parents=True)
    with pytest.raises(error), begun(folder, overwrite=False, result="best/policy.yaml"):
        (folder / "events").touch()
        raise error
    assert folder.exists() == (tmp_path / "runs").exists() == there
    with begun(folder, overwrite=False, result="best/policy.yaml"):
        (folder / "events").touch()
    assert content(folder) == [MARK, "events"]
    assert content(tmp_path / "runs") == ["first"]


def test_a_start_that_fails_keeps_what_was_to_be_overwritten(tmp_path):
    folder = tmp_path / "run"
    with begun(folder, overwrite=False, result="*.txt"):
        (folder / "old.txt").write_text("a week of work")
    with pytest.raises(ValueError, match="no such robot"), begun(folder, overwrite=True, result="*.txt"):
        assert content(folder) == [MARK]
        raise ValueError("no such robot")
    assert content(folder) == [MARK, "old.txt"]
    assert (folder / "old.txt").read_text() == "a week of work"
    assert content(tmp_path) == ["run"]


def test_what_a_run_has_finished_is_kept(tmp_path):
    folder = tmp_path / "run"
    with begun(folder, overwrite=False, result="*.txt"):
        (folder / "old.txt").touch()
    with pytest.raises(KeyboardInterrupt), begun(folder, overwrite=True, result="*.txt"):
        (folder / "new.txt").touch()
        raise KeyboardInterrupt
    assert content(folder) == [MARK, "new.txt"]
    assert content(tmp_path) == ["run"]


def test_files_that_a_run_reads_are_not_overwritten(tmp_path):
    with begun(tmp_path / "run", overwrite=False, result="*"):
        (tmp_path / "run" / "task.yaml").touch()
    task = tmp_path / "run" / "task.yaml"
    with (
        pytest.raises(ValueError, match=r"task\.yaml lies in it"),
        begun(tmp_path / "run", overwrite=True, result="*", kept=(Path("ppo"), task)),
    ):
        pass
    assert task.is_file()


def out_of_reach(tmp_path, monkeypatch):
    """Folders that cannot be had, and a part of what is said about each."""
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    closed = tmp_path / "closed"
    closed.mkdir()
    mkdir: Any = tempfile.TemporaryDirectory

    def refused(*arguments, dir=None, **options):
        if Path(dir) == closed:
            raise PermissionError(errno.EACCES, "Permission denied", str(dir))
        return mkdir(*arguments, dir=dir, **options)

    monkeypatch.setattr(tempfile, "TemporaryDirectory", refused)  # permissions do not bind root
    return {
        tmp_path / "file": "file is not a folder",
        tmp_path / "file" / "run": "file is not a folder",
        tmp_path / "link": "link is not a folder",
        closed / "a" / "run": "Permission denied",
        closed: "Permission denied",
        tmp_path / ("n" * 300): "File name too long",
        Path("/proc/results"): "new folders are not possible there",
    }


def test_a_folder_that_cannot_be_had_is_refused_before_the_work_begins(tmp_path, monkeypatch):
    for folder, why in out_of_reach(tmp_path, monkeypatch).items():
        for opened in (begun(folder, False, "*"), staged(folder, overwrite=False)):
            with pytest.raises(ValueError, match=f"^results cannot be written to .*: .*{why}; choose another --out$"):
                opened.__enter__()
    assert content(tmp_path) == ["closed", "file", "link"]


def test_advice_on_folders_that_are_not_empty_helps(tmp_path):
    """--overwrite is named where it would be accepted, and not elsewhere."""
    (tmp_path / "ours").mkdir()
    (tmp_path / "ours" / MARK).touch()
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.txt").touch()
    with pytest.raises(ValueError, match="or add --overwrite to delete what is in it"):
        check_free(tmp_path / "ours", overwrite=False)
    check_free(tmp_path / "ours", overwrite=True)
    with pytest.raises(ValueError, match="theirs is not empty; choose another --out") as caught:
        check_free(tmp_path / "theirs", overwrite=False)
    assert "--overwrite" not in str(caught.value)


def test_an_empty_working_folder_may_hold_the_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with staged(Path(), overwrite=False) as fresh:
        (fresh / "page.md").touch()
    assert content(Path()) == [MARK, "page.md"]
    assert Path("page.md").samefile(tmp_path / "page.md")


def test_a_file_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "there.xml").touch()
    for file, why in (
        (tmp_path, "is a folder; give --mjcf the name of a file in it"),
        (tmp_path / "no" / "a.xml", "there is no folder '.*no' to write a.xml in; make it first"),
        (tmp_path / "there.xml", "is there already; choose another --mjcf, or add --overwrite to replace it"),
    ):
        with pytest.raises(ValueError, match=why):
            check_file(file, False, "--mjcf")
    check_file(tmp_path / "there.xml", True, "--mjcf")
    check_file(tmp_path / "new.xml", False, "--mjcf")
