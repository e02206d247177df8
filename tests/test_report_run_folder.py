"""Folders of results never take the place of anything but results."""

import errno
import os
import re
from pathlib import Path

import pytest

from caster_gym import durable_files
from caster_gym.durable_files import MARK
from caster_gym.report import run_folder
from caster_gym.report.run_folder import begun, check_can_be_made, check_file, check_free, staged

OURS = ("*.txt", "events", "best/policy.yaml")


def test_a_folder_of_somebody_else_stays(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    for overwrite, complaint in ((False, "is not empty"), (True, "does not hold results of caster-gym alone")):
        with pytest.raises(ValueError, match=complaint), begun(tmp_path, overwrite, "*.txt", ours=OURS):
            pass
        with pytest.raises(ValueError, match=complaint), staged(tmp_path, overwrite, OURS):
            pass
    assert (tmp_path / "thesis.txt").read_text() == "mine"


def test_a_policy_that_is_to_be_read_is_not_deleted(tmp_path):
    (tmp_path / MARK).touch()
    (tmp_path / "best").mkdir()
    with pytest.raises(ValueError, match="lies in it"):
        check_free(tmp_path, overwrite=True, ours=OURS, kept=(tmp_path / "best",))


def test_staged_results_replace_the_old_ones_at_once(tmp_path):
    folder = tmp_path / "results"
    for text in ("first", "second"):
        with staged(folder, overwrite=True, ours=OURS) as fresh:
            (fresh / f"{text}.txt").write_text(text)
    assert sorted(path.name for path in folder.iterdir()) == [MARK, "second.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_results_that_cannot_take_their_place_leave_the_old_ones(tmp_path, monkeypatch):
    folder = tmp_path / "results"
    with staged(folder, overwrite=False, ours=OURS) as fresh:
        (fresh / "old.txt").touch()

    def fail(one, other):
        raise OSError(errno.EBUSY, "Device or resource busy", str(other))

    monkeypatch.setattr(durable_files, "_exchange", fail)
    with pytest.raises(OSError, match="busy"), staged(folder, overwrite=True, ours=OURS) as fresh:
        (fresh / "new.txt").touch()
    assert sorted(path.name for path in folder.iterdir()) == [MARK, "old.txt"]
    assert [path.name for path in tmp_path.iterdir()] == ["results"]


def test_staged_results_that_fail_leave_the_old_ones(tmp_path):
    folder = tmp_path / "results"
    with staged(folder, overwrite=False, ours=OURS) as fresh:
        (fresh / "old.txt").touch()
    with pytest.raises(KeyboardInterrupt), staged(folder, overwrite=True, ours=OURS) as fresh:
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
    with pytest.raises(error), begun(folder, overwrite=False, result="best/policy.yaml", ours=OURS):
        (folder / "events").touch()
        raise error
    assert folder.exists() == (tmp_path / "runs").exists() == there
    with begun(folder, overwrite=False, result="best/policy.yaml", ours=OURS):
        (folder / "events").touch()
    assert content(folder) == [MARK, "events"]
    assert content(tmp_path / "runs") == ["first"]


def test_a_start_that_fails_keeps_what_was_to_be_overwritten(tmp_path):
    folder = tmp_path / "run"
    with begun(folder, overwrite=False, result="*.txt", ours=OURS):
        (folder / "old.txt").write_text("a week of work")
    with pytest.raises(ValueError, match="no such robot"), begun(folder, overwrite=True, result="*.txt", ours=OURS):
        assert content(folder) == [MARK, run_folder.BEFORE]
        raise ValueError("no such robot")
    assert content(folder) == [MARK, "old.txt"]
    assert (folder / "old.txt").read_text() == "a week of work"
    assert content(tmp_path) == ["run"]


def test_what_a_run_has_finished_is_kept(tmp_path):
    folder = tmp_path / "run"
    with begun(folder, overwrite=False, result="*.txt", ours=OURS):
        (folder / "old.txt").touch()
    with pytest.raises(KeyboardInterrupt), begun(folder, overwrite=True, result="*.txt", ours=OURS):
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
        begun(tmp_path / "run", overwrite=True, result="*", kept=(Path("ppo"), task), ours=("*.yaml",)),
    ):
        pass
    assert task.is_file()


def out_of_reach(tmp_path, monkeypatch):
    """Folders that cannot be had, and a part of what is said about each."""
    (tmp_path / "file").touch()
    (tmp_path / "link").symlink_to(tmp_path / "nowhere")
    (tmp_path / "to-file").symlink_to(tmp_path / "file")
    closed = tmp_path / "closed"
    closed.mkdir()
    mkdir = Path.mkdir

    def refused(self, *arguments, **options):
        if self.parent == closed:
            raise PermissionError(errno.EACCES, "Permission denied", str(self))
        mkdir(self, *arguments, **options)

    monkeypatch.setattr(Path, "mkdir", refused)  # permissions do not bind root
    return {
        tmp_path / "file": "file is not a folder",
        tmp_path / "file" / "run": "file is not a folder",
        tmp_path / "to-file": "to-file is not a folder",
        tmp_path / "link": "link is a link to nothing",
        tmp_path / "link" / "run": "link is a link to nothing",
        closed / "a" / "run": "Permission denied",
        closed: "Permission denied",
        tmp_path / ("n" * 300): "File name too long",
        Path("/proc/results"): "new folders are not possible there",
    }


def test_a_folder_that_cannot_be_had_is_refused_before_the_work_begins(tmp_path, monkeypatch):
    for folder, why in out_of_reach(tmp_path, monkeypatch).items():
        for opened in (begun(folder, False, "*"), staged(folder, overwrite=False, ours=OURS)):
            with pytest.raises(ValueError, match=f"^results cannot be written to .*: .*{why}; choose another --out$"):
                opened.__enter__()
    assert content(tmp_path) == ["closed", "file", "link", "to-file"]


@pytest.mark.parametrize("address", ["s3://bucket/run", "memory://run", "gs://bucket", "abfs+x://a"])
def test_an_address_is_no_folder(tmp_path, monkeypatch, address):
    """Rather than a folder called 's3:'. A drive of Windows has one letter."""
    monkeypatch.chdir(tmp_path)
    told = f"^results cannot be written to {re.escape(address)}, since locks and renames need a file system; give --out"
    for opened in (
        begun(Path(address), False, "*"),
        begun(Path(address), False, "*", resume=True),
        staged(Path(address), overwrite=False, ours=OURS),
    ):
        with pytest.raises(ValueError, match=told):
            opened.__enter__()
    assert content(tmp_path) == []
    check_can_be_made(Path("c:/run"))
    check_can_be_made(Path("run:2"))


def test_advice_on_folders_that_are_not_empty_helps(tmp_path):
    """--overwrite is named where it would be accepted, and not elsewhere."""
    (tmp_path / "ours").mkdir()
    for name in (MARK, "old.txt", ".DS_Store"):
        (tmp_path / "ours" / name).touch()
    (tmp_path / "theirs").mkdir()
    (tmp_path / "theirs" / "thesis.txt").touch()
    with pytest.raises(ValueError, match="or add --overwrite to delete what is in it"):
        check_free(tmp_path / "ours", overwrite=False, ours=OURS)
    check_free(tmp_path / "ours", overwrite=True, ours=OURS)
    with pytest.raises(ValueError, match="theirs is not empty; choose another --out") as caught:
        check_free(tmp_path / "theirs", overwrite=False, ours=OURS)
    assert "--overwrite" not in str(caught.value)


def test_an_empty_working_folder_may_hold_the_results(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with staged(Path(), overwrite=False, ours=OURS) as fresh:
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


def run_with_results(folder, text):
    """A finished run, with files of several kinds."""
    with begun(folder, overwrite=False, result="best/policy.yaml", ours=OURS):
        (folder / "best").mkdir()
        for name in ("events", "best/policy.yaml"):
            (folder / name).write_text(text)


@pytest.mark.parametrize("name", ["notes.md", "best/notes.txt", "best/deep/policy.yaml", ".hidden"])
def test_a_file_that_is_not_ours_is_named_and_nothing_is_deleted(tmp_path, name):
    folder = tmp_path / "run"
    run_with_results(folder, "old")
    (folder / name).parent.mkdir(exist_ok=True)
    (folder / name).write_text("mine")
    for opened in (begun(folder, True, "*", ours=OURS), staged(folder, True, OURS)):
        with pytest.raises(ValueError, match=f"since {folder / name} is not a file that this command writes"), opened:
            pass
    assert (folder / name).read_text() == "mine" and (folder / "events").read_text() == "old"


def test_what_a_person_puts_into_the_folder_of_a_run_that_fails_stays(tmp_path):
    folder = tmp_path / "run"
    run_with_results(folder, "old")
    with pytest.raises(ValueError, match="no such robot"), begun(folder, True, "best/policy.yaml", ours=OURS):
        (folder / "best").mkdir()
        for name in ("events", "best/notes.md"):
            (folder / name).write_text("mine")
        raise ValueError("no such robot")
    assert (folder / "best" / "notes.md").read_text() == "mine"
    assert (folder / "events").read_text() == (folder / "best" / "policy.yaml").read_text() == "old"
    assert content(folder) == [MARK, "best", "events"]


def test_a_link_that_is_in_the_way_is_not_ours(tmp_path):
    """Neither it nor what it leads to is deleted."""
    folder = tmp_path / "run"
    run_with_results(folder, "old")
    (folder / "state").symlink_to(tmp_path)
    with (
        pytest.raises(ValueError, match="state is not a file that this command writes"),
        staged(folder, True, (*OURS, "state/*")),
    ):
        pass
    assert (folder / "state").is_symlink()


@pytest.mark.parametrize("how", ["begun", "staged"])
def test_a_link_to_a_folder_stays_and_leads_to_the_results(tmp_path, how):
    (tmp_path / "disk" / "runs").mkdir(parents=True)
    link = tmp_path / "link"
    link.symlink_to(tmp_path / "disk" / "runs")
    for out, overwrite in ((link, False), (link, True), (link / "a", False), (link / "a", True)):
        if out.name == "a":
            (link / "events").unlink(missing_ok=True)
        if how == "begun":
            with begun(out, overwrite, "*", ours=(*OURS, "a/*")):
                (out / "events").touch()
        else:
            with staged(out, overwrite, (*OURS, "a/*")) as fresh:
                (fresh / "events").touch()
        assert link.is_symlink() and content(out) == [MARK, "events"]
        assert content(tmp_path) == ["disk", "link"] and content(tmp_path / "disk") == ["runs"]


def test_a_link_to_the_input_is_seen_through(tmp_path):
    run_with_results(tmp_path / "run", "old")
    (tmp_path / "link").symlink_to(tmp_path / "run")
    for read in (tmp_path / "run" / "best", tmp_path / "link" / "best"):
        for out in (tmp_path / "run", tmp_path / "link"):
            with pytest.raises(ValueError, match="lies in it"):
                check_free(out, True, OURS, (read,))


@pytest.mark.parametrize("how", ["begun", "staged"])
def test_the_working_folder_may_hold_results_but_is_not_overwritten(tmp_path, monkeypatch, how):
    monkeypatch.chdir(tmp_path)

    def write(overwrite):
        if how == "begun":
            with begun(Path(), overwrite, "*", ours=OURS):
                Path("events").touch()
        else:
            with staged(Path(), overwrite, OURS) as fresh:
                (fresh / "events").touch()

    write(overwrite=False)
    assert content(Path()) == [MARK, "events"] and Path("events").samefile(tmp_path / "events")
    with pytest.raises(ValueError, match=r"^\. is not overwritten, since .* lies in it; choose another --out"):
        write(overwrite=True)
    assert content(Path()) == [MARK, "events"]


def test_a_device_is_not_written_over(tmp_path):
    os.mkfifo(tmp_path / "pipe.xml")
    (tmp_path / "link.xml").symlink_to(tmp_path / "no" / "a.xml")
    for name, why in (("pipe.xml", "not a file but a device"), ("link.xml", "there is no folder '.*no' to write")):
        for overwrite in (False, True):
            with pytest.raises(ValueError, match=why):
                check_file(tmp_path / name, overwrite, "--mjcf")
