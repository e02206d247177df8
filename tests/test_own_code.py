"""caster_gym.own_code: what settings name as module:Name is found beside their file, and mistakes get a sentence."""

import sys

import pytest

from caster_gym.configuration import ConfigurationError
from caster_gym.own_code import RESULTS, OwnCode

NUMBER = OwnCode("number", "a number", lambda thing: isinstance(thing, float), "a float", "it has no number")


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Loads from a module in a folder; the module's name is new in each test."""
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")  # restores sys.path afterwards
    module = f"own_{tmp_path.name}"
    folder = tmp_path / "folder"
    folder.mkdir()
    (folder / f"{module}.py").write_text("HALF, WORD = 0.5, 'half'", encoding="utf-8")
    (folder / f"{module}_empty.py").touch()
    (folder / f"{module}_broken.py").write_text("1 / 0", encoding="utf-8")
    (folder / f"{module}_needy.py").write_text("import no_such_library", encoding="utf-8")

    def load(reference, place=folder):
        return NUMBER.load(reference.replace("OWN", module), place)

    yield load
    for name in [name for name in sys.modules if name.startswith(module)]:
        del sys.modules[name]


def test_a_module_is_found_beside_the_file_that_names_it(own):
    assert own("OWN:HALF") == 0.5


def test_a_module_is_found_in_the_working_folder(own, tmp_path, monkeypatch):
    with pytest.raises(ConfigurationError, match=r"there is no module 'own_.*' in the working folder or among"):
        own("OWN:HALF", None)
    monkeypatch.chdir(tmp_path / "folder")
    assert own("OWN:HALF", None) == own("OWN:HALF", tmp_path) == 0.5


@pytest.mark.parametrize(
    ("reference", "message"),
    [
        ("OWN", "a number of your own is written as module:Name, got number 'own_.*'$"),
        ("../OWN:HALF", "is written as module:Name"),
        ("nowhere:HALF", "there is no module 'nowhere' in .*folder, in the working folder or among the installed"),
        ("OWN:HALV", r"module 'own_.*' has no 'HALV'; did you mean 'HALF'\?"),
        ("OWN_empty:HALF", "has no 'HALF'; it has no number"),
        ("OWN:WORD", "own_.*:WORD must be a float, got 'half'"),
        ("OWN_broken:HALF", "cannot be imported: ZeroDivisionError: division by zero"),
        ("OWN_needy:HALF", "needs 'no_such_library', which is not installed"),
    ],
)
def test_mistakes_get_one_sentence(own, reference, message):
    with pytest.raises(ConfigurationError, match=message):
        own(reference)


@pytest.mark.parametrize("result", RESULTS)
def test_nothing_in_a_folder_of_results_brings_code(own, tmp_path, result):
    """Unless somebody has loaded it already."""
    (tmp_path / "folder" / result).touch()
    with pytest.raises(ConfigurationError, match="is a folder of results, from which no code is run: copy the file"):
        own("OWN:HALF")
    assert f"own_{tmp_path.name}" not in sys.modules
    (tmp_path / "folder" / result).unlink()
    own("OWN:HALF")
    (tmp_path / "folder" / result).touch()
    assert own("OWN:HALF") == 0.5
