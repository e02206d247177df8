"""docs/step.md: its nine files hold what it says, and the page of a step calls it in that order."""

import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
ROWS = re.findall(r"^\| `([\w.]+)` \|.*\| (\S+\.py) \|$", (ROOT / "docs/step.md").read_text(encoding="utf-8"), re.M)
PAGE = (ROOT / "caster_gym/envs/native/step.py").read_text(encoding="utf-8")


def test_a_step_is_followed_in_at_most_nine_files():
    assert len(ROWS) == len({file for _, file in ROWS}) <= 9
    for _, file in ROWS:
        assert (ROOT / file).is_file()


def test_each_call_stands_where_the_page_says():
    """`evaluate` and `report` are calls of what stands there under the task's own names."""
    other = {"evaluate": "reward", "report": "Report"}
    for name, file in ROWS:
        wanted = other.get(name, name.rpartition(".")[2])
        assert re.search(rf"^ *(def|class) {wanted}\b", (ROOT / file).read_text(encoding="utf-8"), re.M), name


def test_the_page_calls_them_in_this_order():
    step = PAGE[PAGE.index("def _step_lanes(") :].split("\n\n\n")[0]
    assert step.index(" drive(") < step.index(" fetch(") < step.index(" look_at(") < step.index(" deliver(")
    look = PAGE[PAGE.index("def look(") :].split("\n\n\n")[0]
    assert (
        look.index(" evaluate(")
        < look.index(" write(workspace, lane, rows.observation, observe(")
        < look.index(" report(")
    )


def test_everything_that_the_page_calls_comes_from_its_files_or_is_plumbing():
    """What a step imports from environments: rows and borrowed arrays are plumbing, which one need not follow."""
    plumbing = {"native", "layout", "reference", "rows", "tracking", "randomness"}
    modules = set(re.findall(r"^from caster_gym\.envs(?:\.native)?\.(\w+) import", PAGE, re.M))
    assert modules - plumbing <= {Path(file).stem for _, file in ROWS}
