"""Which sources outside the package compiled code depends on, so that an edit compiles it again.

Named tuples tell: whoever compiles code for a type of theirs notes with it the modules whose functions the code calls.
"""

import ast
import hashlib
import sys
from collections.abc import Iterable, Iterator
from importlib.util import resolve_name
from pathlib import Path
from typing import Any

_OURS = __name__.partition(".")[0]
_INSTALLED = {"site-packages", "dist-packages"}  # where an edit comes with another version

_modules: dict[Any, tuple[str, ...]] = {}  # by type of named tuple, the outside modules that its code comes from
_digests: dict[Any, str | None] = {}  # of their sources as they were read; None of code that has no file


def note_outside(kinds: Iterable[Any], modules: Iterable[str]) -> None:
    """Note that code compiled for these types calls functions of these modules, and of what they import."""
    outside = tuple(sorted(name for name in modules if name.partition(".")[0] != _OURS))
    for kind in kinds if outside else ():
        _modules[kind] = outside
        _digests[kind] = _digest(outside)


def outside_digest(types: Any) -> str | None:
    """What stands for all outside sources of code for these compiler's types, "" if there are none.

    None: they have no files, or have changed since this process read them; such code is not to be kept.
    """
    kinds = [kind for kind in _kinds_in(types) if kind in _modules]
    if any(_digests[kind] is None or _digest(_modules[kind]) != _digests[kind] for kind in kinds):
        return None
    return " ".join(f"{kind.__module__}.{kind.__qualname__} {_digests[kind]}" for kind in kinds)


def _kinds_in(types: Any) -> Iterator[Any]:
    """The types of named tuples anywhere in compiler's types."""
    if hasattr(types, "instance_class"):
        yield types.instance_class
    parts = types if isinstance(types, tuple) else getattr(types, "types", None)
    if parts is None:
        parts = getattr(types, "field_dict", {}).values()
    for part in parts:
        yield from _kinds_in(part)


def _digest(modules: tuple[str, ...]) -> str | None:
    """Of the sources of modules and of those that they import, as far as these are a user's own."""
    sources: dict[str, bytes] = {}
    try:
        for name in modules:
            _add_sources(name, name.partition(".")[0], sources)
    except (AttributeError, OSError, SyntaxError, UnicodeDecodeError):
        return None
    return hashlib.sha256(repr(sorted(sources.items())).encode()).hexdigest()[:16]


def is_own(name: str, top: str) -> bool:
    """Whether a module is a user's: in the package of that top, or outside of all packages that are installed."""
    root, module = name.partition(".")[0], sys.modules.get(name)
    if module is None or root == _OURS or root in sys.stdlib_module_names - {"__main__"}:
        return False
    return root == top or not set(Path(getattr(module, "__file__", None) or "").parts) & _INSTALLED


def _add_sources(name: str, top: str, sources: dict[str, bytes]) -> None:
    """Add the source of a module, if it is the user's own, and of what it imports; top: package of the first one."""
    if name in sources or not is_own(name, top):
        return
    module: Any = sys.modules[name]
    sources[name] = Path(module.__file__ or "").read_bytes()
    for imported in _imports(sources[name], module):
        _add_sources(imported, top, sources)


def _imports(source: bytes, module: Any) -> Iterator[str]:
    """Names of all modules that a module may import; among them some that are no modules."""
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            origin = "." * node.level + (node.module or "")
            origin = resolve_name(origin, module.__package__) if node.level else origin
            yield origin
            yield from (f"{origin}.{alias.name}" for alias in node.names)
