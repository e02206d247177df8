"""caster_gym.tables: columns found by their names, in SI units, and times that keep their digits."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.table_files import read_table
from caster_gym.tables import Column, Quantity, Table, TableNote

QUANTITIES = {
    "time": Quantity("time", ("time", "t", "stamp")),
    "x": Quantity("length", ("x", "pos_x", "position_x")),
    "torque": Quantity("torque", ("torque",)),
}


def table(header, *rows):
    columns = tuple(Column(*one) if isinstance(one, tuple) else Column(one, None) for one in header)
    return Table("file", columns, [list(row) for row in rows], list(range(2, 2 + len(rows)))).matched(QUANTITIES)


@pytest.mark.parametrize(
    ("name", "factor"),
    [
        ("x", 1.0), ("X", 1.0), ("x_mm", 1e-3), ("pos_x", 1.0), ("pos x", 1.0), ("position-x", 1.0), ("pos_x_cm", 1e-2),
        ("/odom/pose/pose/position/x", 1.0), ("field.pose.pose.position.x", 1.0), (("x", "mm"), 1e-3),
    ],
)  # fmt: skip
def test_a_column_is_found_by_any_of_its_names_and_read_in_its_unit(name, factor):
    assert_allclose(table([name], ["2"], ["-3"]).numbers(["x"]), [[2.0 * factor], [-3.0 * factor]], rtol=1e-15)


@pytest.mark.parametrize("name", ["target_pos_x", "xx", "vx", "x_ref", "x_rad"])
def test_a_column_of_something_else_is_not_taken(name):
    made = table([name], ["2"])
    assert made.found == {}
    assert made.left_out(["x"]) == [name]


def test_of_several_names_the_first_one_known_counts():
    made = table(["pos_x", "stamp", "x", "time"], ["1", "5", "2", "7"])
    assert made.numbers(["x"])[0, 0] == 2.0
    assert made.left_out(["x", "time"]) == ["pos_x", "stamp"]


@pytest.mark.parametrize(
    ("header", "message"),
    [
        (["x", "x"], "the column 'x' stands twice; name it once"),
        (["x", "x_m"], r"\('x', 'x_m'\) are both 'x'"),
        (["/a/position/x", "/b/position/x"], "are both 'x'"),
        ([("x", "furlong")], r"column 'x' must be in m, cm, mm, .*, got \[furlong\]"),
    ],
)
def test_columns_that_leave_a_doubt_are_refused(header, message):
    with pytest.raises(ValueError, match=message):
        table(header, ["1"] * len(header))


@pytest.mark.parametrize(
    ("cell", "message"),
    [
        ("a", "file, line 3: 'x' must be a finite number, got 'a'"),
        ("inf", "line 3: 'x' must be a finite number, got 'inf'"),
        ("", "line 3: 'x' must be a finite number, got ''"),
        ("1,5", "line 3: '1,5' has a decimal comma; write decimal points, as in 1.5"),
        ("1.234,5", "as in 1234.5"),
    ],
)
def test_a_cell_that_is_no_number_is_refused_with_its_line(cell, message):
    with pytest.raises(ValueError, match=message):
        table(["x"], ["1"], [cell]).numbers(["x"])


@pytest.mark.parametrize(
    ("name", "unit", "per_second"),
    [(("time", "ns"), "ns", 10**9), (("time", "µs"), "us", 10**6), ("t_ms", "ms", 10**3), ("time_s", "s", 1)],
)
def test_long_stamps_keep_their_digits(name, unit, per_second):
    """A double of 1.6e18 has steps of 256, so that 20 ms ± 1 ns are told apart only before it is made one."""
    first = 1_583_332_205 * per_second
    steps = np.array([0, 1, 3, 7]) * max(per_second // 50, 1) + np.array([0, 1, 1, 0])
    times, start = table([name], *([str(first + int(step))] for step in steps)).times()
    assert_allclose(times, steps / per_second, rtol=1e-15)
    assert start == pytest.approx(1_583_332_205)


@pytest.mark.parametrize(("power", "unit"), [(9, "ns"), (6, "us"), (3, "ms")])
def test_stamps_since_1970_tell_their_unit_by_their_size(power, unit):
    rows = [[str(1_583_332_205 * 10**power + k * 10**power)] for k in range(3)]
    with pytest.warns(TableNote, match=f"'stamp' is taken to be in {unit}"):
        assert_allclose(table(["stamp"], *rows).times()[0], [0.0, 1.0, 2.0])


def test_times_that_do_not_grow_are_refused_at_the_first_line_that_does_not():
    with pytest.raises(ValueError, match=r"line 4: 't' must grow from line to line, got 0\.5 after 1"):
        table(["t"], ["0"], ["1"], ["0.5"], ["0.4"]).times()


def test_many_times_that_are_far_apart_are_hardly_seconds_unless_that_is_said():
    rows = [[str(20 * k)] for k in range(30)]
    with pytest.raises(ValueError, match=r"'t' grows by 20 .* can hardly be seconds; call the column 'time \[ms\]'"):
        table(["t"], *rows).times()
    assert table([("t", "s")], *rows).times()[0][-1] == 580.0
    assert table([("t", "ms")], *rows).times()[0][-1] == pytest.approx(0.58)


@pytest.mark.parametrize(
    ("time", "x", "said"),
    [
        ("1", "1e16", "line 3: 'x' must be a number up to 1e.15, got '1e16'"),
        ("1", "1e999", "line 3: 'x' must be a finite number, got '1e999'"),
        ("1e999999", "1", "line 3: 'time' must be a finite number, got '1e999999'"),
        ("1e9999999", "1", "line 3: 'time' must be a finite number, got '1e9999999'"),
        ("1e23", "1", "line 3: 'time' must be a number up to 1e.22, got '1e23'"),
    ],
)
def test_numbers_that_nothing_can_be_computed_with_are_refused_with_their_line(tmp_path, time, x, said):
    (tmp_path / "odd.csv").write_text(f"time,x\n0,0\n{time},{x}\n")
    quantities = {"time": Quantity("time", ("time",)), "x": Quantity("length", ("x",))}
    table = read_table(tmp_path / "odd.csv").matched(quantities)
    with pytest.raises(ValueError, match=said):
        (table.times(), table.numbers(["x"]))
