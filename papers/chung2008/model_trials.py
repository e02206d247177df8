"""Trials of computed torque with incomplete models: the same motions at rising speeds, all models side by side."""

from collections.abc import Sequence
from itertools import product
from typing import Any, NamedTuple, get_args

import numpy as np
from numpy.typing import ArrayLike

from caster_gym.agents.comparison.evaluation import roll_out
from caster_gym.agents.control.computed_torque import ComputedTorque, Gains, KnownModel, gains, known_model
from caster_gym.arrays import Array
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import ObservationLayout
from caster_gym.paths.feasibility import motor_use
from caster_gym.paths.headings import Spinning
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Circle, Ellipse, Shape
from caster_gym.paths.specification import AnyPath
from caster_gym.paths.trajectory import Trajectory
from caster_gym.robot import Robot, load_robot
from caster_gym.tasks.episodes import Episodes
from caster_gym.tasks.measuring import rms
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.tasks.track.metrics import METRICS, measure
from papers.chung2008.model_error import lacks, predict, trailing_steering

MODELS: tuple[KnownModel, ...] = get_args(KnownModel)  # the exact one first
EXACT, PRINTED, BARE = range(3)  # of MODELS
FREQUENCIES = (3.0, 30.0)  # [rad/s] of the feedback: soft and stiff
SOFT, STIFF = range(2)  # of FREQUENCIES
PERIOD = 0.02  # [s] between torques
FINE_PERIOD = 0.01  # [s] the same, to tell what holding torques costs
PATHS: dict[str, AnyPath] = {
    "circle": Circle(radius=1.0, heading=Spinning()),  # one turn of the heading, in time as (61) of chung2008
    "ellipse": Ellipse(semi_axes=(3.0, 1.0), heading=Spinning()),
    "random paths": RandomPaths(count=4, seed=2),
}
HELD = ("circle", "random paths")  # where the fine period is tried
LONGEST = {"chung2008": 60.0, "xr4000": 40.0}  # [s] a motion; the paper's circle takes 60 s
SLOWEST = 0.1  # [m/s] mean speed
RUNGS = 5  # speeds of each motion
STARTS = 4  # disturbed ones on each path
RESERVE = 0.9  # share of the motors that a reference may ask; the rest is the feedback's

_LEAST_DURATION = 1.0  # [s]
_ACCURACY = 1.01  # of the shortest duration


class Trials(NamedTuple):
    """What came of trials; arrays (models, frequencies, starts, trajectories), whole episodes but for `settled`."""

    position: Array  # [m] RMSE
    settled: Array  # [m] the same after settling
    heading: Array  # [rad] RMSE
    worst: Array  # [m] greatest position error
    effort: Array  # mean square torque as a share of the limits
    saturation: Array  # share of torques at a limit
    failed: Array  # 1 or 0
    apart: Array  # [m] RMS distance from the robot of the first model's controller, the rest being equal


class Study(NamedTuple):
    """What one robot did; arrays (models, frequencies, paths, rungs), random paths pooled, rungs from slow to fast."""

    robot: str
    durations: Array  # (paths, rungs) [s]
    speeds: Array  # (paths, rungs) [m/s]
    position: Array  # [m] RMSE
    heading: Array  # [rad] RMSE
    worst: Array  # [m]
    effort: Array  # mean square torque as a share of the limits
    saturation: float  # greatest share of torques at a limit
    apart: Array  # [m] RMS distance from the robot of the exact model's controller: what the model alone does
    predicted: Array  # [m] the same by the law
    balanced: Array  # [m] the same by the law of an error that changes slowly
    grip: tuple[float, float]  # least and greatest eigenvalue of M⁻¹ M̂ without wheels
    held: Array  # (frequencies, HELD) [m] RMSE of the exact model on the fastest rung at the fine period
    disturbed: Array  # (models, frequencies, paths) [m] RMSE on the fastest rung from disturbed starts, settled


class SharedModel(Model):
    """What the controllers of a batch know of their robots; the batch is divided equally among the models, in order."""

    def __init__(self, robot: Robot, models: Sequence[KnownModel]) -> None:
        super().__init__(robot)
        self._known = [known_model(robot, one) for one in models]

    def inverse_dynamics(self, steering: ArrayLike, twist: ArrayLike, twist_rate: ArrayLike) -> Array:
        parts = (np.split(np.asarray(whole), len(self._known)) for whole in (steering, twist, twist_rate))
        forces = [model.inverse_dynamics(*part) for model, *part in zip(self._known, *parts, strict=True)]
        return np.concatenate(forces)


