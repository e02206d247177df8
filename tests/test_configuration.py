"""YAML files and typed models: numbers are numbers, a key stands once, an error says what, where and what instead."""

import re
from pathlib import Path
from typing import Annotated, Literal, Self

import pytest
from pydantic import Field, PositiveFloat, PositiveInt, ValidationError, model_validator

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError, Frozen, Positive, is_yaml, parse, parse_yaml, read_yaml


class Gain(Frozen):
    proportional: PositiveFloat
    derivative: float = 0.0


class Controller(Frozen):
    name: str
    gain: Gain
    axes: Annotated[tuple[Gain, ...], Field(max_length=3)] = ()


class Wall(Frozen):
    kind: Literal["wall"] = "wall"
    length: PositiveFloat = 1.0
    ends: tuple[float, float] = (0.0, 0.0)


class Pillar(Frozen):
    kind: Literal["pillar"] = "pillar"
    radius: PositiveFloat = 1.0


class World(Frozen):
    """One field of each sort that messages and numbers depend on."""

    walls: Annotated[tuple[Wall, ...], Field(min_length=1)] = (Wall(),)
    first: Annotated[Wall | Pillar, Field(discriminator="kind")] = Wall()
    things: tuple[Annotated[Wall | Pillar, Field(discriminator="kind")], ...] = ()
    grid: tuple[tuple[PositiveFloat, ...], ...] = ()
    size: PositiveFloat | Literal["any"] = "any"
    count: PositiveInt = 1
    open: bool = False
    weights: dict[str, float] = Field(default_factory=dict)
    file: Path = Path("world.csv")

    @model_validator(mode="after")
    def _agrees(self) -> Self:
        if self.count == 13:
            raise ValueError("count and walls must agree")
        if self.count == 14:
            raise ValueError("count must not be 14, got 14 walls")
        return self


def complaint(**content):
    """What is said about a world."""
    with pytest.raises(ConfigurationError) as caught:
        parse(World, content, "world")
    return str(caught.value).removeprefix("world: ")


def write(folder, text):
    path = folder / "controller.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def load(folder, text):
    path = write(folder, text)
    return parse(Controller, read_yaml(path), str(path))


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("3e-4", 3e-4),
        ("1e6", 1e6),
        ("-2E3", -2e3),
        ("+1.5e+2", 150.0),
        (".5e1", 5.0),
        ("7.e-1", 0.7),
        ("2", 2),
        ("0.25", 0.25),
    ],
)
def test_exponents_make_numbers_with_or_without_a_point(tmp_path, text, number):
    value = read_yaml(write(tmp_path, f"rate: {text}"))["rate"]
    assert not isinstance(value, str)
    assert value == number


@pytest.mark.parametrize("text", ["e4", "1e", "1e5m", "'3e-4'", "v1e5", "1e-"])
def test_words_stay_words(tmp_path, text):
    assert read_yaml(write(tmp_path, f"rate: {text}"))["rate"] == text.strip("'")


def test_anchors_and_merges_fill_what_a_mapping_does_not_say(tmp_path):
    content = read_yaml(write(tmp_path, "a: &a {x: 1, y: {z: 2}}\nb: {<<: *a, x: 3}"))
    assert content["b"] == {"x": 3, "y": {"z": 2}}


@pytest.mark.parametrize(
    "text", ["gain: 1\nname: a\ngain: 2", "outer:\n  gain: 1\n  gain: 1", "list: [{gain: 1, gain: 2}]"]
)
def test_key_that_stands_twice_is_refused_with_its_line(tmp_path, text):
    with pytest.raises(ConfigurationError, match=r"controller\.yaml.*'gain' stands twice(.|\n)*line \d"):
        read_yaml(write(tmp_path, text))


@pytest.mark.parametrize("text", ["", "- 1\n- 2", "word"])
def test_file_must_hold_a_mapping(tmp_path, text):
    with pytest.raises(ConfigurationError, match=r"controller\.yaml must hold a mapping"):
        read_yaml(write(tmp_path, text))


