"""What all tasks have in common: time, corridor, starts, obstacles and costs."""

from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, Literal, Self, TypeAlias

from pydantic import Field, NonNegativeFloat, field_validator, model_validator

from caster_gym.configuration import Extensible, Positive
from caster_gym.engines.time_step import MOST_SUBSTEPS, SHORTEST_PERIOD
from caster_gym.floor import Floor

MOST_HORIZONS = 64  # each of them is compiled

Horizons: TypeAlias = Annotated[tuple[Annotated[float, Field(gt=0.0, le=1000.0)], ...], Field(max_length=MOST_HORIZONS)]
Turn: TypeAlias = Annotated[float, Field(ge=0.0, le=3.1416)]  # [rad] either way


class TaskParameters(Extensible):
    """How a path is to be walked, and what that costs; a task adds its own fields, among them `preview`."""

    usual_names: ClassVar[Mapping[str, str]] = {
        "dt": "control_period",
        "control_dt": "control_period",
        "timestep": "'control_period' is the time between actions [s], each of 'substeps' steps of the simulator",
        "time_step": "'control_period' is the time between actions [s], each of 'substeps' steps of the simulator",
        "control_freq": "give the time between actions instead: 'control_period' [s], its inverse",
        "control_frequency": "give the time between actions instead: 'control_period' [s], its inverse",
        "frame_skip": "substeps",
        "decimation": "substeps",
        "action_repeat": "substeps",
        "max_episode_steps": "an episode is as long as its path: set the 'duration' or the 'laps' of that",
        "max_steps": "an episode is as long as its path: set the 'duration' or the 'laps' of that",
        "time_limit": "an episode is as long as its path: set the 'duration' or the 'laps' of that",
        "seed": "give the seed to reset: env.reset(seed=0)",
        "n_envs": "robots are counted by gymnasium.make_vec(…, num_envs=8)",
        "horizon": "'preview' says how far ahead the observation looks",
        "lookahead": "preview",
        "obstacles": "obstacles stand in 'arena'",
        "trajectory": "the path is given as 'path'",
        "paths": "the path, or a list of them, is given as 'path'",
        "friction": "wheels slip on a 'floor' of finite friction, such as {friction: 0.3}",
        "floor_friction": "wheels slip on a 'floor' of finite friction, such as {friction: 0.3}",
        "mu": "wheels slip on a 'floor' of finite friction, such as {friction: 0.3}",
        **dict.fromkeys(("slip", "ice", "slippery"), "wheels slip on a 'floor' of finite friction, {friction: 0.05}"),
        "patches": "patches lie on the 'floor', {patches: [{friction: 0.05, x: 1.0, y: 0.0, radius: 0.4}]}",
        "contact_time": "it belongs to the 'floor', as {friction: 0.3, contact_time: 0.01}",
        "impact_law": "it belongs to the 'arena', as {impact_law: stronge}",
        "restitution": "it belongs to the 'arena', as {restitution: 0.5}",
        "impact_friction": "it belongs to the 'arena', as {friction: 0.2}",
        "height": "it belongs to the 'platform' of the 'robot', whose mass centre is so high above the floor",
        "ground": "floor",
        "terrain": "floor",
    }

    control_period: Annotated[float, Field(ge=SHORTEST_PERIOD, le=1.0)] = 0.02  # [s] between actions
    substeps: Annotated[int, Field(gt=0, le=MOST_SUBSTEPS)] = 4  # RK4 steps in a control period
    corridor: Positive = 0.5  # [m] position error that ends an episode
    start_offset: NonNegativeFloat = 0.05  # [m] greatest start offset along each axis
    start_turn: Turn = 0.2  # [rad] greatest start heading error
    touching: Literal["allowed", "ends"] = "allowed"  # what touching an obstacle means for the episode
    preview: Horizons = ()  # horizons at which the reference is shown
    nearest: Annotated[int, Field(ge=0, le=16)] = 0  # obstacles that the observation shows
    floor: Literal["grip"] | Floor = "grip"  # or one of finite friction, on which wheels may slip
    effort_weight: NonNegativeFloat = 0.02
    impact_weight: NonNegativeFloat = 0.0
    impact_scale: Positive = 0.5  # [N s] normal impulse in a control period that costs half of the weight
    coarse: Annotated[float, Field(gt=1.0)] = 10.0  # length of the wide reward kernel over that of the fine one

    @field_validator("floor", mode="before")
    @classmethod
    def _a_mapping_is_a_floor(cls, floor: Any) -> Any:
        """What is wrong with it is then told of it alone, and not of the word `grip` too."""
        return Floor.model_validate(floor) if isinstance(floor, Mapping) else floor

    @property
    def time_step(self) -> float:
        """Length of one RK4 step. [s]"""
        return self.control_period / self.substeps

    @property
    def slippery(self) -> Floor | None:
        """The floor if wheels may slip on it, else None."""
        return None if self.floor == "grip" else self.floor

    @property
    def touching_ends(self) -> bool:
        """Whether an episode ends when the robot touches an obstacle."""
        return self.touching == "ends"

    @property
    def start_reach(self) -> float:
        """Greatest distance of a start from the path. [m]"""
        return float(self.start_offset * 2.0**0.5)

    @model_validator(mode="after")
    def _starts_in_its_corridor(self) -> Self:
        if self.start_reach >= self.corridor:
            raise ValueError(
                f"a start_offset of {self.start_offset:g} m along both axes leaves the corridor of {self.corridor:g} m"
            )
        return self
