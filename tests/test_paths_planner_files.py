"""caster_gym.paths.planner_files: WPILib, Choreo and PathPlanner. The layouts are those of their published examples."""

import json

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.configuration import ConfigurationError
from caster_gym.paths import planner_files, read_paths
from caster_gym.paths.planner_files import read_planner_file
from caster_gym.paths.splines import Spline
from caster_gym.paths.timed import Timed
from caster_gym.tables import TableNote

TIMES = np.linspace(0.0, 2.0, 21)
WPILIB = [
    {
        "acceleration": 0.0,
        "curvature": 0.0,
        "pose": {"rotation": {"radians": 0.25 * t}, "translation": {"x": 1.0 + t, "y": 2.0 * t}},
        "time": t,
        "velocity": 1.0,
    }
    for t in TIMES
]
SAMPLES = [{"t": t, "x": 1.0 + t, "y": 2.0 * t, "heading": 0.25 * t, "vx": 1.0, "fx": [0.0] * 4} for t in TIMES]
CHOREO = {
    "name": "drive",
    "version": 2,
    "snapshot": {"waypoints": [{"x": 0.0, "y": 0.0, "heading": 0.0}]},
    "trajectory": {"sampleType": "Swerve", "waypoints": [0.0, 2.0], "samples": SAMPLES},
}
OLD_CHOREO = {
    "samples": [
        {"timestamp": t, "x": 1.0 + t, "y": 2.0 * t, "heading": 0.25 * t, "velocityX": 1.0, "angularVelocity": 0.25}
        for t in TIMES
    ]
}


def anchor(x, y, before, after):
    point = [None if c is None else {"x": c[0], "y": c[1]} for c in ((x, y), before, after)]
    return {"anchor": point[0], "prevControl": point[1], "nextControl": point[2], "isLocked": False, "linkedName": None}


def path_planner(**changes):
    return {
        "version": "2025.0",
        "waypoints": [
            anchor(0.0, 0.0, None, (1.0, 0.0)),
            anchor(3.0, 0.0, (2.0, 0.0), (4.0, 0.0)),
            anchor(5.0, 2.0, (5.0, 1.0), None),
        ],
        "rotationTargets": [],
        "globalConstraints": {"maxVelocity": 3.0},
        "goalEndState": {"velocity": 0, "rotation": 90.0},
        "idealStartingState": {"velocity": 0, "rotation": 0.0},
        **changes,
    }


def read(folder, name, content):
    (folder / name).write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
    return read_paths(folder / name)[0]


@pytest.mark.parametrize(
    ("name", "content"),
    [
        ("a.wpilib.json", WPILIB),
        ("a.traj", CHOREO),
        ("a.traj", OLD_CHOREO),
        ("a.json", {"states": WPILIB}),
    ],
)
def test_trajectories_of_planners_keep_their_times_and_poses(tmp_path, name, content):
    path = read(tmp_path, name, content)
    assert path.shape == "timed"
    assert_allclose(path.poses, np.column_stack([TIMES, 1.0 + TIMES, 2.0 * TIMES, 0.25 * TIMES]), atol=1e-15)
    (trajectory,) = path.trajectories(0.02)
    t = 0.02 * np.arange(101)
    assert_allclose(trajectory.samples[:, :2], np.column_stack([1.0 + t, 2.0 * t]), atol=1e-12)


def test_headings_of_a_trajectory_may_be_wrapped(tmp_path):
    wrapped = [{**sample, "heading": float(np.angle(np.exp(1j * (3.0 + 0.25 * sample["t"]))))} for sample in SAMPLES]
    path = read(tmp_path, "a.traj", {"trajectory": {"samples": wrapped}})
    assert_allclose([pose[3] for pose in path.poses], 3.0 + 0.25 * TIMES, atol=1e-12)


def test_the_robot_s_rotation_of_path_planner_s_trajectories_counts_in_degrees(tmp_path):
    states = [{**state, "holonomicRotation": 45.0} for state in WPILIB]
    assert {pose[3] for pose in read(tmp_path, "a.json", states).poses} == {np.pi / 4.0}


def test_a_path_of_path_planner_follows_its_bezier_curves(tmp_path):
    """The middle of a cubic Bézier curve is (p0 + 3 p1 + 3 p2 + p3) / 8."""
    path = read(tmp_path, "a.path", path_planner())
    points = np.array(path.waypoints)
    assert path.shape == "spline"
    assert_allclose(points[[0, 16, 32]], [[0.0, 0.0], [3.0, 0.0], [5.0, 2.0]], atol=1e-15)
    assert_allclose(points[24], [(3.0 + 3 * 4.0 + 3 * 5.0 + 5.0) / 8, (3 * 1.0 + 2.0) / 8], atol=1e-15)


