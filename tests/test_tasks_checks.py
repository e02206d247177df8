"""tasks.checks, tasks.building: a task whose parts do not fit each other is refused before anything compiles."""

import dataclasses
import math
from typing import Any, NamedTuple

import numpy as np
import pytest
import torch

from caster_gym.engines.native.compilation import compilations
from caster_gym.envs.report import Endings
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.mechanics.scalars import absolute, clip, sqrt, where
from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.checks import check_reward
from caster_gym.tasks.hold.reference import Poses
from caster_gym.tasks.registry import TASKS, find_task
from caster_gym.tasks.track import TASK
from caster_gym.tasks.track.reference import Timetable
from tests.moments import weights_of


class Terms(NamedTuple):
    near: float
    power: float


class Swapped(NamedTuple):
    power: float
    near: float


class Weights(NamedTuple):
    corridor: float
    touching_ends: float
    effort_weight: float


class Careless(NamedTuple):
    effort_weight: float


class Unknown(NamedTuple):
    corridor: float
    touching_ends: float
    power_weight: float


def complete(moment, weights):
    return Terms(power=-weights.effort_weight * moment.record.power, near=1.0)


def lowest(moment, weights):
    return Terms(min(moment.errors.ahead, weights.effort_weight), 0.0)


def branching(moment, _weights):
    return Terms(1.0 if moment.errors.ahead > 0.0 and moment.effort < 1.0 else 0.0, 0.0)


def task_with(reward=complete, source=Timetable, **other):
    """The tracking task with other parts; nothing is taught to the compiler."""
    task = object.__new__(type(TASK))
    fields = {field.name: getattr(TASK, field.name) for field in dataclasses.fields(TASK)}
    changed = {"name": "mine", "terms": Terms, "weights": Weights, "reward": reward, "source": source, **other}
    for name, value in (fields | changed).items():
        object.__setattr__(task, name, value)
    return task


@pytest.mark.parametrize("name", TASKS)
def test_the_tasks_that_come_with_the_package_fit(name):
    task = find_task(name)
    check_reward(task, weights_of(task))


