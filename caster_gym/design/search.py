"""Search for the wheel radius and the trail that suit a target best. Derivation: docs/analysis.md, section S."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from caster_gym.arrays import Array
from caster_gym.design.envelope import Motions, envelope_loads, joined, motor_uses, path_loads, sampled_motions
from caster_gym.design.isotropy import global_isotropies
from caster_gym.design.region import TYPICAL, DesignTarget, Region, check_designable, radius_and_trail, redesigned
from caster_gym.design.sizing import harder_motions, motor_shares, trajectories_of
from caster_gym.design.target import driven_as, loaded
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot

GRID = {"isotropy": 33, "torque": 17, "use": 17}  # designs along each side of the grid that the search starts from
NEARBY = 1.1  # [-] factor by which radius and trail are changed to see how flat the optimum is
_INTERVALS = {2: 5.0, 3: 10.0, 4: 15.0}  # [°] of the steering angles that isotropy is averaged over, by casters
_COARSE_INTERVAL = 30.0  # [°] with more casters, whose combinations grow as a power
_STARTS = 3  # local optima of the grid from which the search goes on
_EXCHANGES = 6  # how often motions are added that are harder for the best design and those nearby than all samples
_EXACT_ENOUGH = 5e-3  # [-] by which a harder motion may exceed the samples
_LONGEST_SEARCH = 150  # designs in one local search


@dataclass(frozen=True)
class Design:
    """The best design found, and what was found on the way."""

    robot: Robot  # with the best radius and trail, the joints driven that the target names
    radius: float  # [m]
    trail: float  # [m]
    value: float  # [-] of the objective: isotropy is to be great, torque and use small
    own: tuple[float, float, float]  # radius [m], trail [m] and value of the robot as it was
    bounds: tuple[str, ...]  # in words, those on which it lies
    nearby: tuple[tuple[str, float, float, float], ...]  # what was changed, radius [m], trail [m], value
    grid: tuple[Array, Array, Array]  # radii, trails [m] and values, for a picture
    motions: Motions  # samples of the envelope that were enough


def optimise(robot: Robot, target: DesignTarget, report: Callable[[float], None] = lambda share: None) -> Design:
    """The best radius and trail: a grid of designs, then Nelder and Mead's search from its best local optima.

    report is told the share of the work that is done. For torque and use, motions that are harder than the samples for
    the design found and for those nearby are added and the search goes on, until there are none.
    Raises ValueError as `check_designable` does, and for a target that no design within the bounds can meet.
    """
    from scipy.optimize import minimize

    own = radius_and_trail(robot)
    able = driven_as(robot, target)
    region = check_designable(able, target)
    search = _Search(able, target, region)
    search.learn(*own)
    count = GRID[target.objective]
    sides = np.linspace(0.0, 1.0, count)
    places = np.stack(np.meshgrid(sides, sides, indexing="ij"), axis=-1)
    costs = np.empty((count, count))
    for i in range(count):
        costs[i] = search.costs(places[i])
        report(0.6 * (i + 1) / count)
    if not np.isfinite(costs).any():
        raise ValueError(
            f"no design within the bounds reaches the target: motors of robot {robot.name!r} turn faster than their "
            f"top speeds, with a margin of {target.margin:g}{_fast_enough(able, target, region)}"
        )
    starts = _local_optima(costs)[:_STARTS]
    place, total = places[starts[0]], len(starts) + _EXCHANGES
    for k in range(total):
        here = places[starts[k]] if k < len(starts) else place
        corners = np.concatenate([np.zeros((1, 2)), np.diag(np.where(here < 0.5, 1.0, -1.0))])  # inwards
        found = minimize(
            lambda p: float(search.costs(p[None])[0]),
            here,
            method="Nelder-Mead",
            bounds=[(0.0, 1.0)] * 2,
            options={
                "initial_simplex": here + corners / (count - 1),
                "xatol": 1e-5,
                "fatol": 1e-9,
                "maxfev": _LONGEST_SEARCH,
            },
        )
        if k == 0 or found.fun < search.costs(place[None])[0]:
            place = found.x
        report(0.6 + 0.4 * (k + 1) / total)
        radius, trail = (float(size) for size in region.design(place))
        around = _around(radius, trail)
        if k >= len(starts) - 1:
            harder = [search.learn(r, d) for _, r, d in (("", radius, trail), *around)]
            if not any(harder):
                break
    report(1.0)
    return Design(
        robot=redesigned(able, radius, trail),
        radius=radius,
        trail=trail,
        value=search.value(radius, trail),
        own=(*own, search.value(*own)),
        bounds=region.bounds_at(place, target),
        nearby=tuple((words, r, d, search.value(r, d)) for words, r, d in around),
        grid=(*region.design(places), search.sign * costs),
        motions=search.motions,
    )


def _fast_enough(robot: Robot, target: DesignTarget, region: Region) -> str:
    """How much faster motors must be for a design at a corner of the region to reach the target, as advice."""
    for factor in (1.5, 2.0, 3.0, 5.0, 10.0, 20.0, 50.0, 100.0):
        casters = tuple(
            caster.model_copy(
                update={
                    name: motor.model_copy(update={"max_speed": factor * motor.max_speed})
                    for name, motor in zip(("roll", "steer"), caster.motors, strict=True)
                }
            )
            for caster in robot.casters
        )
        search = _Search(robot.model_copy(update={"casters": casters}), target, region)
        if np.isfinite(search.costs(np.array(TYPICAL[1:]))).any():
            return f"; motors {factor:g} times as fast would suffice"
    return ""


def _around(radius: float, trail: float) -> tuple[tuple[str, float, float], ...]:
    """What is changed, radius and trail [m] of the designs nearby, on both sides of each bound."""
    return (
        (f"radius / {NEARBY:g}", radius / NEARBY, trail),
        (f"radius × {NEARBY:g}", radius * NEARBY, trail),
        (f"trail / {NEARBY:g}", radius, trail / NEARBY),
        (f"trail × {NEARBY:g}", radius, trail * NEARBY),
    )


def isotropy_interval(caster_count: int) -> float:
    """Interval between the steering angles over which a design's isotropy is averaged. [rad]"""
    return float(np.radians(_INTERVALS.get(caster_count, _COARSE_INTERVAL)))


