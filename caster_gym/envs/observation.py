"""Observations: one list of channels gives the numbers, their places, units and meanings.

A channel is a function that sees something, and a line in `CHANNELS`, in whose order observations lie. The functions
are on generic scalars; quantities are in the body frame B.
"""

from collections.abc import Callable
from typing import Literal, NamedTuple, TypeAlias, get_args

import numpy as np
from numpy.typing import NDArray

from caster_gym.envs.tracking import Errors, Point, Reference, to_body
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    CasterParameters,
    PlatformParameters,
    RobotParameters,
)
from caster_gym.mechanics.scalars import Scalar, clip, each, flatten, minimum, where
from caster_gym.robot import Robot

POSITION_UNIT = 0.1  # [m] an observed position error of 1
PREVIEW_UNIT = 0.5  # [m] an observed distance to a previewed point of 1
SPEED_UNIT = 1.0  # [m/s] also of a wheel's rim and of a pivot around its wheel
SPEED_ERROR_UNIT = 0.25  # [m/s]
YAW_RATE_UNIT = 2.0  # [rad/s]
YAW_RATE_ERROR_UNIT = 0.5  # [rad/s]
ACCELERATION_UNIT = 2.0  # [m/s²]
YAW_ACCELERATION_UNIT = 4.0  # [rad/s²]
GAP_UNIT = 0.25  # [m] to an obstacle
GAP_LIMIT = 1.0  # [m] obstacles farther away look as if they were there
OBSERVATION_LIMIT = 20.0  # observed quantities are clipped here, far beyond what a robot in its corridor reaches


class Neighbour(NamedTuple):
    """An obstacle nearby."""

    gap: Scalar  # [m]
    nx: Scalar  # unit normal, towards the robot, in W
    ny: Scalar


class View(NamedTuple):
    """What there is to observe, in W unless said otherwise."""

    state: State
    reference: Reference
    errors: Errors  # in B
    preview: tuple[Point, ...]
    nearest: tuple[Neighbour, ...]
    rates: tuple[tuple[Scalar, Scalar], ...]  # θ̇, δ̇ of each caster [rad/s]
    robot: RobotParameters


def position_error(view: View) -> tuple[Scalar, ...]:
    """Where the reference is."""
    return view.errors.ahead, view.errors.left


def heading_error(view: View) -> tuple[Scalar, ...]:
    """How the reference is turned."""
    return view.errors.cos, view.errors.sin


def twist_error(view: View) -> tuple[Scalar, ...]:
    """How much faster the reference is."""
    return view.errors.vx, view.errors.vy, view.errors.omega


def twist(view: View) -> tuple[Scalar, ...]:
    """How fast the robot is."""
    return view.state.twist


def reference_acceleration(view: View) -> tuple[Scalar, ...]:
    """How the reference changes its motion."""
    ax, ay = to_body(view.state.heading, view.reference.ax, view.reference.ay)
    return ax, ay, view.reference.alpha


def directions(view: View) -> tuple[Scalar, ...]:
    """Rolling directions of the casters."""
    return flatten(view.state.directions)


def joint_speeds(view: View) -> tuple[Scalar, ...]:
    """Rolling and steering rates of the casters, as speeds of the rim and of the pivot around the wheel."""
    return flatten(each(_caster_speeds, (), view.rates, view.robot.casters))


def preview(view: View) -> tuple[Scalar, ...]:
    """The coming points of the path."""
    return flatten(each(_point_ahead, (view.state,), view.preview))


def obstacles(view: View) -> tuple[Scalar, ...]:
    """The nearest obstacles."""
    return flatten(each(neighbour_seen, (view.state,), view.nearest))


def _caster_speeds(rates: tuple[Scalar, Scalar], caster: CasterParameters) -> tuple[Scalar, Scalar]:
    theta, delta = rates
    return theta * caster.radius, delta * caster.trail


def _point_ahead(state: State, point: Point) -> tuple[Scalar, ...]:
    c, s = state.heading
    ahead, left = to_body(state.heading, point.x - state.position[0], point.y - state.position[1])
    vx, vy = to_body(state.heading, point.vx, point.vy)
    return ahead, left, c * point.cos + s * point.sin, c * point.sin - s * point.cos, vx, vy, point.omega


