"""Rooms are closed: who imports what from where; and whatever text names a module names one that is there."""

import ast
import pkgutil
import re
import tomllib
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parent.parent
OPEN = {
    "caster_gym.design": {"caster_gym.design", "caster_gym.design.isotropy", "caster_gym.design.joint_sets"},
    "caster_gym.identification": {"caster_gym.identification"},
}
BELOW_AGENTS = ("analysis", "report", "design", "identification")


def modules(*folders: str) -> dict[str, Path]:
    """Source files by module name; the links in caster_gym to agents and configs are not followed."""
    names = {"agents": "caster_gym.agents"}
    found = {}
    for folder in folders:
        for file in sorted((ROOT / folder).rglob("*.py")):
            parts = file.relative_to(ROOT).with_suffix("").parts
            if parts[:2] not in (("caster_gym", "agents"), ("caster_gym", "configs")):
                found[".".join((names.get(parts[0], parts[0]), *parts[1:])).removesuffix(".__init__")] = file
    return found


def imported(file: Path) -> Iterator[str]:
    """Modules that a file imports, also late, within functions."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            yield node.module
        elif isinstance(node, ast.Import):
            yield from (one.name for one in node.names)


@pytest.mark.parametrize("room", OPEN)
def test_nobody_reaches_into_a_room(room):
    inner = {name for name in modules("caster_gym") if name.startswith(f"{room}.")}
    assert len(inner) > 5
    for name, file in modules("caster_gym", "agents", "papers", "scripts").items():
        if name != room and name not in inner:
            reached = {one for one in imported(file) if one == room or one.startswith(f"{room}.")}
            assert reached <= OPEN[room], name


@pytest.mark.parametrize("room", BELOW_AGENTS)
def test_rooms_below_the_agents_do_not_import_them(room):
    for name, file in modules(f"caster_gym/{room}").items():
        assert not [one for one in imported(file) if one.startswith("caster_gym.agents")], name


def test_what_is_installed_imports_nothing_that_is_not():
    for name, file in modules("caster_gym", "agents").items():
        assert not {one.split(".")[0] for one in imported(file)} & {"papers", "scripts", "tests"}, name


ALL = modules("caster_gym", "agents", "papers", "scripts", "tests")
MADE_UP = (  # by who follows a recipe
    *("caster_gym.tasks.mine", "configs/tasks/mine.yaml", "tests/test_tasks_mine.py"),
    *("agents/control/springs.py", "configs/agents/spring.yaml", "tests/test_agents_control_springs.py"),
)
DOTTED = re.compile(r"(?<![\w.])(?:caster_gym|papers|scripts|tests)(?:\.[A-Za-z]\w*)+(?!\.?\w)")
TOPS = "caster_gym|agents|papers|scripts|tests|configs|docs"
SLASHED = re.compile(rf"(?<![\w/.])(?:{TOPS})/[\w/.-]*\.(?:py|yaml|md|csv)\b")


def exists(name: str, folder: Path = ROOT) -> bool:
    """Whether there is such a file, for a page in a folder, or such a module or name in one."""
    if "/" in name:
        return (ROOT / name).is_file() or (folder / name).is_file()
    try:
        return name in ALL or pkgutil.resolve_name(name) is not None
    except (ImportError, AttributeError):
        return False


def test_names_that_are_gone_are_told_from_others():
    assert all(map(exists, ("caster_gym.robot.Robot.joints", "caster_gym.mechanics", "docs/step.md")))
    assert not any(map(exists, ("caster_gym.robot.Root", "caster_gym.robots", "caster_gym/robots.py")))


@pytest.mark.parametrize("pattern", [DOTTED, SLASHED], ids=["modules", "files"])
def test_what_comments_and_pages_name_is_there(pattern):
    """Of tests, which may name what is wrong, their first lines."""
    texts = [*ALL.values(), *ROOT.glob("*.md"), *ROOT.glob("docs/*.md"), *ROOT.glob("configs/**/*.yaml")]
    named: dict[str, Path] = {}
    for file in texts:
        text = file.read_text(encoding="utf-8")
        named |= dict.fromkeys(
            pattern.findall(text.partition("\n")[0] if file.is_relative_to(ROOT / "tests") else text), file
        )
    assert len(named) > 50
    gone = {name: str(file) for name, file in named.items() if name not in MADE_UP and not exists(name, file.parent)}
    assert gone == {}


def test_types_are_checked_strictly_wherever_there_is_code():
    """Functions of tests alone need no annotations; agents are seen through the link in caster_gym."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["mypy"]
    folders = {file.parent.name for file in ROOT.glob("*/*.py") if not file.parent.name.startswith((".", "build"))}
    assert folders - {"agents", "configs", "findings"} == set(settings["files"])
    assert (ROOT / "caster_gym" / "agents").resolve() == ROOT / "agents"
    (tests,) = (one for one in settings["overrides"] if one["module"] == "tests.*")
    untyped = {"disallow_untyped_defs", "disallow_incomplete_defs", "disallow_untyped_calls"}
    assert settings["strict"] and tests == {"module": "tests.*", **dict.fromkeys(untyped, False)}
