"""Values as messages show them: in a few words, however large they are."""

import reprlib

LONGEST_VALUE = 80  # characters

_BRIEF = reprlib.Repr()
_BRIEF.maxlevel = 3
_BRIEF.maxtuple = _BRIEF.maxlist = _BRIEF.maxdict = _BRIEF.maxset = 8
_BRIEF.maxstring = _BRIEF.maxother = LONGEST_VALUE


def brief(value: object) -> str:
    """The value as Python writes it, cut at LONGEST_VALUE characters."""
    return cut(_BRIEF.repr(value))  # it may be far larger than its file, by aliases


def cut(text: str, most: int = LONGEST_VALUE) -> str:
    """The text, or its beginning."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
