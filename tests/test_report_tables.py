"""caster_gym.report.tables: what a reader, Markdown and a CSV reader make of the same rows."""

import csv

import pytest

from caster_gym.report.tables import markdown_table, write_csv


def test_numbers_in_tables_have_four_digits():
    assert markdown_table(("a",), [(12345.678,), (1e-9,), ("word",)]).endswith("| 1.235e+04 |\n| 1e-09 |\n| word |")


def test_a_bar_in_a_cell_does_not_begin_a_column():
    assert markdown_table(("|v|", "b"), [("x|y", 1)]) == "| \\|v\\| | b |\n| --- | --- |\n| x\\|y | 1 |"


def test_padded_columns_line_up():
    assert markdown_table(("", "longer"), [("ab", 1.5), ("abcd", "x")], padded=True) == (
        "|      | longer |\n| ---- | ------ |\n| ab   | 1.5    |\n| abcd | x      |"
    )


@pytest.mark.parametrize("padded", [False, True])
def test_a_row_of_another_length_is_refused(padded):
    with pytest.raises(ValueError, match="zip"):
        markdown_table(("a", "b"), [("1", "2", "3")], padded)


def test_a_csv_file_gives_back_every_digit(tmp_path):
    numbers = (0.1 + 0.2, 1e-300, 123456789.123456789)
    write_csv(tmp_path / "a.csv", ("text", "x", "y", "z"), [('a "quoted", text', *numbers)])
    text = (tmp_path / "a.csv").read_bytes().decode("utf-8")
    assert "\r" not in text and text.endswith("\n")
    head, (words, *cells) = csv.reader(text.splitlines())
    assert (head, words) == (["text", "x", "y", "z"], 'a "quoted", text')
    assert tuple(map(float, cells)) == numbers
