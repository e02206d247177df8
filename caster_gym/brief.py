"""Values as messages show them: in a few words, however large they are."""

import reprlib
from types import BuiltinFunctionType, FunctionType, MethodType

LONGEST_VALUE = 80  # characters


class _Brief(reprlib.Repr):
    """Objects that do not say what they are, and functions, appear by name, not by their place in memory."""

    def repr_instance(self, x: object, level: int) -> str:
        if isinstance(x, FunctionType | MethodType | BuiltinFunctionType):
            return f"the function {x.__qualname__}"
        if type(x).__repr__ is object.__repr__:
            return f"an object of class {type(x).__name__}"
        return super().repr_instance(x, level)

    repr_builtin_function_or_method = repr_function = repr_method = repr_instance


_BRIEF = _Brief()
_BRIEF.maxlevel = 3
_BRIEF.maxtuple = _BRIEF.maxlist = _BRIEF.maxdict = _BRIEF.maxset = 8
_BRIEF.maxstring = _BRIEF.maxother = LONGEST_VALUE


def brief(value: object) -> str:
    """The value as Python writes it, cut at LONGEST_VALUE characters."""
    return cut(_BRIEF.repr(value))  # it may be far larger than its file, by aliases


def cut(text: str, most: int = LONGEST_VALUE) -> str:
    """The text, or its beginning."""
    return text if len(text) <= most else f"{text[: most - 1]}…"
