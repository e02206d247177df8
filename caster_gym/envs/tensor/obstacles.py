"""Obstacles for a batch of tensors: each robot has those beside its own path, in tables of one shape for all.

Obstacles of different paths share a slot of the tables where they are of one kind (with faces, with corners, round);
spare faces and corners repeat the last one, and a spare slot holds something far away. The slots keep the order in
which each path lists its obstacles. How robots step among obstacles depends on what they touch, so that this, alone in
the Torch engine, waits for the device.
"""

from typing import Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor
from torch.utils import _pytree as pytree

from caster_gym.engines.tensor.motion import state_of, surface_below
from caster_gym.envs.observation import GAP_LIMIT, Neighbour
from caster_gym.envs.plan import Plan
from caster_gym.envs.report import Record, record_of
from caster_gym.envs.tensor.state import Given, record_parts
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.integration import State, pack_state
from caster_gym.mechanics.plant import guarded_driven_step, slip_speeds
from caster_gym.mechanics.scalars import each, flatten, pairs, where
from caster_gym.mechanics.separation import Hull, Obstacles, Surroundings, clearance, separation

_FAR = 1e6  # [m] where nobody comes


class _Radii(NamedTuple):
    """Radii of the obstacles in one slot, of which is known beforehand whether they are zero."""

    values: Tensor  # (robots,) [m]
    round: bool

    def __radd__(self, other: float) -> "_Radii":
        return _Radii(other + self.values, self.round or other > 0.0)

    def __rsub__(self, other: Tensor) -> Tensor:
        return other - self.values

    def __gt__(self, zero: Any) -> bool:
        return self.round


