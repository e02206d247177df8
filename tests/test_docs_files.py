"""docs/files.md: every example on the page is read, and becomes what its table says."""

import re
from pathlib import Path

import pytest

from caster_gym.paths import read_paths
from caster_gym.paths.files import POINT, TIME
from caster_gym.paths.splines import Spline
from caster_gym.paths.timed import Timed
from caster_gym.units import UNITS, read_unit

PAGE = (Path(__file__).parents[1] / "docs" / "files.md").read_text(encoding="utf-8")
EXAMPLES = dict(re.findall(r"^```\w+ (\S+\.\w+)\n(.*?)^```", PAGE, re.M | re.S))
PROMISED = re.findall(r"^\| `(\S+\.\w+)` \| .* \| `(\w+)` \| (\d+) (?:waypoints|poses) \|$", PAGE, re.M)


def test_the_table_names_every_example_and_no_other():
    assert [name for name, _, _ in PROMISED] == list(dict.fromkeys(name for name, _, _ in PROMISED))
    assert {name for name, _, _ in PROMISED} == set(EXAMPLES)


@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
@pytest.mark.parametrize(("name", "shape", "count"), PROMISED)
def test_every_example_is_read_as_promised(tmp_path, name, shape, count):
    for file, text in EXAMPLES.items():
        (tmp_path / file).write_text(text, encoding="utf-8")
    (path,) = read_paths(tmp_path / name)
    assert isinstance(path, Spline | Timed) and path.shape == shape
    assert len(path.waypoints if isinstance(path, Spline) else path.poses) == int(count)
    assert path.trajectories(0.02)


def test_the_units_of_the_page_are_those_that_are_read():
    rows = re.findall(r"^\| (time|length|angle|velocity|rate of an angle|torque) \| (.*) \|$", PAGE, re.M)
    kinds = {"rate of an angle": "rate"}
    assert len(rows) == 6
    for quantity, listed in rows:
        kind = kinds.get(quantity, quantity)
        main = [re.sub(r" \(.*\)", "", one) for one in re.split(r", (?![^(]*\))", listed)]
        assert main == list(UNITS[kind])
        for other in re.findall(r"[^,()]+", " ".join(re.findall(r"\(.*?\)", listed))):
            assert not other.strip() or read_unit(other, kind)


def test_the_names_of_the_page_are_those_that_are_read():
    times = re.findall(r"^\| `time` \| (.*) \|$", PAGE, re.M)[0]
    points = re.findall(r"^\| `x`, `y` \| (.*?);", PAGE, re.M)[0]
    assert {name.strip("` ").replace(".", "_") for name in times.split(",")} <= set(TIME.names)
    assert {name.strip() for name in points.split(",")} <= set(POINT["x"].names)


def test_the_code_of_the_page_runs():
    (code,) = re.findall(r"^```python\n(.*?)^```", PAGE, re.M | re.S)
    exec(compile(code, "docs/files.md", "exec"), {})
