"""Starts that a reset asks for: a pose, a place along the path, a twist, steering angles.

What is not asked for stays as the task draws it. The draw itself is made in any case, so that later episodes are the
same whether or not a start was given.
"""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from caster_gym.arena.clearance import ROUNDING
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.inputs import checked_numbers, checked_options
from caster_gym.envs.native.engine import DRAW_A_PATH, Outcome, TaskEngine
from caster_gym.envs.plan import PlaceName, Span
from caster_gym.envs.randomness import episode_seed, uniforms
from caster_gym.envs.report import REPORT
from caster_gym.envs.rows import span
from caster_gym.envs.tracking import Reference, start
from caster_gym.mechanics.integration import State, pack_state, unpack_state
from caster_gym.mechanics.parameters import unpack_parameters
from caster_gym.mechanics.slip_state import rolling_state, unpack_slip_state
from caster_gym.paths.trajectory import rounded_down
from caster_gym.robot import Robot

_BY_ROUNDING = 1.0 + 1e-9  # of speeds and lengths that stand exactly at their limit


class Start(NamedTuple):
    """What is asked of some robots, a row for each; None is left to the draw."""

    place: Array | None  # (robots,) time along a trajectory [s], or arc length along a path [m]
    pose: Array | None  # (robots, 3) x, y [m] and heading [rad] in W
    twist: Array | None  # (robots, 3) vx, vy [m/s] and ω [rad/s] in B
    steering: Array | None  # (robots, N) δ [rad]

    @property
    def drawn(self) -> bool:
        """Whether all is left to the draw."""
        return all(part is None for part in self)


DRAWN = Start(None, None, None, None)
_PLACES: dict[PlaceName, str] = {"progress": "metres along the path", "time": "seconds along the trajectory"}


def read_options(options: Any, engine: TaskEngine, *others: str) -> Mapping[str, Any]:
    """The options of a reset of these robots, which may have others beside those of a start."""
    place: PlaceName | None = engine.plan.source.place
    known = (*others, "path", *([place] if place else []), "pose", "twist", "steering")
    here = f"here the place along the path is {place!r}, in {_PLACES[place]}" if place else ""
    return checked_options(options, known, {name: here for name in _PLACES if place and name != place})


def read_start(options: Mapping[str, Any], engine: TaskEngine, chosen: NDArray[np.bool_]) -> Start:
    """The start that options ask for of the chosen ones (robots,). Raises ValueError for what can be no start."""
    place: PlaceName | None = engine.plan.source.place
    meanings: dict[str, tuple[int | None, str]] = {
        **({place: (None, _PLACES[place])} if place else {}),
        "pose": (3, "x, y [m] and heading [rad] in the world frame"),
        "twist": (3, "vx, vy [m/s] and yaw rate [rad/s] in the body frame"),
        "steering": (engine.robot.caster_count, "the steering angle [rad] of each caster"),
    }
    parts: dict[str | None, Array | None] = dict.fromkeys((place, *meanings))
    for name, (width, meaning) in meanings.items():
        if name in options:
            rows = checked_numbers(name, options[name], len(chosen), width, meaning)[chosen]
            if not np.isfinite(rows).all():
                raise ValueError(f"options[{name!r}] must be {meaning}, finite numbers, got {options[name]!r}")
            parts[name] = rows
    return Start(parts[place], parts["pose"], parts["twist"], parts["steering"])


def restart_at(
    engine: TaskEngine, selected: NDArray[np.int64], wanted: Start, path: int | NDArray[np.int64] = DRAW_A_PATH
) -> Outcome:
    """New episodes of some robots, as `TaskEngine.restart`, from starts that may be given.

    Raises ValueError, with all robots as they were, for a start outside the path, its corridor or what the casters can
    do, or inside an obstacle.
    """
    if wanted.drawn:
        return engine.restart(selected, path=path)
    before = engine.changing
    try:
        outcome = engine.restart(selected, path=path)
        _put(engine, selected, wanted)
        seen = engine.look()
        check_free(engine, seen.reports[:, selected], selected)
    except ValueError:
        engine.changing = before
        raise
    outcome.observations[selected] = seen.observations[selected]
    outcome.reports[:, selected] = seen.reports[:, selected]
    return outcome


