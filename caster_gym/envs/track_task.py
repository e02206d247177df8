"""The parameters of the tracking task."""

from collections.abc import Mapping
from typing import Annotated, Any, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from caster_gym.configuration import Frozen, parse
from caster_gym.envs.tracking import Weights

Horizon: TypeAlias = Annotated[float, Field(gt=0.0, le=1000.0)]


class TrackTask(Frozen):
    """How a timed trajectory is to be followed, and what that is worth."""

    control_period: Annotated[float, Field(ge=1e-5, le=1.0)] = 0.02  # [s] between actions
    substeps: Annotated[int, Field(gt=0, le=1000)] = 4  # RK4 steps in a control period
    preview: tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...] = (
        0.1,
        0.2,
        0.4,
    )  # [s] horizons at which the coming trajectory is shown
    corridor: PositiveFloat = 0.5  # [m] position error that ends an episode
    start_offset: NonNegativeFloat = 0.05  # [m] greatest start offset along each axis
    start_turn: Annotated[float, Field(ge=0.0, le=3.1416)] = 0.2  # [rad] greatest start heading error
    position_weight: NonNegativeFloat = 0.5
    heading_weight: NonNegativeFloat = 0.3
    speed_weight: NonNegativeFloat = 0.2
    effort_weight: NonNegativeFloat = 0.02
    position_scale: PositiveFloat = 0.01  # [m]
    heading_scale: PositiveFloat = 0.02  # [rad]
    speed_scale: PositiveFloat = 0.1  # [m/s]
    yaw_rate_scale: PositiveFloat = 0.3  # [rad/s]
    coarse: Annotated[float, Field(gt=1.0)] = 10.0  # length of the wide reward kernel over that of the fine one

    @model_validator(mode="after")
    def _horizons_are_periods(self) -> Self:
        if list(self.preview) != sorted(set(self.preview)):
            raise ValueError(f"preview horizons must rise from one to the next, got {list(self.preview)}")
        for horizon in self.preview:
            steps = horizon / self.control_period
            if steps < 0.5 or abs(steps - round(steps)) > 1e-6:
                raise ValueError(
                    f"preview horizons must be multiples of the control period {self.control_period:g} s, "
                    f"got {horizon:g} s"
                )
        if self.start_offset * 2.0**0.5 >= self.corridor:
            raise ValueError(
                f"a start_offset of {self.start_offset:g} m along both axes leaves the corridor of {self.corridor:g} m"
            )
        return self

    @property
    def time_step(self) -> float:
        """Length of one RK4 step. [s]"""
        return self.control_period / self.substeps

    def weights(self) -> Weights:
        """The reward's numbers."""
        return Weights(
            self.position_weight,
            self.heading_weight,
            self.speed_weight,
            self.effort_weight,
            self.position_scale,
            self.heading_scale,
            self.speed_scale,
            self.yaw_rate_scale,
            self.coarse,
            self.corridor,
        )


def read_task(fields: Mapping[str, Any]) -> TrackTask:
    """A checked task from keyword arguments."""
    return parse(TrackTask, fields, "the tracking task")