WRONG: dict[str, dict[str, Any]] = {
    r"the reward of task 'mine': TypeError: Terms\.__new__\(\) missing 1 required positional argument: 'power': "
    r"Terms \(near, power\) takes one number for each \(.*test_tasks_checks\.py, line \d+\)": {
        "reward": lambda moment, weights: Terms(near=1.0)  # type: ignore[call-arg]
    },
    r"Terms\.__new__\(\) got an unexpected keyword argument 'rest'": {
        "reward": lambda moment, weights: Terms(near=1.0, power=0.0, rest=1.0)  # type: ignore[call-arg]
    },
    r"the reward of task 'mine' gives Swapped \(power, near\), and must give Terms \(near, power\), which the task": {
        "reward": lambda moment, weights: Swapped(1.0, 2.0)
    },
    r"the reward of task 'mine' gives a float, and must give Terms": {"reward": lambda moment, weights: 1.0},
    r"the reward of task 'mine' must give a number as 'near', and gives \(0\.5, 0\.5, 0\.5\)": {
        "reward": lambda moment, weights: Terms(moment.state.twist, 0.0)
    },
    r"the reward of task 'mine': AttributeError: 'Weights' object has no attribute 'power_weight': Weights \(corridor, "
    r"touching_ends, effort_weight\) names the parameters of TrackParameters that it may use": {
        "reward": lambda moment, weights: Terms(weights.power_weight, 0.0)
    },
    r"the reward of task 'mine': TypeError: conditions differ from robot to robot, and `if`, `and`, `or`, `not`, `min` "
    r"and `max` take one for all: write where, minimum, .* \(.*test_tasks_checks\.py, line \d+\)": {"reward": lowest},
    r"conditions differ from robot to robot, .*\.py, line \d+\)$": {"reward": branching},
    r"the endings of task 'mine': TypeError: conditions differ": {"endings": branching},
    r"the reward of task 'mine': TypeError: numbers differ from robot to robot, and functions of Python, `math` and "
    r"NumPy take one for all: calculate with .*, or write where, .* \(.*test_tasks_checks\.py, line \d+\)": {
        "reward": lambda moment, weights: Terms(math.exp(moment.errors.ahead), 0.0)
    },
    r"the reward of task 'mine': TypeError: numbers differ .* \(.*test_tasks_checks\.py, line \d+\)$": {
        "reward": lambda moment, weights: Terms(np.clip(moment.errors.ahead, 0.0, 1.0), 0.0)
    },
    r"the reward of task 'mine': TypeError: .*ufunc.*: write where, .* \(.*test_tasks_checks\.py, line \d+\)": {
        "reward": lambda moment, weights: Terms(np.exp(moment.errors.ahead), 0.0)
    },
    r"the reward of task 'mine': TypeError: .* not _Tried: write where, .* \(.*test_tasks_checks\.py, line \d+\)": {
        "reward": lambda moment, weights: Terms(torch.exp(moment.errors.ahead), 0.0)  # type: ignore[arg-type]
    },
    r"the reward of task 'mine' must give a finite number as 'power', and gives nan for a robot that moves beside its "
    r"reference \(.*test_tasks_checks\.py, line \d+\)": {"reward": lambda moment, weights: Terms(0.0, math.nan)},
    r"the reward of task 'mine' must give a finite number as 'near', and gives inf for a robot at rest on its "
    r"reference, without obstacles \(": {"reward": lambda moment, weights: Terms(moment.situation.clearance, 0.0)},
    r"the reward of task 'mine': ZeroDivisionError: .*, as at all other moments that were tried \(.*, line \d+\)": {
        "reward": lambda moment, weights: Terms(1.0 / (weights.effort_weight - 0.02), 0.0)
    },
    r"task 'mine': each field of Unknown must be a number of TrackParameters, and 'power_weight' is none there": {
        "weights": Unknown
    },
    r"the endings of task 'mine': AttributeError: 'Careless' object has no attribute 'corridor'": {"weights": Careless},
    r"the endings of task 'mine' gives Terms \(near, power\), and must give Endings \(left_corridor, ": {
        "endings": complete
    },
    r"lay_out of task 'mine' gives a Timetable, and must give a Poses, its source": {"source": Poses},
}


@pytest.mark.parametrize("sentence", WRONG)
def test_what_does_not_fit_is_told_before_anything_is_compiled(sentence):
    """By what makes the engines of environments and by tensors alike."""
    task, before = task_with(**WRONG[sentence]), compilations()
    with pytest.raises(OwnCodeError, match=sentence):
        build_engine(task, "chung2008", "circle", None, None, {}, 1)
    with pytest.raises(OwnCodeError, match=sentence):
        TorchTask(task, path="circle")
    assert compilations() == before


def test_a_reward_may_do_all_that_scalars_can():
    """Calculate with numbers, conditions and weights, choose by conditions, and branch by what all robots share."""

    def rich(moment, weights):
        x = moment.errors.ahead
        chosen = clip(where(x > 0.2, x, -x) + absolute(1 - x) * sqrt(x * x), 0.0, 1.0)
        counted = (x != 2.0) * (x >= 0.1) + 2.0 ** (-x) / (1.0 + abs(x) ** 2)
        return Terms(power=chosen if weights.effort_weight > 0.0 else 0.0, near=counted)

    task = task_with(reward=rich)
    check_reward(task, weights_of(task))


@pytest.mark.parametrize("term", [lambda errors: 1.0 / (errors.ahead - 0.5), lambda errors: sqrt(errors.ahead - 0.1)])
def test_arithmetic_that_fails_for_some_of_the_numbers_tried_is_no_mistake(term):
    """Of the moments that come, none may be such; if one is, whoever trains or evaluates says so."""
    task = task_with(
        reward=lambda moment, weights: Terms(term(moment.errors), 0.0), endings=lambda *_: Endings(0.0, 0.0, 0.0)
    )
    check_reward(task, weights_of(task))
