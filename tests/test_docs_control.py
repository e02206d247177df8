"""docs/control.md: the page, the controllers and their tests name the same equations."""

import re
from pathlib import Path

ROOT = Path(__file__).parents[1]
TAG = re.compile(r"\(([TX]\d+)\)")
PAGE = (ROOT / "docs" / "control.md").read_text(encoding="utf-8")
DERIVED = re.findall(r"\*\*\(([TX]\d+)\)\*\*", PAGE)


def tags(folder, pattern):
    return {tag for path in (ROOT / folder).glob(pattern) for tag in TAG.findall(path.read_text(encoding="utf-8"))}


def test_the_page_and_the_code_have_the_same_equations():
    assert len(DERIVED) == len(set(DERIVED)) >= 15
    assert set(TAG.findall(PAGE)) == set(DERIVED) == tags("agents/control", "*.py")


def test_every_equation_is_tested():
    assert set(DERIVED) <= tags("tests", "test_agents_control_*.py")


def test_equations_stand_in_order():
    for section in "TX":
        numbers = [int(tag[1:]) for tag in DERIVED if tag[0] == section]
        assert numbers == list(range(1, len(numbers) + 1)), section
