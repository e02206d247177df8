"""The pages that `python -m papers` made are the whole of both papers, and every difference has its evidence."""

import csv
import re
from pathlib import Path

import pytest

PAPERS = Path(__file__).parents[1] / "docs" / "papers"
NAMES = ("chung2008", "kim2001")


def rows(name, file):
    with (PAPERS / name / file).open(encoding="utf-8", newline="") as lines:
        return list(csv.DictReader(lines))


def test_differences_are_numbered_without_a_gap():
    tags = {row["tag"] for name in NAMES for row in rows(name, "differences.csv")}
    assert tags == {f"E{number}" for number in range(1, 30)}
    page = (PAPERS / "differences.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| (E\d+) \|", page, re.MULTILINE)) == tags


def test_every_difference_has_one_nature():
    """What character recognition may have done is told apart from what mathematics shows."""
    natures = {(row["tag"], row["nature"]) for name in NAMES for row in rows(name, "differences.csv")}
    assert len(natures) == len(dict(natures))
    of = {nature: {tag for tag, its in natures if its == nature} for _, nature in natures}
    assert of["scan, probably"] == {"E7", "E11", "E19", "E20", "E21", "E23", "E28"}
    assert of["scan, possibly"] == {"E2", "E4", "E5", "E6"}
    assert of["reading"] == {"E14", "E15", "E16", "E24"}


@pytest.mark.parametrize("page", ["differences.md", "chung2008.md", "kim2001.md"])
def test_every_page_says_that_the_source_is_a_scan(page):
    assert "scanned text" in (PAPERS / page).read_text(encoding="utf-8")[:2000]


def test_rows_on_other_robots_are_not_the_papers():
    printed = [row["what"] for name in NAMES for row in rows(name, "checks.csv") if row["own"] == "False"]
    assert not [what for what in printed if "xr4000" in what or "tidybot2" in what]


@pytest.mark.parametrize("name", NAMES)
def test_every_difference_has_its_evidence(name):
    assert all(row["evidence"] for row in rows(name, "differences.csv"))


@pytest.mark.parametrize("name", NAMES)
def test_every_failed_check_names_a_difference_of_its_paper(name):
    tags = {row["tag"] for row in rows(name, "differences.csv")}
    failed = [row for row in rows(name, "checks.csv") if row["agrees"] == "False"]
    assert failed
    for row in failed:
        assert tags & set(re.findall(r"E\d+", row["remark"])), row


@pytest.mark.parametrize("name", NAMES)
def test_every_file_of_a_page_is_there_and_every_picture_is_shown(name):
    page = (PAPERS / f"{name}.md").read_text(encoding="utf-8")
    linked = set(re.findall(rf"\]\({name}/([^)]+)\)", page))
    there = {path.name for path in (PAPERS / name).iterdir()}
    assert linked <= there
    assert {file for file in there if file.endswith(".png")} <= linked
