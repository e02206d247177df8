"""The section on joint sets: the paper's statements, and tables that hold every set once."""

import pytest

from papers.kim2001.joint_sets import ADMISSIBLE, section
from papers.notation import in_letters, in_words
from papers.page import unexplained


@pytest.fixture(scope="module")
def made():
    return section()


@pytest.fixture(scope="module")
def tables(made):
    return {table.name: table for table in made.tables}


def test_every_statement_agrees_or_names_its_erratum(made):
    assert len(made.checks) == 5
    assert [check.printed for check in made.checks if not check.agrees] == ["more than two"]
    assert unexplained([made]) == ()


def test_the_sets_without_singularity_are_the_printed_three(tables):
    """kim2001, III."""
    rows = [row for row in tables["joint_sets_chung2008"].rows if row[1] == 4 and row[2] == "never"]
    assert [row[0] for row in rows] == [in_letters(in_words(letters)) for letters in ADMISSIBLE]


@pytest.mark.parametrize(("name", "sets"), [("chung2008", 63), ("xr4000", 255), ("tidybot2", 255)])
def test_tables_hold_every_set_with_its_evidence(tables, name, sets):
    rows = tables[f"joint_sets_{name}"].rows
    assert len({row[0] for row in rows}) == len(rows) == sets
    for row in rows:
        verdict, there, everywhere = row[2], row[5], row[6]
        if verdict == "never":
            assert float(everywhere) > 0.5 and there == ""
        else:
            assert float(there) < 1e-12 and everywhere == ""  # rounding
    of_types = tables[f"joint_sets_types_{name}"].rows
    assert sum(row[2] for row in of_types) == sets
    assert sum(sum(row[3:]) for row in tables["joint_sets_counts"].rows if row[0] == name) == sets


def test_a_picture_has_one_robot_for_each_type(made, tables):
    for picture, name in zip(made.pictures, ("chung2008", "xr4000", "tidybot2"), strict=True):
        labels = [text.get_text() for text in picture.figure.axes[0].texts]
        assert sum(int(label.removeprefix("×")) for label in labels) == sum(
            row[2] for row in tables[f"joint_sets_types_{name}"].rows
        )
