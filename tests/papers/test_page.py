"""A page says what agrees, what does not, and why."""

import csv

import pytest

from caster_gym.report.figures import new_figure
from papers.page import (
    Check,
    Difference,
    Picture,
    Section,
    Table,
    check_number,
    differences_page,
    printed_checks,
    unexplained,
    write_page,
)


@pytest.mark.parametrize(
    ("printed", "ours", "agrees", "shown"),
    [
        ("5.4329", 5.43294, True, "5.43294"),
        ("5.4329", 5.43296, False, "5.43296"),
        ("-0.00078", -0.000784, True, "-0.000784"),
        ("-0.00078", 0.00078, False, "0.000780"),
        ("10", 10.4, True, "10.4"),
        ("2.604e-6", 2.6043e-6, True, "0.0000026043"),
        ("0.37", float("nan"), False, "nan"),
    ],
)
def test_a_printed_number_agrees_within_half_a_unit_of_its_last_digit(printed, ours, agrees, shown):
    assert check_number("it", printed, ours) == Check("it", printed, shown, agrees)


def test_a_tolerance_may_be_given():
    assert check_number("it", "5.4329", 5.4331, tolerance=2e-4).agrees
    assert not check_number("it", "5.4329", 5.4332, tolerance=2e-4).agrees


def section(name="curve", tag="E3"):
    return Section(
        "Forces",
        "What is computed.",
        checks=(
            check_number("(1)", "3", 3.0),
            Check("(2)", "always", "sometimes", False, f"{tag}: not when it rains"),
            Check("by hand", "0.5", "0.5", True, own=True),
        ),
        tables=(Table(name, "How it falls.", ("speed", "error"), [(1.0, 0.12345678), (2.0, "none | at all")]),),
        pictures=(Picture(name, "Error by speed", "It falls.", new_figure()),),
        differences=(Difference(tag, "(2)", "always", "sometimes", "it rained"),),
    )


def test_page_holds_verdicts_tables_and_figures(tmp_path):
    page = write_page("paper", "A paper", "Somebody, 2001.", [section()], tmp_path)
    assert "1 of 2 printed numbers and statements agree; 1 differs, for 1 reason (E3)." in page
    assert "are counted separately; 1 of 1 hold." in page
    assert "Checks of our own:\n\n| what | expected | found | verdict | remark |" in page
    assert page.index("| (2) |") < page.index("Checks of our own:") < page.index("| by hand | 0.5 | 0.5 | pass |")
    assert "| (2) | always | sometimes | **fail** | E3: not when it rains |" in page
    assert "| 1 | 0.1235 |\n| 2 | none \\| at all |" in page
    assert "![Error by speed](paper/curve.png)" in page
    assert page.count("It falls.") == 1
    assert (tmp_path / "curve.png").read_bytes().startswith(b"\x89PNG")
    with (tmp_path / "curve.csv").open(encoding="utf-8", newline="") as file:
        assert list(csv.reader(file)) == [["speed", "error"], ["1.0", "0.12345678"], ["2.0", "none | at all"]]


def test_the_file_of_checks_tells_which_are_our_own(tmp_path):
    write_page("paper", "A paper", "", [section()], tmp_path)
    with (tmp_path / "checks.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.DictReader(file))
    assert [(row["what"], row["own"]) for row in rows] == [("(1)", "False"), ("(2)", "False"), ("by hand", "True")]
    assert [check.what for check in printed_checks([section()])] == ["(1)", "(2)"]


def test_a_page_without_checks_of_our_own_does_not_speak_of_them(tmp_path):
    plain = section()._replace(checks=(check_number("(1)", "3", 3.0),))
    assert "of our own" not in write_page("paper", "A paper", "", [plain], tmp_path)


def failing(remark, own=False):
    return Section("Forces", "", checks=(Check("it", "1", "2", False, remark, own),))


@pytest.mark.parametrize("remark", ["", "an error of the eye", "Exactly half", "E4: another difference", "E33"])
@pytest.mark.parametrize("own", [False, True])
def test_a_failed_check_must_name_a_difference_of_its_paper(remark, own):
    assert unexplained([section(), failing(remark, own)]) == ("it",)


@pytest.mark.parametrize("remark", ["E3", "E3: not so", "see E4 and E3"])
def test_a_failed_check_that_does_so_is_explained(remark):
    """The difference may stand in another section."""
    assert unexplained([section(), failing(remark)]) == ()


def test_a_long_table_is_a_file_alone(tmp_path):
    long = Section("Long", "", tables=(Table("long", "All.", ("n",), [(float(n),) for n in range(100)]),))
    page = write_page("paper", "A paper", "", [long], tmp_path)
    assert "(paper/long.csv)" in page
    assert "| 7 |" not in page


def test_no_table_or_figure_replaces_another(tmp_path):
    with pytest.raises(ValueError, match="two tables or figures of paper are called 'curve'"):
        write_page("paper", "A paper", "", [section(), section()], tmp_path)
    assert list(tmp_path.iterdir()) == []


def test_differences_of_all_papers_stand_in_the_order_of_their_numbers(tmp_path):
    for name, tags in (("one", ("E10", "E2")), ("two", ("E3",))):
        (tmp_path / name).mkdir()
        write_page(name, name, "", [section(name=tag, tag=tag) for tag in tags], tmp_path / name)
    page = differences_page(tmp_path, ("one", "two", "not reproduced yet"))
    assert page.index("| E2 | [one](one.md) |") < page.index("| E3 | [two](two.md) |") < page.index("| E10 |")
    assert "it rained" in page


def of_nature(tag, nature):
    one = section(name=tag, tag=tag)
    return one._replace(differences=tuple(difference._replace(nature=nature) for difference in one.differences))


def test_differences_are_parted_by_what_the_scan_may_have_done(tmp_path):
    (tmp_path / "chung2008").mkdir()
    sections = [of_nature("E3", "print"), of_nature("E2", "scan, possibly"), of_nature("E1", "reading")]
    write_page("chung2008", "", "", sections, tmp_path / "chung2008")
    page = differences_page(tmp_path, ("chung2008",))
    assert page.index("scanned text") < page.index("## Errors of the print (1)") < page.index("| E3 |")
    assert page.index("| E3 |") < page.index("## Possible errors of the scan (1)") < page.index("| E2 |")
    assert "| possibly |" in page
    assert page.index("| E2 |") < page.index("## What depends on the reading (1)") < page.index("| E1 |")
    assert page.index("| E1 |") < page.index("## Repairs that do not count")


def test_a_page_counts_each_reason_once_and_readings_apart(tmp_path):
    twice = [of_nature("E3", "print"), *[of_nature("E3", "print")._replace(tables=(), pictures=())]]
    sections = [*twice, of_nature("E1", "reading")]
    page = write_page("paper", "A paper", "", sections, tmp_path)
    assert (
        "3 of 6 printed numbers and statements agree; 2 differ, for 1 reason (E3); "
        "1 depends on the reading, for 1 reason (E1)."
    ) in page
    assert "| (2) | always | sometimes | depends on the reading | E1: not when it rains |" in page
