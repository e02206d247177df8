"""The parameters of the holding task."""

from collections.abc import Mapping
from typing import Annotated, ClassVar

from pydantic import Field, NonNegativeFloat

from caster_gym.configuration import Positive
from caster_gym.tasks.parameters import TaskParameters, Turn


class HoldParameters(TaskParameters):
    """Which pose is to be held, from where, for how long, and how that is rewarded."""

    usual_names: ClassVar[Mapping[str, str]] = {
        **TaskParameters.usual_names,
        **dict.fromkeys(("max_episode_steps", "max_steps", "time_limit"), "an episode lasts for its 'duration' [s]"),
        "goal": "target",
    }

    target: tuple[float, float, float] | None = None  # [m, m, rad] x, y and heading in W; None: the end of each path
    duration: Annotated[float, Field(gt=0.0, le=3600.0)] = 4.0  # [s] of an episode
    corridor: Positive = 1.0  # [m] distance from the pose that ends an episode
    start_offset: NonNegativeFloat = 0.3  # [m] greatest start offset along each axis of the pose
    start_turn: Turn = 1.0  # [rad] greatest start heading error
    position_weight: NonNegativeFloat = 0.4
    heading_weight: NonNegativeFloat = 0.3
    rest_weight: NonNegativeFloat = 0.3
    position_scale: Positive = 0.01  # [m]
    heading_scale: Positive = 0.02  # [rad]
    speed_scale: Positive = 0.05  # [m/s]
    yaw_rate_scale: Positive = 0.2  # [rad/s]
    coarse: Annotated[float, Field(gt=1.0)] = 30.0  # length of the wide reward kernel over that of the fine one
