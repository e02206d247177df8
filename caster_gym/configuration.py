"""YAML files checked against typed models: an unknown key, a wrong value or a typo is an error that says where."""

import difflib
import re
from collections.abc import Iterable, Iterator, Mapping, Sized
from pathlib import Path
from types import MappingProxyType, UnionType
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, Self, TypeAlias, TypeVar, Union, get_args, get_origin

from numpy.linalg import LinAlgError
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, ValidationError, model_validator
from pydantic.functional_validators import ModelWrapValidatorHandler
from pydantic_core import ErrorDetails, InitErrorDetails, PydanticCustomError

from caster_gym.bounded_files import YAML_BYTES, read_bytes
from caster_gym.brief import brief, cut
from caster_gym.file_names import FOLDER
from caster_gym.plain_yaml import YamlError, read_plain_yaml

_LONGEST_MESSAGE = 600  # characters of what is wrong in one place
_SURVEYED = 200  # problems that are looked at
MOST_PROBLEMS = 8  # in a message
SMALLEST, GREATEST = 1e-12, 1e15  # of numbers in SI units: farther out, products of some of them lose their sense


def _not_tiny(value: float) -> float:
    if value < SMALLEST:
        raise ValueError(f"must be at least {SMALLEST:g}, got {value:g}: nothing can be computed with less")
    return value


Positive: TypeAlias = Annotated[float, Field(gt=0.0), AfterValidator(_not_tiny)]
"""A positive number that can be computed with."""


