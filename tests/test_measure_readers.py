"""The table of readers on the export's page answers every question for every reader."""

from pathlib import Path

import pytest

from scripts.measure_readers import BEGIN, END, table
from scripts.readers.facts import FACTS, READERS

ROOT = Path(__file__).parents[1]


def published() -> list[list[str]]:
    page = (ROOT / "docs" / "export.md").read_text(encoding="utf-8")
    lines = page.split(BEGIN)[1].split(END)[0].strip().splitlines()
    return [[cell.strip() for cell in line.strip("|").split("|")] for line in lines]


def test_every_reader_has_a_probe_and_pinned_packages():
    for probe, packages in READERS.values():
        assert (ROOT / "scripts" / "readers" / f"{probe}.py").is_file()
        assert all("==" in package for package in packages)


def test_the_page_answers_every_question_for_every_reader():
    head, _, *rows = published()
    assert head[1:] == list(READERS)
    assert [row[0] for row in rows] == list(FACTS)
    assert all(cell for row in rows for cell in row)


@pytest.mark.parametrize(
    ("fact", "words"),
    [
        ("motors of two joints", "dropped"),
        ("rotors of two joints (armature of a tendon)", "dropped"),
        ("armature of joints", "without a word"),
    ],
)
def test_the_page_warns_of_what_drake_drops(fact, words):
    head, _, *rows = published()
    drake = next(i for i, name in enumerate(head) if name.startswith("Drake"))
    assert words in next(row for row in rows if row[0] == fact)[drake]


def test_the_table_has_a_row_for_every_question_and_a_column_for_every_reader():
    answers = {"A": dict.fromkeys(FACTS, "taken"), "B": dict.fromkeys(FACTS, "dropped")}
    head, _, *rows = table(answers).splitlines()
    assert head == "|  | A | B |"
    assert [row.split(" | ")[1:] for row in rows] == [["taken", "dropped |"]] * len(FACTS)
