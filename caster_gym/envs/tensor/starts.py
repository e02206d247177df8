"""Where episodes of robots on tensors start: drawn by the task, or given to a reset."""

import math

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caster_gym.engines.tensor.motion import state_of
from caster_gym.envs.native.engine import TaskEngine
from caster_gym.envs.starts import Start, check_longest, check_motion, check_place, nearest_row
from caster_gym.envs.tensor.randomness import episode_seed, uniform
from caster_gym.envs.tensor.reference import TorchSource, torch_source
from caster_gym.envs.tensor.state import TaskState
from caster_gym.envs.tracking import start
from caster_gym.mechanics.floor import FloorTable
from caster_gym.mechanics.integration import State, pack_state, state_rows
from caster_gym.mechanics.parameters import RobotParameters
from caster_gym.mechanics.scalars import Direction
from caster_gym.mechanics.slip_state import rolling_state

BEFORE_START = -1.0  # [m] progress of an episode that is about to start


class TorchStarts:
    """Where robots of a task start; task: its name, for errors."""

    def __init__(
        self,
        task: str,
        engine: TaskEngine,
        source: TorchSource,
        floor: FloorTable | None,
        dtype: torch.dtype,
        device: torch.device,
    ) -> None:
        self._task, self._engine, self._source, self._floor = task, engine, source, floor
        self._dtype, self._device = dtype, device
        # plain numbers, since what is reached through other objects is looked up anew before each compiled call
        self._casters, self._paths = engine.robot.caster_count, len(engine.plan.names)
        self._offset, self._turn = engine.spread.tolist()  # greatest displacements of a start [m], [rad]

    def place(self, keys: Tensor, episodes: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """States at the start of an episode, and its path."""
        seed = episode_seed(keys, episodes)
        drawn = (uniform(seed, 0) * self._paths).long()
        paths = torch.where(wanted < 0, drawn, wanted)
        offset, turn = self._displacement(seed)
        x, _ = offset
        directions = tuple(self._direction(2.0 * math.pi * uniform(seed, 4 + i)) for i in range(self._casters))
        none = torch.zeros_like(x)
        nowhere = State((none, none), (none, none), (none, none, none), directions)
        guidance = self._source.fetch(nowhere, torch.zeros_like(episodes), paths, none + BEFORE_START)
        bodies = torch.stack(pack_state(start(guidance.reference, offset, turn, directions)))
        still = state_rows(self._casters, self._floor is not None) - len(bodies)  # rates of a robot at rest
        return torch.cat((bodies, torch.zeros_like(bodies[:still]))), paths

    def _displacement(self, seed: Tensor) -> tuple[tuple[Tensor, Tensor], Direction]:
        """How far a start lies beside its place, in the reference's frame [m], and its turn."""
        x, y = (((2.0 * uniform(seed, i) - 1.0) * self._offset).to(self._dtype) for i in (1, 2))
        return (x, y), self._direction((2.0 * uniform(seed, 3) - 1.0) * self._turn)

    def move_to(
        self, given: Start, bodies: Tensor, state: TaskState, paths: Tensor, checked: Tensor, robot: RobotParameters
    ) -> tuple[Tensor, Tensor, Tensor, TorchSource]:
        """Drawn bodies where a start is given, with clocks, progress, and a source under which progress stays.

        Does what `caster_gym.envs.starts` does with arrays. Raises ValueError for what can be no start.
        """
        engine, now = self._engine, state_of(bodies, self._floor)
        plain, chosen = paths.cpu().numpy(), checked.cpu().numpy()
        clocks, progress = torch.zeros_like(state.clocks), torch.zeros_like(state.progress)
        source = engine.plan.source
        by_progress = source.place == "progress"
        still = torch_source(source.still(), self._task, self._dtype, self._device)
        if given.place is not None:
            place = given.place.copy()
            place[chosen] = check_place(engine, plain[chosen], place[chosen])
            if by_progress:
                progress = self._tensor(place)
            else:
                check_longest(engine)
                clocks = torch.as_tensor(np.rint(place / engine.control_period).astype(np.int64), device=self._device)
            none = torch.zeros_like(state.progress)
            nowhere = State((none, none), (none, none), (none, none, none), ())
            reference = still.reference_at(paths, progress if by_progress else clocks, nowhere)
            offset, turn = self._displacement(episode_seed(state.keys, state.episodes))
            drawn = start(reference, offset, turn, ())
            now = now._replace(position=drawn.position, heading=drawn.heading)
        if given.pose is not None:
            x, y, heading = self._tensor(given.pose).unbind(1)
            now = now._replace(position=(x, y), heading=(torch.cos(heading), torch.sin(heading)))
        if given.twist is not None:
            vx, vy, omega = self._tensor(given.twist).unbind(1)
            now = now._replace(twist=(vx, vy, omega))
        if given.steering is not None:
            angles = self._tensor(given.steering)
            pairs = zip(torch.cos(angles).unbind(1), torch.sin(angles).unbind(1), strict=True)
            now = now._replace(directions=tuple(pairs))
        if given.twist is not None:
            heads = np.array([torch.stack(f).detach().cpu().double().numpy() for f in now.directions])  # (N, 2, robots)
            check_motion(engine.robot, np.arctan2(heads[:, 1], heads[:, 0]).T[chosen], given.twist[chosen])
        if by_progress and given.pose is not None and given.place is None:
            before = self._tensor(nearest_row(engine, plain, given.pose[:, :2]))
            progress = self._source.fetch(now, clocks, paths, before).progress
        if self._floor is not None:
            now = rolling_state(now, robot)
        return torch.stack(pack_state(now)), clocks, progress, still

    def _tensor(self, numbers: NDArray[np.float64]) -> Tensor:
        return torch.as_tensor(numbers, dtype=self._dtype, device=self._device)

    def _direction(self, angle: Tensor) -> Direction:
        return torch.cos(angle).to(self._dtype), torch.sin(angle).to(self._dtype)