class Frozen(BaseModel):
    """Parameters that are checked once and never change.

    Words and yes/no are not taken for numbers, and numbers beyond GREATEST are refused.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)

    longest_list: ClassVar[int] = 1000  # items of a list or keys of a mapping in it

    # What others call a field, or what is not set here: the field's name here, or where to set it, in words
    usual_names: ClassVar[Mapping[str, str]] = MappingProxyType({})

    @model_validator(mode="wrap")
    @classmethod
    def _numbers_are_numbers(cls, content: Any, read: ModelWrapValidatorHandler[Self]) -> Self:
        if isinstance(content, Mapping):
            for key, value in content.items():
                if isinstance(value, list | tuple | Mapping) and len(value) > cls.longest_list:
                    raise ValueError(f"{brief(key)} has {len(value)} items, at most {cls.longest_list} are read")
        model = read(content)
        if isinstance(content, Mapping):
            problems = [
                InitErrorDetails(
                    type=PydanticCustomError("misread", "should be {kind}", {"kind": kind}), loc=loc, input=it
                )
                for loc, it, kind in _misread(content, vars(model))
            ]
            if problems:
                raise ValidationError.from_exception_data(cls.__name__, problems)
        return model


class Extensible(Frozen):
    """Parameters to which users add fields in classes of their own: the defaults of these are checked too."""

    model_config = ConfigDict(validate_default=True)


class ConfigurationError(ValueError):
    """A configuration that cannot be used; the message names the key, the value and what would be right.

    >>> import caster_gym
    >>> caster_gym.load_robot("chung2009")
    Traceback (most recent call last):
    caster_gym.configuration.ConfigurationError: unknown robot 'chung2009'; known are ...
    """


Model = TypeVar("Model", bound=BaseModel)


def is_yaml(path: str | Path) -> bool:
    """Whether a name is that of a YAML file, by its suffix."""
    return Path(path).suffix.lower() in (".yaml", ".yml")


def read_yaml(path: Path) -> dict[str, Any]:
    """Content of a YAML file that holds a mapping. Raises ConfigurationError, whatever the file holds."""
    try:
        text = read_bytes(path, YAML_BYTES).decode("utf-8")
    except UnicodeDecodeError as error:
        raise ConfigurationError(f"{path} cannot be read as YAML: {error}") from error
    except ValueError as error:
        raise ConfigurationError(str(error)) from error
    content = parse_yaml(text, str(path))
    if not isinstance(content, dict):
        kind = {"NoneType": "nothing", "list": "a list", "str": "words"}.get(type(content).__name__, repr(content))
        raise ConfigurationError(f"{path} must hold a mapping of keys to values, got {kind}")
    return content


def parse_yaml(text: str, source: str) -> Any:
    """Value of a YAML text from a source that errors name."""
    try:
        return read_plain_yaml(text)
    except YamlError as error:
        raise ConfigurationError(f"{source} cannot be read as YAML: {error}") from error


def parse(model: type[Model], content: Mapping[str, Any], source: str, folder: Path | None = None) -> Model:
    """A checked model; errors become sentences that name the source, the key and the value.

    folder: of the file that the content was read from; relative names of files in the content start there.
    """
    try:
        return model.model_validate(content, context={FOLDER: folder})
    except ValidationError as error:
        raise ConfigurationError(f"{source}: {describe(error, model)}") from error
    except (ArithmeticError, LinAlgError) as error:  # of checks that compute
        raise ConfigurationError(f"{source}: nothing can be computed with its numbers: {error}") from error


def describe(error: ValidationError, model: type[BaseModel]) -> str:
    """What is wrong, key by key, in sentences. Items of lists count from 1, as joints do."""
    problems = error.errors(include_url=False)
    many, problems = len(problems) - _SURVEYED, problems[:_SURVEYED]
    deeper = {problem["loc"][:depth] for problem in problems for depth in range(len(problem["loc"]))}
    wrong = {problem["loc"][:-2] for problem in problems if problem["type"] != "missing"}
    complaints: dict[tuple[str, str], list[str]] = {}  # by place and value: each member of a union has its own
    for problem in problems:
        if problem["type"] == "too_short" and problem["loc"] in deeper:
            continue  # only items without problems were counted
        if problem["type"] == "missing" and "tuple[" in str(problem["loc"][-2:-1]) and problem["loc"][:-2] in wrong:
            continue  # of the longer kind of item, where the shorter one is given
        place, message, value = _complaint(problem, model)
        told = complaints.setdefault((place, value), [])
        told += [message] if message not in told else []
    places: dict[str, list[str]] = {}  # by what is wrong there, which is told once
    for (place, value), (first, *others) in complaints.items():
        places.setdefault(" or ".join([first, *(other.lstrip(": ") for other in others)]) + value, []).append(place)
    sentences = [f"{_listed(where)}{wrong}" for wrong, where in places.items()]
    more = max(len(sentences) - MOST_PROBLEMS, 0) + max(many, 0)
    return "; ".join([*sentences[:MOST_PROBLEMS], *([f"and {more} more problems"] if more > 0 else [])])


def _listed(places: list[str]) -> str:
    """Places where the same is wrong; the same place of several items of a list is told once: casters 1 to 5."""
    grouped: dict[tuple[str, str], list[int]] = {}
    for place in places:
        head, number, tail = _NUMBERED.split(place, maxsplit=1) if _NUMBERED.search(place) else (place, "", "")
        grouped.setdefault((head, tail), []).extend([int(number)] if number else [])
    told = [
        f"{head}{'s' if len(numbers) > 1 else ''}{f' {_numbers(numbers)}' if numbers else ''}{tail}"
        for (head, tail), numbers in grouped.items()
    ]
    more = len(told) - MOST_PROBLEMS
    return ", ".join(told[:MOST_PROBLEMS]) + (f" and {more} more" if more > 0 else "")


_NUMBERED = re.compile(r"(?<=[a-z]) (\d+)(?=: )")  # of an item that is called by its kind


def _numbers(numbers: list[int]) -> str:
    """1; 1 and 3; 1 to 5: numbers that rise."""
    if len(numbers) > 2 and numbers == list(range(numbers[0], numbers[-1] + 1)):
        return f"{numbers[0]} to {numbers[-1]}"
    return " and ".join([", ".join(map(str, numbers[:-1])), str(numbers[-1])] if numbers[1:] else map(str, numbers))


def did_you_mean(name: object, known: Iterable[str], usual: Mapping[str, str] = MappingProxyType({})) -> str:
    """What others call so here, else the known name nearest to an unknown one, or all of them.

    usual: as `Frozen.usual_names`, a known name or words for each that others use.
    """
    names = sorted(known)
    if here := usual.get(str(name)):
        return f"it is called {here!r} here" if here in names else here
    near = difflib.get_close_matches(str(name), names, n=1, cutoff=0.5)
    return f"did you mean {near[0]!r}?" if near else f"known are {', '.join(names)}"


def _advice(key: str, models: Iterable[type[BaseModel]]) -> str:
    """What to write instead of a key that none of the models has."""
    usual = {name: here for model in models for name, here in getattr(model, "usual_names", {}).items()}
    return did_you_mean(key, {name for model in models for name in model.model_fields}, usual)


def _misread(given: Any, read: Any) -> Iterator[tuple[tuple[int | str, ...], Any, str]]:
    """Where something else was made a number or a truth value of, what it was, and what it should have been."""
    if isinstance(given, Mapping) and isinstance(read, Mapping):
        parts = [(key, given[key], value) for key, value in read.items() if key in given]
    elif isinstance(given, list | tuple) and isinstance(read, list | tuple):
        parts = [(i, *pair) for i, pair in enumerate(zip(given, read, strict=False))]
    else:
        parts = []
    for part, one, result in parts:
        yield from (((part, *below), it, kind) for below, it, kind in _misread(one, result))
    truth = isinstance(read, bool)
    if isinstance(read, int | float) and (isinstance(given, str) or isinstance(given, bool) != truth):
        yield (), given, "true or false" if truth else "a number"
    elif isinstance(read, float) and abs(read) > GREATEST:
        yield (), given, f"a number up to {GREATEST:g}"


def _complaint(problem: ErrorDetails, model: type[BaseModel]) -> tuple[str, str, str]:
    """Where a problem is, what is wrong there, and the value if that does not name it: three parts of a sentence."""
    kind, location, details = problem["type"], problem["loc"], problem.get("ctx", {})
    if kind == "extra_forbidden":
        place, key = _place(model, location[:-1]), str(location[-1])
        models = [one for one in place.members if _is_model(one)]
        return f"{place.around}unknown key {brief('.'.join((*place.keys, key)))}", f"; {_advice(key, models)}", ""
    where = str(_place(model, location))
    if kind == "missing" and isinstance(problem["input"], Sized) and isinstance(location[-1], int):  # of a short list
        place = _place(model, location[:-1])
        return str(place), f" should have {_lengths(place)} items, got {len(problem['input'])}", ""
    if kind == "missing":
        return where, " is missing", ""
    if kind == "union_tag_invalid":
        known = set(str(details["expected_tags"]).replace("'", "").split(", "))
        tag, discriminator = details["tag"], str(details["discriminator"]).strip("'")
        return where, f": unknown {discriminator} {brief(tag)}; {did_you_mean(tag, known)}", ""
    if kind == "union_tag_not_found":
        return where, f": {details['discriminator']} is missing", ""
    if kind in ("too_short", "too_long") and "actual_length" in details:
        bound = f"at least {details['min_length']}" if kind == "too_short" else f"at most {details['max_length']}"
        bound = _lengths(_place(model, location)) or bound
        items = "item" if bound.endswith(" 1") else "items"
        count = details["actual_length"]
        comma = "; decimals have a point, as 0.03" if kind == "too_long" and count == 2 * details["max_length"] else ""
        return where, f" should have {bound} {items}, got {count}{comma}", ""
    message = _PLAIN.get(kind, re.sub(r"^(Value error, |\w+ (?=should))", "", problem["msg"]))
    complete = (
        not location
        or "got " in message
        or message.startswith("there is no ")
        or isinstance(details.get("error"), ConfigurationError)
    )
    message = cut(message, _LONGEST_MESSAGE)
    joint = " " if message.startswith(("should", "must", "needs")) else ": "
    got = f", got {brief(problem['input'])}{_with_a_point(problem['input']) if 'a number' in message else ''}"
    return where, f"{joint if where else ''}{message}", "" if complete else got


def _with_a_point(value: Any) -> str:
    """What to write instead of a number with a decimal comma."""
    if not (isinstance(value, str) and (found := _DECIMAL_COMMA.fullmatch(value.strip()))):
        return ""
    whole, decimals = found.groups()
    thousands = f" or {whole}{decimals}" if len(decimals) == 3 and whole.lstrip("+-0") else ""
    return f": write {whole}.{decimals}{thousands}"


_DECIMAL_COMMA = re.compile(r"([-+]?\d+),(\d+(?:[eE][-+]?\d+)?)")


def _lengths(place: "_Place") -> str:
    """How many items a list there has, "2" or "2 or 3"; empty if it may have any number of them."""
    kinds = [get_args(one) for one in place.members if get_origin(one) is tuple]
    return " or ".join(sorted({str(len(one)) for one in kinds})) if all(Ellipsis not in one for one in kinds) else ""


_PLAIN = {  # for what pydantic says in terms of Python
    **dict.fromkeys(("model_type", "model_attributes_type", "dict_type"), "should be a mapping of keys to values"),
    **dict.fromkeys(("tuple_type", "list_type"), "should be a list"),
    "string_type": "should be text",
    **dict.fromkeys(("float_type", "float_parsing"), "should be a number"),
    **dict.fromkeys(("int_type", "int_parsing", "int_from_float"), "should be a whole number"),
}


class _Place(NamedTuple):
    """A place inside a model: the items of lists around it, the keys below the last of them, what may stand there."""

    around: str  # "caster 1: " or empty
    keys: tuple[str, ...]
    members: tuple[Any, ...]

    def __str__(self) -> str:
        return f"{self.around}{'.'.join(self.keys)!r}" if self.keys else self.around.removesuffix(": ")


def _place(model: type[BaseModel], location: tuple[int | str, ...]) -> _Place:
    """The place of a pydantic location, whose parts are keys, indices and names of members of unions."""
    here = _Place("", (), (model,))
    for part in location:
        if isinstance(part, int):
            here = _item(here, part + 1)
            continue
        models = [one for one in here.members if _is_model(one)]
        fields = [one.model_fields[part].annotation for one in models if part in one.model_fields]
        values = [get_args(one)[-1] for one in here.members if get_origin(one) is dict]
        if fields or values:
            here = _Place(here.around, (*here.keys, part), _members(*fields, *values))
        else:
            named = tuple(one for one in models if _goes_by(one, part))
            here = here._replace(members=named or here.members)
    return here


def _item(place: _Place, number: int) -> _Place:
    """An item of the list at a place, called by its kind if the list is: caster 1 of casters."""
    members = _members(*(kind for one in place.members for kind in get_args(one) if kind is not Ellipsis))
    name = ".".join(place.keys)
    nouns = {re.sub(r"(?<=[a-z])(?=[A-Z])", "-", one.__name__).lower() for one in members if _is_model(one)}
    if not place.keys:
        *outer, inner = place.around.removesuffix(": ").rsplit(": ", 1)  # a list in a list
        around = f"{': '.join([*outer, f'number {number} of {inner}'])}: "
    elif {place.keys[-1]} == {f"{noun.replace('-', '_')}s" for noun in nouns}:
        above = "".join(f"{key}: " for key in place.keys[:-1])
        around = f"{place.around}{above}{nouns.pop()} {number}: "
    else:
        around = f"{place.around}number {number} of {name!r}: "
    return _Place(around, (), members)


def _members(*annotations: Any) -> tuple[Any, ...]:
    """The types that annotations allow, their unions and metadata unfolded; of a model, its kinds too."""
    members: list[Any] = []
    for annotation in annotations:
        if get_origin(annotation) is Annotated:
            members += _members(get_args(annotation)[0])
        elif get_origin(annotation) in (Union, UnionType):
            members += _members(*get_args(annotation))
        else:
            members += [annotation, *(annotation.__subclasses__() if _is_model(annotation) else ())]
    return tuple(members)


def _is_model(annotation: Any) -> bool:
    return isinstance(annotation, type) and issubclass(annotation, BaseModel)


def _goes_by(model: type[BaseModel], name: str) -> bool:
    """Is a member of a union known by this name, that of its class or the default of its discriminator?"""
    return model.__name__ == name or any(
        field.default == name or (get_origin(field.annotation) is Literal and name in get_args(field.annotation))
        for field in model.model_fields.values()
    )
