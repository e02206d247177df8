"""caster_gym.paths.timed: trajectories that have times of their own, from files, arrays and other trajectories."""

import re
import subprocess
import sys

import gymnasium as gym
import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.identification.recording import record, write_recording
from caster_gym.paths import Trajectory, build_trajectories, read_paths
from caster_gym.paths.course import build_courses
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.splines import Spline
from caster_gym.paths.timed import Timed
from caster_gym.tables import TableNote
from tests.motion_laws import derivative_error

ROBOT = load_robot("chung2008")
STEPS = ((0.0, 0.0, 0.0, 0.0), (4.0, 1.0, 0.0, 0.0), (7.0, 1.0, 0.0, 0.0), (12.0, 1.5, 1.0, 4.0))


def moving(t):
    """A walk along a wave at another law than the quintic, with headings."""
    s = (t / 8.0) ** 2 * (3.0 - t / 4.0)
    return np.column_stack([t, 1.5 * s, 0.4 * np.sin(3.0 * s), 0.5 * s])


def test_a_file_with_times_is_tracked_by_its_own_times(tmp_path):
    t = np.linspace(0.0, 8.0, 161)
    rows = [",".join(f"{number:.6f}" for number in row) for row in moving(t)]
    file = tmp_path / "timed.csv"
    file.write_text("\n".join(["time,x,y,heading", *rows]) + "\n")
    env = gym.make("caster_gym:CasterTrack-v0", path=file)
    env.reset(seed=0)
    for k in range(1, 151):
        info = env.step(np.zeros(env.action_space.shape, np.float32))[-1]
        pose = moving(np.array([0.02 * k]))[0]
        if info["left_corridor"]:
            env.reset(seed=k)
            break
        assert_allclose(info["reference_pose"][:2], pose[1:3], atol=1e-4)  # six digits, and a spline of 50 ms
    assert k > 50


@pytest.mark.parametrize("kind", [np.array, np.ndarray.tolist, lambda a: [tuple(row) for row in a], lambda a: list(a)])
def test_arrays_and_lists_of_poses_with_times_are_timed_paths(kind):
    (path,) = read_paths(kind(moving(np.linspace(0.0, 8.0, 30))))
    assert isinstance(path, Timed)
    assert len(path.poses) == 30 and path.duration == pytest.approx(8.0)


def test_a_trajectory_object_is_given_again_sample_by_sample():
    (original,) = build_trajectories(
        {"shape": "lemniscate", "heading": {"kind": "spinning", "turns": 1.0}}, ROBOT, 0.02
    )
    (again,) = build_trajectories(original, ROBOT, 0.02)
    assert_allclose(again.samples, original.samples, atol=1e-12)  # the angle of the heading and back
    assert read_paths([original, "circle"])[1].shape == "circle"


def test_a_trajectory_object_at_another_time_step_lies_between_its_samples():
    for exact in RandomPaths(count=3, seed=4).trajectories(0.01):
        coarse = Trajectory("coarse", 0.04, exact.samples[::4])
        (fine,) = read_paths(coarse)[0].trajectories(0.01)
        assert_allclose(fine.samples[:, :4], exact.samples[:, :4], atol=1e-6)  # h⁶ of the sixth derivatives, 1e3 m/s⁶


@pytest.mark.parametrize(
    ("path", "least"),
    [
        (Timed(poses=STEPS), 1.8),  # the third derivative jumps where it comes to rest
        (Timed(poses=moving(np.linspace(0.0, 8.0, 41)).tolist(), stretch=1.5, rotation=0.3), 6.0),
    ],
)
def test_every_column_is_the_derivative_of_the_one_before(path, least):
    coarse, fine = (derivative_error(path.trajectories(h)) for h in (0.02, 0.01))
    assert coarse / fine > least
    assert fine < 1e-2


def test_few_poses_are_passed_from_rest_to_rest_with_a_rest_where_one_is_repeated():
    (trajectory,) = Timed(poses=STEPS).trajectories(0.02)
    t = trajectory.samples
    heading = np.unwrap(np.arctan2(t[:, 3], t[:, 2]))
    for time, x, y, angle in STEPS:
        k = round(time / 0.02)
        assert_allclose([t[k, 0], t[k, 1], heading[k]], [x, y, angle], atol=1e-9)
    assert np.abs(t[200:351, 4:]).max() < 1e-9
    assert np.abs(t[[0, -1], 4:]).max() < 1e-9


def test_turning_on_the_spot_and_standing_still_are_trajectories():
    (turning,) = build_trajectories([(0, 0, 0, 0), (6, 0, 0, 6.2832)], ROBOT, 0.02)
    assert np.abs(turning.samples[:, [0, 1, 4, 5, 7, 8]]).max() == 0.0
    assert np.trapezoid(turning.samples[:, 6], dx=0.02) == pytest.approx(6.2832, abs=1e-6)
    (still,) = build_trajectories([(0, 1, 2, 0.5), (3, 1, 2, 0.5)], ROBOT, 0.02)
    assert_allclose(still.samples, [[1, 2, np.cos(0.5), np.sin(0.5), *[0] * 6]] * 151, atol=1e-15)


