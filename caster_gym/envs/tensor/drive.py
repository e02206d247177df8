"""How robots on tensors move for a control period: motors, floor, obstacles, and the record of what happened."""

from collections.abc import Callable
from typing import Any

import torch
from torch import Tensor

from caster_gym.engines.tensor.motion import driven_rows, slipping_rows, state_of, surface_below
from caster_gym.envs.report import RECORD, Record
from caster_gym.envs.rows import check_names, span
from caster_gym.envs.tensor.obstacles import TorchSurroundings
from caster_gym.envs.tensor.state import Given, TaskState, empty_record
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.room import step_within_room
from caster_gym.mechanics.scalars import Scalar

_ASKED = span((RECORD.traction, RECORD.lifted))
check_names(Record._fields[:1], "the first field of Record", ("power",), "that which motors give beside torques")


class TorchDrive:
    """What moves robots; floor: None where no wheel slips; around: None where there is no obstacle.

    h: of a substep [s]. Without diagnostics nobody works out what is asked of the floor.
    """

    def __init__(
        self,
        casters: int,
        substeps: int,
        h: float,
        floor: FloorTable | None,
        around: TorchSurroundings | None,
        diagnostics: bool,
    ) -> None:
        # plain numbers, since what is reached through other objects is looked up anew before each compiled call
        self._casters, self._slipping, self._substeps, self._h = casters, 0 if floor is None else casters, substeps, h
        self._floor, self._around, self._diagnostics = floor, around, diagnostics

    def drive(self, move: Callable[..., Any], state: TaskState, given: Given) -> tuple[Tensor, Tensor]:
        """States after a control period, and its record; move: the method `move`, compiled or not."""
        bodies, room, record = state.bodies, state.room, empty_record(state.bodies, self._casters, self._slipping)
        # obstacles are looked for after each substep, and a gradient through all of them would compile for long
        at_once = self._substeps if self._around is None and not bodies.requires_grad else 1
        for _ in range(0, self._substeps, at_once):
            bodies, record, room = move(bodies, record, room, given, at_once)
            if self._around is not None:
                share = 1.0 / self._substeps
                bodies, record, room = self._around.careful_step(
                    bodies, record, room, given, state.paths, self._h, share, self._floor
                )
        return bodies, record

    def move(
        self, bodies: Tensor, record: Tensor, room: Tensor, given: Given, steps: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """States, records and rooms after RK4 steps; who may touch something stays, with a negative room."""
        n, around = 2 * self._casters, self._around
        asked = slice(n + _ASKED.start, n + _ASKED.stop)
        for _ in range(steps):
            target, done, asks, slips = self._step(bodies, given)
            share: Scalar = 1.0 / self._substeps
            if around is None:
                bodies = target
            else:
                now, aim = state_of(bodies, self._floor), state_of(target, self._floor)
                end, room, went = step_within_room(around, room, now, aim, self._h, around.hull.reach)
                bodies, went = torch.stack(end), went.to(bodies.dtype)
                share, asks = share * went, went * asks
                slips = None if slips is None else went * slips
            asks = torch.maximum(asks, record[asked])
            kept = record[asked.stop : n + len(RECORD)]
            rows = [record[: n + 1] + share * done, record[n + 1 : asked.start], asks, kept]
            if slips is not None:
                rows.append(torch.maximum(slips, record[n + len(RECORD) :]))
            record = torch.cat(rows)
        return bodies, record, room

    def _step(self, bodies: Tensor, given: Given) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
        """Where an ordinary step leads, what motors did, what was asked of the floor, and how fast each wheel slips."""
        if self._floor is None:
            went = driven_rows(bodies, given.commands, given.push, self._h, given.robot, self._diagnostics)
            return *went, None
        surface = surface_below(state_of(bodies, self._floor), given.robot, self._floor)
        return slipping_rows(bodies, given.commands, given.push, self._h, torch.stack(surface.frictions), given.robot)