def _put(engine: TaskEngine, selected: NDArray[np.int64], wanted: Start) -> None:
    """Put robots that have just been drawn a start where it is wanted."""
    state = _states(engine, selected)
    if wanted.place is not None:
        _move_along(engine, selected, wanted.place)
        drawn = _drawn_pose(engine, selected)
        state = state._replace(position=drawn.position, heading=drawn.heading)
    if wanted.pose is not None:
        x, y, heading = wanted.pose.T
        state = state._replace(position=(x, y), heading=(np.cos(heading), np.sin(heading)))
    if wanted.twist is not None:
        state = state._replace(twist=tuple(wanted.twist.T))
    if wanted.steering is not None:
        cos, sin = np.cos(wanted.steering), np.sin(wanted.steering)
        state = state._replace(directions=tuple(zip(cos.T, sin.T, strict=True)))
    if wanted.twist is not None:
        steering = np.stack([np.arctan2(s, c) for c, s in state.directions], axis=1)
        check_motion(engine.robot, steering, wanted.twist)
    if engine.slipping:
        state = rolling_state(state, unpack_parameters(tuple(engine.parameters[selected].T)))
    _put_states(engine, selected, state)
    if wanted.pose is not None and wanted.place is None and engine.plan.source.place == "progress":
        _find_place(engine, selected, wanted.pose[:, :2])


def _states(engine: TaskEngine, selected: NDArray[np.int64]) -> State:
    """States of some robots, as one of arrays (selected,)."""
    unpack = unpack_slip_state if engine.slipping else unpack_state
    return unpack(tuple(engine.states[selected].T))


def _put_states(engine: TaskEngine, selected: NDArray[np.int64], state: State) -> None:
    engine.put(selected, np.stack(pack_state(state), axis=1))


def _move_along(engine: TaskEngine, selected: NDArray[np.int64], place: Array) -> None:
    """Move clocks or progress to a place along each robot's path."""
    place = check_place(engine, engine.paths[selected], place)
    if engine.plan.source.place == "progress":
        engine.put(selected, progress=place)
    else:
        engine.put(selected, clocks=np.rint(place / engine.control_period).astype(np.int64))


def check_place(engine: TaskEngine, paths: NDArray[np.int64], place: Array) -> Array:
    """Places (robots,) on paths (robots,), in range in spite of rounding. Raises ValueError for ones that are not."""
    source: Any = engine.plan.source
    span = Span(*source.spans[paths].T)
    name, unit, rows = source.place, "s", span.last - span.first
    most = (rows - 1) * engine.control_period  # at least one control period is left
    if name == "progress":
        unit, most = "m", rows * source.spacings[paths]
    bad = (place < 0.0) | (place > most * _BY_ROUNDING)
    if bad.any():
        i = int(bad.argmax())
        path, last = engine.plan.names[paths[i]], rounded_down(most[i], 6)
        raise ValueError(f"options[{name!r}] must lie in 0 … {last:g} {unit} on path {path!r}, got {place[i]:g} {unit}")
    within: Array = np.minimum(place, most)
    return within


def check_longest(engine: TaskEngine) -> None:
    """Refuse a time on trajectories that episodes are too short for, where clocks start at zero. Raises ValueError."""
    span = Span(*engine.plan.source.spans.T)
    if (span.periods < span.last - span.first).any():
        raise ValueError(
            "options['time'] cannot be given where max_episode_steps ends episodes before their trajectory: leave one "
            "of them away"
        )


def _drawn_pose(engine: TaskEngine, selected: NDArray[np.int64]) -> State:
    """Poses beside the places where robots have been put, displaced as at the start of their paths."""
    none = np.zeros(len(selected))
    headless = _states(engine, selected)._replace(heading=(none, none))
    _put_states(engine, selected, headless)  # a robot without a heading is shown the path's own, even where it is free
    x, y, cos, sin = engine.look().reports[span(REPORT.reference_pose), selected]
    keys, coming = engine.episodes(selected)
    seeds = episode_seed(keys, coming - np.uint64(1))
    sides, forth, turns = (2.0 * uniforms(seeds, np.arange(1, 4)) - 1.0).T.copy()
    offset, turn = engine.spread
    reference = Reference(x, y, cos, sin, none, none, none, none, none, none)
    return start(reference, (sides * offset, forth * offset), (np.cos(turns * turn), np.sin(turns * turn)), ())


