"""Arrays from callers are what they must be, or are named."""

import numpy as np
import pytest

from caster_gym.analysis.checked import finite


def test_a_good_array_is_passed_on_as_numbers():
    array = finite("twist", [[1, 2, 3], [4, 5, 6]], 3)
    assert array.dtype == np.float64
    np.testing.assert_array_equal(array, [[1.0, 2.0, 3.0], [4.0, 5.0, 6.0]])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (1.0, r"twist must have a last axis of 3, got shape \(\)"),
        ([[1.0, 2.0]], r"twist must have a last axis of 3, got shape \(1, 2\)"),
        ([0.0, np.nan, 1.0], "twist must be finite, got nan"),
        ([[0.0, 0.0, 0.0], [0.0, -np.inf, 0.0]], "twist must be finite, got -inf"),
    ],
)
def test_a_bad_array_is_named(value, message):
    with pytest.raises(ValueError, match=message):
        finite("twist", value, 3)
