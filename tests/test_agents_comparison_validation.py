"""agents.comparison.validation: a history is read back as it was written, and a file that is none is told."""

import pytest

from caster_gym.agents.comparison.validation import Validation, read_history, write_history
from caster_gym.tasks.track.metrics import TrackVerdict

HISTORY = [Validation(1000 * k, 1.5 * k, TrackVerdict(0.1 / k, 0.2, 0.3, k, -0.5)) for k in (1, 2, 3)]


def test_a_history_is_read_back_as_it_was_written(tmp_path):
    write_history(tmp_path / "validation.csv", HISTORY)
    assert read_history(tmp_path / "validation.csv", TrackVerdict) == HISTORY


@pytest.mark.parametrize(
    ("wrong", "right"),
    [("steps", "step"), ("2000", "many"), ("2000", "inf"), ("2000,3.0", "2000"), ("2000", "1" * 5000)],
)
def test_a_file_that_is_no_history_is_told(tmp_path, wrong, right):
    file = tmp_path / "validation.csv"
    write_history(file, HISTORY)
    text = file.read_text(encoding="utf-8")
    assert wrong in text
    file.write_text(text.replace(wrong, right), encoding="utf-8")
    with pytest.raises(ValueError, match=r"validation\.csv(, line 3: it has| is no history of a training run: row)"):
        read_history(file, TrackVerdict)
