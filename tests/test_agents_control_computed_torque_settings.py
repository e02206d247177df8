"""caster_gym.agents.control.computed_torque_settings: what may be stated, and in which order settings are tried."""

from typing import Any

import pytest

from caster_gym.agents.control.beliefs import Prediction, Sensors
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.observer_torque import ObserverTorque
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.wrappers import ActionDelay, SensorNoise

LAYOUT = ObservationLayout(load_robot("chung2008"), (0.1, 0.2, 0.4))
FEATURES = [SensorNoise(position=0.002), ActionDelay(periods=2)]


def settings(**fields: Any) -> ComputedTorqueSettings:
    return parse(ComputedTorqueSettings, {"algorithm": "computed torque", **fields}, "test")


def test_a_scenario_tells_delays_and_noise():
    informed = settings(predict="scenario", observe="scenario").informed(LAYOUT, FEATURES)
    assert (informed.predict, informed.observe) == (Prediction(delay=2), Sensors(position=0.002))
    assert type(informed.controller(LAYOUT, 0.02)) is ObserverTorque
    stated = settings(predict={"delay": 2})
    assert stated.informed(LAYOUT, FEATURES) == stated
    with pytest.raises(ValueError, match="need the features of an environment"):
        settings(predict="scenario").controller(LAYOUT, 0.02)


def test_without_either_it_is_plain_computed_torque_without_memory():
    plain = settings()
    assert plain.informed(LAYOUT, FEATURES) == plain
    assert type(plain.controller(LAYOUT, 0.02)) is ComputedTorque
    assert not hasattr(plain.controller(LAYOUT, 0.02), "reset")


def test_a_force_that_stays_needs_an_observer():
    with pytest.raises(
        ConfigurationError, match=r"a 'drift' of 2 N/√s needs an observer .*: write 'observe: scenario'"
    ):
        settings(drift=[0.0, 2.0])


@pytest.mark.parametrize(("key", "value"), [("delay", 2), ("noise", 0.1), ("integral", 1.0), ("predictor", 1)])
def test_usual_names_are_answered(key, value):
    with pytest.raises(ConfigurationError, match=r"predict|observe|drift"):
        settings(**{key: value})


def numbers(one: Any) -> tuple[float, float, float]:
    return one.natural_frequencies[0], one.unmodelled[0], one.drift[0]


def rounds(search: Any, best: Any) -> list[list[tuple[float, float, float]]]:
    """All that a search proposes where these numbers are the best, or those nearest to them."""

    def away(one: Any) -> float:
        return float(sum(abs(a - b) for a, b in zip(numbers(one), best, strict=True)))

    tried, proposed, found = [], next(search), []
    while True:
        found.append([numbers(one) for one in proposed])
        tried += proposed
        try:
            proposed = search.send(min(tried, key=away))
        except StopIteration:
            return found


def test_all_combinations_are_tried_and_then_what_is_around_the_best():
    asked = settings(observe={}, natural_frequencies=[5.0, 20.0], unmodelled=[0.1, 1.0], drift=[0.0], refinements=2)
    first, *around = rounds(asked.search(), (38.0, 1.0, 0.0))
    assert first == [(5.0, 0.1, 0.0), (5.0, 1.0, 0.0), (20.0, 0.1, 0.0), (20.0, 1.0, 0.0)]
    assert around[0] == [(40.0, 1.0, 0.0), (10.0, 1.0, 0.0), (20.0, 2.0, 0.0), (20.0, 0.5, 0.0)]
    assert around[1][0] == (80.0, 1.0, 0.0)  # from the better one on; a drift of 0 stays
    assert around[2][0][0] == pytest.approx(40.0 * 2.0**0.5)  # as no whole step helps any more
    assert len(around) == 3


def test_without_an_observer_only_the_natural_frequency_is_searched_for():
    found = rounds(
        settings(natural_frequencies=[10.0], refinements=1, unmodelled=[1.0, 2.0]).search(), (10.0, 1.0, 0.0)
    )
    assert [[one[0] for one in each] for each in found] == [[10.0], [20.0, 5.0]]


def test_the_shipped_one_has_all_of_it():
    shipped = read_agent("computed_torque_observer")
    assert isinstance(shipped, ComputedTorqueSettings)
    assert (shipped.predict, shipped.observe) == ("scenario", "scenario")
