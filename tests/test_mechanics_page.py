"""The page of the equations, the code and the tests name the same equations."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
TAG = re.compile(r"\(([KDIGMCOSA]\d+)\)")


def tags(*paths):
    return {tag for path in paths for tag in TAG.findall(path.read_text(encoding="utf-8"))}


PAGE = ROOT / "docs" / "equations.md"
CODE = sorted((ROOT / "caster_gym" / "mechanics").glob("*.py"))
TESTS = sorted((ROOT / "tests").glob("test_mechanics_*.py"))


def test_every_equation_of_the_code_is_derived_on_the_page():
    assert tags(*CODE) >= {"K1", "D3", "G4", "C1", "A1"}  # the search finds them
    derived = set(re.findall(r"\*\*\(([A-Z]\d+)\)\*\*", PAGE.read_text(encoding="utf-8")))
    assert tags(*CODE, *TESTS) <= derived
    assert tags(PAGE) == derived


def test_every_equation_of_the_page_is_computed_or_is_a_law():
    """(C2) is a law that nobody needs to compute."""
    assert tags(PAGE) - tags(*CODE) <= {"C2"}


@pytest.mark.parametrize("tag", sorted(tags(PAGE)))
def test_every_equation_of_the_page_is_tested(tag):
    others = [path for path in TESTS if path != Path(__file__)]
    assert tag in tags(*others)


def test_equations_stand_in_order():
    """Each section counts its equations from 1 on, without a gap."""
    found = re.findall(r"\*\*\(([A-Z])(\d+)\)\*\*", PAGE.read_text(encoding="utf-8"))
    for section in sorted({letter for letter, _ in found}):
        numbers = [int(number) for letter, number in found if letter == section]
        assert numbers == list(range(1, len(numbers) + 1)), section
