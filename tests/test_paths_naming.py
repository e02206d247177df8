"""caster_gym.paths.naming: an unknown name is answered with the nearest known one."""

from caster_gym.paths.naming import unknown_name


def test_a_name_with_a_slip_is_answered_with_the_nearest():
    assert unknown_name("shape", "elipse", ("ellipse", "circle")) == "unknown shape 'elipse'; did you mean 'ellipse'?"


def test_a_name_like_none_of_them_is_answered_with_all():
    assert unknown_name("shape", "qqq", ("ellipse", "circle")) == "unknown shape 'qqq'; known are circle, ellipse"


def test_a_name_that_is_missing_is_said_to_be_missing():
    assert unknown_name("shape", None, ("ellipse", "circle")) == "'shape' is missing; known are circle, ellipse"
