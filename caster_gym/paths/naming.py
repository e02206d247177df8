"""Names that nobody knows, and the nearest one that is known."""

import difflib
from collections.abc import Iterable


def unknown_name(what: str, name: object, known: Iterable[str]) -> str:
    """Sentence that refuses a name and offers the nearest known one, or all of them."""
    names = sorted(known)
    if name is None:
        return f"{what!r} is missing; known are {', '.join(names)}"
    near = difflib.get_close_matches(str(name), names, n=1, cutoff=0.4)
    hint = f"did you mean {near[0]!r}?" if near else f"known are {', '.join(names)}"
    return f"unknown {what} {name!r}; {hint}"
