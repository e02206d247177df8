"""The parameters of the following task."""

from typing import Annotated, Self

from pydantic import Field, NonNegativeFloat, model_validator

from caster_gym.configuration import Positive
from caster_gym.paths.trajectory import rounded_up
from caster_gym.tasks.parameters import Horizons, TaskParameters, Turn


class FollowParameters(TaskParameters):
    """How a path is to be followed at the robot's own pace, and how that is rewarded."""

    preview: Horizons = (0.05, 0.15, 0.4)  # [m] arc lengths ahead at which the path is shown
    corridor: Positive = 0.25  # [m] distance from the path that ends an episode
    start_offset: NonNegativeFloat = 0.02  # [m] greatest start offset along each axis
    start_turn: Turn = 0.1  # [rad] greatest start heading error
    nearest: Annotated[int, Field(ge=0, le=16)] = 3  # obstacles that the observation shows
    speed_limit: Positive = 1.0  # [m/s] along the path; faster progress is worth no more
    margin: Annotated[float, Field(gt=0.0, le=1.0)] = 0.8  # share of the motors that the time law may use
    free_heading: bool = False  # the robot may turn as it likes
    window: Positive = 0.2  # [m] how far ahead of its progress the robot's nearest point is sought
    allowance: Annotated[float, Field(ge=1.0, le=100.0)] = 1.5  # time allowed, as a multiple of the time law's
    arrival: Positive = 0.01  # [m] from the end, where the path counts as done
    arrival_scale: Positive = 0.02  # [m] distance from the end that halves what staying there is worth
    progress_weight: NonNegativeFloat = 0.2
    cross_track_weight: NonNegativeFloat = 0.4
    heading_weight: NonNegativeFloat = 0.4
    impact_weight: NonNegativeFloat = 0.5
    cross_track_scale: Positive = 0.01  # [m]
    heading_scale: Positive = 0.15  # [rad]

    @model_validator(mode="after")
    def _lengths_fit(self) -> Self:
        if list(self.preview) != sorted(set(self.preview)):
            raise ValueError(f"preview distances must rise from one to the next, got {list(self.preview)}")
        if self.window < 2.0 * self.stride:
            raise ValueError(
                f"the window of {self.window:g} m must be at least {rounded_up(2.0 * self.stride, 6):g} m, twice the "
                "way of a control period at the speed limit"
            )
        return self

    @property
    def stride(self) -> float:
        """Way along the path in a control period at the speed limit. [m]"""
        return self.speed_limit * self.control_period
