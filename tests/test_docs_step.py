"""docs/step.md: its nine files an engine hold what it says, and the pages of a step call it in that order."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
NUMBA, TORCH = (ROOT / "docs/step.md").read_text(encoding="utf-8").split("## On tensors")
PAGE = (ROOT / "caster_gym/envs/native/step.py").read_text(encoding="utf-8")
TASK, LOOK = ((ROOT / f"caster_gym/envs/tensor/{name}.py").read_text(encoding="utf-8") for name in ("task", "look"))


def rows_of(text):
    """Calls and files of a table."""
    return re.findall(r"^\| `([\w.]+)` \|.*\| (\S+\.py) \|$", text, re.M)


def imported(page):
    """Modules of environments that a page imports from."""
    return set(re.findall(r"^from caster_gym\.envs(?:\.native|\.tensor)?\.(\w+) import", page, re.M))


def stands_in_order(text, *calls):
    places = [text.index(call) for call in calls]
    return places == sorted(places)


@pytest.mark.parametrize("text", [NUMBA, TORCH])
def test_a_step_is_followed_in_at_most_nine_files(text):
    rows = rows_of(text)
    assert 8 <= len(rows) == len({file for _, file in rows}) <= 9
    for _, file in rows:
        assert (ROOT / file).is_file()


def test_each_call_stands_where_the_page_says():
    """`evaluate` and `report` are calls of what stands there under the task's own names."""
    other = {"evaluate": "reward", "report": "Report"}
    for name, file in rows_of(NUMBA + TORCH):
        wanted = other.get(name, name.rpartition(".")[2])
        assert re.search(rf"^ *(def|class) {wanted}\b", (ROOT / file).read_text(encoding="utf-8"), re.M), name


def test_the_page_calls_them_in_this_order():
    step = PAGE[PAGE.index("def _step_lanes(") :].split("\n\n\n")[0]
    assert stands_in_order(step, " drive(", " fetch(", " look_at(", " deliver(")
    look = PAGE[PAGE.index("def look(") :].split("\n\n\n")[0]
    assert stands_in_order(look, " evaluate(", " write(workspace, lane, rows.observation, observe(", " report(")


def test_on_tensors_it_calls_them_in_the_same_order():
    step = TASK[TASK.index("    def step(") : TASK.index("    def restart(")]
    assert stands_in_order(step, ".drive(", "._look(")
    look = LOOK[LOOK.index("    def look(") : LOOK.index("    def _fetch(")]
    assert stands_in_order(look, "._fetch(", " evaluate_by(", " observe(", "._report(")


def test_everything_that_the_page_calls_comes_from_its_files_or_is_plumbing():
    """What a step imports from environments: rows and borrowed arrays are plumbing, which one need not follow."""
    plumbing = {"native", "layout", "reference", "rows", "tracking", "randomness"}
    assert imported(PAGE) - plumbing <= {Path(file).stem for _, file in rows_of(NUMBA)}


def test_so_does_everything_on_tensors():
    """Plumbing there: what a task is made from, what goes in and out of calls, and starts, which no step needs."""
    plumbing = {"inputs", "engine", "layout", "plan", "reference", "starts", "state", "tracking"}
    assert (imported(TASK) | imported(LOOK)) - plumbing <= {Path(file).stem for _, file in rows_of(TORCH)}
