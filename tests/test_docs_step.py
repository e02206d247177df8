"""docs/step.md: each function of a step is in the file that the page names, and the one that it names calls it."""

import ast
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
TEXT, TORCH = (ROOT / "docs/step.md").read_text(encoding="utf-8").split("## On tensors")
TASK, LOOK = ((ROOT / f"caster_gym/envs/tensor/{name}.py").read_text(encoding="utf-8") for name in ("task", "look"))
ROWS = re.findall(r"^\| `([\w.]+)`( of the task)? \| (?:`([\w.]+)`|you) \|.*\| (\S+\.py) \|$", TEXT, re.M)
FILES = {name: file for name, of_task, _, file in ROWS if not of_task}

# How a function is called where not by its own name: compiled, chosen for all lanes, or by the task
CALLED = {"_step_single": "step_single", "look": "look_at"}
CHOSEN = {("fetch", "fetch"): "fetch_reference", ("look", "evaluate_by"): "evaluate"}


def calls(name, file):
    """Names of what a function, or method of a class, of a file calls, in their order there."""
    within: ast.AST = ast.parse((ROOT / file).read_text(encoding="utf-8"))
    for part in name.split("."):
        kind = ast.ClassDef if part[0].isupper() else ast.FunctionDef
        (within,) = [node for node in ast.iter_child_nodes(within) if isinstance(node, kind) and node.name == part]
    found = [node.func for node in ast.walk(within) if isinstance(node, ast.Call)]
    found.sort(key=lambda node: (node.end_lineno or 0, node.end_col_offset or 0))
    return [node.attr if isinstance(node, ast.Attribute) else getattr(node, "id", "") for node in found]


def test_the_table_is_read_whole_and_names_nine_files():
    table = TEXT.partition("|---|---|---|---|\n")[2].partition("\n\n")[0]
    assert len(ROWS) == len(table.splitlines()) > 10
    assert len({file for *_, file in ROWS}) == 9


@pytest.mark.parametrize(("name", "file"), [(name, file) for name, _, _, file in ROWS])
def test_each_function_is_where_the_page_says(name, file):
    calls(name, file)


@pytest.mark.parametrize("caller", dict.fromkeys(caller for _, _, caller, _ in ROWS if caller))
def test_what_is_called_by_one_function_is_called_there_in_this_order(caller):
    told = [name for name, _, by, _ in ROWS if by == caller]
    wanted = [CHOSEN.get((caller, name), CALLED.get(name, name.rpartition(".")[2])) for name in told]
    assert [name for name in calls(caller, FILES[caller]) if name in wanted] == wanted


def test_what_is_chosen_while_compiling_is_what_the_page_goes_on_with():
    chosen = (ROOT / "caster_gym/envs/native/reference.py").read_text(encoding="utf-8")
    assert "fetch = code_of(source).fetch\n" in chosen
    assert "endings, reward = code.endings, code.reward\n" in chosen
    assert chosen.count("evaluate_by(\n") == 1


def imported(page):
    """Modules of environments that a page imports from."""
    return set(re.findall(r"^from caster_gym\.envs(?:\.native|\.tensor)?\.(\w+) import", page, re.M))


def test_everything_that_a_step_imports_is_on_the_page_or_plumbing():
    """What a step imports from environments: rows and borrowed arrays are plumbing, which one need not follow."""
    page = (ROOT / "caster_gym/envs/native/step.py").read_text(encoding="utf-8")
    plumbing = {"native", "layout", "reference", "rows", "report", "randomness"}
    assert imported(page) - plumbing <= {Path(file).stem for *_, file in ROWS}


ON_TENSORS = re.findall(r"^\| `([\w.]+)` \|.*\| (\S+\.py) \|$", TORCH, re.M)


def test_on_tensors_each_call_stands_in_one_of_nine_files():
    assert len({file for _, file in ON_TENSORS}) <= 9 <= len(ON_TENSORS)
    for name, file in ON_TENSORS:
        text = (ROOT / file).read_text(encoding="utf-8")
        assert re.search(rf"^ *(def|class) {name.rpartition('.')[2]}\b", text, re.M), name


def stands_in_order(text, *calls):
    places = [text.index(call) for call in calls]
    return places == sorted(places)


def test_on_tensors_it_calls_them_in_the_same_order():
    step = TASK[TASK.index("    def step(") : TASK.index("    def restart(")]
    assert stands_in_order(step, ".drive(", "._look(")
    look = LOOK[LOOK.index("    def look(") : LOOK.index("    def _fetch(")]
    assert stands_in_order(look, "._fetch(", " evaluate_by(", " observe(", "._report(")


def test_everything_on_tensors_is_on_the_page_or_plumbing_too():
    """Plumbing there: what a task is made from, what goes in and out of calls, and starts, which no step needs."""
    plumbing = {"inputs", "engine", "layout", "plan", "reference", "report", "starts", "state"}
    assert (imported(TASK) | imported(LOOK)) - plumbing <= {Path(file).stem for _, file in ON_TENSORS}
