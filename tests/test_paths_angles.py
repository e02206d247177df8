"""caster_gym.paths.angles: degrees where they are said, and never by mistake."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.configuration import ConfigurationError
from caster_gym.paths import read_paths
from caster_gym.paths.angles import unwrapped
from caster_gym.paths.headings import Fixed, Profile, Spinning, Tangent

LINE = [[0.0, 0.0], [1.0, 0.0], [2.0, 1.0]]


@pytest.mark.parametrize(
    ("degrees", "radians"),
    [
        (Fixed(angle=90, unit="deg"), Fixed(angle=0.5 * np.pi)),
        (Tangent(offset=-180, unit="deg"), Tangent(offset=-np.pi)),
        (Spinning(angle=30, turns=2.0, unit="deg"), Spinning(angle=np.pi / 6, turns=2.0)),
        (Profile(angles=(0, 90, 360), unit="deg"), Profile(angles=(0.0, 0.5 * np.pi, 2.0 * np.pi))),
    ],
)
def test_degrees_mean_the_same_as_their_radians(degrees, radians):
    slopes = (np.zeros(3, dtype=complex), *(np.ones(3, dtype=complex),) * 3)
    share = np.array([0.0, 0.4, 1.0])
    for one, other in zip(degrees.turn(share, slopes), radians.turn(share, slopes), strict=True):
        assert_allclose(one, other, atol=1e-12)
    assert degrees.unit is None
    assert type(degrees)(**degrees.model_dump()) == degrees


@pytest.mark.parametrize(
    "path",
    [
        {"shape": "circle", "heading": {"kind": "fixed", "angle": 90}},
        {"shape": "circle", "heading": {"kind": "fixed", "angle": -45.0}},
        {"shape": "circle", "heading": {"kind": "tangent", "offset": 180}},
        {"shape": "circle", "heading": {"kind": "spinning", "angle": 45}},
        {"shape": "circle", "heading": {"kind": "profile", "angles": [0, 45, 90]}},
        {"shape": "spline", "waypoints": [[0, 0, 0], [1, 0, 45], [2, 1, 90]]},
        {"shape": "timed", "poses": [[0, 0, 0, 0], [5, 1, 0, 90]]},
        [[0, 0, 0], [1, 0, 45], [2, 1, 90]],
        np.array([[0, 0, 0, 0], [5, 1, 0, 90]]),
    ],
)
def test_angles_that_can_hardly_be_radians_are_refused_and_the_advice_helps(path):
    with pytest.raises(ConfigurationError, match="can hardly be in radians: write `unit: deg`"):
        read_paths(path)
    for unit in ("deg", "rad"):
        mapping = path
        if not isinstance(path, dict):
            shape, key = ("timed", "poses") if len(path[0]) == 4 else ("spline", "waypoints")
            mapping = {"shape": shape, key: path}
        if "heading" in mapping:
            mapping = {**mapping, "heading": {**mapping["heading"], "unit": unit}}
        else:
            mapping = {**mapping, "unit": unit}
        (read,) = read_paths(mapping)
        assert read_paths(read.model_dump(mode="json")) == (read,)


@pytest.mark.parametrize("shape", ["circle", "random_paths"])
def test_a_rotation_in_degrees_is_refused_with_its_radians(shape):
    with pytest.raises(ConfigurationError, match=r"'rotation' must be in radians, got 90, .* degrees, write 1\.5708"):
        read_paths({"shape": shape, "rotation": 90})
    assert read_paths({"shape": shape, "rotation": 1.5708})[0].rotation == 1.5708


def test_a_rotation_of_many_turns_in_degrees_is_refused_with_one_that_is_accepted():
    with pytest.raises(ConfigurationError, match="'rotation' must be in radians") as error:
        read_paths({"shape": "circle", "rotation": 36090})
    told = float(str(error.value).rsplit(" ", 1)[1])
    assert read_paths({"shape": "circle", "rotation": told})[0].rotation == pytest.approx(np.pi / 2, rel=1e-5)  # digits


def test_turns_in_degrees_are_refused_with_their_number():
    with pytest.raises(ConfigurationError, match="and 720 looks like degrees; if it is, write 2"):
        read_paths({"shape": "circle", "heading": {"kind": "spinning", "turns": 720}})


@pytest.mark.parametrize(
    ("path", "message"),
    [
        (
            {"shape": "circle", "heading": {"kind": "fixed", "angle": 1.0, "unit": "gon"}},
            "'heading.unit' should be 'rad' or",
        ),
        ({"shape": "circle", "heading": {"kind": "fixed", "angle": "90"}}, "'heading.angle' should be a number"),
        ({"shape": "spline", "waypoints": LINE, "unit": "grad"}, "'unit' should be 'rad' or 'deg'"),
    ],
)
def test_other_units_and_words_are_refused_as_before(path, message):
    with pytest.raises(ConfigurationError, match=message):
        read_paths(path)


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        ([3.0, -3.0], [3.0, 2.0 * np.pi - 3.0]),  # wrapped at half a turn
        ([0.0, 3.2], [0.0, 3.2]),  # beyond: as it stands
        ([0.0, 6.2832], [0.0, 6.2832]),
        ([0.0, 0.0, 4.0], [0.0, 0.0, 4.0]),
        (np.arange(5.0, 9.0, 0.3) % (2.0 * np.pi), np.arange(5.0, 9.0, 0.3)),  # wrapped at a turn
    ],
)
def test_only_wrapped_angles_are_unwrapped(angles, expected):
    assert_allclose(unwrapped(np.array(angles)), expected, atol=1e-12)
