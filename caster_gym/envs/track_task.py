"""The parameters of the tracking task."""

from collections.abc import Mapping
from typing import Annotated, Any, Self

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator

from caster_gym.configuration import parse
from caster_gym.envs.task import Task
from caster_gym.envs.tracking import Weights


class TrackTask(Task):
    """How a timed trajectory is to be followed, and what that is worth."""

    preview: tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...] = (
        0.1,
        0.2,
        0.4,
    )  # [s] horizons at which the coming trajectory is shown
    position_weight: NonNegativeFloat = 0.5
    heading_weight: NonNegativeFloat = 0.3
    speed_weight: NonNegativeFloat = 0.2
    position_scale: PositiveFloat = 0.01  # [m]
    heading_scale: PositiveFloat = 0.02  # [rad]
    speed_scale: PositiveFloat = 0.1  # [m/s]
    yaw_rate_scale: PositiveFloat = 0.3  # [rad/s]

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
        self.check_start()
        return self

    def weights(self) -> Weights:
        """The reward's numbers."""
        return Weights(
            self.position_weight,
            self.heading_weight,
            self.speed_weight,
            self.effort_weight,
            self.impact_weight,
            self.position_scale,
            self.heading_scale,
            self.speed_scale,
            self.yaw_rate_scale,
            self.impact_scale,
            self.coarse,
            self.corridor,
            float(self.touching == "ends"),
        )


def read_task(fields: Mapping[str, Any]) -> TrackTask:
    """A checked task from keyword arguments."""
    return parse(TrackTask, fields, "the tracking task")
