"""Checks what user-defined controllers return, and reports errors with the agent and the line."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from caster_gym.agents.control.protocol import Agent, ControllerSettings
from caster_gym.arrays import Flags
from caster_gym.brief import brief
from caster_gym.control.episodes import reset_of
from caster_gym.envs.inputs import read_actions
from caster_gym.envs.observation import ObservationLayout
from caster_gym.own_errors import OwnCodeError, in_own_code


def candidates_of(settings: ControllerSettings, called: str) -> Sequence[ControllerSettings]:
    """The settings that an agent offers to choose from. called: what messages call the agent."""
    if not settings.is_own:
        return settings.candidates()
    words = f"{_described(settings, called)}: its method candidates"
    with in_own_code(words, type(settings).candidates):
        found = settings.candidates()
    listed = isinstance(found, Sequence) and all(isinstance(one, ControllerSettings) for one in found)
    if not listed or not found:
        raise OwnCodeError(f"{words} must return a list of at least one {type(settings).__name__}, got {brief(found)}")
    return found


def controller_of(settings: ControllerSettings, layout: ObservationLayout, period: float, called: str) -> Agent:
    """The controller of an agent; one of a user's own is checked, now and whenever it acts."""
    if not settings.is_own:
        return settings.controller(layout, period)
    agent = _described(settings, called)
    words = f"{agent}: its method controller"
    with in_own_code(words, type(settings).controller):
        controller = settings.controller(layout, period)
    if isinstance(controller, type):
        raise OwnCodeError(f"{words} must return an object, got the class {controller.__name__} itself: call it")
    if not callable(getattr(controller, "act", None)):
        raise OwnCodeError(f"{words} must return an object with a method act, got {brief(controller)}")
    with in_own_code(f"{agent}: the name of its controller", type(controller)):
        name = getattr(controller, "name", None)
    if not isinstance(name, str) or not name.strip():
        raise OwnCodeError(
            f"{words} must return an object whose name, for tables and figures, is a text, got {brief(name)} as the "
            f"name of {brief(controller)}"
        )
    try:
        reset_of(controller)
    except ValueError as error:
        raise OwnCodeError(f"{words} gave {brief(controller)}: {error}") from error
    return _Checked(controller, name, agent, layout)


def _described(settings: ControllerSettings, called: str) -> str:
    return f"agent {called!r}" if called == settings.algorithm else f"agent {called!r} ({settings.algorithm})"


class _Checked:
    """An agent whose actions are checked."""

    def __init__(self, agent: Any, name: str, described: str, layout: ObservationLayout) -> None:
        self.name = name
        self._agent, self._driven, self._reset = agent, layout.robot.driven, reset_of(agent)
        self._words = f"{described}: its method"

    def reset(self, mask: Flags) -> None:
        """New episodes of some robots begin."""
        with in_own_code(f"{self._words} reset", self._reset):
            self._reset(mask)

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) in −1 … 1 for observations (robots, size)."""
        words = f"{self._words} act"
        with in_own_code(words, self._agent.act):
            given = self._agent.act(observations)
        shape = (len(observations), len(self._driven))
        if given is None:
            raise OwnCodeError(f"{words} must return actions of shape {shape}, got None")
        try:
            actions = read_actions(given, shape, "actions")
        except Exception as error:  # of whatever was given, such as a tensor that needs its gradient
            raise OwnCodeError(f"{words} gave no usable actions: {error}") from error
        if (missing := np.isnan(actions)).any():
            robot, joint = np.argwhere(missing)[0]
            raise OwnCodeError(f"{words} must return numbers, got nan for {self._driven[joint]} of robot {robot + 1}")
        return actions
