"""caster_gym.table_files: files of tables as people have them, and sentences for those that cannot be read."""

import pytest

from caster_gym import table_files
from caster_gym.table_files import read_table


def read(folder, text, name="table.csv"):
    file = folder / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return read_table(file)


PLAIN = "x [m],y [m],heading [deg]\n0,0,0\n1,2,90\n"


@pytest.mark.parametrize(
    "text",
    [
        PLAIN,
        PLAIN.replace(",", ";"),
        PLAIN.replace(",", "\t"),
        PLAIN.replace(",", "  "),
        PLAIN.replace(",", ", "),
        PLAIN.replace("\n", "\r\n"),
        PLAIN.replace("\n", "\n\n"),
        PLAIN.replace("[", "(").replace("]", ")"),
        "\ufeff" + PLAIN,
        "# made by a planner\n# 5c1d\n" + PLAIN,
        "# made by a planner\n# " + PLAIN,
        "% " + PLAIN,
        "// " + PLAIN,
        PLAIN.replace("\n", ",\n"),
        '"x [m]","y [m]","heading [deg]"\n"0","0","0"\n"1","2","90"\n',
        "x,y,heading\nm,m,deg\n0,0,0\n1,2,90\n",
        "x / m,y / m,heading / deg\n0,0,0\n1,2,90\n",
        "x in m,y in m,heading in deg\n0,0,0\n# a note\n1,2,90\n",
        PLAIN.encode("utf-16"),
        "x,y,heading\n# m, m, deg\n0,0,0\n1,2,90\n",
        "# x,y,heading\n# [m],[m],[deg]\n0,0,0\n1,2,90\n",
        "# x [m],y [m],heading [deg]\n# exported,at,noon\n0,0,0\n1,2,90\n",
        "sep=;\n" + PLAIN.replace(",", ";"),
    ],
)
def test_the_same_table_is_read_however_it_is_written(tmp_path, text):
    table = read(tmp_path, text)
    assert [tuple(column) for column in table.columns] == [("x", "m"), ("y", "m"), ("heading", "deg")]
    assert [[float(cell) for cell in row] for row in table.rows] == [[0.0, 0.0, 0.0], [1.0, 2.0, 90.0]]


def test_a_degree_sign_of_a_western_spreadsheet_is_read(tmp_path):
    assert read(tmp_path, "x,heading [°]\n0,0\n".encode("cp1252")).columns[1].unit == "°"


def test_columns_of_words_and_of_other_units_are_in_nobody_s_way(tmp_path):
    table = read(tmp_path, "# time,x,y,mode\n0,1,2,DRIVE\n1,2,3,\n")
    assert [column.name for column in table.columns] == ["time", "x", "y", "mode"]
    table = read(tmp_path, "time,x,acceleration,charge\nms,m,m/s^2,V\n0,1,2,24\n")
    assert [column.unit for column in table.columns] == ["ms", "m", "m/s^2", "V"]
    assert table.lines == [3]


def test_lines_are_counted_as_an_editor_counts_them(tmp_path):
    assert read(tmp_path, "# made by hand\n\nx,y\n0,0\n\n# more\n1,1\n").lines == [4, 7]


@pytest.mark.parametrize("name", ["Unnamed: 0", "wheel 1", "run 2024-01-02"])
def test_names_of_columns_may_have_numbers_in_them(tmp_path, name):
    """pandas calls an index that was written without a name 'Unnamed: 0'."""
    table = read(tmp_path, f"{name},x,y\n0,1,2\n")
    assert [column.name for column in table.columns] == [name, "x", "y"]
    assert table.rows == [["0", "1", "2"]]


@pytest.mark.parametrize("word", ["True", "0.0D+00", "furlong"])
def test_a_row_of_words_that_are_no_units_is_a_row(tmp_path, word):
    assert read(tmp_path, f"x,y\n{word},{word}\n").rows == [[word, word]]


def test_a_tum_file_has_no_header(tmp_path):
    row = "1305031098.6659 1.35 0.63 1.66 0.0 0.0 0.7071 0.7071\n"
    assert [column.name for column in read(tmp_path, row + row, "a.tum").columns][:3] == ["timestamp", "tx", "ty"]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "is empty; it needs a header such as x,y"),
        ("0,0\n1,1\n", "line 1: the header that names the columns is missing, got '0,0'; put a line such as x,y"),
        ("# 17.5\n0,0\n1,1\n", "line 2: the header that names the columns is missing"),
        ("x,y\n0,0\n1;1\n", "line 3: the header names 2 columns, separated by commas, got 1 cells: '1;1'"),
        ("x;y\n0;0;0\n", "separated by semicolons, got 3 cells"),
        (
            "x,y\n0,0,0,0\n1,5,0,5\n",
            "line 2: .* got 4 cells: '0,0,0,0'; if these are decimal commas, write decimal points",
        ),
        ("x,y\n0,0\n".encode("utf-16-le"), "holds zero bytes, .*; export it as CSV in UTF-8"),
        (b"\x89PNG\r\n\x1a\n\0\0", "holds zero bytes"),
        (b"x,y\n\xff\xfe\n", "cannot be read as CSV: .*; save it as UTF-8"),
    ],
)
def test_what_cannot_be_read_is_refused_with_what_to_change(tmp_path, text, message):
    with pytest.raises(ValueError, match=message) as error:
        read(tmp_path, text)
    assert str(tmp_path / "table.csv") in str(error.value)


def test_a_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"there is no file .*none\.csv"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(ValueError, match="is a folder, not a file"):
        read_table(tmp_path)


def test_lines_are_bounded_in_number_and_length(tmp_path, monkeypatch):
    file = tmp_path / "points.csv"
    monkeypatch.setattr(table_files, "MOST_LINES", 4)
    for end in ("\n", "\r", "\r\n", "\x0b"):
        file.write_text(f"x,y{end}1,2{end}3,4{end}5,6", newline="")
        assert len(table_files.read_lines(file)) == 4
        file.write_text(f"x,y{end}1,2{end}3,4{end}5,6{end}7,8", newline="")
        with pytest.raises(ValueError, match=r"points\.csv has \d lines, at most 4 are read; keep every tenth row"):
            read_table(file)
    file.write_text(f"x,y\n1,{'2' * table_files.LONGEST_LINE}")
    with pytest.raises(ValueError, match=r"line 2: it has 5002 characters, at most 5000 are read"):
        read_table(file)
