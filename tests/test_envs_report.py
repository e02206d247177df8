"""caster_gym.envs.report: each quantity has its name, of one robot and of many, whatever the number of reward terms."""

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.envs.report import (
    REPORT_ROWS,
    Deviation,
    Endings,
    Pose,
    Record,
    Report,
    Situation,
    flat_report,
    named,
    torque_rows,
)

COUNTER = iter(range(10_000))


def numbers(kind):
    """A named tuple of numbers of which no two are alike."""
    return kind(*(float(next(COUNTER)) for _ in kind._fields))


REPORT = Report(
    Endings(1.0, 0.0, 1.0),
    numbers(Deviation),
    numbers(Pose),
    numbers(Pose),
    numbers(Record),
    numbers(Situation),
)


@pytest.mark.parametrize("slips", [(), (0.1, 0.2)])
@pytest.mark.parametrize("terms", [("alone",), ("a", "b", "c", "d", "e", "f", "g")])
def test_a_report_is_read_as_it_was_written(terms, slips):
    values = tuple(0.5 + i for i in range(len(terms)))
    row = np.array(flat_report(REPORT, values, ((11.0, 12.0), (13.0, 14.0)), slips))
    info = named(row, terms, len(slips))
    assert info["reward_terms"] == dict(zip(terms, values, strict=True))
    assert_array_equal(info["torque"], [11.0, 12.0, 13.0, 14.0])
    assert_array_equal(row[torque_rows(len(terms), 2)], info["torque"])
    assert_array_equal(info.get("wheel_slip", []), slips)
    assert (info["left_corridor"], info["not_finite"], info["touched"]) == (True, False, True)
    assert_array_equal(info["pose"], REPORT.pose)
    assert_array_equal(info["reference_pose"], REPORT.reference_pose)
    record, situation = REPORT.record, REPORT.situation
    assert_array_equal(info["impulse"], [record.impulse_x, record.impulse_y])
    assert (info["power"], info["traction_use"], info["wheels_lifted"]) == (
        record.power,
        record.traction,
        record.lifted,
    )
    assert (info["impacts"], info["normal_impulse"]) == (record.impacts, record.pressing)
    assert info["impact_traction"] == record.impact_traction
    assert (info["progress"], info["progress_share"], info["clearance"]) == situation
    assert (info["position_error"], info["conditioning"]) == (
        REPORT.deviation.position_error,
        REPORT.deviation.conditioning,
    )


def test_many_robots_have_the_infos_of_each():
    terms = ("a", "b")
    row = np.array(flat_report(REPORT, (1.0, 2.0), ((3.0, 4.0), (5.0, 6.0)), (7.0, 8.0)))
    one, many = named(row, terms, 2), named(np.stack((row, 2.0 * row), axis=1), terms, 2)
    assert one.keys() == many.keys()
    for name in one.keys() - {"reward_terms"}:
        assert_array_equal(many[name][0], one[name], err_msg=name)
    assert {name: term[0] for name, term in many["reward_terms"].items()} == one["reward_terms"]


def test_a_report_of_another_number_of_terms_is_refused():
    row = np.zeros(REPORT_ROWS + 1)
    with pytest.raises(ValueError, match="zip"):
        named(row, ("a", "b"))
