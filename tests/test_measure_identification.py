"""scripts.measure_identification: intervals hold the truth, whichever law friction has, and rows are not made twice."""

import numpy as np
import pytest

from scripts.measure_identification import (
    LAWS,
    TRUTH,
    Held,
    bare_robot,
    coverage_table,
    fitted,
    read_rows,
    recordings,
)

FEW = 3
BENT = "viscous part bent by 20 % at 20 rad/s"


@pytest.mark.slow
@pytest.mark.parametrize("law", ["the model's own", BENT])
def test_errors_of_estimates_are_as_large_as_their_intervals_say(law):
    """Squared errors over variances have mean 1, whichever law friction has.

    Over 9 of them, three for each recording, the mean exceeds 3.1 once in 1,000 samples, were they independent, and is
    below 0.12 as seldom. What rests on a law that does not hold is called into question, and nothing else is.
    """
    rows = [row for i, one in enumerate(recordings(LAWS[law], FEW, 5)) for row in fitted(one, law, i)]
    payload = [row for row in rows if row.name.startswith("payload")]
    squares = [(1.96 * (row.estimate - row.truth) / row.half_width) ** 2 for row in payload]
    assert 0.12 < np.mean(squares) < 3.1
    assert not any(row.doubted for row in payload)
    coefficients = [row for row in rows if row.name.endswith("coulomb")]
    assert all(row.doubted for row in coefficients) == (law == BENT)


def test_recordings_are_motions_of_the_robot_under_their_torques():
    (recording,) = recordings(LAWS["the model's own"], 1, 3)
    assert recording.torque.shape == (101, 4)
    limits = [motor.max_torque for caster in bare_robot().casters for motor in (caster.roll, caster.steer)]
    assert (np.abs(recording.torque) <= np.array(limits) * (1.0 + 1e-12)).all()
    assert np.ptp(recording.pose[:, :2], axis=0).max() > 0.05


def held(law="the model's own", recording=0, name="payload_mass", error=0.0, doubted=False):
    return Held(law, recording, name, TRUTH[name], TRUTH[name] + error, 0.1, doubted, 1.0)


def test_the_table_counts_what_is_not_warned_of():
    rows = [held(recording=0), held(recording=1, error=0.2), held(recording=2), held(recording=3, error=-0.09)]
    rows += [held(recording=3, name="roll_coulomb", error=9.0, doubted=True)]
    last = coverage_table(rows).splitlines()[-1]
    assert last == "| the model's own | 4 | 1 | 75.0 % | – | – | – | – | 75.0 % |"


def test_no_rows_where_there_is_no_file(tmp_path):
    assert read_rows(tmp_path / "coverage.csv") == []
