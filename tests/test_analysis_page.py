"""The page of the analysis, its code and its tests name the same equations, as for the mechanics."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
SECTIONS = "JLQNFUSRH"
TAG = re.compile(rf"\(([{SECTIONS}]\d+)\)")
DERIVED = re.compile(rf"\*\*\(([{SECTIONS}]\d+)\)\*\*")
LAWS = {"J7", "Q7", "Q9", "U7"}  # that nobody needs to compute


def tags(*paths):
    return {tag for path in paths for tag in TAG.findall(path.read_text(encoding="utf-8"))}


PAGE = ROOT / "docs" / "analysis.md"
FOLDERS = ("caster_gym/analysis", "caster_gym/design", "caster_gym/identification", "papers/analysis")
CODE = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("*.py"))
TESTS = sorted(
    path
    for names in ("test_analysis_*.py", "test_design_*.py", "test_identification_*.py", "papers/test_analysis_*.py")
    for path in (ROOT / "tests").glob(names)
)


def test_every_equation_of_the_code_is_derived_on_the_page():
    derived = set(DERIVED.findall(PAGE.read_text(encoding="utf-8")))
    assert {tag[0] for tag in tags(*CODE)} == set(SECTIONS)  # the search finds all of them
    assert tags(*CODE, *TESTS) <= derived
    assert tags(PAGE) == derived


def test_every_equation_of_the_page_is_computed_or_is_a_law():
    assert tags(PAGE) - tags(*CODE) <= LAWS


@pytest.mark.parametrize("tag", sorted(tags(PAGE)))
def test_every_equation_of_the_page_is_tested(tag):
    others = [path for path in TESTS if path != Path(__file__)]
    assert tag in tags(*others)


def test_equations_stand_in_order():
    """Each section counts its equations from 1 on, without a gap."""
    found = [(tag[0], int(tag[1:])) for tag in DERIVED.findall(PAGE.read_text(encoding="utf-8"))]
    for section in SECTIONS:
        numbers = [number for letter, number in found if letter == section]
        assert numbers == list(range(1, len(numbers) + 1)), section
