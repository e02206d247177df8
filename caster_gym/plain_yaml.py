"""YAML that holds data alone: mappings, lists, text, numbers, true, false and null.

Texts may come from strangers, so that all that grows is bounded: how deep a text is, how many values it stands for once
its aliases are written out, how long words and numbers are. Values are built from libyaml's events one by one, without
recursion. What YAML knows beside data, its tags, is refused. Dates stay text, and `3e-4` and `1e6` are numbers.
"""

import math
import re
from collections.abc import Iterator
from typing import Any

import yaml

from caster_gym.brief import brief

MOST_VALUES = 150_000  # with aliases written out; a timed path of 10 minutes at 50 Hz
DEEPEST = 50  # lists and mappings in one another; the settings of a comparison have 8
LONGEST_TEXT = 20_000  # characters of a key or a value
LONGEST_NUMBER = 64  # characters; of integers, 64 digits are more than any seed has

_PARSER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)  # ten times as fast, wherever PyYAML was built with libyaml
_WORDS = {
    **dict.fromkeys(("", "~", "null", "Null", "NULL"), None),
    **dict.fromkeys(("true", "True", "TRUE", "yes", "Yes", "YES", "on", "On", "ON"), True),
    **dict.fromkeys(("false", "False", "FALSE", "no", "No", "NO", "off", "Off", "OFF"), False),
    **dict.fromkeys((f"{sign}.{word}" for sign in ("", "+") for word in ("inf", "Inf", "INF")), math.inf),
    **dict.fromkeys(("-.inf", "-.Inf", "-.INF"), -math.inf),
    **dict.fromkeys((".nan", ".NaN", ".NAN"), math.nan),
}
_INTEGER = re.compile(r"[-+]?(?:0|[1-9][0-9_]*)")
_OTHER_BASE = re.compile(r"([-+]?)(?:0b([01_]+)|0x([0-9a-fA-F_]+)|0([0-7_]+))")
_FLOAT = re.compile(r"[-+]?(?:[0-9][0-9_]*\.[0-9_]*|\.[0-9][0-9_]*|[0-9]+(?=[eE]))(?:[eE][-+]?[0-9]+)?")
_BEGINS_NUMBERS = frozenset("+-.0123456789")
_NONE, _MERGE = object(), object()
_TAGS = {  # what may be said of a value that is one anyway
    "tag:yaml.org,2002:str": str,
    "tag:yaml.org,2002:int": int,
    "tag:yaml.org,2002:float": float,
    "tag:yaml.org,2002:bool": bool,
    "tag:yaml.org,2002:null": type(None),
    "tag:yaml.org,2002:map": dict,
    "tag:yaml.org,2002:seq": list,
}


class YamlError(ValueError):
    """A text that is no plain YAML; the message says what is wrong, and where."""


def read_plain_yaml(text: str) -> Any:
    """The value that a text stands for. Raises YamlError.

    >>> read_plain_yaml("rates: [3e-4, &fast 1e6]\\nagain: *fast")
    {'rates': [0.0003, 1000000.0], 'again': 1000000.0}
    """
    try:
        return _Builder().build(yaml.parse(text, Loader=_PARSER))
    except yaml.MarkedYAMLError as error:
        raise YamlError(f"{error.problem}{_place(error.problem_mark)}") from error
    except (yaml.YAMLError, UnicodeEncodeError) as error:  # of characters that no text has
        raise YamlError(" ".join(str(error).split())) from error


class _Open:
    """A list or a mapping that is not complete yet."""

    def __init__(self, start: Any, before: int) -> None:
        self.start, self.before = start, before  # its event, and how many values there were before it
        self.value: dict[str, Any] | list[Any] = {} if isinstance(start, yaml.MappingStartEvent) else []
        self.key: Any = _NONE  # of a mapping, while its value is awaited
        self.merged: list[dict[str, Any]] = []
        self._last: Any = None  # event of the last item, key or value

    def add(self, value: Any, event: Any) -> None:
        """Take the next item, or the next key or value."""
        before, self._last = self._last, event
        if isinstance(self.value, list):
            self.value.append(value)
        elif self.key is _NONE:
            self.key = self._checked_key(value, event, before)
        elif self.key is _MERGE:
            self.merged += self._checked_merge(value, event)
            self.key = _NONE
        else:
            self.value[self.key] = value
            self.key = _NONE

    def _checked_key(self, key: Any, event: Any, before: Any) -> Any:
        if key == "<<" and event.implicit[0] and not self.merged:
            return _MERGE
        if not isinstance(key, str):
            number = _split_number(before, event)
            raise _fault(
                f"decimals have a point: write {number}" if number else f"a key must be text, got {_kind(key)}", event
            )
        if key in self.value:
            raise _fault(f"the key {brief(key)} stands twice", event)
        return key

    def _checked_merge(self, value: Any, event: Any) -> list[dict[str, Any]]:
        mappings = value if isinstance(value, list) else [value]
        if not all(isinstance(one, dict) for one in mappings):
            raise _fault("only mappings can be merged by <<", event)
        return mappings

    def completed(self) -> dict[str, Any] | list[Any]:
        """The whole value; what is merged into a mapping gives way to its own keys, and to what is merged first."""
        if isinstance(self.value, dict) and self.merged:
            return {**{key: it for one in reversed(self.merged) for key, it in one.items()}, **self.value}
        return self.value


