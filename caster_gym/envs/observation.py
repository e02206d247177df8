"""What the parts of an observation mean: their places, units, frames and scales, by name."""

from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs import tracking
from caster_gym.robot import Robot


class Part(NamedTuple):
    """A named part of the observation: physical value = observed · scale."""

    name: str
    place: slice
    scale: NDArray[np.float64]
    meaning: str


class ObservationLayout:
    """Names the parts of the observations of one robot and task, and turns them back into physical units.

    Agents that need physical quantities decode them from the observation, so that all agents observe the same.
    preview: how far ahead the reference is shown, in seconds ("s") or metres along the path ("m"). nearest: number of
    obstacles shown.

    >>> import caster_gym, gymnasium
    >>> robot = caster_gym.load_robot("chung2008")
    >>> layout = caster_gym.ObservationLayout(robot, preview=(0.1, 0.2, 0.4))  # as CasterTrack-v0 has it
    >>> observation, info = gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate").reset(seed=0)
    >>> layout.size, layout.physical(observation, "position_error").shape  # ahead and left [m]
    (46, (2,))
    """

    def __init__(
        self, robot: Robot, preview: tuple[float, ...], unit: Literal["s", "m"] = "s", nearest: int = 0
    ) -> None:
        n = robot.caster_count
        speed, yaw = tracking.SPEED_UNIT, tracking.YAW_RATE_UNIT
        error, yaw_error = tracking.SPEED_ERROR_UNIT, tracking.YAW_RATE_ERROR_UNIT
        acceleration, yaw_acceleration = tracking.ACCELERATION_UNIT, tracking.YAW_ACCELERATION_UNIT
        rates = [speed / scale for caster in robot.casters for scale in (caster.radius, caster.trail)]
        point = [tracking.PREVIEW_UNIT] * 2 + [1.0] * 2 + [speed] * 2 + [yaw]
        self.robot = robot
        self.preview = preview
        self.unit = unit
        self.nearest = nearest
        self._parts: dict[str, Part] = {}
        self._add("position_error", [tracking.POSITION_UNIT] * 2, "reference minus robot, ahead and left, in B [m]")
        self._add("heading_error", [1.0] * 2, "cos and sin of reference heading minus robot heading")
        self._add("twist_error", [error, error, yaw_error], "reference minus robot, vx, vy, ω, in B [m/s, rad/s]")
        self._add("twist", [speed, speed, yaw], "of the robot, vx, vy, ω, in B [m/s, rad/s]")
        self._add(
            "reference_acceleration",
            [acceleration, acceleration, yaw_acceleration],
            "of the reference point and heading, world derivative, components in B [m/s², rad/s²]",
        )
        self._add("directions", [1.0] * (2 * n), "cos δ_i, sin δ_i of each caster, in B")
        self._add("joint_rates", rates, "θ̇_i, δ̇_i of each caster [rad/s]; observed as speeds r θ̇ and d δ̇")
        for horizon in preview:
            self._add(
                f"preview_{horizon:g}{unit}",
                point,
                f"reference {horizon:g} {unit} ahead: ahead, left [m], cos and sin of its heading, vx, vy [m/s], "
                "ω [rad/s], in B",
            )
        for k in range(1, nearest + 1):
            self._add(
                f"obstacle_{k}",
                [tracking.GAP_UNIT, 1.0, 1.0],
                f"nearest obstacle but {k - 1}: gap [m], direction from it to the robot, in B; farther than "
                f"{tracking.GAP_LIMIT:g} m: that gap, and no direction",
            )

    def _add(self, name: str, scale: list[float], meaning: str) -> None:
        first = self.size
        self._parts[name] = Part(name, slice(first, first + len(scale)), np.array(scale), meaning)

    @property
    def size(self) -> int:
        """Length of an observation."""
        return max((part.place.stop for part in self._parts.values()), default=0)

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts, in order."""
        return tuple(self._parts.values())

    def physical(self, observation: NDArray[np.floating], name: str) -> NDArray[np.float64]:
        """One part (..., size of the part) of observations (..., size), in physical units."""
        part = self._parts[name]
        return observation[..., part.place].astype(np.float64) * part.scale

    def table(self) -> str:
        """The layout as a Markdown table."""
        lines = ["| index | name | meaning | unit of 1 |", "|---|---|---|---|"]
        for part in self.parts:
            index = f"{part.place.start}–{part.place.stop - 1}"
            scale = ", ".join(f"{value:g}" for value in dict.fromkeys(part.scale))
            lines.append(f"| {index} | {part.name} | {part.meaning} | {scale} |")
        return "\n".join(lines)