class _Search:
    """The objective at places of a region, and the motions over which it takes the worst."""

    def __init__(self, robot: Robot, target: DesignTarget, region: Region) -> None:
        self.robot, self.target, self.region = robot, target, region
        self.motions = sampled_motions(robot.caster_count)
        self.paths: tuple[Trajectory, ...] = trajectories_of(target)
        self.sign = -1.0 if target.objective == "isotropy" else 1.0

    def value(self, radius: float, trail: float) -> float:
        """The objective of a design: isotropy, or the greatest torque or use of a motor. [-]"""
        if self.target.objective == "isotropy":
            return float(self._isotropies(np.array([radius]), np.array([trail]))[0])
        full = loaded(redesigned(self.robot, radius, trail), self.target)
        parts = [envelope_loads(self.motions, full, self.target)]
        parts += [path_loads(self.paths, full, self.target.margin)] if self.paths else []
        measure = motor_uses if self.target.objective == "use" else motor_shares
        return max(float(measure(part, full, self.target.margin).max()) for part in parts)

    def costs(self, places: Array) -> Array:
        """What is to be least, at places (K, 2) of the unit square."""
        radius, trail = self.region.design(places)
        if self.target.objective == "isotropy":
            return -self._isotropies(radius, trail)
        return np.array([self.value(float(r), float(d)) for r, d in zip(radius, trail, strict=True)])

    def learn(self, radius: float, trail: float) -> bool:
        """Add the motions that are hardest for a design; whether they are harder than all that were known."""
        if self.target.objective == "isotropy":
            return False
        before = self.value(radius, trail)
        full = loaded(redesigned(self.robot, radius, trail), self.target)
        self.motions = joined(self.motions, harder_motions(self.motions, full, self.target))
        return self.value(radius, trail) > before * (1.0 + _EXACT_ENOUGH)

    def _isotropies(self, radius: Array, trail: Array) -> Array:
        target = self.target
        return global_isotropies(
            self.robot,
            self.robot.driven,
            (target.speed, target.speed, target.yaw_rate),
            self.robot.max_speeds[self.robot.driven_indices],
            radius,
            trail,
            isotropy_interval(self.robot.caster_count),
        )


def _local_optima(costs: Array) -> list[tuple[int, int]]:
    """Places of the grid that no neighbour is better than, the best first."""
    padded = np.pad(costs, 1, constant_values=np.inf)
    rows, columns = costs.shape
    around = [padded[1 + i : 1 + i + rows, 1 + j : 1 + j + columns] for i in (-1, 0, 1) for j in (-1, 0, 1)]
    low = np.isfinite(costs) & (costs <= np.min(around, axis=0))
    found = [(int(i), int(j)) for i, j in np.argwhere(low)]
    return sorted(found, key=lambda place: float(costs[place]))
