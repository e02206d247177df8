"""caster_gym.engines.cache_folders: compiled code lies where nobody else can put code for us to run."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

from caster_gym.engines import cache_folders
from caster_gym.engines.cache_folders import fault_of, is_trusted

if not hasattr(os, "getuid"):
    pytest.skip("users and modes are POSIX's", allow_module_level=True)


@pytest.fixture(autouse=True)
def temporary(tmp_path, monkeypatch):
    """A folder for temporary files, and nothing said so far."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setattr(cache_folders, "_said", set())
    return (tmp_path / "temporary").resolve() / f"caster_gym-{os.getuid()}"


@pytest.fixture
def chosen(tmp_path):
    made = tmp_path.resolve() / "chosen"
    made.mkdir(mode=0o755)
    return made


def folders(chosen):
    return list(cache_folders.cache_folders(str(chosen)))


def test_the_chosen_folder_then_a_temporary_one_of_mode_0700(chosen, temporary):
    assert folders(chosen) == [chosen, temporary]
    assert stat.S_IMODE(temporary.stat().st_mode) == 0o700


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o757, 0o1777])
def test_a_folder_that_others_can_write_is_left_alone_and_told_once(chosen, temporary, mode, capsys):
    """Sticky or not: in /tmp itself everybody can add files."""
    chosen.chmod(mode)
    assert folders(chosen) == folders(chosen) == [temporary]
    told = capsys.readouterr().err
    assert told.count("\n") == 1
    assert f"others can write to {chosen} (mode {mode:04o})" in told and "NUMBA_CACHE_DIR" in told


@pytest.mark.parametrize(("mode", "trusted"), [(0o777, False), (0o775, False), (0o1777, True), (0o755, True)])
def test_nobody_else_can_rename_what_lies_above(chosen, temporary, mode, trusted):
    """In a sticky folder only owners rename."""
    (chosen / "deep").mkdir()
    chosen.chmod(mode)
    assert folders(chosen / "deep") == ([chosen / "deep"] if trusted else []) + [temporary]


def test_links_are_followed_before_a_folder_is_looked_at(chosen, temporary, tmp_path):
    (tmp_path / "link").symlink_to(chosen)
    assert folders(tmp_path / "link") == [chosen, temporary]
    chosen.chmod(0o777)
    assert folders(tmp_path / "link") == [temporary]


def test_folders_of_root_are_trusted_and_those_of_other_users_are_not(chosen, monkeypatch):
    """As a user beside the one to whom all that is here belongs."""
    owner = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    monkeypatch.setattr(cache_folders, "_owners", lambda higher: {owner + 1, owner if higher else owner + 1})
    assert fault_of(chosen) == f"{chosen} belongs to user {owner}, who could put other code there"
    monkeypatch.setattr(cache_folders, "_owners", lambda higher: {owner + 1, owner})  # as root's
    assert fault_of(chosen) is None


def test_the_owners_that_are_trusted():
    """Above, also whoever owns `/`: in a container that does not map root, that is another number."""
    assert cache_folders._owners(False) == {os.getuid(), 0}
    assert cache_folders._owners(True) == {os.getuid(), 0, Path("/").stat().st_uid}


@pytest.mark.parametrize("mode", [0o777, 0o770, 0o755, 0o500])
def test_a_temporary_folder_of_another_mode_is_left_alone(chosen, temporary, mode):
    """We would have made it with 0700: somebody else may have had a hand in it."""
    temporary.mkdir()
    temporary.chmod(mode)
    assert folders(chosen) == [chosen]


def test_a_temporary_folder_of_another_user_is_left_alone(chosen, temporary, monkeypatch):
    temporary.mkdir(mode=0o700)
    owner = os.getuid()
    monkeypatch.setattr(os, "getuid", lambda: owner + 1)
    temporary.rename(temporary.with_name(f"caster_gym-{owner + 1}"))
    assert temporary.with_name(f"caster_gym-{owner + 1}") not in folders(chosen)


def test_a_link_in_the_place_of_the_temporary_folder_is_left_alone(chosen, temporary, tmp_path):
    (tmp_path / "elsewhere").mkdir(mode=0o700)
    temporary.symlink_to(tmp_path / "elsewhere")
    assert folders(chosen) == [chosen]


def test_where_no_folder_can_be_made_there_is_none(tmp_path, monkeypatch):
    (tmp_path / "file").touch()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "file"))
    assert folders(tmp_path / "file" / "cache") == []


def test_a_file_is_trusted_if_it_is_regular_and_nobody_else_can_write_it(tmp_path):
    file = tmp_path / "file"
    file.touch(mode=0o644)
    assert is_trusted(file.stat())
    for mode in (0o664, 0o646):
        file.chmod(mode)
        assert not is_trusted(file.stat())
    assert not is_trusted(tmp_path.stat())
