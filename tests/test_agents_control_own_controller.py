"""agents.control.own_controller: what a controller of a user's own gives is used, or refused by the agent's name."""

import inspect
import re
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_array_equal

from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.own_controller import candidates_of, controller_of
from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.own_errors import OwnCodeError
from caster_gym.robot import load_robot
from caster_gym.tasks.building import observation_layout
from caster_gym.tasks.registry import find_task
from caster_gym.tasks.track.parameters import TrackParameters

LAYOUT = observation_layout(find_task("track"), load_robot("chung2008"), TrackParameters())
SEEN = np.zeros((2, LAYOUT.size), dtype=np.float32)
HALF = np.full((2, 6), 0.5, dtype=np.float32)


class Springs:
    """Acts as it is told."""

    name = "spring"

    def __init__(self, actions: Any = HALF) -> None:
        self.actions = actions

    def act(self, observations):
        return self.actions() if callable(self.actions) else self.actions


class Nameless:
    def act(self, observations):
        return HALF


def own(given, candidates=None):
    """Settings whose `controller` gives this, or what this gives if it is a function."""

    class Own(ControllerSettings):
        def controller(self, layout, period):
            return given() if callable(given) and not isinstance(given, type) else given

        def candidates(self):
            return [self] if candidates is None else candidates()

    return Own(algorithm="springs:Spring")


def made(settings):
    return controller_of(settings, LAYOUT, 0.02, "stiff.yaml")


class Deaf(Springs):
    def act(self):  # type: ignore[override]
        return HALF


class Remembering(Springs):
    """Has a method, or something else, that is told which robots begin an episode."""

    def __init__(self, reset: Any) -> None:
        super().__init__()
        self.reset = reset


def fail(*_: object) -> Any:
    raise ValueError("too stiff")


def test_controllers_of_the_package_are_given_as_they_are():
    settings = ComputedTorqueSettings(algorithm="computed torque")
    assert isinstance(made(settings), ComputedTorque)
    assert candidates_of(settings, "computed_torque") == settings.candidates()


@pytest.mark.parametrize("actions", [HALF, HALF.astype(np.float64), HALF.tolist(), HALF.T.copy().T])
def test_actions_may_be_whatever_holds_the_numbers(actions):
    controller = made(own(Springs(actions)))
    assert controller.name == "spring"
    given = controller.act(SEEN)
    assert_array_equal(given, HALF)
    assert (given.dtype, given.flags.carray) == (np.float32, True)


@pytest.mark.parametrize(
    ("controller", "message"),
    [
        (None, "controller must return an object with a method act, got None"),
        (3, "controller must return an object with a method act, got 3"),
        (object(), "controller must return an object with a method act, got an object of class object$"),
        (Springs, "controller must return an object, got the class Springs itself: call it"),
        (Nameless(), "controller must return an object whose name, .*, is a text, got None as the name of"),
        (fail, r"controller: ValueError: too stiff \(.*test_agents_control_own_controller\.py, line \d+\)"),
        (
            Remembering(3),
            "controller gave an object of class Remembering: its reset must be a method that takes a mask of robots",
        ),
    ],
)
def test_what_is_no_controller_is_refused_by_the_name_of_the_agent(controller, message):
    with pytest.raises(OwnCodeError, match=rf"^agent 'stiff.yaml' \(springs:Spring\): its method {message}"):
        made(own(controller))


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (lambda: None, r"must return actions of shape \(2, 6\), got None"),
        (HALF[0], r"gave no usable actions: actions must have shape \(2, 6\), got \(6,\)"),
        ([[0.5], [0.5, 0.5]], r"gave no usable actions: actions must be an array of shape \(2, 6\)"),
        ("fast", r"gave no usable actions: actions must have shape \(2, 6\), got \(\)"),
        (HALF.astype(str), "gave no usable actions: actions must hold real numbers, got words"),
        (HALF + 1j, "gave no usable actions: actions must hold real numbers, got complex numbers"),
        ([[0.0] * 6, [0.0, 0.0, np.nan, 0.0, 0.0, 0.0]], "must return numbers, got nan for roll_2 of robot 2"),
        (fail, r"ValueError: too stiff \(.*test_agents_control_own_controller\.py, line \d+\)"),
    ],
)
def test_what_are_no_actions_is_refused_by_the_name_of_the_agent(actions, message):
    controller = made(own(Springs(actions)))
    with pytest.raises(OwnCodeError, match=rf"^agent 'stiff.yaml' \(springs:Spring\): its method act:? {message}"):
        controller.act(SEEN)


def test_a_call_that_does_not_fit_is_told_with_the_line_of_the_method():
    here = r"test_agents_control_own_controller\.py, line"
    with pytest.raises(OwnCodeError, match=rf"act: TypeError.* {inspect.getsourcelines(Deaf.act)[1]}\)$") as caught:
        made(own(Deaf())).act(SEEN)
    assert re.search(here, str(caught.value))

    class Own(ControllerSettings):
        def controller(self, layout):  # type: ignore[override]
            return Springs()

    with pytest.raises(OwnCodeError, match=rf"controller: TypeError.*{here} \d+\)$"):
        made(Own(algorithm="springs:Spring"))


def test_a_reset_is_passed_on_and_its_errors_are_told_by_the_name_of_the_agent():
    told: list[np.ndarray] = []
    mask = np.array([True, False])
    made(own(Remembering(told.append))).reset(mask)
    assert_array_equal(told, [mask])
    made(own(Springs())).reset(mask)  # it has none, and needs none
    with pytest.raises(
        OwnCodeError, match=r"^agent 'stiff.yaml' \(springs:Spring\): its method reset: ValueError: too"
    ):
        made(own(Remembering(fail))).reset(mask)


@pytest.mark.parametrize(
    ("candidates", "message"),
    [
        (lambda: [], r"must return a list of at least one Own, got \[\]"),
        (lambda: None, "must return a list of at least one Own, got None"),
        (lambda: [1.0, 2.0], r"must return a list of at least one Own, got \[1.0, 2.0\]"),
        (fail, r": ValueError: too stiff \(.*test_agents_control_own_controller\.py, line \d+\)"),
    ],
)
def test_what_are_no_candidates_is_refused_by_the_name_of_the_agent(candidates, message):
    with pytest.raises(OwnCodeError, match=rf"^agent 'springs:Spring': its method candidates ?{message}"):
        candidates_of(own(Springs(), candidates), "springs:Spring")
