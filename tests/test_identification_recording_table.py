"""identification.recording_table: recordings as they are logged, and sentences for those that cannot be read."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.identification.recording import FEWEST_ROWS, record, write_recording
from caster_gym.identification.recording_table import read_recording
from caster_gym.robot import load_robot
from caster_gym.tables import TableNote

ROBOT = load_robot("chung2008")


@pytest.fixture(scope="module")
def shaken():
    return record(ROBOT, 1.0, 0.02, seed=1)


@pytest.fixture
def rows(shaken, tmp_path):
    write_recording(tmp_path / "run.csv", shaken)
    return [line.split(",") for line in (tmp_path / "run.csv").read_text().splitlines()]


def reread(folder, rows, separator=","):
    (folder / "changed.csv").write_text("\n".join(separator.join(row) for row in rows) + "\n")
    return read_recording(folder / "changed.csv", ROBOT)


def assert_same(back, recording, tolerance=1e-9):
    assert back.time_step == pytest.approx(recording.time_step, rel=1e-6)
    assert_allclose(back.measured, recording.measured, rtol=tolerance, atol=1e-9)
    assert_allclose(back.torque, recording.torque, rtol=tolerance, atol=1e-9)


@pytest.mark.parametrize("separator", [",", ";", "\t", ", "])
def test_any_separator_and_a_commented_header_do(shaken, rows, tmp_path, separator):
    assert_same(reread(tmp_path, rows, separator), shaken)
    assert_same(reread(tmp_path, [["# " + rows[0][0], *rows[0][1:]], *rows[1:]], separator), shaken)


OTHER_UNITS = [
    {"s": ("ms", 1e3), "m": ("mm", 1e3), "rad": ("deg", np.degrees(1.0)), "m/s": ("cm/s", 1e2),
     "rad/s": ("deg/s", np.degrees(1.0)), "N m": ("mN m", 1e3)},
    {"s": ("us", 1e6), "m": ("cm", 1e2), "rad": ("°", np.degrees(1.0)), "m/s": ("mm/s", 1e3),
     "rad/s": ("°/s", np.degrees(1.0)), "N m": ("mNm", 1e3)},
    {"s": ("µs", 1e6), "m": ("m", 1.0), "rad": ("rad", 1.0), "m/s": ("mps", 1.0), "rad/s": ("rpm", 30.0 / np.pi),
     "N m": ("N·m", 1.0)},
    {"N m": ("Nm", 1.0)},
]  # fmt: skip


@pytest.mark.parametrize("units", OTHER_UNITS)
def test_other_units_of_a_file_mean_the_same(shaken, rows, tmp_path, units):
    header, *numbers = rows
    written = [cell[cell.index("[") + 1 : -1] for cell in header]
    changed = [
        cell.replace(f"[{u}]", f"[{units.get(u, (u, 1.0))[0]}]") for cell, u in zip(header, written, strict=True)
    ]
    scaled = [
        [f"{float(c) * units.get(u, (u, 1.0))[1]:.15g}" for c, u in zip(row, written, strict=True)] for row in numbers
    ]
    assert_same(reread(tmp_path, [changed, *scaled]), shaken)


@pytest.mark.parametrize(
    ("header", "first"), [("time [ns]", 1_583_332_205_000_000_000), ("stamp", 1_583_332_205_000_000_000)]
)
@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
def test_stamps_in_nanoseconds_keep_their_digits(shaken, rows, tmp_path, header, first):
    stamped = [[str(first + round(1e9 * float(row[0]))), *row[1:]] for row in rows[1:]]
    assert_same(reread(tmp_path, [[header, *rows[0][1:]], *stamped]), shaken)


@pytest.mark.parametrize(
    "names",
    [
        {"time": "t_s", "heading": "theta", "x": "pos_x", "y": "pos_y"},
        {"time": "stamp", "heading": "yaw", "x": "px", "y": "py", "yaw_rate": "omega", "steering_1": "delta_1"},
        {"torque_roll_1": "tau_roll_1", "vx": "linear.x", "vy": "linear.y", "x": "/odom/pose/pose/position/x"},
    ],
)
def test_columns_may_have_other_names(shaken, rows, tmp_path, names):
    header = [f"{names.get(c.split(' ')[0], c.split(' ')[0])} {c.split(' ', 1)[1]}" for c in rows[0]]
    if "t_s" in header[0]:
        header[0] = "t_s"
    assert_same(reread(tmp_path, [header, *rows[1:]]), shaken)


def test_the_order_of_columns_does_not_matter(shaken, rows, tmp_path):
    assert_same(reread(tmp_path, [row[::-1] for row in rows]), shaken)


def test_columns_that_are_not_needed_are_left_out_and_named(shaken, rows, tmp_path):
    more = [[*row, extra, "0.5"] for row, extra in zip(rows, ["battery [V]", *["24.1"] * (len(rows) - 1)], strict=True)]
    more[0][-1] = "current_1 [A]"
    with pytest.warns(TableNote, match=r"the columns battery, current_1 are left out, not needed"):
        assert_same(reread(tmp_path, more), shaken)


def test_a_heading_may_be_a_quaternion(shaken, rows, tmp_path):
    place = next(i for i, cell in enumerate(rows[0]) if cell.startswith("heading"))
    half = 0.5 * shaken.pose[:, 2]
    turned = [
        [*row[:place], f"{a:.15g}", f"{b:.15g}", *row[place + 1 :]]
        for row, a, b in zip(rows[1:], np.sin(half), np.cos(half), strict=True)
    ]
    back = reread(tmp_path, [[*rows[0][:place], "qz", "qw", *rows[0][place + 1 :]], *turned])
    assert_allclose(np.exp(1j * back.pose[:, 2]), np.exp(1j * shaken.pose[:, 2]), atol=1e-12)


@pytest.mark.parametrize("share", [0.05, 0.2])
def test_times_that_jitter_are_made_even_and_told(rows, tmp_path, share):
    """A wave that is sampled at jittering times, with a torque that is held: values follow, the impulse is kept."""
    rng = np.random.default_rng(3)
    even = 0.02 * np.arange(len(rows) - 1)
    times = even + np.concatenate([[0.0], rng.uniform(-share, share, len(even) - 2), [0.0]]) * 0.02
    changed = []
    for row, t in zip(rows[1:], times, strict=True):
        held = np.sin(1.5 * t) if t < even[-1] else 0.0
        changed.append([f"{t:.12g}", f"{np.sin(2.0 * t):.12g}", *row[2:10], *[f"{held:.12g}"] * 6])
    with pytest.warns(TableNote, match=r"differ by up to \d+% from 0\.\d+ s; the recording is resampled to even steps"):
        back = reread(tmp_path, [rows[0], *changed])
    assert back.time_step == pytest.approx(0.02, rel=1e-9)
    assert_allclose(back.pose[:, 0], np.sin(2.0 * even), atol=1e-6)  # a cubic spline: h⁴ / 384 times 16 m/s⁴
    given = np.sin(1.5 * times[:-1]) * np.diff(times)
    assert_allclose(back.torque[:-1, 0].sum() * 0.02, given.sum(), rtol=1e-9)


def test_jitter_within_a_hundredth_is_left_as_it_is(shaken, rows, tmp_path):
    rng = np.random.default_rng(0)
    moved = [[f"{float(row[0]) + rng.uniform(-5e-5, 5e-5):.9f}", *row[1:]] for row in rows[1:]]
    with warnings.catch_warnings():
        warnings.simplefilter("error", TableNote)
        back = reread(tmp_path, [rows[0], *moved])
    assert_allclose(back.measured, shaken.measured, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("lost", "line", "count"), [([7], 8, "1 sample is"), ([7, 8, 9, 20], 8, "3 samples are"), ([30, 40], 31, "1")]
)
def test_the_first_real_gap_is_named(rows, tmp_path, lost, line, count):
    kept = [row for number, row in enumerate(rows, start=1) if number - 1 not in lost]
    with pytest.raises(
        ValueError, match=rf"line {line}: this sample comes .* 0\.02 s are usual: {count}.* missing before it"
    ):
        reread(tmp_path, kept)


def drop(first, last=None):
    return lambda rows: [row[:first] + row[(last or first + 1) :] for row in rows]


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (drop(3), "'heading' are missing.*the header names time"),
        (drop(5), "'vy' are missing"),
        (drop(9), "'steering_3' are missing, for robot 'chung2008' of 3 casters"),
        (
            lambda rows: [[*rows[0][:9], "stering_3 [rad]", *rows[0][10:]], *rows[1:]],
            "missing.*is it called 'stering_3'",
        ),
        (
            lambda rows: [[*rows[0][:3], "psi [rad]", *rows[0][4:]], *rows[1:]],
            "'psi' is counted from the x-axis by some",
        ),
        (lambda rows: [[*rows[0], "x [m]"], *([*r, "0"] for r in rows[1:])], "'x' stands twice"),
        (lambda rows: [["time [h]", *rows[0][1:]], *rows[1:]], r"'time' must be in s, ms, us, ns, min, got \[h\]"),
        (lambda rows: [*rows[:4], [*rows[4][:2], "nan", *rows[4][3:]], *rows[5:]], "line 5: 'y' must be .* got 'nan'"),
        (lambda rows: [*rows[:4], [*rows[4][:2], "", *rows[4][3:]], *rows[5:]], "line 5: 'y' must be .* got ''"),
        (lambda rows: [*rows[:6], rows[6][:-1], *rows[7:]], "line 7: the header names 16 columns, .* got 15 cells"),
        (
            lambda rows: [*rows[:8], ["0.121", *rows[8][1:]], *rows[9:]],
            "line 9: this sample comes 0.001 s .*: too early",
        ),
        (lambda rows: [rows[0], *reversed(rows[1:])], "line 3: 'time' must grow"),
        (lambda rows: rows[:FEWEST_ROWS], f"has {FEWEST_ROWS - 1} samples; a recording needs at least {FEWEST_ROWS}"),
        (lambda rows: [], "is empty"),
    ],
)
@pytest.mark.filterwarnings("ignore::caster_gym.tables.TableNote")
def test_a_wrong_file_is_refused_by_a_sentence_that_names_the_place(rows, tmp_path, change, words):
    with pytest.raises(ValueError, match=words):
        reread(tmp_path, change(rows))


@pytest.mark.parametrize("name", ["heading", "steering_2"])
def test_angles_in_degrees_without_a_unit_are_refused_and_the_advice_helps(shaken, rows, tmp_path, name):
    place = next(i for i, cell in enumerate(rows[0]) if cell.startswith(name))
    degrees = [[*row[:place], f"{np.degrees(float(row[place])) + 360.0:.9g}", *row[place + 1 :]] for row in rows[1:]]
    bare, said = ([*rows[0][:place], head, *rows[0][place + 1 :]] for head in (name, f"{name} [deg]"))
    with pytest.raises(
        ValueError, match=rf"column '{name}': an angle of .* hardly be in radians; call .* '{name} \[deg\]'"
    ):
        reread(tmp_path, [bare, *degrees])
    back = reread(tmp_path, [said, *degrees])
    assert_allclose(np.exp(1j * back.pose[:, 2]), np.exp(1j * shaken.pose[:, 2]), atol=1e-7)
    assert_allclose(np.exp(1j * back.steering), np.exp(1j * shaken.steering), atol=1e-7)


def test_a_decimal_comma_is_refused_with_the_reason(rows, tmp_path):
    commas = [rows[0], *([cell.replace(".", ",") for cell in row] for row in rows[1:])]
    with pytest.raises(ValueError, match=r"line \d+: '\S+' has a decimal comma; write decimal points"):
        reread(tmp_path, commas, ";")
