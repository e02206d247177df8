"""caster_gym.paths.waypoints: what follows from how waypoints were written, against curves known in closed form."""

import numpy as np
import pytest
from numpy.testing import assert_allclose
from scipy.spatial import cKDTree

from caster_gym.configuration import ConfigurationError
from caster_gym.paths import read_paths
from caster_gym.paths.splines import Spline

FULL = np.linspace(0.0, 2.0 * np.pi, 20001)


def ellipse(t):
    """Points and curvature of an ellipse of 6.07 m."""
    a, b = 1.2, 0.7
    return a * np.cos(t) + 1j * b * np.sin(t), a * b / ((a * np.sin(t)) ** 2 + (b * np.cos(t)) ** 2) ** 1.5


def lemniscate(t):
    """Gerono's figure of eight, 1.8 m wide."""
    x1, y1, x2, y2 = 0.9 * np.cos(t), 0.9 * np.cos(2 * t), -0.9 * np.sin(t), -1.8 * np.sin(2 * t)
    return 0.9 * np.sin(t) + 0.45j * np.sin(2 * t), (x1 * y2 - y1 * x2) / np.hypot(x1, y1) ** 3


def pairs(p):
    return tuple(zip(p.real.tolist(), p.imag.tolist(), strict=True))


def rounded(p, step):
    return np.round(p.real / step) * step + 1j * np.round(p.imag / step) * step


def curvature_error(spline, curve, turned=0.0):
    """Root mean square and greatest error of the curvature, as a share of the curve's greatest; distance [m]."""
    p, first, second, _ = spline.curve(np.linspace(0.0, 1.0, 1500))
    true, bend = curve(FULL)
    true = true * np.exp(1j * turned)
    distance, nearest = cKDTree(np.column_stack([true.real, true.imag])).query(np.column_stack([p.real, p.imag]))
    error = ((first.conj() * second).imag / np.abs(first) ** 3 - bend[nearest]) / np.abs(bend).max()
    return np.sqrt(np.mean(error**2)), np.abs(error).max(), distance.max()


def along(curve, count, closed, turned=0.0):
    """Points of a curve, on a whole round or a part of it, turned by an angle."""
    t = np.linspace(0.0, 2.0 * np.pi, count, endpoint=False) if closed else np.linspace(0.3, 5.0, count)
    return curve(t)[0] * np.exp(1j * turned)


# ---- Rounding


@pytest.mark.parametrize("curve", [ellipse, lemniscate])
@pytest.mark.parametrize("turned", [0.0, 0.4])
@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("count", [50, 400, 5000])
def test_rounding_to_a_millimetre_leaves_curvature_right_within_a_few_percent(curve, turned, closed, count):
    """3 % rms. An open curve is less certain at its ends, where points lie on one side only: 12 % there."""
    spline = Spline(waypoints=pairs(rounded(along(curve, count, closed, turned), 0.001)), closed=closed)
    error, most, distance = curvature_error(spline, curve, turned)
    assert error < 0.03
    assert most < (0.07 if closed else 0.12)
    assert distance < 1.5e-3  # more than 0.7 mm, a rounded point's own distance, at the ends alone


@pytest.mark.parametrize(("step", "most"), [(1e-2, 0.09), (5e-3, 0.065), (1e-3, 0.025), (1e-4, 0.006), (1e-5, 0.003)])
@pytest.mark.parametrize("count", [120, 1500])
def test_the_error_of_curvature_falls_with_the_step_of_the_rounding(step, most, count):
    """About as the step to the power 5/9 of smoothing splines with this penalty: 9 % of 1 cm are 2 % of 1 mm."""
    spline = Spline(waypoints=pairs(rounded(along(lemniscate, count, True, 0.3), step)), closed=True)
    assert curvature_error(spline, lemniscate, 0.3)[0] < most


@pytest.mark.parametrize("offset", [0.0, 0.00037])
@pytest.mark.parametrize("dtype", [np.float64, np.float32])
def test_rounding_is_seen_through_offsets_units_and_single_precision(offset, dtype):
    p = along(ellipse, 400, True)
    millimetres = np.column_stack([np.rint(1000.0 * p.real), np.rint(1000.0 * p.imag)])
    points = (0.001 * millimetres + offset).astype(dtype).astype(np.float64)
    spline = Spline(waypoints=tuple(map(tuple, points.tolist())), closed=True)
    assert "rounded to 0.001 m" in spline.description
    assert curvature_error(spline, lambda t: (ellipse(t)[0] + offset * (1 + 1j), ellipse(t)[1]))[0] < 0.02


def test_single_precision_alone_is_a_rounding_too():
    """Points 1.2 mm apart, in error by 3e-8 m: a spline through them would be wrong by 0.2 1/m."""
    p = along(ellipse, 5000, True, 0.2).astype(np.complex64).astype(complex)
    spline = Spline(waypoints=pairs(p), closed=True)
    assert "rounded to" in spline.description
    assert curvature_error(spline, ellipse, 0.2)[1] < 0.002