def test_headings_in_whole_tenths_of_degrees_make_no_accelerations():
    """Most of the time the robot does not turn, so that neighbours tell nothing; the digits do, in degrees."""
    t = np.arange(0.0, 30.0, 0.02)
    heading = np.sin(np.clip(t - 20.0, 0.0, np.pi)) ** 4
    poses = np.column_stack([t, 0.1 * t, 0.0 * t, np.round(np.degrees(heading), 1)])
    (trajectory,) = Timed(poses=poses.tolist(), unit="deg").trajectories(0.02)
    true = np.gradient(np.gradient(heading, 0.02), 0.02)[: len(trajectory.samples)]
    assert np.abs(trajectory.samples[:, 9] - true).max() < 0.3  # of 4 rad/s²; unsmoothed, the rounding alone makes 5


@pytest.mark.parametrize("digits", [2, 3])
def test_a_log_that_starts_at_rest_and_is_rounded_is_driven(digits):
    """Its spline would ask for 4 · 0.29 mm · 50² s⁻² = 3 m/s² at millimetres, and ten times that at centimetres."""
    t = np.arange(0.0, 18.0, 0.02)
    true = moving(np.clip(t - 4.0, 0.0, 8.0))
    log = np.column_stack([t, np.round(true[:, 1:], digits)])
    (trajectory,) = build_trajectories(log, ROBOT, 0.02)
    assert np.abs(trajectory.samples[:, :2] - true[:, 1:3]).max() < 2.0 * 10.0**-digits
    accelerations = np.abs(
        trajectory.samples[:, 7:9] - np.gradient(np.gradient(true[:, 1:3], 0.02, axis=0), 0.02, axis=0)
    )
    assert np.percentile(accelerations, 90) < 0.05  # the law's acceleration jumps where it starts and ends
    assert np.hypot(*trajectory.samples[:150, 4:6].T).max() < 3.0 * 10.0**-digits  # [m/s] wavering of the last digit


def test_what_the_motors_cannot_do_is_refused_and_the_stretch_offered_does():
    path = {"shape": "timed", "poses": [[0, 0, 0, 0], [1, 2, 0, 0]]}
    with pytest.raises(ValueError, match=r"a stretch of at least .* would suffice") as error:
        build_trajectories(path, ROBOT, 0.02)
    stretch = float(re.findall(r"stretch of at least ([\d.]+)", str(error.value))[0])
    (trajectory,) = build_trajectories({**path, "stretch": stretch}, ROBOT, 0.02)
    assert trajectory.duration == pytest.approx(stretch, abs=0.02)
    with pytest.raises(ValueError, match="would suffice"):
        build_trajectories({**path, "stretch": 0.9 * stretch}, ROBOT, 0.02)


@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
@pytest.mark.parametrize("robot", ["tidybot2", "chung2008"])
def test_recordings_that_are_written_are_read_back_as_paths(tmp_path, robot):
    """The recorded twists are not read: the motion through the poses has them all the same."""
    chosen = load_robot(robot)
    recording = record(chosen, 2.0, 0.02, seed=1)
    write_recording(tmp_path / "run.csv", recording)
    (path,) = read_paths(tmp_path / "run.csv")
    t = path.trajectories(0.02)[0].samples
    assert_allclose(t[:, :2], recording.pose[: len(t), :2], atol=1e-5)
    velocity = (t[:, 4] + 1j * t[:, 5]) * (t[:, 2] - 1j * t[:, 3])
    assert recording.twist is not None
    twist = recording.twist[: len(t)]
    assert np.abs(velocity - (twist[:, 0] + 1j * twist[:, 1])).max() < 0.02  # torques jump between samples
    assert np.abs(t[:, 6] - twist[:, 2]).max() < 0.1
    slow = {"shape": "timed", "file": str(tmp_path / "run.csv"), "stretch": 2.0}
    assert build_trajectories(slow, chosen, 0.02)


def test_follow_takes_the_geometry_of_a_timed_path():
    t = np.linspace(0.0, 8.0, 161)
    (course,) = build_courses(moving(t), ROBOT, 1.0)
    slow = Timed(poses=moving(t).tolist(), stretch=3.0)
    (other,) = build_courses(slow, ROBOT, 1.0)
    fine = moving(np.linspace(0.0, 8.0, 10_001))
    length = np.hypot(*np.diff(fine[:, 1:3], axis=0).T).sum()
    assert course.length == pytest.approx(length, rel=1e-4)
    assert other.length == pytest.approx(course.length, rel=1e-5)
    assert other.duration == pytest.approx(course.duration, rel=1e-3)


