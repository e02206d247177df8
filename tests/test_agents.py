"""caster_gym.agents: its rooms import from one another in one direction only."""

import ast
from collections.abc import Iterator
from pathlib import Path

import caster_gym.agents

HOME = Path(caster_gym.agents.__path__[0])
ROOMS = [
    "workers",
    "control",
    "comparison",
    "learning",
    "registry",
    "sweep",
    "commands",
]  # each imports from those before it


def room_of(module: str) -> str:
    return module.removeprefix("caster_gym.agents.").split(".")[0]


def imports(file: Path) -> Iterator[str]:
    """Rooms from which a file imports, at its top, within functions or for types alone."""
    for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom):
            assert node.level == 0, f"{file} imports relatively"
            names = [node.module or "", *(f"{node.module}.{alias.name}" for alias in node.names)]
        elif isinstance(node, ast.Import):
            names = [alias.name for alias in node.names]
        else:
            continue
        yield from {room_of(name) for name in names if name.startswith("caster_gym.agents.")}


def test_every_file_is_in_a_room():
    found = {file.relative_to(HOME).parts[0].removesuffix(".py") for file in HOME.rglob("*.py")}
    assert found == {"__init__", *ROOMS}


def test_rooms_import_from_those_before_them():
    for file in HOME.rglob("*.py"):
        if file.name == "__init__.py":
            assert list(imports(file)) == []
            continue
        room = file.relative_to(HOME).parts[0].removesuffix(".py")
        allowed = ROOMS[: ROOMS.index(room) + 1]
        assert set(imports(file)) <= set(allowed), file
