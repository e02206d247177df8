"""plain_yaml: data as YAML has it, by PyYAML's own reader; what else YAML knows, and what has no bound, is refused."""

import math
from pathlib import Path

import pytest
import yaml

from caster_gym import plain_yaml
from caster_gym.plain_yaml import YamlError, read_plain_yaml

PARSERS = [yaml.SafeLoader, *([yaml.CSafeLoader] if yaml.__with_libyaml__ else [])]
FILES = sorted((Path(__file__).parents[1] / "configs").rglob("*.yaml"))


@pytest.mark.parametrize(
    "text",
    [
        "",
        "~",
        "a: b",
        "- 1\n- {x: y, z: [1.5, -2, +3]}\n- ~",
        "[yes, No, on, OFF, true, null, Null, '', 'yes', \"1\"]",
        "[0b101, 0x1F, 017, 08, 1_000, -5, +7, 1., 1.5e+3, .5, -0.5e-3, 0.0, -0, 0o17, -, --, 1-2, 1.2.3, .inf, -.INF]",
        "a: |\n  b\n  c\nd: >\n  e\n  f\n",
        "!!str 5",
        "{a: !!float 1.5, b: !!int 3, c: !!map {d: e}, f: !!seq [g], h: !!null '', i: ! 5}",
        "a: &a {x: 1, y: [2]}\nb: *a\nc: {<<: *a, x: 3, z: 4}\nd: {<<: [{x: 5}, *a], w: 6}",
        "'<<': 1",
        "🛞: ½ … \u00a0",
    ],
)
@pytest.mark.parametrize("parser", PARSERS, ids=lambda parser: parser.__name__)
def test_data_are_read_as_the_safe_loader_reads_them(monkeypatch, parser, text):
    """With libyaml, and with PyYAML built without it."""
    monkeypatch.setattr(plain_yaml, "_PARSER", parser)
    assert read_plain_yaml(text) == yaml.safe_load(text)


@pytest.mark.parametrize("file", FILES, ids=lambda file: f"{file.parent.name}/{file.stem}")
def test_the_files_of_the_package_are_read_as_the_safe_loader_reads_them(file):
    """But for numbers with exponents, of which it reads some as text."""

    def same(ours, theirs):
        if isinstance(theirs, dict):
            return ours.keys() == theirs.keys() and all(same(ours[key], theirs[key]) for key in theirs)
        if isinstance(theirs, list):
            return len(ours) == len(theirs) and all(map(same, ours, theirs))
        return ours == theirs or (isinstance(ours, float) and ours == float(theirs))

    text = file.read_text(encoding="utf-8")
    assert same(read_plain_yaml(text), yaml.safe_load(text))


def test_dates_and_times_stay_text_and_nan_is_a_number():
    assert read_plain_yaml("[2001-02-03, 1:30, 12:30:45]") == ["2001-02-03", "1:30", "12:30:45"]
    assert math.isnan(read_plain_yaml(".nan"))


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("a: 1\nb: 2\na: 3", "the key 'a' stands twice at line 3, column 1"),
        ("1: 2", "a key must be text, got 1"),
        ("{trail: 0,03, radius: 1}", "decimals have a point: write 0.03 at line 1, column 11"),
        ("{x: -2,5e-3}", "decimals have a point: write -2.5e-3"),
        ("{x: 0, 3: y}", "a key must be text, got 3"),
        ("{x: y,3}", "a key must be text, got 3"),
        ("[a]: 2", "a key must be text, got a list"),
        ("~: 2", "a key must be text, got nothing"),
        ("a: !!python/object/apply:os.getcwd []", "the tag .*os.getcwd' is not read: files hold data alone"),
        ("!!binary aGVsbG8=", "the tag .*binary' is not read"),
        ("!!set {a, b}", "the tag .*set' is not read"),
        ("!!timestamp 2001-02-03", "the tag .*timestamp' is not read"),
        ("!!int word", "the tag .*int' does not fit 'word'"),
        ("!!map [1]", "the tag .*map' does not fit a list"),
        ("a: {<<: 3}", "only mappings can be merged"),
        ("a: *b", "the alias 'b' stands for nothing complete before it"),
        ("&a [*a]", "the alias 'a' stands for nothing complete before it"),
        ("---\na: 1\n---\nb: 2", "a second document begins at line 3"),
        ("a: [1, 2", r"at line \d, column \d"),
        ("a: \x07", "control characters"),
        ("\udc80", "surrogates"),
    ],
)
def test_what_is_no_data_is_refused(text, said):
    with pytest.raises(YamlError, match=said):
        read_plain_yaml(text)


def test_what_aliases_stand_for_is_counted(monkeypatch):
    """Three aliases of a list of three numbers, in a list: 1 + 4 + 3 · 4 values."""
    text = "[&a [1, 2, 3], *a, *a, *a]"
    monkeypatch.setattr(plain_yaml, "MOST_VALUES", 17)
    assert read_plain_yaml(text) == 4 * [[1, 2, 3]]
    monkeypatch.setattr(plain_yaml, "MOST_VALUES", 16)
    with pytest.raises(YamlError, match="it stands for more than 16 values at line 1, column 24"):
        read_plain_yaml(text)


def test_depth_is_bounded():
    deepest = plain_yaml.DEEPEST
    assert read_plain_yaml("[" * deepest + "]" * deepest)
    with pytest.raises(YamlError, match=f"more than {deepest} lists and mappings stand in one another"):
        read_plain_yaml("[" * (deepest + 1) + "]" * (deepest + 1))


@pytest.mark.parametrize("digits", ["1{}", "1.{}", "0x{}"])
def test_digits_are_bounded(digits):
    read_plain_yaml(digits.format("0" * (plain_yaml.LONGEST_NUMBER - 2)))
    with pytest.raises(YamlError, match=f"a number of .* at most {plain_yaml.LONGEST_NUMBER} are read"):
        read_plain_yaml(digits.format("0" * plain_yaml.LONGEST_NUMBER))


def test_text_is_bounded():
    longest = plain_yaml.LONGEST_TEXT
    assert read_plain_yaml("a" * longest) == "a" * longest
    with pytest.raises(YamlError, match=f"at most {longest} are read"):
        read_plain_yaml("a" * (longest + 1))