def test_rotations_of_path_planner_are_met_in_degrees_over_the_shorter_way(tmp_path):
    targets = [{"waypointRelativePos": 1.0, "rotationDegrees": 170.0}]
    path = read(
        tmp_path, "a.path", path_planner(rotationTargets=targets, goalEndState={"velocity": 0, "rotation": -170.0})
    )
    angle = path.heading.turn(np.array([0.0, path.heading.progress[1], 1.0]), ())[0]
    assert_allclose(np.degrees(angle), [0.0, 170.0, 190.0], atol=1e-9)
    ways = np.hypot(*np.diff(np.array(path.waypoints), axis=0).T)
    assert path.heading.progress[1] == pytest.approx(ways[:16].sum() / ways.sum())


def test_versions_of_path_planner_without_a_start_or_with_angles_at_waypoints(tmp_path):
    old = path_planner(idealStartingState=None)
    assert read(tmp_path, "a.path", old).heading.angle == pytest.approx(0.5 * np.pi)
    older = {
        "waypoints": [
            {"anchorPoint" if key == "anchor" else key: value for key, value in one.items()} for one in old["waypoints"]
        ]
    }
    older["waypoints"][0]["holonomicAngle"], older["waypoints"][2]["holonomicAngle"] = 0.0, 45.0
    assert_allclose(read(tmp_path, "b.path", older).heading.angles, [0.0, np.pi / 4.0])
    with pytest.warns(TableNote, match="zones in which the robot points towards a place are left out"):
        read(tmp_path, "c.path", path_planner(pointTowardsZones=[{"name": "Speaker"}]))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"trajectory": {"samples": []}}, "has 0 samples; generate the trajectory before it is exported"),
        ({"a": 1}, "is none of the JSON files that are known"),
        ([[0.0, 0.0], [1.0, 0.0]], "is none of the JSON files that are known"),
        ('{"a": 1', "line 1: cannot be read as JSON"),
        ([{"time": 0.0}, {"time": 1.0}], "'x' is missing or of the wrong kind"),
        ([{"x": 0.0, "y": 0.0, "heading": 0.0}] * 2, "'time' is missing"),
        ({"waypoints": [anchor(0, 0, None, None), anchor(1, 1, None, None)]}, "nextControl of waypoint 1"),
        ({"waypoints": [anchor(0, 0, None, None)]}, "has 1 waypoints; a path needs at least two"),
    ],
)
def test_a_file_without_what_is_needed_is_refused_by_name(tmp_path, content, message):
    with pytest.raises(ConfigurationError, match=message) as error:
        read(tmp_path, "a.traj", content)
    assert "a.traj" in str(error.value)


@pytest.mark.parametrize("shape", ["spline", "timed"])
def test_a_planner_s_file_can_be_named_in_a_mapping(tmp_path, shape):
    read(tmp_path, "a.traj", CHOREO)
    (path,) = read_paths({"shape": shape, "file": str(tmp_path / "a.traj")})
    assert isinstance(path, Spline | Timed) and path.shape == shape
    rows = path.waypoints if isinstance(path, Spline) else [pose[1:] for pose in path.poses]
    assert_allclose(rows, np.column_stack([1.0 + TIMES, 2.0 * TIMES, 0.25 * TIMES]), atol=1e-15)


def test_a_path_without_times_is_no_timed_path(tmp_path):
    read(tmp_path, "a.path", path_planner())
    with pytest.raises(ConfigurationError, match="has no times; use it as a path of shape 'spline'"):
        read_paths({"shape": "timed", "file": str(tmp_path / "a.path")})


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('{"samples": [3, 4]}', "is missing or of the wrong kind"),
        ('{"samples": [{"t": 0, "x": "a", "y": 0, "heading": 0}, {}]}', "is missing or of the wrong kind"),
        ('{"waypoints": [3, 4]}', "is missing or of the wrong kind"),
        ('{"waypoints": [null, null]}', "is missing or of the wrong kind"),
        ('{"samples": [{"t": NaN}]}', "cannot be read as JSON: NaN is no finite number"),
        ('{"samples": [{"t": 1e999, "x": 0, "y": 0, "heading": 0}, {}]}', "is missing or of the wrong kind"),
        ("[" * 50_000, "cannot be read as JSON: .*recursion"),
    ],
)
def test_whatever_json_holds_is_told_with_its_file(tmp_path, text, said):
    (tmp_path / "odd.json").write_text(text)
    with pytest.raises(ConfigurationError, match=rf"odd\.json.*{said}"):
        read_planner_file(tmp_path / "odd.json")


def test_samples_and_waypoints_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(planner_files, "MOST_POINTS", 32)
    file = tmp_path / "long.json"
    file.write_text(json.dumps([{"t": k, "x": 0, "y": 0, "heading": 0} for k in range(33)]))
    with pytest.raises(ConfigurationError, match=r"long\.json has 33 samples, at most 32 are read"):
        read_planner_file(file)
    file.write_text(json.dumps({"waypoints": 3 * [{"anchor": {"x": 0, "y": 0}}]}))
    with pytest.raises(ConfigurationError, match=r"long\.json has 3 waypoints, at most 2 are read"):
        read_planner_file(file)
