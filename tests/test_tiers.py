"""The tests themselves: files are named after what they test, and what `make quick` and `make lowest` run is there."""

import ast
import re
from pathlib import Path

import pytest

TESTS = Path(__file__).parent
FILES = sorted(file.name for file in TESTS.glob("test_*.py"))
TOPS = ("caster_gym", "agents", "scripts")
WHOLE = "api cheats messages packaging rooms tiers written_once"  # laws of the package
SHARED = {  # what the modules of a folder do together
    "agents_commands": "train",
    "analysis": "page",
    "engines": "gradients obstacles slip",
    "envs": "floor floor_use",
    "mechanics": "engines page published",
}


def test_each_file_is_named_after_what_it_tests():
    """The path of a module or of a folder; perhaps with a subject, of a module or of those shared ones, behind it."""
    files = [file.relative_to(TESTS.parent) for top in TOPS for file in (TESTS.parent / top).rglob("*.py")]
    modules = {re.sub("^(caster_gym|scripts)_", "", "_".join(file.with_suffix("").parts)) for file in files}
    folders = {name.removesuffix("___init__") for name in modules}  # and modules
    subjects = {f"{folder}_{subject}" for folder, listed in SHARED.items() for subject in listed.split()}
    names = {name.removeprefix("test_").removesuffix(".py") for name in FILES}
    others = names - folders - subjects - set(WHOLE.split())
    assert not {name for name in others if not name.startswith(("docs_", *(f"{module}_" for module in modules)))}
    assert subjects <= names  # what is no longer there is not listed


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
