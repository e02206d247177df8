"""caster_gym.agents.comparison.metrics: each task is measured as befits it, and verdicts can be read."""

import pytest

from caster_gym.agents.comparison.metrics import in_words
from caster_gym.tasks.follow.metrics import FollowVerdict
from caster_gym.tasks.registry import find_task
from caster_gym.tasks.track.metrics import TrackVerdict
from tests.series import episodes


@pytest.mark.parametrize(("task", "verdict"), [("track", TrackVerdict), ("follow", FollowVerdict)])
def test_a_verdict_is_on_what_was_measured(task, verdict):
    how = find_task(task).metrics
    found = how.verdict.of(how.measure(episodes(), how.settling))
    assert isinstance(found, verdict)
    assert found.failures == 0


def test_a_verdict_reads_as_a_sentence():
    tracking = TrackVerdict(0.00123, 0.01, 0.002, 1, 0.9)
    assert in_words(tracking) == "position RMSE 1.23 mm, 1 failure"
    following = FollowVerdict(0.987, 0.00456, 0.02, 0.0, 0, 0, 1.1)
    assert in_words(following) == "time for the path 98.7 % of the time law's, cross-track RMSE 4.56 mm, 0 failures"
