"""Robots that differ from their description: loads, friction, wheels. Every episode draws from the nominal robot.

Only the plant changes; agents know the nominal robot. Parameters are rows (k, fields) in the order of
`caster_gym.mechanics.parameters.pack_parameters`.
"""

from collections.abc import Mapping
from typing import Annotated, ClassVar, Literal, TypeAlias

import numpy as np
from pydantic import AfterValidator, NonNegativeFloat

from caster_gym.arrays import Array, Indices, Seeds
from caster_gym.envs.randomness import uniforms
from caster_gym.floor import GREATEST
from caster_gym.mechanics.parameters import (
    CASTER_FIELDS,
    PLATFORM_FIELDS,
    CasterParameters,
    PlatformParameters,
    with_load,
)
from caster_gym.wrappers.feature import (
    Feature,
    Observations,
    Place,
    PlantRuntime,
    Quantities,
    Range,
    Robots,
    Runtime,
    Size,
    between,
    limits,
)


class Payload(Feature):
    """A load that is fixed to the platform.

    >>> import gymnasium
    >>> from caster_gym.wrappers import Payload, wrap
    >>> env = wrap(gymnasium.make("caster_gym:CasterTrack-v0", path="lemniscate"), Payload(mass=(0.0, 2.0), x=0.05))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["payload"] = "payload"
    mass: Size = 1.0  # [kg]
    x: Range = 0.0  # [m] its mass centre, forward of C
    y: Range = 0.0  # [m] and left of C
    inertia: NonNegativeFloat = 0.0  # [kg m²] about a vertical axis through its mass centre; 0: a point
    height: Size | None = None  # [m] of its mass centre above the floor; null: as high as the platform's

    def runtime(self, place: Place) -> Runtime:
        """Platforms with loads."""
        return _Payload(self)


def _of_a_floor(value: float | tuple[float, float]) -> float | tuple[float, float]:
    low, high = limits(value)
    if low < 0.0 or high > GREATEST:
        raise ValueError(f"must lie in 0 … {GREATEST:g}, as a floor's friction does")
    return value


OfAFloor: TypeAlias = Annotated[Range, AfterValidator(_of_a_floor)]


class Friction(Feature):
    """Other friction in each joint, drawn joint by joint, and another floor.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import Friction, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), Friction(added_coulomb=(0.0, 0.01)))
    >>> observation, info = env.reset(seed=0)
    """

    usual_names: ClassVar[Mapping[str, str]] = {"friction": "floor_friction", "mu": "floor_friction"}

    kind: Literal["friction"] = "friction"
    viscous_scale: Size = 1.0  # [-] of the joints' own viscous friction
    coulomb_scale: Size = 1.0  # [-] of the joints' own dry friction
    added_viscous: Size = 0.0  # [N m s/rad] on top, in every joint
    added_coulomb: Size = 0.0  # [N m] on top, in every joint
    floor_friction: OfAFloor | None = None  # [-] between wheels and floor; null: the robot's own

    def runtime(self, place: Place) -> Runtime:
        """Joints and floors with other friction. Raises ValueError for a floor that grips without friction."""
        if self.floor_friction is not None and limits(self.floor_friction)[0] == 0.0 and place.task.slippery is None:
            raise ValueError(
                f"floor_friction must be greater than 0 where the floor grips, got {self.floor_friction}, since "
                "'traction_use' is a share of it; let wheels slip by the task's 'floor', such as {friction: 0.3}"
            )
        return _Friction(self, place)


class WheelErrors(Feature):
    """Casters whose trails and wheels differ from the description, drawn caster by caster.

    >>> from caster_gym import CasterTrackEnv
    >>> from caster_gym.wrappers import WheelErrors, wrap
    >>> env = wrap(CasterTrackEnv(path="lemniscate"), WheelErrors(radius=(-0.001, 0.001)))
    >>> observation, info = env.reset(seed=0)
    """

    kind: Literal["wheel_errors"] = "wheel_errors"
    trail: Range = 0.0  # [m] true trail minus described one
    radius: Range = 0.0  # [m] true radius minus described one

    def runtime(self, place: Place) -> Runtime:
        """Casters of other sizes. Raises ValueError for ones that do not exist."""
        robot = place.engine.robot
        trail = min(caster.trail for caster in robot.casters) + limits(self.trail)[0]
        radius = min(caster.radius for caster in robot.casters) + limits(self.radius)[0]
        if trail <= 0.0 or radius <= 0.0:
            raise ValueError(
                f"wheel_errors must leave trails and radii of robot {robot.name!r} positive, "
                f"got a trail of {trail:g} m and a radius of {radius:g} m"
            )
        return _WheelErrors(self, place)


class _Payload(PlantRuntime):
    def __init__(self, feature: Payload) -> None:
        self._feature = feature

    def rebuild(self, parameters: Array, seeds: Seeds) -> Array:
        shares = uniforms(seeds, np.arange(4))
        return self._loaded(parameters, shares)

    def extremes(self, parameters: Array) -> Array:
        """The lightest load, at each corner: more mass makes everything slower."""
        corners = np.array([(0.0, x, y, 0.0) for x in (0.0, 0.5, 1.0) for y in (0.0, 0.5, 1.0)])
        rows = np.repeat(parameters, len(corners), axis=0)
        return self._loaded(rows, np.tile(corners, (len(parameters), 1)))

    def _loaded(self, parameters: Array, shares: Array) -> Array:
        """Robots with loads at shares (k, 4) of the ranges of mass, x, y and height."""
        feature = self._feature
        added = between(feature.mass, shares[:, 0])
        x, y = between(feature.x, shares[:, 1]), between(feature.y, shares[:, 2])
        bare = PlatformParameters(*parameters[:, :PLATFORM_FIELDS].T)
        rebuilt = parameters.copy()
        z = None if feature.height is None else between(feature.height, shares[:, 3])
        rebuilt[:, :PLATFORM_FIELDS] = np.stack(with_load(bare, added, x, y, feature.inertia, z), axis=1)
        return rebuilt


class _Friction(PlantRuntime):
    def __init__(self, feature: Friction, place: Place) -> None:
        casters = place.engine.robot.caster_count
        self._floor = feature.floor_friction
        self._kinds = (
            (_joints(casters, "viscous"), feature.viscous_scale, feature.added_viscous),
            (_joints(casters, "coulomb"), feature.coulomb_scale, feature.added_coulomb),
        )

    def rebuild(self, parameters: Array, seeds: Seeds) -> Array:
        rebuilt = parameters.copy()
        first = 1
        for columns, scale, added in self._kinds:
            shares = uniforms(seeds, first + np.arange(2 * len(columns)))
            factors, terms = between(scale, shares[:, : len(columns)]), between(added, shares[:, len(columns) :])
            rebuilt[:, columns] = factors * parameters[:, columns] + terms
            first += 2 * len(columns)
        if self._floor is not None:
            rebuilt[:, _platform("floor_friction")] = between(self._floor, uniforms(seeds, np.zeros(1, np.int64))[:, 0])
        return rebuilt

    def extremes(self, parameters: Array) -> Array:
        """The greatest friction in every joint."""
        rebuilt = parameters.copy()
        for columns, scale, added in self._kinds:
            rebuilt[:, columns] = limits(scale)[1] * parameters[:, columns] + limits(added)[1]
        return rebuilt


class _WheelErrors(PlantRuntime):
    """Encoders show joint rates, whatever the wheels' sizes: observations scale these with the described sizes."""

    def __init__(self, feature: WheelErrors, place: Place) -> None:
        robot = place.engine.robot
        self._feature, self._place = feature, place
        radii, trails = (_casters(robot.caster_count, name) for name in ("radius", "trail"))
        self._columns = [column for pair in zip(radii, trails, strict=True) for column in pair]
        self._described = np.array([size for caster in robot.casters for size in (caster.radius, caster.trail)])
        self._rates = place.part("joint_rates").place
        self._ratios = np.ones((place.count, len(self._described)))

    def rebuild(self, parameters: Array, seeds: Seeds) -> Array:
        rebuilt = parameters.copy()
        rebuilt[:, self._columns] += self._errors(seeds)
        return rebuilt

    def extremes(self, parameters: Array) -> Array:
        """The ends of both ranges, in all casters alike."""
        ends = [(r, d) for r in limits(self._feature.radius) for d in limits(self._feature.trail)]
        rebuilt = np.repeat(parameters, len(ends), axis=0)
        rebuilt[:, self._columns] += np.tile(ends, (len(parameters), len(self._columns) // 2))
        return rebuilt

    def begin(self, robots: Indices, quantities: Quantities) -> None:
        self._ratios[robots] = self._described / (self._described + self._errors(self._place.seeds[robots]))

    def observe(self, observations: Observations, robots: Robots) -> Observations:
        shown = observations.copy()
        shown[:, self._rates] = shown[:, self._rates] * self._ratios[robots]
        return shown

    def _errors(self, seeds: Seeds) -> Array:
        """Errors (k, 2 N) of each caster's radius and trail. [m]"""
        shares = uniforms(seeds, np.arange(len(self._described)))
        errors = np.empty_like(shares)
        errors[:, ::2] = between(self._feature.radius, shares[:, ::2])
        errors[:, 1::2] = between(self._feature.trail, shares[:, 1::2])
        return errors


def _platform(name: str) -> int:
    return PlatformParameters._fields.index(name)


def _casters(count: int, name: str) -> list[int]:
    """Columns of a parameter of every caster."""
    return [PLATFORM_FIELDS + i * CASTER_FIELDS + CasterParameters._fields.index(name) for i in range(count)]


def _joints(casters: int, name: str) -> list[int]:
    """Columns of a parameter of every rolling and steering joint."""
    return sorted(_casters(casters, f"roll_{name}") + _casters(casters, f"steer_{name}"))
