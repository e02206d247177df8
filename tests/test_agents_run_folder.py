"""Folders of results never take the place of anything but results."""

from pathlib import Path

import pytest

from caster_gym.agents.run_folder import MARK, check_free, prepare, replace_file, staged


def test_a_folder_of_somebody_else_stays(tmp_path):
    (tmp_path / "thesis.txt").write_text("mine")
    for overwrite, complaint in ((False, "is not empty"), (True, "does not hold results of caster-gym alone")):
        with pytest.raises(ValueError, match=complaint):
            prepare(tmp_path, overwrite)
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
