"""The floor as it is written."""

import pytest
from pydantic import ValidationError

from caster_gym.configuration import ConfigurationError
from caster_gym.floor import Floor, Patch, load_floor


def test_a_floor_grips_or_has_a_friction():
    assert load_floor("grip") is None
    assert load_floor({"friction": 0.3}) == Floor(friction=0.3, contact_time=0.01)
    assert load_floor({"friction": 0}) == Floor(friction=0.0)  # as a patch may be
    assert load_floor({}) == Floor()  # the robot's own friction
    ice = {"friction": 0.1, "x": 1.0, "y": 0.0, "radius": 0.5}
    floor = load_floor({"friction": 0.7, "patches": [ice]})
    assert floor is not None
    assert floor.patches == (Patch(friction=0.1, x=1.0, y=0.0, radius=0.5),)
    assert load_floor(floor) is floor


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ("ice", "floor must be 'grip' or a mapping such as {friction: 0.7}, got 'ice'"),
        ({"frction": 0.3}, "frction"),
        ({"friction": -0.1}, "greater than or equal to 0"),
        ({"friction": 1e4}, "less than or equal to 1000"),
        ({"patches": [{"friction": 0.1, "x": 0.0, "y": 0.0, "radius": 0.0}]}, "radius"),
    ],
)
def test_what_is_no_floor_is_refused(given, says):
    with pytest.raises(ConfigurationError, match=says.replace("{", r"\{").replace("}", r"\}")):
        load_floor(given)
    with pytest.raises(ValidationError):
        Floor(contact_time=0.0)