def neighbour_seen(state: State, neighbour: Neighbour) -> tuple[Scalar, Scalar, Scalar]:
    """Gap to an obstacle [m], and the direction from it to the robot; far away, no direction."""
    nx, ny = to_body(state.heading, neighbour.nx, neighbour.ny)
    near = neighbour.gap < GAP_LIMIT
    return minimum(neighbour.gap, GAP_LIMIT), where(near, nx, 0.0 * nx), where(near, ny, 0.0 * ny)


Item: TypeAlias = Literal["robot", "caster", "point", "obstacle"]


class Channel(NamedTuple):
    """A line of the observation: physical value = observed · unit."""

    name: str
    see: Callable[[View], tuple[Scalar, ...]]  # physical values, of all items one behind the other
    units: tuple[float, ...]  # of the values of one item
    meaning: str  # with names of the item in braces
    per: Item = "robot"
    levers: tuple[str, ...] = ()  # fields of a caster [m] by which observed speeds are divided to give rates


_TWIST = (SPEED_UNIT, SPEED_UNIT, YAW_RATE_UNIT)

CHANNELS = (
    Channel("position_error", position_error, (POSITION_UNIT,) * 2, "reference minus robot, ahead and left, in B [m]"),
    Channel("heading_error", heading_error, (1.0,) * 2, "cos and sin of reference heading minus robot heading"),
    Channel(
        "twist_error",
        twist_error,
        (SPEED_ERROR_UNIT, SPEED_ERROR_UNIT, YAW_RATE_ERROR_UNIT),
        "reference minus robot, vx, vy, ω, in B [m/s, rad/s]",
    ),
    Channel("twist", twist, _TWIST, "of the robot, vx, vy, ω, in B [m/s, rad/s]"),
    Channel(
        "reference_acceleration",
        reference_acceleration,
        (ACCELERATION_UNIT, ACCELERATION_UNIT, YAW_ACCELERATION_UNIT),
        "of the reference point and heading, world derivative, components in B [m/s², rad/s²]",
    ),
    Channel("directions", directions, (1.0,) * 2, "cos δ_i, sin δ_i of each caster, in B", "caster"),
    Channel(
        "joint_rates",
        joint_speeds,
        (SPEED_UNIT,) * 2,
        "θ̇_i, δ̇_i of each caster [rad/s]; observed as speeds r θ̇ and d δ̇",
        "caster",
        ("radius", "trail"),
    ),
    Channel(
        "preview_{ahead}",
        preview,
        (PREVIEW_UNIT, PREVIEW_UNIT, 1.0, 1.0, *_TWIST),
        "reference {ahead_in_words} ahead: ahead, left [m], cos and sin of its heading, vx, vy [m/s], ω [rad/s], in B",
        "point",
    ),
    Channel(
        "obstacle_{number}",
        obstacles,
        (GAP_UNIT, 1.0, 1.0),
        "nearest obstacle but {nearer}: gap [m], direction from it to the robot, in B; farther than "
        f"{GAP_LIMIT:g} m: that gap, and no direction",
        "obstacle",
    ),
)


