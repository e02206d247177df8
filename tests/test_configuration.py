"""YAML files and typed models: numbers are numbers, a key stands once, an error says what, where and what instead."""

from typing import Annotated

import pytest
from pydantic import Field, PositiveFloat, ValidationError

from caster_gym.configuration import ConfigurationError, Frozen, parse, read_yaml


class Gain(Frozen):
    proportional: PositiveFloat
    derivative: float = 0.0


class Controller(Frozen):
    name: str
    gain: Gain
    axes: Annotated[tuple[Gain, ...], Field(max_length=3)] = ()


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
    assert isinstance(caught.value, ValueError)


def test_parameters_never_change():
    gain = Gain(proportional=1.0)
    with pytest.raises(ValidationError, match="frozen"):
        gain.proportional = 2.0
    assert hash(gain) == hash(Gain(proportional=1.0))
