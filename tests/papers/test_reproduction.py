"""Reproductions end whole or not at all, and say what they cannot explain."""

from importlib import import_module

import pytest
from typer.testing import CliRunner

from papers import reproduction
from papers.__main__ import app
from papers.page import Check, Difference, Section
from papers.reproduction import PAPERS, Paper, find_paper, reproduce


def explained():
    checks = (Check("(1)", "2", "2", True), Check("(2)", "3", "4", False, "E1: a sign"))
    return Section("One", "Text.", checks, differences=(Difference("E1", "(2)", "3", "4", "measured"),))


def unexplained():
    return Section("Two", "Text.", (Check("(3)", "5", "6", False),))


def broken():
    raise ValueError("no such robot")


@pytest.fixture
def papers(monkeypatch):
    """Papers with one section each, called after them."""
    made = {f.__name__: Paper("A title", "Somebody.", {"work": f"{__name__}:{f.__name__}"}) for f in SECTIONS}
    monkeypatch.setattr(reproduction, "PAPERS", made)
    monkeypatch.setattr(reproduction, "_build", lambda place: globals()[place.split(":")[1]]())


SECTIONS = (explained, unexplained, broken)


def test_a_reproduction_leaves_a_page_and_its_folder(papers, tmp_path):
    told = []
    verdict = reproduce("explained", tmp_path, False, lambda *what: told.append(what))
    assert verdict == (1, 2, ())
    assert told == [("work", 0), ("done", 1)]
    assert sorted(path.name for path in tmp_path.iterdir()) == ["differences.md", "explained", "explained.md"]
    assert "E1: a sign" in (tmp_path / "explained.md").read_text(encoding="utf-8")
    page = (tmp_path / "differences.md").read_text(encoding="utf-8")
    assert "| E1 | [explained](explained.md) | (2) | 3 | 4 | measured |" in page
    assert (tmp_path / "explained" / "run.yaml").is_file()


def test_what_fails_leaves_the_results_of_before(papers, tmp_path):
    (tmp_path / "broken").mkdir()
    (tmp_path / "broken" / ".caster-gym").touch()
    with pytest.raises(ValueError, match="no such robot"):
        reproduce("broken", tmp_path, True, lambda *_: None)
    assert [path.name for path in tmp_path.iterdir()] == ["broken"]


@pytest.mark.parametrize("name", ["explained.md", "differences.md"])
def test_pages_of_somebody_else_stay(papers, tmp_path, name):
    (tmp_path / name).write_text("my thesis")
    with pytest.raises(ValueError, match=f"{name} is there already, and not from caster-gym"):
        reproduce("explained", tmp_path, True, lambda *_: None)
    assert [path.name for path in tmp_path.iterdir()] == [name]
    assert (tmp_path / name).read_text() == "my thesis"


def test_our_own_pages_are_replaced_only_if_told_to(papers, tmp_path):
    reproduce("explained", tmp_path, False, lambda *_: None)
    with pytest.raises(ValueError, match="is not empty"):
        reproduce("explained", tmp_path, False, lambda *_: None)
    assert reproduce("explained", tmp_path, True, lambda *_: None).compared == 2


def test_a_file_is_no_folder(papers, tmp_path):
    (tmp_path / "file").touch()
    with pytest.raises(ValueError, match="file is not a folder; choose another --out"):
        reproduce("explained", tmp_path / "file", False, lambda *_: None)


def test_a_difference_without_a_reason_is_an_error_of_the_command(papers, tmp_path):
    result = CliRunner().invoke(app, ["unexplained", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "no reason is known why these differ: (3)" in result.output
    assert (tmp_path / "unexplained.md").is_file()


@pytest.mark.parametrize("out", ["/proc/results", "file/results", "file"])
def test_the_folder_is_tried_before_anything_is_computed(papers, tmp_path, monkeypatch, out):
    (tmp_path / "file").touch()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(reproduction, "_build", None)
    result = CliRunner().invoke(app, ["explained", "--out", out])
    assert result.exit_code == 2
    assert "choose another --out" in result.output
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file"]


def test_an_unknown_paper_is_named(tmp_path):
    result = CliRunner().invoke(app, ["chung2009", "--out", str(tmp_path)])
    assert result.exit_code == 2
    assert "unknown paper 'chung2009'; did you mean 'chung2008'?" in result.output


@pytest.mark.parametrize("name", PAPERS)
def test_every_section_of_a_paper_is_there(name):
    for place in find_paper(name).parts.values():
        module, function = place.split(":")
        assert callable(getattr(import_module(module), function))
