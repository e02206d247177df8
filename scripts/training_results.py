"""What `scripts.measure_training` measures: training runs and their validations, and where the time goes."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from caster_gym.agents.learning.settings import LearnerSettings
from scripts.speed_timing import Values
from scripts.training_busy import Beside


class Point(NamedTuple):
    """A validation of a training run."""

    steps: int  # control periods so far
    seconds: float  # of the processor so far, validations left out
    verdict: Any  # of the task's metrics


class Trial(NamedTuple):
    """One episode of a trained policy on a test path."""

    path: str
    position_rmse: float  # [m]
    failed: bool


class Course(NamedTuple):
    """A training run."""

    learner: str
    seed: int
    points: tuple[Point, ...]
    trials: tuple[Trial, ...] = ()  # of its best policy

    def first(self, goal: float) -> Point | None:
        """The validation that first meets the goal, a position RMSE [m], without a failure."""
        met = (one for one in self.points if not one.verdict.failures and one.verdict.position_rmse < goal)
        return next(met, None)

    @property
    def best(self) -> Point:
        """The validation of the policy that is kept."""
        return max(self.points, key=lambda one: one.verdict.merit)


class WindowCosts(NamedTuple):
    """Seconds of the processor that SHAC takes."""

    periods: int  # of a window, all robots together
    substeps: int  # RK4 steps in each of them
    forward: float  # simulation, policy and rewards of a window
    backward: float  # their gradient
    critic: float
    compiling: float  # and one window, on a machine that has never compiled it
    fetching: float  # the same from then on, the compiled code being on disk


class Results(NamedTuple):
    """All that was measured."""

    agents: Mapping[str, LearnerSettings]
    share: Values
    courses: Sequence[Course]
    costs: Mapping[str, WindowCosts]
    rates: Mapping[str, tuple[LearnerSettings, float]]  # of learners on tensors [steps/s]
    beside: Beside | None = None  # training with one thread and with two, beside busy processes


class Occasion(NamedTuple):
    """Where and how it was measured."""

    command: str
    turns: int
    goal: float  # [m]
    loads: tuple[float, float]  # of the machine at the start and at the end
