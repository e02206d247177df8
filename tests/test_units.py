"""caster_gym.units: units as they are written, and angles that can hardly be radians."""

import numpy as np
import pytest

from caster_gym.units import UNITS, read_unit, unlikely_angle, unlikely_radians


@pytest.mark.parametrize(
    ("written", "quantity", "unit"),
    [
        ("Nm", "torque", "N m"), ("N·m", "torque", "N m"), ("N⋅m", "torque", "N m"), ("N*m", "torque", "N m"),
        ("N m", "torque", "N m"), ("mNm", "torque", "mN m"), ("mN·m", "torque", "mN m"), ("nm", "torque", "N m"),
        ("°", "angle", "deg"), ("Deg", "angle", "deg"), ("degrees", "angle", "deg"), ("°/s", "rate", "deg/s"),
        ("deg / s", "rate", "deg/s"), ("radps", "rate", "rad/s"), ("mps", "velocity", "m/s"),
        ("ns", "time", "ns"), ("µs", "time", "us"), ("μs", "time", "us"), ("us", "time", "us"), ("sec", "time", "s"),
        ("MM", "length", "mm"), ("metres", "length", "m"),
    ],
)  # fmt: skip
def test_a_unit_is_read_however_it_is_written(written, quantity, unit):
    assert read_unit(written, quantity) == unit


@pytest.mark.parametrize(
    ("written", "quantity"), [("MN m", "torque"), ("furlong", "length"), ("m", "time"), ("", "angle")]
)
def test_what_is_no_unit_of_a_quantity_is_none(written, quantity):
    assert read_unit(written, quantity) is None


def test_sizes_of_units_by_hand():
    assert UNITS["length"]["in"] == pytest.approx(0.0254)
    assert UNITS["angle"]["deg"] * 180.0 == pytest.approx(np.pi)
    assert UNITS["rate"]["rpm"] * 60.0 == pytest.approx(2.0 * np.pi)
    assert UNITS["velocity"]["km/h"] * 36.0 == pytest.approx(10.0)
    assert all(next(iter(units.values())) == 1.0 for units in UNITS.values())


@pytest.mark.parametrize(
    "degrees",
    [
        (0, 90),
        (0, 45, 90),
        (0, 10, 20),
        (-180, 0),
        (0, 15),
        (0.0, 120.5),
        tuple(range(360)),
        np.linspace(0.0, 359.0, 57),
    ],
)
def test_angles_in_degrees_are_told_from_radians(degrees):
    assert unlikely_radians(degrees) is not None


@pytest.mark.parametrize(
    "radians",
    [(0.0, 3.2), (0.0, 6.2832), (0.0, 4.0, 8.0, 12.0), (0.0, 12.566), (0.0, 31.416, 62.832), (-7.0, 7.0), ()],
)
def test_turns_in_radians_are_left_alone(radians):
    assert unlikely_radians(radians) is None


def test_an_angle_alone_need_not_be_more_than_a_turn():
    assert not any(unlikely_angle(angle) for angle in (0.0, -3.1416, 6.2832))
    assert all(unlikely_angle(angle) for angle in (45.0, -90.0, 7.0))