@pytest.mark.parametrize("digits", [3, 12])
@pytest.mark.parametrize("noise", [0.0, 5e-4])
def test_follow_takes_logs_that_rest_and_waver(digits, noise):
    t = np.arange(0.0, 18.0, 0.02)
    log = moving(np.clip(t - 4.0, 0.0, 8.0))
    log[:, 1:3] += noise * np.random.default_rng(0).standard_normal((len(t), 2))
    (course,) = build_courses(np.column_stack([t, np.round(log[:, 1:], digits)]), ROBOT, 1.0)
    fine = moving(np.linspace(0.0, 8.0, 10_001))
    assert course.name == "timed"
    assert course.length == pytest.approx(np.hypot(*np.diff(fine[:, 1:3], axis=0).T).sum(), rel=3e-3)
    # y = 0.4 sin(2 x) bends by 0.4 · 2² 1/m at its crest; noise through which a spline leads makes hundreds
    assert 0.9 * 1.6 < np.abs(course.samples[:, 4]).max() < 1.2 * 1.6


def test_follow_passes_a_rest_on_the_way():
    (course,) = build_courses(STEPS, ROBOT, 1.0)
    assert np.hypot(*(course.samples[:, :2] - [1.0, 0.0]).T).min() < 0.01  # half of a row


def test_poses_without_headings_face_their_way():
    t = np.linspace(0.0, 8.0, 401)
    (trajectory,) = Timed(poses=moving(t)[:, :3].tolist()).trajectories(0.02)
    fast = np.hypot(*trajectory.samples[:, 4:6].T) > 0.05
    velocity = trajectory.samples[fast, 4] + 1j * trajectory.samples[fast, 5]
    heading = trajectory.samples[fast, 2] + 1j * trajectory.samples[fast, 3]
    assert np.abs(np.angle(velocity / heading)).max() < 0.02  # smoothed by 1 mrad, most where the slow parts begin


def test_centre_and_rotation_place_the_whole_motion():
    plain, placed = Timed(poses=STEPS), Timed(poses=STEPS, centre=(1.0, -2.0), rotation=0.5)
    (a,), (b,) = plain.trajectories(0.02), placed.trajectories(0.02)
    turn = np.exp(0.5j)
    assert_allclose(
        b.samples[:, 0] + 1j * b.samples[:, 1], 1.0 - 2.0j + turn * (a.samples[:, 0] + 1j * a.samples[:, 1])
    )
    assert_allclose(b.samples[:, 7] + 1j * b.samples[:, 8], turn * (a.samples[:, 7] + 1j * a.samples[:, 8]), atol=1e-12)
    assert_allclose(b.samples[:, 6], a.samples[:, 6])


@pytest.mark.parametrize("tolerance", [0.0, 5e-3])
def test_a_tolerance_that_is_given_counts(tolerance):
    t = np.arange(0.0, 8.0, 0.02)
    log = np.column_stack([t, np.round(moving(t)[:, 1:], 3)])
    (trajectory,) = Timed(poses=log.tolist(), tolerance=tolerance).trajectories(0.02)
    miss = np.sqrt(np.mean((trajectory.samples[:, :2] - log[: len(trajectory.samples), 1:3]) ** 2))
    assert miss == pytest.approx(tolerance, rel=0.02, abs=1e-9)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"poses": [[0, 0, 0, 0]]}, "'poses' should have at least 2 items"),
        ({"poses": [[0, 0, 0, 0], [1, 1, 1]]}, "either every pose has a heading or none"),
        (
            {"poses": [[0, 0, 0], [2, 1, 1], [2, 1, 1]]},
            "times must grow from pose to pose, got 2 s after 2 s in pose 3",
        ),
        ({"poses": [[0, 0, 0], [1, 1, 1]], "file": "a.csv"}, "either 'poses' or a 'file'"),
        ({"poses": [[0, 0, 0], [1, 1, 1]], "stretch": 0}, "'stretch' should be greater than 0"),
        ({"poses": [[0, 0, 0], [1, 1, float("nan")]]}, "finite"),
        (
            {"poses": [[0, 0, 0, 0], [1, 1, 1, 1]], "rates": [[0] * 6]},
            "rates need a pose with a heading each, got 1 for 2",
        ),
        ({}, "'poses' is missing"),
    ],
)
def test_poses_that_make_no_motion_are_refused(content, message):
    with pytest.raises(ConfigurationError, match=message):
        read_paths({"shape": "timed", **content})


def test_too_few_time_steps_are_refused_and_the_stretch_offered_does():
    path = {"shape": "timed", "poses": [[0, 0, 0, 0], [0.1, 0.001, 0, 0]]}
    with pytest.raises(ValueError, match=r"5 time steps of 0\.02 s; a path needs at least 10, that is a stretch of 2;"):
        build_trajectories(path, ROBOT, 0.02)
    assert read_paths({**path, "stretch": 2})[0].trajectories(0.02)


