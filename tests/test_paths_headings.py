"""caster_gym.paths.headings: where the body x-axis points."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.configuration import ConfigurationError, parse
from caster_gym.paths.headings import Fixed, Profile, Spinning, Tangent
from caster_gym.paths.shapes import Circle, Lemniscate


def samples(shape):
    (trajectory,) = shape.trajectories(0.02)
    return trajectory.samples


def test_tangent_points_along_the_velocity():
    table = samples(Lemniscate(heading=Tangent()))[1:-1]
    velocity = table[:, 4:6] / np.hypot(table[:, 4], table[:, 5])[:, None]
    assert_allclose(table[:, 2:4], velocity, atol=1e-12)  # rounding of slow speeds near the ends


def test_tangent_is_defined_at_rest():
    assert_allclose(samples(Circle())[[0, -1], 2:4], [[0.0, 1.0], [0.0, 1.0]], atol=1e-14)


def test_offset_is_counted_from_the_tangent():
    plain, offset = samples(Lemniscate()), samples(Lemniscate(heading=Tangent(offset=0.4)))
    turn = (offset[:, 2] + 1j * offset[:, 3]) / (plain[:, 2] + 1j * plain[:, 3])
    assert_allclose(turn, np.exp(0.4j), atol=1e-14)
    assert_allclose(offset[:, 4:], plain[:, 4:], atol=0.0)


def test_fixed_does_not_turn():
    table = samples(Lemniscate(heading=Fixed(angle=2.0)))
    assert_allclose(table[:, 2:4], [[np.cos(2.0), np.sin(2.0)]] * len(table), atol=1e-15)
    assert not table[:, [6, 9]].any()


@pytest.mark.parametrize("laps", [1, 3])
def test_spinning_makes_its_turns_by_the_quintic_however_many_laps(laps):
    table = samples(Circle(heading=Spinning(turns=2.5, angle=0.3), laps=laps))
    tau = np.linspace(0.0, 1.0, len(table))
    angle = 0.3 + 5.0 * np.pi * (10.0 * tau**3 - 15.0 * tau**4 + 6.0 * tau**5)
    # Rounding of angles up to 16 rad.
    assert_allclose(table[:, 2:4], np.stack([np.cos(angle), np.sin(angle)], axis=1), atol=1e-13)


def test_profile_passes_its_angles_at_their_progress():
    angles, progress = (0.5, 2.0, -1.0, 7.0), (0.0, 0.25, 0.6, 1.0)
    no_slopes: Any = ()  # a profile does not look at them
    angle, *_ = Profile(angles=angles, progress=progress).turn(np.array(progress), no_slopes)
    assert_allclose(angle, angles, atol=1e-12)  # rounding of the spline's equations
    even, *_ = Profile(angles=angles).turn(np.array([0.0, 1 / 3, 2 / 3, 1.0]), no_slopes)
    assert_allclose(even, angles, atol=1e-12)


@pytest.mark.parametrize("kind", ["tangent", "fixed", "spinning"])
def test_a_kind_may_be_given_by_its_name_alone(kind):
    heading = Circle.model_validate({"heading": kind}).heading
    assert heading == Circle.model_validate({"heading": {"kind": kind}}).heading
    assert heading.kind == kind


@pytest.mark.parametrize(
    ("heading", "message"),
    [
        ("spining", "unknown kind 'spining'; did you mean 'spinning'"),
        ({"turns": 1.0}, "'kind' is missing; known are fixed, profile, spinning, tangent"),
        ({"kind": "spinning", "trns": 1.0}, "unknown key 'heading.trns'; did you mean 'turns'"),
        ({"kind": ["fixed"]}, "unknown kind"),
        ({"kind": "profile", "angles": [1.0]}, "angles"),
        ({"kind": "profile", "angles": [0.0, 1.0], "progress": [0.0, 0.5, 1.0]}, "got 3 for 2"),
        ({"kind": "profile", "angles": [0.0, 1.0], "progress": [0.0, 0.9]}, r"ascend from 0 to 1, got \[0.0, 0.9\]"),
        ({"kind": "profile", "angles": [0.0, 1.0, 2.0], "progress": [0.0, 0.0, 1.0]}, "ascend from 0 to 1"),
        (3.0, "heading"),
    ],
)
def test_a_heading_that_cannot_be_is_refused_by_name(heading, message):
    with pytest.raises(ConfigurationError, match=message):
        parse(Circle, {"heading": heading}, "path")