def test_points_that_are_not_evenly_spaced_are_smoothed_as_well():
    t = np.sort(np.random.default_rng(4).uniform(0.0, 2.0 * np.pi, 700))
    spline = Spline(waypoints=pairs(rounded(lemniscate(t)[0], 0.001)), closed=True)
    assert curvature_error(spline, lemniscate)[0] < 0.04


@pytest.mark.parametrize("count", [40, 120, 2000])
def test_exact_points_are_met_exactly(count):
    p = along(ellipse, count, True, 0.1)
    spline = Spline(waypoints=pairs(p), closed=True)
    assert spline.description == f"spline of {count} waypoints"
    chords = np.abs(np.diff(np.append(p, p[0])))
    at = np.concatenate([[0.0], np.cumsum(chords)])[:-1] / chords.sum()
    assert_allclose(spline.curve(at)[0], p, atol=1e-12)


@pytest.mark.parametrize(
    "waypoints",
    [
        ((0, 0), (1, 0), (1, 1), (2.5, 1.5)),
        tuple((0.1 * i, 0.0) for i in range(11)) + tuple((1.0, 0.1 * i) for i in range(1, 11)),
        tuple((0.5 * i, float(i % 2)) for i in range(29)),
        tuple((0.3 * i, 0.3 * (i * i % 7)) for i in range(60)),  # a coarse grid, but no two points fall together
    ],
)
def test_typed_waypoints_are_met_exactly(waypoints):
    spline = Spline(waypoints=waypoints)
    p = np.array([complex(*one) for one in waypoints])
    chords = np.abs(np.diff(p))
    at = np.concatenate([[0.0], np.cumsum(chords)]) / chords.sum()
    assert_allclose(spline.curve(at)[0], p, atol=1e-9)  # rounding of an ill-conditioned spline through corners
    assert "smoothed" not in spline.description


def test_a_tolerance_of_zero_leads_through_rounded_points():
    p = rounded(along(ellipse, 400, True), 0.001)
    spline = Spline(waypoints=pairs(p), closed=True, tolerance=0.0)
    assert "smoothed" not in spline.description
    assert np.abs(spline.curve(np.array([0.0]))[0] - p[0]) < 1e-12


# ---- Noise


@pytest.mark.parametrize("closed", [True, False])
@pytest.mark.parametrize("count", [200, 3000])
def test_noise_of_a_given_size_is_smoothed(closed, count):
    """Motion capture: 2 mm along each axis, so 2.8 mm in the plane."""
    p = along(ellipse, count, closed)
    noisy = p + np.random.default_rng(count).normal(0.0, 0.002, (2, count)).T @ [1.0, 1.0j]
    spline = Spline(waypoints=pairs(noisy), closed=closed, tolerance=0.0028)
    error, _, distance = curvature_error(spline, ellipse)
    assert error < 0.06 and distance < 0.006
    assert "as its tolerance allows" in spline.description


def test_noise_at_rest_adds_no_way():
    """200 samples at rest before 2 m straight ahead, noise of 1 mm: the chords alone would add 0.35 m."""
    x = np.concatenate([np.zeros(200), np.linspace(0.0, 2.0, 400)])
    points = np.column_stack([x, 0.0 * x]) + np.random.default_rng(5).normal(0.0, 0.001, (600, 2))
    spline = Spline(waypoints=tuple(map(tuple, points.tolist())), tolerance=0.0014)
    p, first, _, _ = spline.curve(np.linspace(0.0, 1.0, 1000))
    assert np.abs(first).mean() == pytest.approx(2.0, abs=0.02)
    assert np.abs(p.imag).max() < 0.002


# ---- Repeated waypoints


@pytest.mark.parametrize("gap", [0.0, 1e-8, 1e-6, 1e-4, 1e-3])
@pytest.mark.parametrize("direction", [0.0, 0.8, 2.0, 3.1, -1.5])
@pytest.mark.parametrize("count", [12, 40, 400])
def test_a_closed_path_whose_last_row_repeats_its_first_is_one_closed_curve(gap, direction, count):
    """As if the row were not there."""
    p = along(ellipse, count, True)
    once = Spline(waypoints=pairs(p), closed=True)
    repeated = Spline(waypoints=pairs(np.append(p, p[0] + gap * np.exp(1j * direction))), closed=True)
    u = np.linspace(0.0, 1.0, 200)
    assert_allclose(repeated.curve(u), once.curve(u), atol=0.0)
    assert "the last waypoint repeats the first" in repeated.description


@pytest.mark.parametrize("gap", [0.0, 1e-8, 1e-6, 1e-4])
@pytest.mark.parametrize("direction", [0.5, 1.6, 3.0, -1.6])
def test_a_waypoint_that_nearly_repeats_the_one_before_is_left_out(gap, direction):
    p = along(ellipse, 30, False)
    double = np.insert(p, 11, p[10] + gap * np.exp(1j * direction))
    u = np.linspace(0.0, 1.0, 200)
    assert_allclose(Spline(waypoints=pairs(double)).curve(u), Spline(waypoints=pairs(p)).curve(u), atol=0.0)
    assert "1 waypoint repeats the place before" in Spline(waypoints=pairs(double)).description


