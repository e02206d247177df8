"""caster_gym.engines.tensor.compiler: where Torch keeps what it has compiled."""

import os
import stat
import tempfile
from pathlib import Path

import pytest

from caster_gym.engines import cache_folders
from caster_gym.engines.tensor.compiler import choose_cache

VARIABLE = "TORCHINDUCTOR_CACHE_DIR"


@pytest.fixture(autouse=True)
def home(tmp_path, monkeypatch):
    """A home and a folder for temporary files; Torch's cache as if nobody had chosen or used it yet."""
    (tmp_path / "temporary").mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    monkeypatch.setattr(cache_folders, "_said", set())
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.delenv("NUMBA_CACHE_DIR", raising=False)
    monkeypatch.setenv(VARIABLE, "")
    return tmp_path.resolve()


def test_code_of_torch_lies_beside_ours(home, monkeypatch):
    choose_cache()
    assert Path(os.environ[VARIABLE]) == home / "cache" / "caster_gym" / "torch"
    monkeypatch.setenv(VARIABLE, str(home / "temporary" / "torchinductor_me"))  # where Torch alone would keep it
    choose_cache()
    assert Path(os.environ[VARIABLE]) == home / "cache" / "caster_gym" / "torch"


def test_the_folder_that_a_user_names_is_taken_and_told_of_if_others_can_write_there(home, monkeypatch, capsys):
    named = home / "named"
    named.mkdir(mode=0o755)
    monkeypatch.setenv(VARIABLE, str(named))
    choose_cache()
    assert (os.environ[VARIABLE], capsys.readouterr().err) == (str(named), "")
    named.chmod(0o777)
    choose_cache()
    choose_cache()
    assert os.environ[VARIABLE] == str(named)
    assert capsys.readouterr().err == (
        f"caster_gym: Torch runs code that it finds in {VARIABLE}={named}: others can write to {named} (mode 0777)\n"
    )


def test_without_a_trusted_folder_torch_gets_a_new_one(home, monkeypatch):
    (home / "cache").mkdir()
    (home / "cache").chmod(0o777)
    (home / "temporary" / f"caster_gym-{os.getuid()}").touch()  # in the way of the temporary one
    choose_cache()
    folder = Path(os.environ[VARIABLE])
    assert folder.parent == home / "temporary" and stat.S_IMODE(folder.stat().st_mode) == 0o700
