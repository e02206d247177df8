"""The pages that `caster-gym reproduce` made are the whole of both papers, and every difference has its evidence."""

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
    assert tags == {f"E{number}" for number in range(1, 29)}
    page = (PAPERS / "differences.md").read_text(encoding="utf-8")
    assert set(re.findall(r"^\| (E\d+) \|", page, re.MULTILINE)) == tags


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