@pytest.mark.parametrize("text", ["a: [1, 2", "a: b: c", "a: !!python/object/apply:os.getcwd []"])
def test_what_is_not_plain_yaml_is_refused(tmp_path, text):
    with pytest.raises(ConfigurationError, match=r"controller\.yaml cannot be read as YAML"):
        read_yaml(write(tmp_path, text))


def test_bytes_that_are_no_text_are_refused(tmp_path):
    path = tmp_path / "controller.yaml"
    path.write_bytes(b"name: \xff\xfe\n")
    with pytest.raises(ConfigurationError, match=r"controller\.yaml cannot be read"):
        read_yaml(path)


def test_missing_file_is_named(tmp_path):
    with pytest.raises(ConfigurationError, match=r"no file .*nowhere\.yaml"):
        read_yaml(tmp_path / "nowhere.yaml")


def test_good_file_becomes_the_model(tmp_path):
    controller = load(tmp_path, "name: a\ngain: {proportional: 2e1}\naxes: [{proportional: 1, derivative: -1}]")
    assert controller == Controller(
        name="a", gain=Gain(proportional=20.0), axes=(Gain(proportional=1.0, derivative=-1.0),)
    )


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("name: a\ngain: {proportional: -2}", ["gain.proportional", "greater than 0", "-2"]),
        ("name: a\ngain: {proportional: .nan}", ["gain.proportional", "finite", "nan"]),
        ("name: a\ngain: {proportional: 1, derivative: .inf}", ["gain.derivative", "finite", "inf"]),
        ("name: a\ngain: {proportional: fast}", ["gain.proportional", "number", "'fast'"]),
        ("name: a\ngain: 3", ["gain", "3"]),
        ("gain: {proportional: 1}", ["name", "missing"]),
        ("name: a\ngain: {proportional: 1}\ngian: 2", ["unknown key 'gian'", "'gain'"]),
        ("name: a\ngain: {proportional: 1, derivativ: 2}", ["unknown key 'gain.derivativ'", "'derivative'"]),
        ("name: a\ngain: {proportional: 1, xyz: 2}", ["gain.xyz", "derivative, proportional"]),
        ("name: a\ngain: {proportional: 1}\naxes: [{proportional: 1, derivate: 0}]", ["derivate", "'derivative'"]),
    ],
)
def test_error_names_file_key_value_and_what_would_be_right(tmp_path, text, said):
    with pytest.raises(ConfigurationError) as caught:
        load(tmp_path, text)
    for words in ["controller.yaml", *said]:
        assert words in str(caught.value)