def test_two_near_waypoints_that_lead_on_are_both_met():
    """A corner of 1 cm, typed."""
    corner = ((0.0, 0.0), (0.99, 0.0), (1.0, 0.01), (1.0, 1.0))
    spline = Spline(waypoints=corner)
    assert spline.description == "spline of 4 waypoints"
    p, *_ = spline.curve(np.linspace(0.0, 1.0, 20001))
    assert all(np.abs(p - complex(*one)).min() < 1e-4 for one in corner)


def test_an_open_path_that_nearly_closes_stays_open_and_tells():
    p = along(ellipse, 40, True)
    spline = Spline(waypoints=pairs(np.append(p, p[0] + 1e-3)))
    assert "ends 0.001 m from its start" in spline.description
    assert_allclose(spline.curve(np.array([1.0]))[0], p[0] + 1e-3, atol=1e-12)


# ---- Headings


@pytest.mark.parametrize("step", [np.radians(1.0), 0.01, np.pi / 512.0])
@pytest.mark.parametrize("closed", [True, False])
def test_rounded_headings_turn_smoothly(step, closed):
    """0.5 rad to and fro over 500 rows: rates within 5 % rms, where steps of 1° would make them wrong by 300 %."""
    t = np.linspace(0.0, 1.0, 500, endpoint=not closed)
    p, heading = np.exp(2.0j * np.pi * t), 0.5 * np.sin(2.0 * np.pi * t)
    rows = zip(p.real.tolist(), p.imag.tolist(), (np.round(heading / step) * step).tolist(), strict=True)
    spline = Spline(waypoints=tuple(rows), closed=closed)
    assert "headings smoothed" in spline.description
    u = np.linspace(0.0, 1.0, 400)
    _, rate, growth = spline.turn(u, spline.curve(u))
    assert np.sqrt(np.mean((rate - np.pi * np.cos(2.0 * np.pi * u)) ** 2)) < 0.05 * np.pi
    assert np.sqrt(np.mean((growth + 2.0 * np.pi**2 * np.sin(2.0 * np.pi * u)) ** 2)) < 0.35 * 2.0 * np.pi**2


def test_headings_smoothed_on_a_turning_round_keep_their_turns():
    t = np.linspace(0.0, 2.0 * np.pi, 300, endpoint=False)
    heading = np.round((t + 0.4) / 0.01) * 0.01
    rows = tuple(zip(np.cos(t).tolist(), np.sin(t).tolist(), heading.tolist(), strict=True))
    spline = Spline(waypoints=rows, closed=True, laps=2)
    u = np.linspace(0.0, 1.0, 300)
    angle, rate, _ = spline.turn(u, spline.curve(2.0 * u))
    assert angle[-1] - angle[0] == pytest.approx(4.0 * np.pi, abs=1e-6)
    assert_allclose(rate, 4.0 * np.pi, rtol=0.02)


def test_noise_that_rounding_does_not_explain_is_told():
    t = np.linspace(0.0, 2.0 * np.pi, 500)
    points = np.column_stack([1.5 * np.sin(t), 0.8 * np.sin(2.0 * t)])
    noisy = (points + np.random.default_rng(5).normal(0.0, 0.001, points.shape)).round(3)
    assert "zigzag by about 0.002 m" in Spline(waypoints=noisy.tolist()).description
    assert "zigzag" not in Spline(waypoints=points.round(3).tolist()).description


@pytest.mark.parametrize("digits", [3, 4, 5, 6])
def test_significant_digits_are_a_rounding_too(digits):
    """Values near 0 have more decimals than others; the curvature was 2.4 instead of 1.39 1/m for 4 digits."""
    t = np.linspace(0.0, 2.0 * np.pi, 500)
    columns = 1.5 * np.sin(t), 0.8 * np.sin(2.0 * t)
    points = tuple((float(f"{x:.{digits}g}"), float(f"{y:.{digits}g}")) for x, y in zip(*columns, strict=True))
    (path,) = Spline(waypoints=points, duration=20.0).trajectories(0.01)
    v, a = path.samples[100:-100, 4:6] @ [1.0, 1.0j], path.samples[100:-100, 7:9] @ [1.0, 1.0j]
    assert np.abs((v.conj() * a).imag / np.abs(v) ** 3).max() < 1.03 * 3.3333  # of the curve itself


@pytest.mark.parametrize("waypoint", [[np.nan, 1.0], ["a", 1.0]])
def test_a_number_that_is_none_is_told_and_no_heading_missed(waypoint):
    with pytest.raises(ConfigurationError, match="number 1 of number 2 of 'waypoints' should be") as error:
        read_paths({"shape": "spline", "waypoints": [[0.0, 0.0], waypoint]})
    assert "missing" not in str(error.value)
