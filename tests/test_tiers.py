"""The tiers of tests: what `make quick` and `make lowest` run is there."""

import ast
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
FILES = sorted(file.name for file in TESTS.glob("test_*.py"))


def is_slow(decorator):
    return ast.unparse(decorator) == "pytest.mark.slow"


@pytest.mark.parametrize("name", FILES)
def test_some_tests_of_every_file_are_quick(name):
    """What a change breaks should show at once, wherever it is made."""
    tree = ast.parse((TESTS / name).read_text(encoding="utf-8"))
    tests = [one for one in tree.body if isinstance(one, ast.FunctionDef) and one.name.startswith("test_")]
    assert not all(any(map(is_slow, one.decorator_list)) for one in tests)
    assert not any(ast.unparse(one) == "pytestmark = pytest.mark.slow" for one in tree.body)


def test_the_lowest_versions_are_tried_on_files_that_exist():
    makefile = (TESTS.parent / "Makefile").read_text(encoding="utf-8")
    (names,) = re.findall(r"^LOWEST_TESTS := ((?:.*\\\n)*.*)", makefile, re.M)
    assert {f"test_{name}.py" for name in names.replace("\\", "").split()} <= set(FILES)