class _Builder:
    """Values from events."""

    def __init__(self) -> None:
        self._stack: list[_Open] = []
        self._anchors: dict[str, tuple[Any, int]] = {}  # values, and how many they are with all that is in them
        self._count = 0
        self._result: Any = _NONE

    def build(self, events: Iterator[Any]) -> Any:
        """The value of the one document."""
        for event in events:
            if isinstance(event, yaml.ScalarEvent):
                self._grow(1, event)
                self._put(_scalar(event), 1, event)
            elif isinstance(event, yaml.CollectionStartEvent):
                self._grow(1, event)
                if len(self._stack) >= DEEPEST:
                    raise _fault(f"more than {DEEPEST} lists and mappings stand in one another", event)
                self._stack.append(_Open(event, self._count - 1))
            elif isinstance(event, yaml.CollectionEndEvent):
                whole = self._stack.pop()
                value = whole.completed()
                _check_tag(value, whole.start)
                self._put(value, self._count - whole.before, whole.start)
            elif isinstance(event, yaml.AliasEvent):
                if event.anchor not in self._anchors:
                    raise _fault(f"the alias {brief(event.anchor)} stands for nothing complete before it", event)
                value, size = self._anchors[event.anchor]
                self._grow(size, event)
                self._put(value, size, event)
            elif isinstance(event, yaml.DocumentStartEvent) and self._result is not _NONE:
                raise _fault("a second document begins", event)
        return None if self._result is _NONE else self._result

    def _grow(self, size: int, event: Any) -> None:
        self._count += size
        if self._count > MOST_VALUES:
            raise _fault(f"it stands for more than {MOST_VALUES} values", event)

    def _put(self, value: Any, size: int, event: Any) -> None:
        """Put a complete value of some size, which counts itself, where it belongs."""
        if self._stack:
            self._stack[-1].add(value, event)
        else:
            self._result = value
        if event.anchor is not None and not isinstance(event, yaml.AliasEvent):
            self._anchors[event.anchor] = value, size


def _scalar(event: Any) -> Any:
    """Text, a number, true, false or None."""
    text = event.value
    if len(text) > LONGEST_TEXT:
        raise _fault(f"a value of {len(text)} characters stands there, at most {LONGEST_TEXT} are read", event)
    if event.tag == "tag:yaml.org,2002:str" or not (event.implicit[0] or event.tag in _TAGS):
        value: Any = text
    elif text in _WORDS:
        value = _WORDS[text]
    elif text[0] in _BEGINS_NUMBERS:
        value = _number(text, event)
    else:
        value = text
    _check_tag(value, event)
    return value


def _number(text: str, event: Any) -> int | float | str:
    """The number that a text is, or the text."""
    integer, other = _INTEGER.fullmatch(text), _OTHER_BASE.fullmatch(text)
    if not (integer or other or _FLOAT.fullmatch(text)):
        return text
    if len(text) > LONGEST_NUMBER:
        raise _fault(f"a number of {len(text)} characters stands there, at most {LONGEST_NUMBER} are read", event)
    plain = text.replace("_", "")
    if integer:
        return int(plain)
    if other is None:
        return float(plain)
    base, digits = next((base, digits) for base, digits in zip((2, 16, 8), other.groups()[1:], strict=True) if digits)
    return int(other[1] + (digits.replace("_", "") or "0"), base)


def _split_number(before: Any, after: Any) -> str:
    """The number, with a point, of which a decimal comma within { } has made a value and a key; empty if it has not."""
    plain = isinstance(before, yaml.ScalarEvent) and isinstance(after, yaml.ScalarEvent)
    if not plain or after.start_mark.index != before.end_mark.index + 1:
        return ""
    number = f"{before.value}.{after.value}"
    return number if re.fullmatch(r"[-+]?\d+\.\d+(?:[eE][-+]?\d+)?", number) else ""


def _check_tag(value: Any, event: Any) -> None:
    """Refuse a tag that makes something else of a value than it is."""
    if event.tag is None or event.tag == "!":
        return
    if event.tag not in _TAGS:
        raise _fault(f"the tag {brief(event.tag)} is not read: files hold data alone", event)
    if type(value) is not _TAGS[event.tag]:
        raise _fault(f"the tag {brief(event.tag)} does not fit {_kind(value)}", event)


def _kind(value: Any) -> str:
    names = {dict: "a mapping", list: "a list", type(None): "nothing"}
    return names.get(type(value)) or brief(value)


def _fault(problem: str, event: Any) -> YamlError:
    return YamlError(f"{problem}{_place(event.start_mark)}")


def _place(mark: Any) -> str:
    return f" at line {mark.line + 1}, column {mark.column + 1}" if mark else ""
