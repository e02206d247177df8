"""caster_gym.paths.files: what path files mean, whoever wrote them."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.paths import build_trajectories, files, read_paths
from caster_gym.paths.splines import Spline
from caster_gym.paths.timed import Timed
from caster_gym.tables import TableNote

ROBOT = load_robot("chung2008")


def written(folder, text, name="path.csv"):
    file = folder / name
    file.write_text(text, encoding="utf-8")
    return file


def race_line(zero):
    """A loop as race-line optimisers write it; ψ counts from the x-axis turned by `zero` [rad]."""
    t = np.linspace(0.0, 2.0 * np.pi, 30, endpoint=False)
    x, y = 2.1 * np.cos(t), 1.3 * np.sin(t)
    heading = np.arctan2(1.3 * np.cos(t), -2.1 * np.sin(t))
    psi = np.angle(np.exp(1j * (heading - zero)))
    rows = [
        f"{0.2 * i:.7f}; {a:.7f}; {b:.7f}; {c:.7f}; 0.5; 2.0; 0.0"
        for i, (a, b, c) in enumerate(zip(x, y, psi, strict=True))
    ]
    head = "# 17b4de0d\n# 603fd398\n# s_m; x_m; y_m; psi_rad; kappa_radpm; vx_mps; ax_mps2\n"
    return head + "\n".join(rows) + "\n", np.column_stack([x, y, heading])


@pytest.mark.parametrize(("zero", "axis"), [(0.0, "x"), (0.5 * np.pi, "y")])
def test_race_lines_of_both_conventions_under_the_same_header_are_read_rightly(tmp_path, zero, axis):
    """Both are in use, with equal headers: only the direction of the points tells them apart."""
    text, expected = race_line(zero)
    with pytest.warns(TableNote) as notes:
        (path,) = read_paths({"shape": "spline", "file": str(written(tmp_path, text)), "closed": True})
    assert isinstance(path, Spline)
    points = np.array(path.waypoints)
    assert_allclose(points[:, :2], expected[:, :2], atol=1e-7)  # seven digits are written
    assert_allclose(np.exp(1j * points[:, 2]), np.exp(1j * expected[:, 2]), atol=1e-6)
    told = " ".join(str(note.message) for note in notes)
    assert f"counted from the {axis}-axis" in told
    assert "s_m, kappa_radpm, vx_mps, ax_mps2 are left out" in told


@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
@pytest.mark.parametrize("zero", [0.0, 0.5 * np.pi])
@pytest.mark.parametrize("timed", [False, True])
def test_the_heading_of_a_race_line_turns_once_a_lap(tmp_path, zero, timed):
    """ψ is wrapped; counted from another axis it must be so no less."""
    text, expected = race_line(zero)
    if timed:
        text = text.replace("# s_m;", "# t_s;").replace("\n0.0000000;", "\n0.0;")
    (path,) = read_paths({"shape": "timed" if timed else "spline", "file": str(written(tmp_path, text))})
    samples = path.trajectories(0.02)[0].samples
    turned = np.diff(np.unwrap(np.arctan2(samples[:, 3], samples[:, 2])))
    whole = np.ptp(np.unwrap(expected[:, 2]))  # 5.95 rad, of a loop that is left open
    assert turned.sum() == pytest.approx(whole, abs=1e-3)
    assert np.abs(turned).sum() < 1.05 * turned.sum()


def test_psi_of_a_robot_that_does_not_face_its_way_needs_its_axis_said(tmp_path):
    file = written(tmp_path, "x,y,psi\n0,0,1.0\n1,0,1.1\n2,0,1.2\n")
    with pytest.raises(ConfigurationError, match=r"may count from the x-axis or from the y-axis.*`zero_axis: x` or"):
        read_paths(file)
    for axis, turn in (("x", 0.0), ("y", 0.5 * np.pi)):
        (path,) = read_paths({"shape": "spline", "file": str(file), "zero_axis": axis})
        assert isinstance(path, Spline)
        assert_allclose([point[-1] for point in path.waypoints], np.array([1.0, 1.1, 1.2]) + turn)


@pytest.mark.parametrize(
    ("text", "points"),
    [
        ("x [mm],y [mm],heading [deg]\n0,0,0\n500,100,90\n", [[0, 0, 0], [0.5, 0.1, np.pi / 2]]),
        ("px;py;theta\n0;0;0\n0.5;0.1;1\n", [[0, 0, 0], [0.5, 0.1, 1.0]]),
        ("pos_x\tpos_y\tyaw_deg\n0\t0\t0\n1\t1\t-90\n", [[0, 0, 0], [1, 1, -np.pi / 2]]),
        ("# x_m, y_m, w_tr_right_m, w_tr_left_m\n0.0, 0.0, 1.1, 1.1\n1.0, 2.0, 1.1, 1.1\n", [[0, 0], [1, 2]]),
        ("x,y,qz,qw\n0,0,0,1\n1,0,0.6,0.8\n", [[0, 0, 0], [1, 0, 2.0 * np.arctan2(0.6, 0.8)]]),
        ("X,Y\n0,0\n1,2\n", [[0, 0], [1, 2]]),
    ],
)
@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
def test_waypoints_in_other_units_and_under_other_names(tmp_path, text, points):
    (path,) = read_paths(written(tmp_path, text))
    assert path.shape == "spline"
    assert_allclose(path.waypoints, points, atol=1e-15)


@pytest.mark.parametrize(
    ("text", "poses"),
    [
        ("time,x,y,heading\n0,0,0,0\n1,2,3,0.5\n", [[0, 0, 0, 0], [1, 2, 3, 0.5]]),
        ("t [ms],x,y\n500,0,0\n1500,1,0\n", [[0, 0, 0], [1, 1, 0]]),
        ("stamp,x_mm,y_mm,yaw_deg\n1583332205000000000,0,0,0\n1583332205020000000,9,0,180\n",
         [[0, 0, 0, 0], [0.02, 0.009, 0, np.pi]]),
    ],
)  # fmt: skip
@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
def test_a_file_with_times_is_a_timed_path(tmp_path, text, poses):
    (path,) = read_paths(written(tmp_path, text))
    assert path.shape == "timed"
    assert_allclose(path.poses, poses, atol=1e-15)


def test_a_tum_trajectory_is_read_with_the_heading_of_its_quaternions(tmp_path):
    rows = [f"{1305031098.66 + 0.5 * k} {0.3 * k} 0.1 1.6 0 0 {np.sin(0.2 * k)} {np.cos(0.2 * k)}" for k in range(4)]
    with pytest.warns(TableNote, match="the column tz is left out"):
        (path,) = read_paths(written(tmp_path, "\n".join(rows), "log.tum"))
    assert isinstance(path, Timed)
    assert_allclose(path.poses, [[0.5 * k, 0.3 * k, 0.1, 0.4 * k] for k in range(4)], atol=1e-7)  # digits of the stamps


def test_the_first_gap_of_a_record_is_told_with_its_line(tmp_path):
    lines = ["time,x,y", *(f"{0.1 * k:.1f},{0.1 * k:.2f},0" for k in range(60) if k not in (20, 21, 22, 40, 41, 42))]
    with pytest.warns(TableNote, match=r"line 22: this pose comes 0\.4 s after the one before, where 0\.1 s are usual"):
        (path,) = read_paths(written(tmp_path, "\n".join(lines)))
    samples = path.trajectories(0.02)[0].samples
    assert_allclose(samples[:, 0], 0.02 * np.arange(len(samples)), atol=1e-9)


def test_a_spline_through_a_file_with_times_leaves_them_out_and_tells(tmp_path):
    file = written(tmp_path, "time,x,y\n0,0,0\n1,2,3\n")
    with pytest.warns(TableNote, match="the times are left out"):
        (path,) = read_paths({"shape": "spline", "file": str(file)})
    assert isinstance(path, Spline)
    assert path.waypoints == ((0.0, 0.0), (2.0, 3.0))


def test_a_heading_beside_a_file_replaces_the_file_s_own(tmp_path):
    file = written(tmp_path, "x,y,heading\n0,0,0\n1,2,3\n")
    with pytest.warns(TableNote, match="the column heading is left out"):
        (path,) = read_paths({"shape": "spline", "file": str(file), "heading": "tangent"})
    assert isinstance(path, Spline)
    assert path.waypoints == ((0.0, 0.0), (1.0, 2.0))


@pytest.mark.parametrize("name", ["POINTS.CSV", "points.txt", "Points.Tsv", "points.dat"])
@pytest.mark.parametrize("kind", [str, lambda file: file])
def test_files_are_known_by_their_suffix_in_any_case_and_kind(tmp_path, name, kind):
    (path,) = read_paths(kind(written(tmp_path, "x,y\n0,0\n1,1\n", name)))
    assert isinstance(path, Spline)
    assert path.waypoints == ((0.0, 0.0), (1.0, 1.0))


@pytest.mark.parametrize("name", ["path.yaml", "PATH.YML"])
def test_a_file_named_in_a_yaml_file_starts_from_its_folder(tmp_path, monkeypatch, name):
    (tmp_path / "inner").mkdir()
    written(tmp_path / "inner", "x,y\n0,0\n1,1\n", "points.csv")
    file = written(tmp_path / "inner", "{shape: spline, file: points.csv, duration: 7.0}", name)
    monkeypatch.chdir(tmp_path)
    (path,) = read_paths(file)
    assert isinstance(path, Spline)
    assert (path.waypoints, path.duration) == (((0.0, 0.0), (1.0, 1.0)), 7.0)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("lat,lon\n52.52,13.4\n", "latitude and longitude; project them to metres, .* and call these x and y"),
        ("u,v\n0,0\n", "no column is called 'x' or 'y'; the header names u, v; call the coordinates x and y"),
        ("x,y,qz,qw\n0,0,0,1\n1,0,0,0\n", "line 3: the quaternion is zero and says no heading; leave its columns out"),
        ("x,z\n0,0\n", "no column is called 'y'"),
        ("x;y\n0;0\n1,5;1\n", "line 3: '1,5' has a decimal comma"),
        ("x,y,heading\n0,0,0\n1,0,90\n", r"'heading': a heading of 90 .* write `unit: deg` .* as in 'heading \[deg\]'"),
        ("time,x,y\n0,0,0\n2,1,1\n2,2,2\n", "line 4: 'time' must grow from line to line, got 2 after 2; leave one of"),
        ("time,x,y\n0,0,0\n2,1,1\n1,2,2\n", "got 1 after 2; sort the lines by it"),
        ("time,x,y\n10:00:01,0,0\n10:00:02,1,1\n", "got '10:00:01'; write times in seconds"),
        ("x,y\n0,0\n1,nan\n", "line 3: 'y' must be a finite number, got 'nan'"),
    ],
)
def test_a_file_that_is_refused_says_what_to_change(tmp_path, text, message):
    file = written(tmp_path, text)
    with pytest.raises(ConfigurationError, match=message) as error:
        read_paths(file)
    assert str(file) in str(error.value)


@pytest.mark.parametrize("unit", ["deg", "rad"])
def test_the_unit_beside_a_file_is_that_of_its_headings(tmp_path, unit):
    file = written(tmp_path, "x,y,heading\n0,0,0\n1,0,90\n2,0,180\n")
    (path,) = read_paths({"shape": "spline", "file": str(file), "unit": unit})
    assert isinstance(path, Spline)
    assert_allclose(
        [point[-1] for point in path.waypoints], np.array([0.0, 90.0, 180.0]) * (np.pi / 180 if unit == "deg" else 1)
    )
    clashing = written(tmp_path, "x,y,heading [rad]\n0,0,0\n1,0,1\n")
    with pytest.raises(ConfigurationError, match="says its unit in the header, and that is not deg; leave 'unit' out"):
        read_paths({"shape": "spline", "file": str(clashing), "unit": "deg"})


@pytest.mark.parametrize("name", ["points.xlsx", "somewhere/points", "drive.auto"])
def test_a_name_of_no_known_kind_of_file_is_refused_with_those_that_are(name):
    with pytest.raises(ConfigurationError, match=r"is no file of a path by its name: those end in \.yaml, \.csv"):
        read_paths(name)


def test_a_timed_path_needs_times(tmp_path):
    file = written(tmp_path, "x,y\n0,0\n1,1\n")
    with pytest.raises(ConfigurationError, match=r"has no column of times; call it 'time \[s\]', or use .* 'spline'"):
        read_paths({"shape": "timed", "file": str(file)})


def test_a_file_of_a_loop_in_degrees_turns_once():
    t = np.linspace(0.0, 2.0 * np.pi, 24, endpoint=False)
    loop = np.column_stack([1.2 * np.cos(t), 1.2 * np.sin(t), np.degrees(t)]).tolist()
    path = {"shape": "spline", "waypoints": loop, "unit": "deg", "closed": True, "duration": 60.0}
    samples = build_trajectories(path, ROBOT, 0.02)[0].samples
    turned = np.abs(np.diff(np.unwrap(np.arctan2(samples[:, 3], samples[:, 2])))).sum()
    assert turned == pytest.approx(2.0 * np.pi, rel=0.01)  # a spline through 24 rounded points wavers little


@pytest.mark.parametrize(("shape", "text"), [("spline", "x,y\n0,0\n1,1\n"), ("timed", "time,x,y\n0,0,0\n5,1,1\n")])
def test_the_file_of_a_mapping_may_be_a_path_object(tmp_path, shape, text):
    (by_object,) = read_paths({"shape": shape, "file": written(tmp_path, text)})
    assert by_object == read_paths({"shape": shape, "file": str(tmp_path / "path.csv")})[0]


def test_points_are_bounded(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "MOST_POINTS", 2)
    (tmp_path / "long.csv").write_text("x,y\n0,0\n1,0\n2,0\n")
    with pytest.raises(ConfigurationError, match=r"long\.csv has 3 points, at most 2 are read; keep every tenth row"):
        read_paths(tmp_path / "long.csv")


def test_a_race_line_without_rows_is_told(tmp_path):
    (tmp_path / "none.csv").write_text("x,y,psi\n")
    with pytest.raises(ConfigurationError, match=r"none\.csv: column 'psi' may count from"):
        read_paths(tmp_path / "none.csv")
