"""caster_gym.agents.sweep.search: what is chosen follows from the settings, whenever it stops and whoever is first."""

import math
from typing import Any

import optuna
import pytest

from caster_gym.agents.sweep.outcome import Outcome
from caster_gym.agents.sweep.search import Search
from caster_gym.agents.sweep.settings import SweepSettings
from caster_gym.configuration import ConfigurationError, parse

SPACE: dict[str, Any] = {
    "agent.learning_rate": {"low": 1e-4, "high": 1e-1, "log": True},
    "agent.n_epochs": {"low": 1, "high": 20},
    "agent.net_arch": {"choices": [[64, 64], [128]]},
}


def settings_of(**others):
    return parse(SweepSettings, {"space": SPACE, "trials": 20, "at_once": 3, "storage": "journal", **others}, "file")


def result(point):
    """Best with a learning rate of 1e-2; some fail, and some are pruned."""
    rate, epochs = point["agent.learning_rate"], point["agent.n_epochs"]
    score = -((math.log10(rate) + 2.0) ** 2) - 0.01 * epochs
    if epochs == 7:
        return Outcome("failed", [], [], "seven")
    return Outcome("pruned" if score < -1.0 else "completed", [[score - 1.0, score]], [{"failures": 0.0}])


def go_on(search, order=1, outcome_of=result):
    """Choose and end trials until nobody is left; of those that run at once, the first or the last ends first."""
    while True:
        while search.may_choose():
            search.choose()
        running = [number for number in range(len(search.points)) if number not in search.outcomes][::order]
        if not running:
            return search
        search.tell(running[0], outcome_of(search.points[running[0]]))


@pytest.fixture(scope="module")
def undisturbed(tmp_path_factory):
    return go_on(Search(settings_of(), tmp_path_factory.mktemp("search"), resume=False))


def test_trials_are_as_many_as_asked_for_and_differ(undisturbed):
    points = undisturbed.points
    assert len({tuple(point.values()) for point in points}) == len(points) == len(undisturbed.outcomes) == 20


def test_later_points_follow_from_earlier_outcomes(undisturbed, tmp_path):
    """Of the first ten that have ended none is left out, after which two more were chosen already."""

    def other(point):
        return Outcome("completed", [[abs(result(point).score("mean"))]])

    points = go_on(Search(settings_of(), tmp_path, resume=False), outcome_of=other).points
    assert points[:12] == undisturbed.points[:12]
    assert not any(one in undisturbed.points for one in points[12:])


@pytest.mark.parametrize(("storage", "first"), [("sqlite", 5), ("journal", 1), ("journal", 5), ("journal", 13)])
def test_a_search_that_was_stopped_chooses_the_same_points(undisturbed, tmp_path, storage, first):
    """By fewer trials at first, and with some running when it stops a second time."""
    go_on(Search(settings_of(trials=first, storage=storage), tmp_path, resume=False))
    stopped = Search(settings_of(storage=storage), tmp_path, resume=True)
    assert len(stopped.points) == len(stopped.outcomes) == first
    while stopped.may_choose():
        stopped.choose()
    again = Search(settings_of(storage=storage), tmp_path, resume=True)
    assert again.points == stopped.points and len(again.points) > len(again.outcomes) == first
    assert go_on(again).points == undisturbed.points
    assert again.outcomes == undisturbed.outcomes


def test_who_ends_first_changes_nothing(undisturbed, tmp_path):
    assert go_on(Search(settings_of(), tmp_path, resume=False), order=-1).points == undisturbed.points


@pytest.mark.parametrize("other", [{"seed": 1}, {"at_once": 2}, {"sampler": "random"}])
def test_other_settings_choose_other_points(undisturbed, tmp_path, other):
    assert go_on(Search(settings_of(**other), tmp_path, resume=False)).points != undisturbed.points


def test_a_trial_waits_for_the_one_that_it_depends_on(tmp_path):
    search = Search(settings_of(), tmp_path, resume=False)
    for _ in range(3):
        search.choose()
    assert not search.may_choose()
    search.tell(1, result(search.points[1]))
    assert not search.may_choose()
    search.tell(0, result(search.points[0]))
    assert search.may_choose()
    assert search.known(3) == [search.outcomes[0]]


def test_optuna_reads_the_study(tmp_path):
    search = go_on(Search(settings_of(trials=8, storage="sqlite"), tmp_path, resume=False))
    study = optuna.load_study(study_name="sweep", storage=f"sqlite:///{tmp_path / 'study.db'}")
    assert [trial.params for trial in study.trials] == search.points
    for trial in study.trials:
        outcome = search.outcomes[trial.number]
        assert trial.state.name == ("COMPLETE" if outcome.kind == "completed" else "PRUNED")
        assert list(trial.intermediate_values.values()) == [one for scores in outcome.scores for one in scores]
    best = max(range(8), key=lambda n: (search.outcomes[n].kind == "completed", search.outcomes[n].score("mean")))
    assert study.best_trial.number == best


def test_points_become_settings(undisturbed):
    settings = undisturbed.settings_of(4)
    assert settings.keys() == SPACE.keys()
    assert settings["agent.net_arch"] in ([64, 64], [128])


def test_a_study_of_others_is_not_gone_on_with(tmp_path):
    url = f"sqlite:///{tmp_path / 'shared.db'}"
    go_on(Search(settings_of(trials=1, storage=url), tmp_path, resume=False))
    with pytest.raises(ConfigurationError, match=r"the study 'sweep' is in .*shared\.db already; .* 'study'"):
        Search(settings_of(storage=url), tmp_path, resume=False)
    go_on(Search(settings_of(trials=1, storage=url, study="another"), tmp_path, resume=False))


@pytest.mark.parametrize("url", ["nodatabase://user@host/name", "sqlite:////no/such/folder/study.db"])
def test_a_database_that_cannot_be_used_is_told(tmp_path, url):
    with pytest.raises(ConfigurationError, match=r"storage .* cannot be used"):
        Search(settings_of(storage=url), tmp_path, resume=False)