def test_all_errors_are_told_at_once(tmp_path):
    with pytest.raises(ConfigurationError, match=r"name.*gain\.proportional") as caught:
        load(tmp_path, "gain: {proportional: -1}")
    assert (
        complaint(cuont=1, fil="x")
        == "unknown key 'cuont'; did you mean 'count'?; unknown key 'fil'; did you mean 'file'?"
    )
    assert isinstance(caught.value, ValueError)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"walls": [{}, {"length": -1}]}, "wall 2: 'length' should be greater than 0, got -1"),
        ({"walls": [{"ends": [0, "b"]}]}, "wall 1: number 2 of 'ends' should be a number, got 'b'"),
        ({"walls": [{"ends": [0]}]}, "wall 1: 'ends' should have 2 items, got 1"),
        ({"walls": [{"ends": [0, 1, 2]}]}, "wall 1: 'ends' should have 2 items, got 3"),
        (
            {"walls": [{"ends": [0, 1, 0, 3]}]},
            "wall 1: 'ends' should have 2 items, got 4; decimals have a point, as 0.03",
        ),
        ({"walls": [{"ends": [0]}] * 2}, "walls 1 and 2: 'ends' should have 2 items, got 1"),
        (
            {"walls": [{"ends": [0]}] * 3 + [{}, {"ends": [0]}]},
            "walls 1, 2, 3 and 5: 'ends' should have 2 items, got 1",
        ),
        ({"walls": [{"length": 0}] * 200}, "walls 1 to 200: 'length' should be greater than 0, got 0"),
        ({"walls": []}, "'walls' should have at least 1 item, got 0"),
        ({"walls": [3]}, "wall 1 should be a mapping of keys to values, got 3"),
        ({"walls": 3}, "'walls' should be a list, got 3"),
        ({"things": [{"kind": "wall"}, {"kind": "pillar", "radius": 0}]}, "number 2 of 'things': 'radius' should be"),
        ({"grid": [[1], [1, -1]]}, "number 2 of number 2 of 'grid' should be greater than 0, got -1"),
        ({"weights": {"speed": "high"}}, "'weights.speed' should be a number, got 'high'"),
        ({"weights": {"speed": "0,03"}}, "'weights.speed' should be a number, got '0,03': write 0.03"),
        ({"weights": {"speed": "-1,250"}}, "'weights.speed' should be a number, got '-1,250': write -1.250 or -1250"),
        ({"count": 1.5}, "'count' should be a whole number, got 1.5"),
    ],
)
def test_items_count_from_one_and_are_called_by_their_kind(content, said):
    assert complaint(**content).startswith(said)


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"first": {"kind": "wall", "lenght": 1}}, "unknown key 'first.lenght'; did you mean 'length'?"),
        ({"first": {"kind": "pillar", "lenght": 1}}, "unknown key 'first.lenght'; known are kind, radius"),
        (
            {"things": [{"kind": "pillar", "radios": 1}]},
            "number 1 of 'things': unknown key 'radios'; did you mean 'radius'?",
        ),
        ({"first": {"kind": "pilar"}}, "'first': unknown kind 'pilar'; did you mean 'pillar'?"),
        ({"first": {"radius": 1}}, "'first': 'kind' is missing"),
        ({"size": "some"}, "'size' should be a number or should be 'any', got 'some'"),
    ],
)
def test_members_of_a_union_are_told_apart(content, said):
    assert complaint(**content) == said


def test_items_with_problems_are_not_counted_as_missing():
    assert complaint(walls=[{"length": 0}]) == "wall 1: 'length' should be greater than 0, got 0"


def test_problem_of_the_whole_is_told_without_all_of_its_content():
    assert complaint(count=13) == "count and walls must agree"
    assert complaint(count=14) == "count must not be 14, got 14 walls"


def test_long_values_are_cut():
    said = complaint(count=list(range(100)))
    assert said.startswith("'count' should be a whole number, got [0, 1, 2, 3")
    assert said.endswith("7, ...]")
    assert len(said) < 130


@pytest.mark.parametrize(
    ("content", "said"),
    [
        ({"count": True}, "'count' should be a number, got True"),
        ({"count": "5"}, "'count' should be a number, got '5'"),
        ({"size": "5"}, "'size' should be a number, got '5'"),
        ({"grid": [[1], [2, True]]}, "number 2 of number 2 of 'grid' should be a number, got True"),
        ({"walls": [{"length": "5"}]}, "wall 1: 'length' should be a number, got '5'"),
        ({"first": {"kind": "pillar", "radius": True}}, "'first.radius' should be a number, got True"),
        ({"weights": {"speed": False}}, "'weights.speed' should be a number, got False"),
        ({"open": 1}, "'open' should be true or false, got 1"),
        ({"open": "yes"}, "'open' should be true or false, got 'yes'"),
    ],
)
def test_words_and_truth_values_are_no_numbers(content, said):
    assert complaint(**content) == said


def test_what_yaml_and_python_write_differently_is_accepted():
    world = parse(
        World,
        {"count": 1e3, "size": 2, "grid": [[1, 2.5]], "open": True, "file": "a.csv", "weights": {"a": 1}},
        "world",
    )
    assert world == World(count=1000, size=2.0, grid=((1.0, 2.5),), open=True, file=Path("a.csv"), weights={"a": 1.0})


