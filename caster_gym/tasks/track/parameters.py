"""The parameters of the tracking task."""

from typing import Self

from pydantic import NonNegativeFloat, model_validator

from caster_gym.configuration import Positive
from caster_gym.tasks.parameters import Horizons, TaskParameters


class TrackParameters(TaskParameters):
    """How a timed trajectory is to be followed, and how that is rewarded."""

    preview: Horizons = (0.1, 0.2, 0.4)  # [s] horizons at which the coming trajectory is shown
    position_weight: NonNegativeFloat = 0.5
    heading_weight: NonNegativeFloat = 0.3
    speed_weight: NonNegativeFloat = 0.2
    position_scale: Positive = 0.01  # [m]
    heading_scale: Positive = 0.02  # [rad]
    speed_scale: Positive = 0.1  # [m/s]
    yaw_rate_scale: Positive = 0.3  # [rad/s]

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
        return self