@pytest.mark.parametrize("lasting", [0.1, 1e-6, 0.0123456])
def test_a_short_record_is_driven_once_it_is_stretched_as_its_message_says(lasting):
    path = {"shape": "timed", "poses": [[0, 0, 0, 0], [lasting, 1, 0, 0]]}
    with pytest.raises(ValueError, match="would suffice") as error:
        build_trajectories(path, ROBOT, 0.02)
    (stretch,) = re.findall(r"a stretch of at least (\S+) would suffice", str(error.value))
    assert build_trajectories({**path, "stretch": float(stretch)}, ROBOT, 0.02)


def test_points_of_different_sizes_are_refused_with_those_that_are_taken():
    for points in ([(0, 0), (1, 0, 0)], [(1, 2, 3, 4, 5)], [(0,), (1,)]):
        with pytest.raises(ConfigurationError, match=r"a list of points has \(x, y\) or .* \(time, x, y, heading\)"):
            read_paths(points)


def test_a_list_of_points_is_a_spline_and_a_list_of_lists_several():
    assert read_paths([(0, 0), (1, 0), (1, 1)]) == (Spline(waypoints=((0.0, 0.0), (1.0, 0.0), (1.0, 1.0))),)
    assert [path.shape for path in read_paths([[(0, 0), (1, 0)], "circle", [(0, 0, 0, 0), (9, 1, 1, 1)]])] == [
        "spline",
        "circle",
        "timed",
    ]
    assert read_paths(np.array([[0, 0, 1.0], [1, 0, 1.5]])) == (Spline(waypoints=((0.0, 0.0, 1.0), (1.0, 0.0, 1.5))),)


def test_the_description_tells_what_is_smoothed():
    t = np.arange(0.0, 8.0, 0.02)
    log = np.column_stack([t, np.round(moving(t)[:, 1:], 3)])
    (path,) = read_paths(log)
    assert isinstance(path, Timed)
    told = path.description
    assert told.startswith("timed path of 400 poses in 7.98 s; smoothed, at 0.00029 m from them")
    assert "headings smoothed, at 0.00029 rad" in told
    assert "as its tolerance allows" in Timed(poses=log.tolist(), tolerance=0.01).description
    assert Timed(poses=STEPS).description == "timed path of 4 poses in 12 s"


def test_a_timed_path_survives_its_dump(tmp_path):
    file = tmp_path / "timed.csv"
    file.write_text("time [s],x [m],y [m],heading [rad],battery [V]\n0,0,0,0,24\n5,1,0,40,24\n")
    with pytest.warns(TableNote, match="the column battery is left out, not needed"):
        (path,) = read_paths(file)
    assert isinstance(path, Timed)
    assert (path.unit, path.poses[1][-1]) == ("rad", 40.0)
    assert read_paths(path.model_dump(mode="json")) == (path,)
    assert hash(path) == hash(read_paths(path.model_dump())[0])


def test_reading_paths_leaves_scipy_alone():
    reads = "from caster_gym.paths import read_paths; read_paths([(0, 0, 0, 0), (1, 1, 1, 1)])"
    command = f"import sys; {reads}; print('scipy' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", command], capture_output=True, text=True).stdout.strip() == "False"


def test_a_record_that_starts_to_turn_and_to_move_at_once_has_a_way():
    """First steps from rest are tiny, and no turns on the spot: all files of Choreo and WPILib start so."""
    t = np.linspace(0.0, 8.0, 161)
    s = (t / 8.0) ** 3 * (10.0 - 15.0 * (t / 8.0) + 6.0 * (t / 8.0) ** 2)
    poses = np.column_stack([t, 2.0 * s, np.sin(2.0 * s), 3.0 * s])
    (course,) = build_courses(poses, ROBOT, 1.0)
    angle = np.unwrap(np.arctan2(course.samples[:, 6], course.samples[:, 5]))
    assert_allclose(angle[[0, -1]], [0.0, 3.0], atol=1e-3)


def test_what_is_advised_for_following_a_timed_path_has_its_own_fields():
    """A timed path has no duration to be given."""
    poses = [[0, 0, 0, 0], [1, 1, 0, 0], [2, 1, 0, 2], [3, 2, 0, 2]]
    with pytest.raises(ValueError, match=r"path 'timed' makes no course: .*turns on the spot") as error:
        build_courses(poses, ROBOT, 1.0)
    found = re.search(r"CasterTrack drives it with a stretch of at least (\d[\d.]*)$", str(error.value))
    assert found and build_trajectories({"shape": "timed", "poses": poses, "stretch": float(found[1])}, ROBOT, 0.02)