def test_parameters_never_change():
    gain = Gain(proportional=1.0)
    with pytest.raises(ValidationError, match="frozen"):
        gain.proportional = 2.0
    assert hash(gain) == hash(Gain(proportional=1.0))


def test_an_alias_bomb_is_refused_in_a_short_sentence(tmp_path):
    """Ten thousand million values in a few hundred bytes: the message must not write them out."""
    lines = ["a0: &a0 [x, x, x, x, x, x, x, x, x, x]"]
    lines += [f"a{i}: &a{i} [{', '.join([f'*a{i - 1}'] * 10)}]" for i in range(1, 10)]
    path = tmp_path / "bomb.yaml"
    path.write_text("\n".join([*lines, "name: *a9"]), encoding="utf-8")
    with pytest.raises(ConfigurationError) as error:
        load_robot(path)
    assert len(str(error.value)) < 5000


@pytest.mark.parametrize("text", ["? [a]\n: 1", "[" * 3000, "x: !!float abc", "x: !!timestamp 2020-99-99"])
def test_whatever_yaml_cannot_read_is_told_with_its_source(text):
    with pytest.raises(ConfigurationError, match="the source cannot be read as YAML"):
        parse_yaml(text, "the source")


@pytest.mark.parametrize(
    ("name", "yes"), [("a.yaml", True), ("A.YML", True), (Path("b/c.Yaml"), True), ("yaml", False)]
)
def test_yaml_files_are_known_by_their_suffix_in_any_case(name, yes):
    assert is_yaml(name) is yes


@pytest.mark.parametrize("number", [1e308, -1e16, 10**20])
def test_numbers_that_nothing_can_be_computed_with_are_refused(number):
    """Their squares and cubes are infinite."""
    assert complaint(grid=[[1.0]], weights={"a": number}) == f"'weights.a' should be a number up to 1e+15, got {number}"
    World.model_validate({"weights": {"a": 1e15, "b": -1e15, "c": 1e-300}})


def test_positive_numbers_are_not_so_small_that_nothing_can_be_computed_with_them():
    class Disc(Frozen):
        radius: Positive

    assert Disc(radius=1e-12).radius == 1e-12
    with pytest.raises(ValidationError, match=r"must be at least 1e-12, got 1e-302"):
        Disc(radius=1e-302)
    with pytest.raises(ValidationError, match="greater than 0"):
        Disc(radius=-1.0)


def test_checks_that_cannot_compute_say_so():
    class Ratio(Frozen):
        over: float

        @model_validator(mode="after")
        def _is_small(self) -> Self:
            assert 1.0 / self.over < 1e9
            return self

    with pytest.raises(ConfigurationError, match=r"^a: nothing can be computed with its numbers: .*division by zero"):
        parse(Ratio, {"over": 0.0}, "a")


def test_of_many_problems_the_first_are_told_and_the_rest_counted():
    told = complaint(**{f"key_{i:04}": 1 for i in range(1000)})
    assert told.startswith("unknown key 'key_0000', ")
    assert re.search(r"'key_0007' and 192 more; known are .*; and 800 more problems$", told)
    told = complaint(things=[{"kind": "pillar", "radius": -1.0}] * 50)
    assert "greater than 0" in told
    assert "and 42 more" in told


def test_long_lists_are_refused_before_their_items_are_looked_at():
    longest = Frozen.longest_list
    assert complaint(grid=[[1.0]] * (longest + 1)) == f"'grid' has {longest + 1} items, at most {longest} are read"
    assert complaint(weights={str(k): "a" for k in range(longest + 1)}).startswith("'weights' has 1001 items")
    assert len(World.model_validate({"grid": [[1.0]] * longest}).grid) == longest


def test_long_names_and_values_are_cut():
    assert len(complaint(**{"k" * 5000: 1})) < 300
    assert len(complaint(first={"kind": "k" * 5000})) < 300
    assert len(complaint(size="k" * 5000)) < 300
