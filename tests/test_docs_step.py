"""docs/step.md: each function of a step is in the file that the page names, and the one that it names calls it."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TEXT, TORCH = (ROOT / "docs/step.md").read_text(encoding="utf-8").split("## On tensors")
TASK, LOOK = ((ROOT / f"caster_gym/envs/tensor/{name}.py").read_text(encoding="utf-8") for name in ("task", "look"))


def rows(text):
    """Name of each function in a table, whether it is the task's, what calls it, and its file."""
    return re.findall(r"^\| `([\w.]+)`( of the task)? \| (?:`([\w.]+)`|you) \|.*\| (\S+\.py) \|$", text, re.M)


TABLES = {"compiled": rows(TEXT), "on tensors": rows(TORCH)}
FILES = {kind: {name: file for name, of_task, _, file in table if not of_task} for kind, table in TABLES.items()}

# How a function is called where not by its own name: compiled, chosen for all lanes, by the task, or maybe compiled
CALLED = {"_step_single": "step_single", "look": "look_at"}
CHOSEN = {
    ("fetch", "fetch"): "fetch_reference",
    ("look", "evaluate_by"): "evaluate",
    ("TorchTask.step", "TorchLook.look"): "_look",
}


def calls(name, file):
    """Names of what a function, or method of a class, of a file calls, in their order there."""
    within: ast.AST = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    for part in name.split("."):
        kind = ast.ClassDef if part[0].isupper() else ast.FunctionDef
        (within,) = [node for node in ast.iter_child_nodes(within) if isinstance(node, kind) and node.name == part]
    found = [node.func for node in ast.walk(within) if isinstance(node, ast.Call)]
    found.sort(key=lambda node: (node.end_lineno or 0, node.end_col_offset or 0))
    return [node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "") for node in found]


@pytest.mark.parametrize(("kind", "text"), [("compiled", TEXT), ("on tensors", TORCH)])
def test_the_table_is_read_whole_and_names_nine_files(kind, text):
    table = text.partition("|---|---|---|---|\n")[2].partition("\n\n")[0]
    assert len(TABLES[kind]) == len(table.splitlines()) > 10
    assert len({file for *_, file in TABLES[kind]}) == 9


@pytest.mark.parametrize(
    ("name", "file"), dict.fromkeys((name, file) for table in TABLES.values() for name, _, _, file in table)
)
def test_each_function_is_where_the_page_says(name, file):
    calls(name, file)


@pytest.mark.parametrize(
    ("kind", "caller"), dict.fromkeys((kind, by) for kind, table in TABLES.items() for _, _, by, _ in table if by)
)
def test_what_is_called_by_one_function_is_called_there_in_this_order(kind, caller):
    told = [name for name, _, by, _ in TABLES[kind] if by == caller]
    wanted = [CHOSEN.get((caller, name), CALLED.get(name, name.rpartition(".")[2])) for name in told]
    assert [name for name in calls(caller, FILES[kind][caller]) if name in wanted] == wanted


def test_what_is_chosen_while_compiling_is_what_the_page_goes_on_with():
    chosen = (ROOT / "caster_gym/envs/native/reference.py").read_text(encoding="utf-8")
    assert "fetch = code_of(source).fetch\n" in chosen
    assert "endings, reward = code.endings, code.reward\n" in chosen
    assert chosen.count("evaluate_by(\n") == 1
    assert "self._look, self._place = self._drive.move, self._looking.look," in TASK


def imported(page):
    """Modules of environments that a page imports from."""
    return set(re.findall(r"^from caster_gym\.envs(?:\.native|\.tensor)?\.(\w+) import", page, re.M))


def test_everything_that_a_step_imports_is_on_the_page_or_plumbing():
    """What a step imports from environments: rows and borrowed arrays are plumbing, which one need not follow."""
    page = (ROOT / "caster_gym/envs/native/step.py").read_text(encoding="utf-8")
    plumbing = {"native", "layout", "plan", "reference", "report", "randomness"}
    assert imported(page) - plumbing <= {Path(file).stem for file in FILES["compiled"].values()}


def test_everything_on_tensors_is_on_the_page_or_plumbing_too():
    """Plumbing there: what a task is made from, what goes in and out of calls, and starts and saved states."""
    plumbing = {
        "inputs",
        "engine",
        "layout",
        "plan",
        "reference",
        "report",
        "starts",
        "state",
        "saved",
        "specification",
    }
    assert (imported(TASK) | imported(LOOK)) - plumbing <= {Path(file).stem for file in FILES["on tensors"].values()}
