"""README.md: its programs print what it shows, and its map of folders is that of the repository."""

import contextlib
import io
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent
TEXT = (ROOT / "README.md").read_text(encoding="utf-8")


def test_the_programs_print_what_stands_below_them():
    programs = re.findall(r"^```python\n(.*?)^```\n\n```\n(.*?)^```", TEXT, re.M | re.S)
    assert len(programs) == TEXT.count("```python") == 2
    for code, shown in programs:
        printed = io.StringIO()
        with contextlib.redirect_stdout(printed):
            exec(compile(code, "README.md", "exec"), {})
        assert printed.getvalue() == shown


def test_the_first_program_comes_within_the_first_screen():
    assert TEXT[: TEXT.index("```python")].count("\n") < 24  # what a page of GitHub shows, beside the picture


def test_the_map_names_every_folder_of_code_and_nothing_else():
    shown = set()
    for cell in re.findall(r"^\| (`[\w/.]+`(?:, `[\w/.]+`)*) \|", TEXT[TEXT.index("## Where things are") :], re.M):
        names = re.findall(r"`([\w/.]+)`", cell)
        inside = "caster_gym/" if names[0].startswith("caster_gym/") else ""
        shown |= {name if name.startswith(inside) else inside + name for name in names}
    assert all((ROOT / name).exists() for name in shown), sorted(name for name in shown if not (ROOT / name).exists())
    there = {f"caster_gym/{folder.parent.name}/" for folder in (ROOT / "caster_gym").glob("*/__init__.py")}
    links = {"caster_gym/agents/", "caster_gym/configs/"}  # to folders that stand at the top
    assert {name for name in shown if name.startswith("caster_gym/") and name.endswith("/")} == there - links
    assert {"agents/", "configs/", "docs/", "papers/", "scripts/", "tests/"} <= shown