def observe(view: View) -> tuple[Scalar, ...]:
    """The observation, as `CHANNELS` say."""
    seen: tuple[Scalar, ...] = ()
    units: tuple[float, ...] = ()
    for channel in CHANNELS:
        values = channel.see(view)
        seen, units = seen + values, units + channel.units * (len(values) // len(channel.units))
    return each(observed, (), seen, units)


def observed(value: Scalar, unit: float) -> Scalar:
    """A number within the observation space; one that is not a number becomes its lower end."""
    return clip(value if unit == 1.0 else value / unit, -OBSERVATION_LIMIT, OBSERVATION_LIMIT)


def observation_size(casters: int, points: int, nearest: int, channels: tuple[Channel, ...] = CHANNELS) -> int:
    """Numbers in an observation of a robot with so many casters, with so many previewed points and obstacles."""
    items = {"robot": 1, "caster": casters, "point": points, "obstacle": nearest}
    return sum(len(channel.units) * items[channel.per] for channel in channels)


_PROBED = {"robot": 1, "caster": 2, "point": 3, "obstacle": 4}  # items, as many of each as of no other


def check_channels(channels: tuple[Channel, ...]) -> None:
    """Refuse channels that would shift or hide others.

    Raises TypeError for two of one name, one that is per something else than `Item` names, and one that does not give a
    number for each of its units.
    """
    robot = RobotParameters(
        PlatformParameters(*(1.0,) * PLATFORM_FIELDS), (CasterParameters(*(1.0,) * CASTER_FIELDS),) * 2
    )
    point, reference = Point(*(1.0,) * len(Point._fields)), Reference(*(1.0,) * len(Reference._fields))
    state = State((1.0, 1.0), (1.0, 0.0), (1.0, 1.0, 1.0), ((1.0, 0.0),) * 2, (), ())
    errors, neighbour = Errors(*(1.0,) * len(Errors._fields)), Neighbour(1.0, 1.0, 0.0)
    view = View(state, reference, errors, (point,) * 3, (neighbour,) * 4, ((1.0, 1.0),) * 2, robot)
    names = [channel.name for channel in channels]
    for channel in channels:
        name, units, function = channel.name, len(channel.units), f"its function {channel.see.__name__} gives"
        if names.count(name) > 1:
            raise TypeError(f"the observation has {names.count(name)} channels {name!r}: each needs a name of its own")
        if channel.per not in _PROBED:
            words = ", ".join(f'"{item}"' for item in _PROBED)
            raise TypeError(f"channel {name!r} of the observation is per={channel.per!r}, which must be one of {words}")
        seen: object = channel.see(view)
        if not isinstance(seen, tuple):
            raise TypeError(
                f"channel {name!r} of the observation: {function} a {type(seen).__name__}, and must give a tuple, of "
                "one number (x,)"
            )
        if len(seen) != units * _PROBED[channel.per]:
            others = [f'; per="{item}" would fit' for item, count in _PROBED.items() if len(seen) == units * count]
            raise TypeError(
                f"channel {name!r} of the observation has {units} units per {channel.per}, and {function} {len(seen)} "
                f"numbers for a robot with 2 casters, 3 points and 4 obstacles: there must be one for each"
                + "".join(others)
            )


check_channels(CHANNELS)


PreviewUnit: TypeAlias = Literal["s", "m"]


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
    >>> layout.size == observation.size, layout.physical(observation, "position_error").shape  # ahead and left [m]
    (True, (2,))
    """

    def __init__(self, robot: Robot, preview: tuple[float, ...], unit: PreviewUnit = "s", nearest: int = 0) -> None:
        if unit not in get_args(PreviewUnit):
            raise ValueError(
                f"the unit of previews must be {' or '.join(map(repr, get_args(PreviewUnit)))}, got {unit!r}"
            )
        self.robot, self.preview, self.unit, self.nearest = robot, preview, unit, nearest
        self._parts: dict[str, Part] = {}
        points = [{"ahead": f"{ahead:g}{unit}", "ahead_in_words": f"{ahead:g} {unit}"} for ahead in preview]
        neighbours = [{"number": str(k + 1), "nearer": str(k)} for k in range(nearest)]
        for channel in CHANNELS:
            scale = list(channel.units) * (robot.caster_count if channel.per == "caster" else 1)
            levers = [getattr(caster, lever) for caster in robot.casters for lever in channel.levers]
            scale = [size / lever for size, lever in zip(scale, levers, strict=True)] if levers else scale
            items = {"point": points, "obstacle": neighbours}
            for words in items.get(channel.per, [{}]):
                self._add(channel.name.format(**words), scale, channel.meaning.format(**words))
        self.size = observation_size(robot.caster_count, len(preview), nearest)

    def _add(self, name: str, scale: list[float], meaning: str) -> None:
        first = max((part.place.stop for part in self._parts.values()), default=0)
        self._parts[name] = Part(name, slice(first, first + len(scale)), np.array(scale), meaning)

    @property
    def parts(self) -> tuple[Part, ...]:
        """All parts, in order."""
        return tuple(self._parts.values())

    def physical(self, observation: NDArray[np.floating], name: str) -> NDArray[np.float64]:
        """One part (..., size of the part) of observations (..., size), in physical units."""
        if name not in self._parts:
            raise ValueError(f"the observation has no part {name!r}; its parts are {', '.join(self._parts)}")
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
