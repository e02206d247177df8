"""Moments made by hand, and what a task's reward is of them."""

from typing import Any

from caster_gym.envs.report import Record, Situation
from caster_gym.envs.tracking import Errors, Moment, unless
from caster_gym.mechanics.scalars import each

NO_ERROR = Errors(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def untouched(power=0.0):
    """The record of a control period without impacts."""
    return Record(*(0.0,) * len(Record._fields))._replace(power=power)


def weights_of(task, **changed):
    """The weights of a task's parameters, by name."""
    return task.weights(*task.weights_of(task.parameters(**changed)).tolist())


def terms_of(task, weights, errors=NO_ERROR, share=0.0, effort=0.0, pressing=0.0, failed=0.0):
    """Terms of a task's reward; 0 in a step that fails."""
    record = untouched()._replace(pressing=pressing)
    nothing: Any = None  # no reward looks at the state or at the reference
    terms = task.reward(Moment(nothing, nothing, errors, effort, record, Situation(0.0, share, 0.0)), weights)
    return task.terms(*each(unless, (failed,), terms[:]))
