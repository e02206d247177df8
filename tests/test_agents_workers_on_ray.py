"""caster_gym.agents.workers.on_ray: a call goes on elsewhere when its machine is lost, and ends with the same bytes."""

import time

import pytest

from caster_gym.agents.workers import on_ray
from caster_gym.agents.workers.on_ray import _Signs

pytest.importorskip("ray")


def test_signs_of_an_attempt_that_no_longer_counts_are_refused(monkeypatch):
    signs = _Signs()
    signs.expect(0, 1)
    assert signs.hear(0, 1, "one", ["first"])
    signs.expect(0, 2)
    assert not signs.hear(0, 1, "one", ["late"])
    assert signs.hear(0, 2, "other", ["second"])
    assert signs.take() == ([(0, "first"), (0, "second")], [])
    assert signs.take() == ([], [])


def test_a_call_is_silent_once_and_one_that_has_not_begun_is_not(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    signs = _Signs()
    signs.expect(0, 1)
    signs.expect(1, 1)
    signs.hear(0, 1, "one", [])
    now[0] += on_ray.SILENT
    assert signs.take() == ([], [])
    now[0] += 1.0
    assert signs.take() == ([], [(0, "one")])
    assert signs.take() == ([], [])
