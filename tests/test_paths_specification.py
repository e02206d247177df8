"""caster_gym.paths.specification: reading paths, and building all of them for a robot."""

import subprocess
import sys

import numpy as np
import pytest
import yaml
from pydantic import TypeAdapter

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.paths import COLUMNS, PathSpecification, build_trajectories, read_paths
from caster_gym.paths.headings import Spinning
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, Ellipse
from caster_gym.paths.splines import Spline

ROBOT = load_robot("chung2008")
SHAPES = ("circle", "ellipse", "lemniscate", "rounded_square", "random_paths")


@pytest.mark.parametrize("shape", SHAPES)
def test_a_name_alone_means_the_shape_with_its_defaults(shape):
    (path,) = read_paths(shape)
    assert path == read_paths({"shape": shape})[0] == read_paths(path)[0]
    assert path.shape == shape


def test_sequences_keep_their_order_and_may_be_nested():
    mixed = ["ellipse", {"shape": "circle", "radius": 2.0}, (Circle(), ["random_paths"])]
    assert read_paths(mixed) == (Ellipse(), Circle(radius=2.0), Circle(), RandomPaths())


def test_a_path_can_be_a_yaml_file(tmp_path):
    file = tmp_path / "path.yaml"
    file.write_text("{shape: circle, radius: 1.5e0, heading: {kind: spinning, turns: 2}}", encoding="utf-8")
    assert read_paths(str(file)) == (Circle(radius=1.5, heading=Spinning(turns=2.0)),)


def test_a_path_can_be_a_csv_file_of_waypoints(tmp_path):
    file = tmp_path / "path.csv"
    file.write_text("x,y\n0,0\n1,1\n", encoding="utf-8")
    assert read_paths(str(file)) == (Spline(waypoints=((0.0, 0.0), (1.0, 1.0))),)


@pytest.mark.parametrize("shape", SHAPES)
def test_specifications_are_hashable_and_survive_a_dump(shape):
    (path,) = read_paths(shape)
    assert len({path, read_paths(shape)[0]}) == 1
    assert read_paths(path.model_dump(mode="json")) == (path,)


def test_specification_is_a_type_for_models_of_others():
    read = TypeAdapter(PathSpecification).validate_python({"shape": "ellipse", "semi_axes": [2, 1]})
    assert read == Ellipse(semi_axes=(2.0, 1.0))
    assert hash(read) == hash(Ellipse(semi_axes=(2.0, 1.0)))


@pytest.mark.parametrize(
    ("path", "message"),
    [
        ("cirle", "unknown shape 'cirle'; did you mean 'circle'"),
        ({"shape": "rounded_sqare"}, "unknown shape 'rounded_sqare'; did you mean 'rounded_square'"),
        ({"radius": 1.0}, "'shape' is missing; known are circle, ellipse"),
        ({"shape": ["circle"]}, "unknown shape"),
        ({"shape": "circle", "raduis": 1.0}, "path 'circle': unknown key 'raduis'; did you mean 'radius'"),
        ({"shape": "random_paths", "max_sped": 1.0}, "unknown key 'max_sped'; did you mean 'max_speed'"),
        ({"shape": "circle", "radius": -1.0}, "'radius' should be greater than 0, got -1"),
        ({"shape": "circle", "radius": float("nan")}, "'radius' should be a finite number, got nan"),
        ({"shape": "circle", "heading": "tangnt"}, "unknown kind 'tangnt'; did you mean 'tangent'"),
        ("spline", "'waypoints' is missing"),
        ("timed", "'poses' is missing"),
        ("nowhere.csv", r"there is no file 'nowhere\.csv'"),
        ("nowhere.yaml", r"there is no file 'nowhere\.yaml'"),
        ([], "at least one path is needed, got none"),
        (
            ["circle", 3],
            "a path is a name, a file, a mapping, a Trajectory, a list of points or a sequence of these, got 3",
        ),
    ],
)
def test_what_is_no_path_is_refused_by_name(path, message):
    with pytest.raises(ConfigurationError, match=message):
        read_paths(path)


def test_all_paths_are_built_at_the_same_time_step():
    built = build_trajectories(["circle", {"shape": "random_paths", "count": 3}, "ellipse"], ROBOT, 0.02)
    assert [t.name for t in built] == ["circle", "random_paths 0", "random_paths 1", "random_paths 2", "ellipse"]
    assert {t.time_step for t in built} == {0.02}
    assert [t.samples.shape for t in built] == [(501, len(COLUMNS))] * 4 + [(601, len(COLUMNS))]


def test_every_trajectory_has_a_name_of_its_own():
    built = build_trajectories(["circle", {"shape": "circle", "radius": 0.8}, "ellipse", "circle"], ROBOT, 0.02)
    assert [t.name for t in built] == ["circle", "circle (2)", "ellipse", "circle (3)"]
    assert np.allclose(built[1].samples[0, 0], 0.8)


@pytest.mark.parametrize("laps", [0, 1001, 10**9, 10**30])
def test_absurd_laps_are_refused_before_anything_is_built(laps):
    with pytest.raises(ValueError, match=r"path 'circle': 'laps' should be (less|greater) than .*got "):
        build_trajectories({"shape": "circle", "laps": laps}, ROBOT, 0.02)


def test_errors_of_building_name_the_path():
    with pytest.raises(ValueError, match=r"path 'circle': a duration of 0\.1 s is 5 time steps"):
        build_trajectories({"shape": "circle", "duration": 0.1}, ROBOT, 0.02)
    with pytest.raises(ValueError, match=r"path 'circle' .* a duration of at least .* would suffice"):
        build_trajectories({"shape": "circle", "duration": 1.0}, ROBOT, 0.02)


def test_importing_paths_leaves_scipy_alone():
    command = "import sys, caster_gym.paths; print('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command], capture_output=True, text=True).stdout.strip() == "False"


@pytest.mark.parametrize(("name", "said"), [("n" * 300, "it is too long"), ("a\0b", "it holds a zero byte")])
def test_a_file_that_names_what_cannot_be_a_file_is_named_too(tmp_path, name, said):
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump({"shape": "spline", "file": name}), encoding="utf-8")
    with pytest.raises(ConfigurationError, match=rf"mine\.yaml: 'file': .* is no name of a file: {said}"):
        read_paths(file)
