"""caster_gym.agents.control.beliefs: what a controller takes from a plant's features, and when they contradict it."""

import pytest

from caster_gym.agents.control.beliefs import Prediction, Sensors, check_prediction, prediction_of, sensors_of
from caster_gym.robot import load_robot
from caster_gym.wrappers import ActionDelay, MotorLag, Payload, SensorNoise, SteeringOffset, WheelErrors

DRAWN = [Payload(), MotorLag(time_constant=(0.0, 0.03)), ActionDelay(periods=(1, 3))]


def test_delays_are_those_in_the_middle_and_add_up():
    assert prediction_of(DRAWN) == Prediction(delay=2, lag=0.015)
    assert prediction_of([*DRAWN, ActionDelay(periods=4)]).delay == 6
    assert prediction_of([Payload()]) == Prediction()


@pytest.mark.parametrize(
    "believed", [{"delay": 1}, {"delay": 3, "lag": 0.03}, {"delay": 9, "lag": 1.0, "mismatch": True}]
)
def test_what_the_plant_may_have_is_believed_and_so_is_what_is_meant(believed):
    check_prediction(Prediction(**believed), DRAWN)


@pytest.mark.parametrize(
    ("believed", "message"),
    [
        (
            {"delay": 4},
            "a delay of 4 control periods, that of the plant is 1 … 3 control periods: write 'predict: scen",
        ),
        (
            {"delay": 2, "lag": 0.05},
            r"a lag of 0\.05 s, that of the plant is 0 … 0\.03 s: .* or 'mismatch: true' beside",
        ),
    ],
)
def test_another_delay_than_the_plants_is_told(believed, message):
    with pytest.raises(ValueError, match=message):
        check_prediction(Prediction(**believed), DRAWN)


def test_noise_of_several_features_adds_up_as_variances():
    robot = load_robot("chung2008")
    noises = [SensorNoise(position=0.003, steering=0.01), SensorNoise(position=0.004)]
    found = sensors_of(noises, robot)
    assert found.position == pytest.approx(0.005)
    assert found == Sensors(position=found.position, steering=0.01)
    assert found.noisy
    assert not sensors_of(DRAWN, robot).noisy
    # uniform between −b and b: b / √3; radii of 25 mm
    wrong = [SteeringOffset(angle=(-0.02, 0.02)), WheelErrors(radius=(-0.0005, 0.0005))]
    assert sensors_of(wrong, robot).wheels == pytest.approx(0.02 * (2.0 / 3.0) ** 0.5)