def _find_place(engine: TaskEngine, selected: NDArray[np.int64], points: Array) -> None:
    """Set the progress of robots to the place of their path that is nearest to them."""
    engine.put(selected, progress=nearest_row(engine, engine.paths[selected], points))
    engine.put(selected, progress=engine.look(progress_stays=False).reports[REPORT.situation.progress, selected])


def nearest_row(engine: TaskEngine, paths: NDArray[np.int64], points: Array) -> Array:
    """Arc lengths (robots,) of the row of each path just before the one that is nearest to points (robots, 2). [m]"""
    from scipy.spatial import KDTree  # late: most environments seek nothing

    rows = np.zeros(len(points), dtype=np.int64)
    for path in np.unique(paths):
        here = paths == path
        rows[here] = KDTree(engine.plan.tables[path][:, :2]).query(points[here])[1]
    source: Any = engine.plan.source
    arcs: Array = np.maximum(rows - 1, 0) * source.spacings[paths]
    return arcs


def check_motion(robot: Robot, steering: Array, twist: Array) -> None:
    """Refuse twists (..., 3) that the casters, steered by (..., N), cannot follow. Raises ValueError.

    Steering axes may be as fast as the fastest wheel, for which time steps are made, and driven motors no faster than
    the speed at which they have no torque left.
    """
    speeds = np.stack(
        [np.hypot(twist[..., 0] - twist[..., 2] * c.y, twist[..., 1] + twist[..., 2] * c.x) for c in robot.casters], -1
    )
    if (speeds > robot.top_speed * _BY_ROUNDING).any():
        at = np.unravel_index(speeds.argmax(), speeds.shape)
        raise ValueError(
            f"options['twist'] moves the steering axis of caster {at[-1] + 1} at {speeds[at]:.3g} m/s, and the wheels "
            f"of robot {robot.name!r} reach {robot.top_speed:.3g} m/s at most"
        )
    _, rolling, turning = Model(robot).rates(steering, twist)
    gears = np.array([caster.gear for caster in robot.casters])
    motors = gears[:, :, 0] * rolling[..., None] + gears[:, :, 1] * turning[..., None]
    limits = robot.max_speeds.reshape(-1, 2)
    driven = np.array([joint in robot.driven for joint in robot.joints]).reshape(limits.shape)
    excess = np.where(driven, np.abs(motors) / limits, 0.0)
    if (excess > _BY_ROUNDING).any():
        at = np.unravel_index(excess.argmax(), excess.shape)
        joint = robot.joints[2 * at[-2] + at[-1]]
        raise ValueError(
            f"options['twist'] turns motor {joint} at {abs(motors[at]):.3g} rad/s with these steering angles, and it "
            f"reaches {limits[at[-2:]]:.3g} rad/s: give a slower twist or 'steering' that trails it"
        )


def check_free(engine: TaskEngine, reports: Array, robots: NDArray[np.int64]) -> None:
    """Refuse starts outside the corridor or inside an obstacle, from reports (quantities, robots) of the start.

    robots: indices of these robots in their batch. Raises ValueError.
    """
    errors, gaps = reports[REPORT.deviation.position_error], reports[REPORT.situation.clearance]
    outside, inside = errors > engine.corridor, gaps < -ROUNDING
    if not (outside | inside).any():
        return
    i = int((outside | inside).argmax())
    x, y = reports[[REPORT.pose.x, REPORT.pose.y], i]
    place = f"the start of robot {robots[i]} at ({x:.3f}, {y:.3f}) m"
    if outside[i]:
        raise ValueError(
            f"{place} lies {errors[i]:.3g} m from its reference, outside the corridor of {engine.corridor:g} m"
        )
    raise ValueError(f"{place} overlaps an obstacle by {-gaps[i]:.3g} m: give a 'pose' that is free")