class SideBySide(ComputedTorque):
    """Computed torque of a batch with one part for each model and, within it, one for each natural frequency.

    Every robot gets the torques of a ComputedTorque of its own; one call for all takes a fraction of the time.
    """

    def __init__(
        self, layout: ObservationLayout, count: int, period: float, models: Sequence[KnownModel] = MODELS
    ) -> None:
        super().__init__(layout, FREQUENCIES[0], period)
        self._model = SharedModel(layout.robot, models)
        both = np.array([gains(frequency, period) for _ in models for frequency in FREQUENCIES])
        rows = np.repeat(both, count // len(both), axis=0)
        self.gains = Gains(rows[:, :1], rows[:, 1:])  # type: ignore[arg-type]  # one row for each robot


class EqualStarts(CasterTrackVectorEnv):
    """A batch in which robots k, k + apart, k + 2 apart, … start alike."""

    def __init__(self, count: int, apart: int, **how: Any) -> None:
        super().__init__(count, **how)
        self._apart = apart

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Like every batch, from one seed."""
        return super().reset(seed=[int(seed) + i % self._apart for i in range(self.num_envs)], options=options)


class TrailingStarts(EqualStarts):
    """Such a batch that starts on the reference, with casters that trail its first motion."""

    def __init__(self, count: int, apart: int, **how: Any) -> None:
        super().__init__(count, apart, start_offset=0.0, start_turn=0.0, **how)

    def reset(self, *, seed: Any = None, options: dict[str, Any] | None = None) -> tuple[Any, dict[str, Any]]:
        """Like every batch; the observation tells of the casters as they then stand."""
        observations, info = super().reset(seed=seed, options=options)
        first = [
            trailing_steering(table[None], self.task.control_period, self.robot)[0, 0]
            for table in self.engine.plan.tables
        ]
        steering = np.array(first)[self.engine.paths]
        directions = np.stack([np.cos(steering), np.sin(steering)], axis=-1).reshape(self.num_envs, -1)
        states = self.engine.states
        states[:, 7 : 7 + directions.shape[1]] = directions
        self.engine.states = states
        place = next(part.place for part in self.engine.layout.parts if part.name == "directions")
        observations[:, place] = directions
        return observations, info


def timed(path: AnyPath, duration: float) -> AnyPath:
    """The same motion, driven in another time [s]. Raises ValueError for a path whose time is not its own to set."""
    if isinstance(path, Shape):
        return path.model_copy(update={"duration": duration})
    if not isinstance(path, RandomPaths):
        raise ValueError(f"a path to be driven in another time is a shape or random paths, got {path.shape!r}")
    slower = duration / path.duration
    return path.model_copy(
        update={
            "duration": duration,
            "max_speed": path.max_speed / slower,
            "max_acceleration": path.max_acceleration / slower**2,
            "max_yaw_rate": path.max_yaw_rate / slower,
        }
    )


def shortest(path: AnyPath, robot: Robot, longest: float) -> float:
    """Shortest duration [s] in which the motors drive a path with some reserve, sought up to the longest.

    Raises ValueError if the longest is too short.
    """

    def asks(duration: float) -> float:
        return float(motor_use(timed(path, duration).trajectories(PERIOD), robot).use.max())

    low, high = _LEAST_DURATION, longest
    if asks(high) > RESERVE:
        raise ValueError(
            f"robot {robot.name!r} cannot drive path {path.shape!r} in {longest:g} s with {1.0 - RESERVE:.0%} of its "
            f"motors in reserve; a longer time would suffice"
        )
    while high > _ACCURACY * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if asks(middle) <= RESERVE else (middle, high)
    return high


def mean_speed(trajectories: Sequence[Trajectory]) -> float:
    """Way over time, mean of all. [m/s]"""
    ways = [np.hypot(*np.diff(one.samples[:, :2], axis=0).T).sum() / one.duration for one in trajectories]
    return float(np.mean(ways))


def run_trials(
    robot: Robot,
    paths: Sequence[AnyPath],
    period: float = PERIOD,
    models: Sequence[KnownModel] = MODELS,
    starts: int | None = None,
    settling: float = 0.0,
) -> Trials:
    """Simulate every model at every natural frequency on all paths; torques change every period [s].

    starts: None starts on the reference with trailing casters; a number is that of disturbed starts on each path.
    settling [s] is what `settled` leaves out.
    """
    task = {"robot": robot, "path": list(paths), "control_period": period, "substeps": round(4 * period / PERIOD)}
    kind, each = (TrailingStarts, 1) if starts is None else (EqualStarts, starts)
    shape = (len(models), len(FREQUENCIES), each, sum(len(path.trajectories(period)) for path in paths))
    count = int(np.prod(shape))
    batch = kind(count, shape[2] * shape[3], **task)
    episodes = roll_out(SideBySide(batch.engine.layout, count, period, models), batch, seed=0)
    whole, after = measure(episodes, 0.0), measure(episodes, settling)
    found = Trials(
        whole.position_rmse,
        after.position_rmse,
        whole.heading_rmse,
        whole.worst_position,
        whole.effort,
        whole.saturation,
        whole.failed,
        _apart(episodes, len(models)),
    )
    return Trials(*(values.reshape(shape) for values in found))


def study(name: str) -> Study:
    """Every model at every natural frequency on all paths at all speeds, beside the law."""
    robot = load_robot(name)
    ladders = [_ladder(path, robot, LONGEST[name]) for path in PATHS.values()]
    rungs = [path for ladder in ladders for path in ladder]
    trajectories = [path.trajectories(PERIOD) for path in rungs]
    counts = [len(some) for some in trajectories]
    trials = run_trials(robot, rungs)

    incomplete = MODELS[1:]
    lacking = [lacks(path, robot, incomplete, PERIOD) for path in rungs]
    chosen = [[one for along in lacking for one in along[m]] for m in range(len(incomplete))]
    runs = [(one, gains(f, PERIOD)) for some, f in product(chosen, FREQUENCIES) for one in some]
    errors = predict([one for one, _ in runs], [of for _, of in runs], PERIOD)
    predicted = rms(np.hypot(errors[1:, :, 0], errors[1:, :, 1]))
    balanced = np.array([float(rms(np.hypot(*one.balanced[:, :2].T))) / of.stiffness for one, of in runs])
    grips = np.concatenate([np.linalg.eigvals(one.grip).real for one in chosen[-1]])

    fastest = [ladder[-1] for ladder in ladders]
    held = [path for kind, path in zip(PATHS, fastest, strict=True) if kind in HELD]
    finely = run_trials(robot, held, FINE_PERIOD, models=MODELS[:1]).position[0, :, 0]
    disturbed = run_trials(robot, fastest, starts=STARTS, settling=METRICS.settling).settled

    def on_ladders(values: Array) -> Array:
        return _pooled(values, counts).reshape(*values.shape[:-1], len(PATHS), RUNGS)

    def beside_exact(values: Array) -> Array:
        of_incomplete = values.reshape(len(incomplete), len(FREQUENCIES), -1)
        return on_ladders(np.concatenate([np.zeros_like(of_incomplete[:1]), of_incomplete]))

    first = np.concatenate([[0], np.cumsum(counts)[:-1]])
    return Study(
        name,
        np.array([some[0].duration for some in trajectories]).reshape(len(PATHS), RUNGS),
        np.array([mean_speed(some) for some in trajectories]).reshape(len(PATHS), RUNGS),
        on_ladders(trials.position[:, :, 0]),
        on_ladders(trials.heading[:, :, 0]),
        np.maximum.reduceat(trials.worst[:, :, 0], first, axis=-1).reshape(-1, len(FREQUENCIES), len(PATHS), RUNGS),
        np.square(on_ladders(np.sqrt(trials.effort[:, :, 0]))),
        float(trials.saturation.max()),
        on_ladders(trials.apart[:, :, 0]),
        beside_exact(predicted),
        beside_exact(balanced),
        (float(grips.min()), float(grips.max())),
        _pooled(finely, [len(path.trajectories(FINE_PERIOD)) for path in held]),
        _pooled(np.sqrt(np.mean(np.square(disturbed), axis=2)), [len(path.trajectories(PERIOD)) for path in fastest]),
    )


def exponents(errors: Array, speeds: Array) -> Array:
    """Powers of the speed with which errors (…, rungs) grow: slopes (…) of lines through logarithms."""
    x = np.log(speeds) - np.log(speeds).mean(axis=-1, keepdims=True)
    slopes: Array = (x * np.log(errors)).sum(axis=-1) / np.square(x).sum(axis=-1)
    return slopes


def _ladder(path: AnyPath, robot: Robot, longest: float) -> list[AnyPath]:
    """The motion at all its speeds, from slow to fast; durations are whole periods."""
    way = mean_speed(path.trajectories(PERIOD)) * path.duration
    slow = min(longest, way / SLOWEST)
    return [
        timed(path, float(round(t / PERIOD) * PERIOD)) for t in np.geomspace(slow, shortest(path, robot, slow), RUNGS)
    ]


def _apart(episodes: Episodes, models: int) -> Array:
    """RMS distance of each robot from the one of the first model's part."""
    place = episodes.pose[..., :2].reshape(len(episodes.pose), models, -1, 2)
    way = place - place[:, :1]
    return rms(np.hypot(way[..., 0], way[..., 1]))


def _pooled(values: Array, counts: Sequence[int]) -> Array:
    """Root mean square over the trajectories (last axis) of each path, so many each."""
    parts = np.split(values, np.cumsum(counts)[:-1], axis=-1)
    return np.stack([np.sqrt(np.mean(np.square(part), axis=-1)) for part in parts], axis=-1)
