"""Evaluation and observation of robots on tensors after a motion: fetch, evaluate, observe, report.

The arithmetic is that of `caster_gym.envs.tracking` and the tasks, whose generic functions run here on tensors with an
entry a robot. Nothing waits for the device, and nothing is written in place.
"""

import math
from typing import TYPE_CHECKING

import torch
from torch import Tensor

from caster_gym.engines.tensor.motion import state_of
from caster_gym.envs.native.layout import as_many
from caster_gym.envs.observation import GAP_LIMIT, Neighbour, ObservationLayout, View, observe
from caster_gym.envs.plan import SPAN, Plan
from caster_gym.envs.report import REPORT, Deviation, Endings, Pose, Record, Report, Situation, flat_report, sum_of
from caster_gym.envs.tensor.obstacles import TorchSurroundings
from caster_gym.envs.tensor.reference import Guidance, TorchSource, torch_weights
from caster_gym.envs.tensor.state import TaskOutcome, record_parts
from caster_gym.envs.tracking import Errors, Reference, distance_square, evaluate_by, report
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import pairs, sqrt

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task


class TorchLook:
    """What becomes of robots at a task, from where they are and what has happened to them."""

    def __init__(
        self,
        task: "Task",
        plan: Plan,
        source: TorchSource,
        layout: ObservationLayout,
        floor: FloorTable | None,
        around: TorchSurroundings | None,
        diagnostics: bool,
        dtype: torch.dtype,
        device: torch.device,
    ) -> None:
        self._source, self._floor, self._around, self._dtype = source, floor, around, dtype
        self._weights = task.weights(*torch_weights(plan.source.weights, dtype, device))
        self._reward, self._endings, self._terms = task.reward, task.endings, plan.terms
        self._nearest, self._diagnostics = layout.nearest, diagnostics

    def look(
        self,
        bodies: Tensor,
        record: Tensor,
        clocks: Tensor,
        paths: Tensor,
        before: Tensor,
        robot: RobotParameters,
        source: TorchSource | None = None,
    ) -> tuple[TaskOutcome, Tensor, Tensor]:
        """Outcome, progress and room of robots that have moved; before: their progress so far, negative at a start.

        source: another one than the task's.
        """
        source = self._source if source is None else source
        state = state_of(bodies, self._floor)
        mean_torques, numbers, slips = record_parts(record, len(robot.casters))
        torques, done = pairs(mean_torques.unbind(0)), Record(*numbers.unbind(0))
        guidance, nearest, situation = self._fetch(source, state, clocks, paths, before)
        reference = guidance.reference
        errors, endings, terms = evaluate_by(
            state, reference, torques, done, situation, robot, self._weights, self._endings, self._reward
        )
        rates = all_joint_rates(state, robot, self._floor)
        seen = observe(View(state, reference, errors, guidance.preview, nearest, rates, robot))
        reported = self._report(state, reference, errors, done, situation, endings, robot)
        rows = list(flat_report(reported, as_many(terms, self._terms), torques, slips.unbind(0)))
        rows[REPORT.deviation.heading_sin] = torch.atan2(errors.sin, errors.cos)
        outcome = TaskOutcome(
            observations=torch.stack(seen).T,
            rewards=sum_of(terms),
            terminated=sum_of(endings) > 0.0,
            truncated=clocks >= source.spans[paths, SPAN.periods],
            report=torch.stack([row.to(self._dtype) for row in rows]),
        )
        return outcome, guidance.progress, situation.clearance

    def _fetch(
        self, source: TorchSource, state: State, clocks: Tensor, paths: Tensor, before: Tensor
    ) -> tuple[Guidance, tuple[Neighbour, ...], Situation]:
        """What the robots are to do, and what is near them."""
        guidance = source.fetch(state, clocks, paths, before)
        if self._around is None:
            none = torch.zeros_like(state.position[0])
            gap, nearest = none + math.inf, (Neighbour(none + GAP_LIMIT, none, none),) * self._nearest
        else:
            gap, nearest = self._around.look(state, paths, self._nearest)
        return guidance, nearest, Situation(guidance.progress, guidance.share, gap)

    def _report(
        self,
        state: State,
        reference: Reference,
        errors: Errors,
        done: Record,
        situation: Situation,
        endings: Endings,
        robot: RobotParameters,
    ) -> Report:
        """What infos are made of; without diagnostics, only what takes no time."""
        if self._diagnostics:
            return report(state, reference, errors, done, situation, endings, robot)
        pose, wanted = Pose(*state.position, *state.heading), Pose(*reference[: len(Pose._fields)])
        none = torch.zeros_like(situation.clearance)
        deviation = Deviation(sqrt(distance_square(errors)), errors.sin, errors.cos, none)
        return Report(endings, deviation, pose, wanted, done, situation)