class TorchSurroundings:
    """The robot's outline, and the obstacles beside each path; arenas (paths, 2): first and end of theirs."""

    def __init__(
        self, around: Surroundings, arenas: NDArray[np.int64], dtype: torch.dtype, device: torch.device
    ) -> None:
        hull, self._all = around
        self._dtype, self._device = dtype, device
        self.hull = Hull(hull.faces.tolist(), hull.corners.tolist(), float(hull.radius), float(hull.reach))
        slots = _slots([[(k, self._kind(k)) for k in range(first, end)] for first, end in arenas.tolist()])
        faces: list[list[tuple[float, ...]]] = []
        corners: list[list[tuple[float, ...]]] = []
        self._spans = []
        for slot in slots:
            widths = [max((self._count(k, at) for k in slot if k is not None), default=0) for at in (0, 2)]
            spans = (len(faces), len(faces) + widths[0], len(corners), len(corners) + widths[1])
            faces += self._columns(slot, self._all.faces, 0, widths[0], (1.0, 0.0, -_FAR))
            corners += self._columns(slot, self._all.corners, 2, widths[1], (-_FAR, 0.0))
            self._spans.append(spans)
        radii = [[0.0 if k is None else float(self._all.radii[k]) for k in slot] for slot in slots]
        self._round = [max(row) > 0.0 for row in radii]
        there = [[k is not None for k in slot] for slot in slots]
        self._faces = self._table(faces, (len(faces), len(arenas), 3))
        self._corners = self._table(corners, (len(corners), len(arenas), 2))
        self._radii = self._table(radii, (len(slots), len(arenas)))
        self._there = torch.as_tensor(there, device=device)

    def _table(self, rows: list[Any], shape: tuple[int, ...]) -> Tensor:
        return torch.as_tensor(np.array(rows).reshape(shape), dtype=self._dtype, device=self._device)

    def _kind(self, k: int) -> tuple[bool, bool, bool]:
        return self._count(k, 0) > 0, self._count(k, 2) > 0, bool(self._all.radii[k] > 0.0)

    def _count(self, k: int, at: int) -> int:
        return int(self._all.spans[k, at + 1] - self._all.spans[k, at])

    def _columns(
        self, slot: list[int | None], table: NDArray[np.float64], at: int, width: int, spare: tuple[float, ...]
    ) -> list[list[tuple[float, ...]]]:
        """Rows of one slot's faces or corners, each with an entry a path."""
        columns = []
        for k in slot:
            own = [] if k is None else table[self._all.spans[k, at] : self._all.spans[k, at + 1]].tolist()
            columns.append(own + [own[-1] if own else spare] * (width - len(own)))
        return [list(row) for row in zip(*columns, strict=True)]

    def beside(self, paths: Tensor) -> Obstacles:
        """Obstacles beside the paths (robots,), every entry a tensor (robots,)."""
        return Obstacles(
            _entries(self._faces, paths),
            _entries(self._corners, paths),
            [_Radii(row[paths], flag) for row, flag in zip(self._radii, self._round, strict=True)],
            self._spans,
            self._all.restitution,
            self._all.friction,
            self._all.law,
        )

    def look(self, state: State, paths: Tensor, count: int) -> tuple[Tensor, tuple[Neighbour, ...]]:
        """Gap to the nearest obstacle, infinite without one [m], and the `count` nearest ones in order."""
        obstacles, none = self.beside(paths), torch.zeros_like(state.position[0])
        nearest = none + torch.inf
        neighbours = [Neighbour(none + GAP_LIMIT, none, none)] * count
        for k, there in enumerate(self._there):
            apart = separation(state.position, state.heading, self.hull, obstacles, k)
            gap = torch.where(there[paths], apart.gap, torch.inf)
            nearest = torch.minimum(gap, nearest)
            moving = Neighbour(gap, apart.nx, apart.ny)
            for j, place in enumerate(neighbours):
                nearer = moving[0] < place[0]
                neighbours[j] = Neighbour(*each(where, (nearer,), moving, place))
                moving = Neighbour(*each(where, (nearer,), place, moving))
        return nearest, tuple(neighbours)

    def careful_step(
        self,
        bodies: Tensor,
        record: Tensor,
        room: Tensor,
        given: Given,
        paths: Tensor,
        h: float,
        share: float,
        floor: FloorTable | None,
    ) -> tuple[Tensor, Tensor, Tensor]:
        """States, records and rooms after the robots whose room is negative have made their step with care.

        share: of the control period that a step of h seconds is.
        """
        near = (room < 0.0).nonzero()[:, 0]
        if not len(near):
            return bodies, record, room
        commands, (x, y, z) = given.commands[:, near].unbind(0), given.push[:, near].unbind(0)
        robot = pytree.tree_map_only(Tensor, lambda one: one[near], given.robot)
        obstacles = self.beside(paths[near])
        state = state_of(bodies[:, near], floor)
        surface = None if floor is None else surface_below(state, robot, floor)
        end, drive, touch = guarded_driven_step(
            state, pairs(commands), (x, y, z), h, robot, self.hull, obstacles, 0, len(self._spans), surface
        )
        torques, numbers, before = record_parts(record[:, near], len(robot.casters))
        happened = record_of(Record(*numbers.unbind(0)), drive, touch, share)
        slips = () if floor is None else each(torch.maximum, (), slip_speeds(end, robot), before.unbind(0))
        torques = torques + share * torch.stack(flatten(drive.torques))
        gap = clearance(end.position, end.heading, self.hull, obstacles, 0, len(self._spans))
        return (
            bodies.index_copy(1, near, torch.stack(pack_state(end))),
            record.index_copy(1, near, torch.cat((torques, torch.stack((*happened, *slips))))),
            room.index_copy(0, near, gap),
        )


def torch_surroundings(plan: Plan, dtype: torch.dtype, device: torch.device) -> TorchSurroundings | None:
    """What is beside the paths of a plan; None where there is no obstacle."""
    if len(plan.around.obstacles.radii) == 0:
        return None
    return TorchSurroundings(plan.around, plan.arenas, dtype, device)


def _slots(listed: list[list[tuple[int, tuple[bool, bool, bool]]]]) -> list[list[int | None]]:
    """For each slot the obstacle of every path in it, if any, so that each path's stay in order and of one kind."""
    slots = []
    ahead = [list(one) for one in listed]
    while any(ahead):
        kind = next(one[0][1] for one in ahead if one)
        slots.append([one.pop(0)[0] if one and one[0][1] == kind else None for one in ahead])
    return slots


def _entries(table: Tensor, paths: Tensor) -> list[list[Tensor]]:
    """Numbers of a table (rows, paths, columns) as tensors (robots,)."""
    return [list(row.unbind(1)) for row in table[:, paths].unbind(0)]
