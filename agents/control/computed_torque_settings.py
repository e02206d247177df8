"""Settings of computed torque, and how its gains are searched for on validation paths."""

from collections.abc import Generator, Mapping, Sequence
from itertools import product
from typing import Annotated, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.agents.control.beliefs import (
    Beliefs,
    Prediction,
    Sensors,
    check_prediction,
    prediction_of,
    sensors_of,
)
from caster_gym.agents.control.computed_torque import ComputedTorque, KnownModel
from caster_gym.agents.control.observer_torque import ObserverTorque
from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.configuration import Positive
from caster_gym.envs.observation import ObservationLayout
from caster_gym.wrappers.feature import Feature

Scenario: TypeAlias = Literal["scenario"]  # as the features of the environment say
MOST_MOVES = 4  # of a refinement
_TUNED = ("natural_frequencies", "unmodelled", "drift")


class ComputedTorqueSettings(ControllerSettings):
    """Model-based control; what is listed is tried on validation paths, and what does best there is taken.

    With an observer these are all combinations of natural frequencies, `unmodelled` and `drift`. Refinements go on from
    the best ones: one number goes up or down by a factor of 2 as long as that helps, then by √2, 2^¼, …
    """

    usual_names: ClassVar[Mapping[str, str]] = {
        **dict.fromkeys(
            ("natural_frequency", "bandwidth"),
            "it is chosen among the 'natural_frequencies' listed, e.g. natural_frequencies: [10.0]",
        ),
        **dict.fromkeys(
            ("kp", "kd"), "gains follow from the natural frequency: list it as natural_frequencies: [10.0]"
        ),
        **dict.fromkeys(("delay", "lag"), "it belongs into 'predict', as predict: {delay: 2, lag: 0.01}"),
        **dict.fromkeys(("noise", "sensors", "observer"), "observe"),
        **dict.fromkeys(("disturbance", "integral", "ki"), "a 'drift' above 0 lets it find forces that stay: [1.0]"),
        "predictor": "predict",
    }
    algorithm: Literal["computed torque"]
    known: KnownModel = "exact"
    natural_frequencies: Annotated[tuple[Positive, ...], Field(min_length=1)] = (5.0, 10.0, 15.0, 20.0, 30.0)
    predict: Scenario | Prediction | None = None  # delay and lag over which it looks ahead
    observe: Scenario | Sensors | None = None  # noise of the sensors, which it filters
    unmodelled: Annotated[tuple[Positive, ...], Field(min_length=1)] = (1.0,)  # [N] forces anew in every period
    drift: Annotated[tuple[NonNegativeFloat, ...], Field(min_length=1)] = (0.0,)  # [N/√s] of a force that it finds
    refinements: Annotated[int, Field(ge=0, le=8)] = 0  # of the search around what has done best
    slack: Annotated[float, Field(ge=0.0, le=1.0)] = 0.0  # share of the least error given away for calmer torques

    @property
    def calmness(self) -> float:
        """Share of the least error that is given away for calmer torques."""
        return self.slack

    @model_validator(mode="after")
    def _forces_are_observed(self) -> Self:
        if self.observe is None and max(self.drift) > 0.0:
            raise ValueError(
                f"a 'drift' of {max(self.drift):g} N/√s needs an observer that finds it: write 'observe: scenario', or "
                "the noise of the sensors, such as observe: {position: 0.002}"
            )
        return self

    def informed(self, layout: ObservationLayout, features: Sequence[Feature]) -> Self:
        """Delays and noise taken from the features where the scenario is to tell them."""
        if isinstance(self.predict, Prediction):
            check_prediction(self.predict, features)
        predict = prediction_of(features) if self.predict == "scenario" else self.predict
        observe = sensors_of(features, layout.robot) if self.observe == "scenario" else self.observe
        return self.model_copy(update={"predict": predict, "observe": observe})

    def controller(self, layout: ObservationLayout, period: float) -> ComputedTorque:
        """The controller with the first of all that is listed. Raises ValueError where a scenario is yet to tell."""
        frequency = self.natural_frequencies[0]
        if self.predict is None and self.observe is None:
            return ComputedTorque(layout, frequency, period, self.known)
        if self.predict == "scenario" or self.observe == "scenario":
            raise ValueError(
                "'predict: scenario' and 'observe: scenario' need the features of an environment: see informed"
            )
        beliefs = Beliefs(
            prediction=self.predict or Prediction(),
            sensors=self.observe,
            unmodelled=self.unmodelled[0],
            drift=self.drift[0],
        )
        return ObserverTorque(layout, frequency, period, beliefs, self.known)

    def candidates(self) -> Sequence[Self]:
        """The same settings with each combination of what is listed; without an observer, of natural frequencies."""
        return [
            self.model_copy(update={name: (one,) for name, one in zip(self._tuned, chosen, strict=True)})
            for chosen in product(*(getattr(self, name) for name in self._tuned))
        ]

    def search(self) -> Generator[Sequence[Self], Self, None]:
        """First all candidates, and then neighbours of the best, ever closer."""
        best = yield self.candidates()
        for number in range(self.refinements):
            for _ in range(MOST_MOVES):
                before, best = best, (yield best.neighbours(2.0 ** (0.5**number)))
                if best == before:
                    break

    def neighbours(self, factor: float) -> Sequence[Self]:
        """Settings that differ in one number, by a factor up or down."""
        return [
            self.model_copy(update={name: (value * times,)})
            for name in self._tuned
            for value in getattr(self, name)[:1]
            for times in (factor, 1.0 / factor)
            if value > 0.0
        ]

    @property
    def _tuned(self) -> tuple[str, ...]:
        """Names of the lists from which numbers are chosen."""
        return _TUNED if self.observe is not None else _TUNED[:1]
