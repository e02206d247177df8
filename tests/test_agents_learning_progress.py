"""caster_gym.agents.learning.progress: rows are added, columns come when they come, and a table goes on."""

import csv

import numpy as np
import pytest

from caster_gym.agents.learning.progress import ProgressTable


def write(table, **values):
    table.write(values, dict.fromkeys(values, ()))


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_columns_stand_in_the_order_in_which_they_came(tmp_path):
    table = ProgressTable(tmp_path / "progress.csv")
    write(table, steps=1, loss=0.5)
    write(table, steps=2, std=0.25, loss=np.float32(0.1))
    write(table, std=0.125)
    text = (tmp_path / "progress.csv").read_text(encoding="utf-8")
    assert text == f"steps,loss,std\n1,0.5,\n2,{float(np.float32(0.1))},0.25\n,,0.125\n"


def test_what_is_excluded_from_csv_is_left_out(tmp_path):
    table = ProgressTable(tmp_path / "progress.csv")
    table.write({"steps": 1, "picture": 2}, {"steps": (), "picture": ("csv",)})
    assert rows(tmp_path / "progress.csv") == [{"steps": "1"}]


def test_a_table_goes_on_from_the_rows_and_columns_that_count(tmp_path):
    path = tmp_path / "progress.csv"
    table = ProgressTable(path)
    write(table, steps=1, loss=0.5)
    columns, count = list(table.columns), table.rows
    write(table, steps=2, std=0.25)
    with path.open("a", encoding="utf-8") as file:
        file.write("3,0.")  # a row of which a killed process has written a part
    table = ProgressTable(path, columns, count)
    assert path.read_text(encoding="utf-8") == "steps,loss\n1,0.5\n"
    write(table, steps=2, loss=0.75)
    assert [row["loss"] for row in rows(path)] == ["0.5", "0.75"]


def test_rows_that_are_missing_are_an_error(tmp_path):
    path = tmp_path / "progress.csv"
    write(ProgressTable(path), steps=1)
    with pytest.raises(ValueError, match="has 1 rows, and had 2"):
        ProgressTable(path, ["steps"], 2)


def test_a_new_table_begins_empty(tmp_path):
    path = tmp_path / "progress.csv"
    path.write_text("old\n1\n", encoding="utf-8")
    write(ProgressTable(path), steps=1)
    assert rows(path) == [{"steps": "1"}]
