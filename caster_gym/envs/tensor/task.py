"""A task's control period as a function of tensors: state and actions in, state and outcome out, differentiable.

The arithmetic is that of `tracking` and `following`, whose generic functions run here on tensors with an entry a robot.
Nothing waits for the device, and nothing is written in place.
"""

import math
from collections.abc import Mapping
from functools import partial
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caster_gym.engines.tensor.compiler import compiled
from caster_gym.engines.tensor.fleet import BODY_ROWS
from caster_gym.engines.tensor.motion import driven_rows, slipping_rows, surface_below, torch_floor
from caster_gym.engines.tensor.scalars import check_memory, checked_device, checked_dtype
from caster_gym.envs.inputs import Actuation, ArenaLike, RobotLike
from caster_gym.envs.native import layout
from caster_gym.envs.native.engine import DRAW_A_PATH
from caster_gym.envs.native.reference import evaluate_by
from caster_gym.envs.observation import GAP_LIMIT, Neighbour, View, observe
from caster_gym.envs.report import (
    RECORD,
    REPORT,
    Deviation,
    Pose,
    Record,
    Report,
    Situation,
    flat_report,
    sum_of,
)
from caster_gym.envs.rows import check_names, span
from caster_gym.envs.starts import DRAWN, Start, check_free, check_longest, check_motion, check_place, nearest_row
from caster_gym.envs.tensor.obstacles import Given, torch_surroundings
from caster_gym.envs.tensor.randomness import episode_seed, uniform
from caster_gym.envs.tensor.reference import TorchSource, torch_weights
from caster_gym.envs.tracking import distance_square, report, start
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import State, pack_state, unpack_state
from caster_gym.mechanics.parameters import RobotParameters, robot_parameters
from caster_gym.mechanics.room import step_within_room
from caster_gym.mechanics.scalars import Direction, Scalar, pairs, sqrt
from caster_gym.mechanics.slip_state import rolling_state, unpack_slip_state
from caster_gym.paths.specification import PathLike

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task

DIAGNOSTICS = ("traction_use", "wheels_lifted", "conditioning")
_BEFORE = -1.0  # [m] progress of an episode that is about to start


_ASKED = span((RECORD.traction, RECORD.lifted))
check_names(Record._fields[:1], "the first field of Record", ("power",), "that which motors give beside torques")


class TaskState(NamedTuple):
    """All that a batch keeps from one control period to the next; robots are the last axis."""

    bodies: Tensor  # (7 + 2 N, robots): x, y, cos β, sin β in W, twist in B, cos δ, sin δ of each caster; if wheels may
    # slip, yaw rate over ground and rolling rate of each caster, and the tilt: 2 N + 2 rows more
    progress: Tensor  # (robots,) [m] along the path, where the task measures it
    room: Tensor  # (robots,) [m] gap to the nearest obstacle, infinite where there is none
    clocks: Tensor  # int64 (robots,) control periods done in the episode
    paths: Tensor  # int64 (robots,) index of the path
    keys: Tensor  # int64 (robots,) from which all random numbers of a robot count
    episodes: Tensor  # int64 (robots,) number of the episode that starts next

    def detached(self) -> "TaskState":
        """The same state without its past, through which no gradient passes any more."""
        return TaskState(*(tensor.detach() for tensor in self))


class TaskOutcome(NamedTuple):
    """What a control period brought."""

    observations: Tensor  # (robots, size)
    rewards: Tensor  # (robots,)
    terminated: Tensor  # bool (robots,)
    truncated: Tensor  # bool (robots,)
    report: Tensor  # (quantities, robots), which `TorchTask.info` names

    @property
    def ended(self) -> Tensor:
        """Whose episode is over (robots,)."""
        return self.terminated | self.truncated


class TorchTask:
    """One of the tasks, for robots of one kind, as functions of tensors.

        state, outcome = task.begin(keys)
        state, outcome = task.step(state, actions)  # actions (robots, driven joints) in −1 … 1
        state, outcome = task.restart(state, outcome)  # new episodes where they have ended
        state = state.detached()  # between windows of a rollout

    Gradients pass from rewards, observations and reports to actions, states, wrenches and parameters of the robots,
    wherever motor limits and kernels have a slope, and end where an episode starts anew. An action that is not a number
    ends its robot's episode as not finite, since to look for it would wait for the device.

    task: its name, as "track" or "my_module:MY_TASK", or its object. robot, path, actuation, arena: as for
    `CasterTrackEnv`; fields: of the task's parameters. longest: greatest number of control periods of an episode.
    compile fuses each part of a step into few kernels; graphs replays them as CUDA graphs, without gradients, see
    `TorchVectorEnv`. Without diagnostics, infos leave out traction use and conditioning, which take longer than
    everything else that is observed.

    parameters: the robot's own numbers, which may be replaced by others, or by tensors (robots,) of them.

    >>> import caster_gym, torch
    >>> task = caster_gym.TorchTask("track", path="lemniscate")
    >>> state, outcome = task.begin(torch.arange(16))
    >>> actions = torch.zeros(16, 6, requires_grad=True)
    >>> state, outcome = task.step(state, actions)
    >>> outcome.rewards.sum().backward()
    >>> outcome.observations.shape, actions.grad.shape
    (torch.Size([16, 46]), torch.Size([16, 6]))
    """

    def __init__(
        self,
        task: "str | Task" = "track",
        robot: RobotLike = "chung2008",
        path: PathLike | None = None,
        actuation: Actuation = None,
        arena: ArenaLike = None,
        fields: Mapping[str, Any] | None = None,
        longest: int | None = None,
        *,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
        compile: bool = False,
        graphs: bool = False,
        diagnostics: bool = True,
    ) -> None:
        from caster_gym.tasks.building import build_engine  # tasks stand above, and are looked up when one is asked for
        from caster_gym.tasks.registry import find_task

        self.definition = definition = find_task(task)
        self.dtype, self.device = checked_dtype(dtype), checked_device(device)
        self.engine, self.task = build_engine(definition, robot, path, actuation, arena, fields or {}, 1, longest)
        self.robot, self.layout, self.diagnostics = self.engine.robot, self.engine.layout, diagnostics
        self.parameters: RobotParameters = robot_parameters(self.robot)
        self._source: TorchSource = self._on_tensors(self.engine.plan.source)
        numbers = self.engine.plan.source.weights
        self._weights = definition.weights(*torch_weights(numbers, self.dtype, self.device))
        self._reward, self._endings = definition.reward, definition.endings
        self._around = torch_surroundings(self.engine.plan, self.dtype, self.device)
        self._floor = None if self.task.slippery is None else torch_floor(self.task.slippery)
        self._slipping, self._terms = self.engine.slipping, self.engine.plan.terms
        # plain numbers, since what is reached through other objects is looked up anew before each compiled call
        self._joints, self._substeps, self._h = 2 * self.robot.caster_count, self.task.substeps, self.task.time_step
        self._start_offset, self._start_turn = self.task.start_offset, self.task.start_turn
        self._paths, self._nearest = len(self.engine.plan.names), self.layout.nearest
        driven = self.robot.driven
        self._slots = tuple(driven.index(joint) if joint in driven else -1 for joint in self.robot.joints)
        self._compiled = compile
        self.graphs = compile and graphs and self._around is None  # obstacles wait for the device
        self._compile()

    def _on_tensors(self, source: Any) -> TorchSource:
        if not hasattr(source, "on_tensors"):
            raise ValueError(
                f"task {self.definition.name!r} does not run on tensors: its {type(source).__name__} has no on_tensors"
            )
        made: TorchSource = source.on_tensors(self.dtype, self.device)
        return made

    def _compile(self) -> None:
        self._move, self._look, self._place = self._moved, self._looked, self._placed
        if self._compiled:
            self._move = compiled(self._moved, self.device, self.graphs)
            self._look = compiled(self._looked, self.device, self.graphs)
            self._place = compiled(self._placed, self.device, self.graphs)

    def __getstate__(self) -> dict[str, Any]:
        """What a copy needs, which compiles its own functions."""
        return {name: value for name, value in vars(self).items() if name not in ("_move", "_look", "_place")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._compile()

    def begin(
        self, keys: Tensor, path: Tensor | int = DRAW_A_PATH, start: Start = DRAWN
    ) -> tuple[TaskState, TaskOutcome]:
        """First episodes of robots with the given keys, int64 (robots,); path: index for each, or drawn.

        start: where it is given, of all robots; see `caster_gym.envs.starts.read_start`.
        """
        count = len(keys)
        rows = 3 * self.layout.size + 2 * self.engine.report_rows
        check_memory(count, rows, self.dtype, self.device)
        whole = torch.zeros(count, dtype=torch.int64, device=self.device)
        none = self._empty(layout.state_rows(self.robot.caster_count, self._floor is not None), count)
        state = TaskState(
            none,
            none[0],
            none[0],
            whole,
            whole,
            torch.as_tensor(keys, device=self.device).clone(),
            whole,
        )
        wanted = torch.as_tensor(path, device=self.device).expand(count)
        return self._start(state, wanted, start, torch.ones_like(whole, dtype=torch.bool))

    def step(self, state: TaskState, actions: Tensor, wrench: Tensor | None = None) -> tuple[TaskState, TaskOutcome]:
        """Hold actions (robots, driven joints) for a control period; nobody is restarted.

        wrench (robots, 3): external, at C, in B [N, N, N m].
        """
        commands = self._commands(actions, len(state.clocks))
        if wrench is not None and wrench.shape != (len(state.clocks), 3):
            raise ValueError(f"wrench must have shape {(len(state.clocks), 3)}, got {tuple(wrench.shape)}")
        doubt = (commands - commands).sum(0)  # not a number where a command is none
        push = doubt.expand(3, -1) if wrench is None else doubt + wrench.to(self.dtype).T
        given = Given(commands, push, self.parameters)
        if commands.requires_grad:
            state = self._differentiable(state)
        bodies, room = state.bodies, state.room
        record = self._empty(self._record_rows, len(doubt)).requires_grad_(bodies.requires_grad)
        h, substeps = self.task.time_step, self.task.substeps
        at_once = substeps if self._around is None and not bodies.requires_grad else 1  # a gradient compiles for long
        for _ in range(0, substeps, at_once):
            bodies, record, room = self._move(bodies, record, room, given, at_once)
            if self._around is not None:
                share = 1.0 / substeps
                bodies, record, room = self._around.careful_step(
                    bodies, record, room, given, state.paths, h, share, self._floor
                )
        clocks = state.clocks + 1
        outcome, progress, room = self._look(bodies, record, clocks, state.paths, state.progress, self.parameters)
        return state._replace(bodies=bodies, progress=progress, room=room, clocks=clocks), outcome

    def restart(
        self,
        state: TaskState,
        outcome: TaskOutcome,
        where: Tensor | None = None,
        path: Tensor | int = DRAW_A_PATH,
        start: Start = DRAWN,
    ) -> tuple[TaskState, TaskOutcome]:
        """New episodes where they have ended, or of the robots of a mask (robots,).

        Observations and reports become those of the starts; rewards and endings stay those of the step.
        """
        again = outcome.ended if where is None else where
        fresh, first = self._start(state, torch.as_tensor(path, device=self.device).expand(len(again)), start, again)
        merged = TaskState(*(torch.where(again, new, old) for new, old in zip(fresh, state, strict=True)))
        return merged, outcome._replace(  # rows of robots, whose entries lie side by side, are the fastest to choose
            observations=torch.where(again, first.observations.T, outcome.observations.T).T,
            report=torch.where(again, first.report, outcome.report),
        )

    def info(self, report: Tensor) -> dict[str, Any]:
        """Named quantities of all robots, as `CasterTrackEnv` describes them: tensors with robots in front."""
        infos: dict[str, Any] = self.engine.info(report)  # type: ignore[arg-type]  # slices tensors as it does arrays
        return infos if self.diagnostics else {name: infos[name] for name in infos if name not in DIAGNOSTICS}

    @property
    def _record_rows(self) -> int:
        """Mean motor torques, then what a Record holds, and the slips of wheels that may slip."""
        return 2 * self.robot.caster_count + len(RECORD) + self._slipping

    def _empty(self, rows: int, count: int) -> Tensor:
        return torch.zeros((rows, count), dtype=self.dtype, device=self.device)

    def _commands(self, actions: Tensor, count: int) -> Tensor:
        """A command in −1 … 1 for each motor (2 N, robots), 0 where it is not driven."""
        if not isinstance(actions, Tensor) or actions.is_complex() or actions.dtype is torch.bool:
            got = actions.dtype if isinstance(actions, Tensor) else type(actions).__name__
            raise ValueError(f"actions must be a tensor of real numbers, got {got}")
        if actions.shape != (count, len(self.robot.driven)):
            raise ValueError(f"actions must have shape {(count, len(self.robot.driven))}, got {tuple(actions.shape)}")
        rows = actions.to(self.dtype).clamp(-1.0, 1.0).T
        if len(self.robot.driven) == len(self._slots):
            return rows.contiguous()  # strides would stop SIMD
        none = torch.zeros_like(rows[0])
        return torch.stack([none if slot < 0 else rows[slot] for slot in self._slots])

    def _moved(
        self, bodies: Tensor, record: Tensor, room: Tensor, given: Given, steps: int
    ) -> tuple[Tensor, Tensor, Tensor]:
        """States, records and rooms after RK4 steps; who may touch something stays, with a negative room."""
        n = self._joints
        around, asked = self._around, slice(n + _ASKED.start, n + _ASKED.stop)
        for _ in range(steps):
            target, done, asks, slips = self._stepped(bodies, given)
            share: Scalar = 1.0 / self._substeps
            if around is None:
                bodies = target
            else:
                now, aim = self._state(bodies), self._state(target)
                end, room, went = step_within_room(around, room, now, aim, self._h, around.hull.reach)
                bodies, went = torch.stack(end), went.to(self.dtype)
                share, asks = share * went, went * asks
                slips = None if slips is None else went * slips
            asks = torch.maximum(asks, record[asked])
            kept = record[asked.stop : n + len(RECORD)]
            rows = [record[: n + 1] + share * done, record[n + 1 : asked.start], asks, kept]
            if slips is not None:
                rows.append(torch.maximum(slips, record[n + len(RECORD) :]))
            record = torch.cat(rows)
        return bodies, record, room

    def _stepped(self, bodies: Tensor, given: Given) -> tuple[Tensor, Tensor, Tensor, Tensor | None]:
        """Where an ordinary step leads, what motors did, what was asked of the floor, and how fast each wheel slips."""
        if self._floor is None:
            went = driven_rows(bodies, given.commands, given.push, self._h, given.robot, self.diagnostics)
            return *went, None
        frictions = torch.stack(surface_below(self._state(bodies), given.robot, self._floor).frictions)
        return slipping_rows(bodies, given.commands, given.push, self._h, frictions, given.robot)

    def _state(self, bodies: Tensor) -> State:
        """The state whose rows these are."""
        rows = bodies.unbind(0)
        return unpack_state(rows) if self._floor is None else unpack_slip_state(rows)

    def _looked(
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
        state, n = self._state(bodies), self._joints
        end = n + len(RECORD)
        torques, done, slips = pairs(record[:n].unbind(0)), Record(*record[n:end].unbind(0)), record[end:].unbind(0)
        source = self._source if source is None else source
        guidance = source.fetch(state, clocks, paths, before)
        reference = guidance.reference
        gap, nearest = self._look_around(state, paths)
        situation = Situation(guidance.progress, guidance.share, gap)
        errors, endings, terms = evaluate_by(
            state, reference, torques, done, situation, robot, self._weights, self._endings, self._reward
        )
        if self.diagnostics:
            reported = report(state, reference, errors, done, situation, endings, robot)
        else:
            pose, wanted = Pose(*state.position, *state.heading), Pose(*reference[: len(Pose._fields)])
            deviation = Deviation(sqrt(distance_square(errors)), errors.sin, errors.cos, torch.zeros_like(gap))
            reported = Report(endings, deviation, pose, wanted, done, situation)
        numbers = list(flat_report(reported, layout.as_many(terms, self._terms), torques, slips))
        numbers[REPORT.deviation.heading_sin] = torch.atan2(errors.sin, errors.cos)
        rates = all_joint_rates(state, robot, self._floor)
        seen = observe(View(state, reference, errors, guidance.preview, nearest, rates, robot))
        truncated = clocks >= source.spans[paths, 2]
        rows = torch.stack([number.to(self.dtype) for number in numbers])
        outcome = TaskOutcome(torch.stack(seen).T, sum_of(terms), sum_of(endings) > 0.0, truncated, rows)
        return outcome, guidance.progress, gap

    def _look_around(self, state: State, paths: Tensor) -> tuple[Tensor, tuple[Neighbour, ...]]:
        """Gap to the nearest obstacle [m], and the obstacles that the observation shows."""
        if self._around is not None:
            return self._around.look(state, paths, self._nearest)
        none = torch.zeros_like(state.position[0])
        return none + math.inf, (Neighbour(none + GAP_LIMIT, none, none),) * self._nearest

    def _start(self, state: TaskState, wanted: Tensor, given: Start, checked: Tensor) -> tuple[TaskState, TaskOutcome]:
        """Everybody at the start of the next episode, on the wanted path or, where it is negative, a drawn one.

        checked: the robots (robots,) whose given start is looked at.
        """
        bodies, paths = self._place(state.keys, state.episodes, wanted)
        clocks, before = torch.zeros_like(state.clocks), torch.full_like(state.progress, _BEFORE)
        look = self._look
        if not given.drawn:
            bodies, clocks, before, source = self._moved_to(given, bodies, state, paths, checked)
            look = partial(self._looked, source=source)
        fresh = TaskState(bodies, before, state.room, clocks, paths, state.keys, state.episodes + 1)
        fresh = self._differentiable(fresh)
        nothing = self._empty(self._record_rows, len(clocks)).requires_grad_(fresh.bodies.requires_grad)
        outcome, progress, room = look(fresh.bodies, nothing, clocks, paths, fresh.progress, self.parameters)
        if not given.drawn:
            robots = checked.nonzero()[:, 0]
            check_free(self.engine, outcome.report[:, robots].detach().cpu().double().numpy(), robots.cpu().numpy())
        fresh = fresh._replace(progress=progress, room=room)
        if self._compiled:
            return fresh.detached(), TaskOutcome(*(tensor.detach() for tensor in outcome))
        return fresh, outcome

    def _differentiable(self, state: TaskState) -> TaskState:
        """The state as the compiled parts want it in all periods of a window: without a past they were other ones."""
        if not (self._compiled and torch.is_grad_enabled()):
            return state
        bodies, progress = (
            tensor if tensor.requires_grad else tensor.detach().requires_grad_()
            for tensor in (state.bodies, state.progress)
        )
        return state._replace(bodies=bodies, progress=progress)

    def _placed(self, keys: Tensor, episodes: Tensor, wanted: Tensor) -> tuple[Tensor, Tensor]:
        """States at the start of an episode, and its path."""
        seed = episode_seed(keys, episodes)
        drawn = (uniform(seed, 0) * self._paths).long()
        paths = torch.where(wanted < 0, drawn, wanted)
        offset, turn = self._displacement(seed)
        x, _ = offset
        directions = tuple(self._direction(2.0 * math.pi * uniform(seed, 4 + i)) for i in range(self._joints // 2))
        none = torch.zeros_like(x)
        nowhere = State((none, none), (none, none), (none, none, none), directions)
        guidance = self._source.fetch(nowhere, torch.zeros_like(episodes), paths, none + _BEFORE)
        bodies = torch.stack(pack_state(start(guidance.reference, offset, turn, directions)))
        still = layout.state_rows(self._joints // 2, self._floor is not None) - len(bodies)  # rates of a robot at rest
        return torch.cat((bodies, torch.zeros_like(bodies[:still]))), paths

    def _rolling(self, bodies: Tensor) -> Tensor:
        """Bodies (7 + 2 N, robots) on the task's floor, in which no wheel slips yet."""
        if self._floor is None:
            return bodies
        return torch.stack(pack_state(rolling_state(unpack_state(bodies.unbind(0)), self.parameters)))

    def _displacement(self, seed: Tensor) -> tuple[tuple[Tensor, Tensor], Direction]:
        """How far a start lies beside its place, in the reference's frame [m], and its turn."""
        x, y = (((2.0 * uniform(seed, i) - 1.0) * self._start_offset).to(self.dtype) for i in (1, 2))
        return (x, y), self._direction((2.0 * uniform(seed, 3) - 1.0) * self._start_turn)

    def _moved_to(
        self, given: Start, bodies: Tensor, state: TaskState, paths: Tensor, checked: Tensor
    ) -> tuple[Tensor, Tensor, Tensor, TorchSource]:
        """Drawn bodies where a start is given, with clocks, progress, and a source under which progress stays.

        Does what `caster_gym.envs.starts` does with arrays. Raises ValueError for what can be no start.
        """
        engine, rows = self.engine, list(bodies[: BODY_ROWS + self._joints].unbind(0))
        plain, chosen = paths.cpu().numpy(), checked.cpu().numpy()
        clocks, progress = torch.zeros_like(state.clocks), torch.zeros_like(state.progress)
        source = engine.plan.source
        by_progress, still = source.place == "progress", self._on_tensors(source.still())
        if given.place is not None:
            place = given.place.copy()
            place[chosen] = check_place(engine, plain[chosen], place[chosen])
            if by_progress:
                progress = self._tensor(place)
            else:
                check_longest(engine)
                clocks = torch.as_tensor(np.rint(place / engine.control_period).astype(np.int64), device=self.device)
            none = torch.zeros_like(rows[0])
            nowhere = State((none, none), (none, none), (none, none, none), ())
            reference = still.reference_at(paths, progress if by_progress else clocks, nowhere)
            offset, turn = self._displacement(episode_seed(state.keys, state.episodes))
            rows[:4] = pack_state(start(reference, offset, turn, ()))[:4]
        if given.pose is not None:
            x, y, heading = self._tensor(given.pose).unbind(1)
            rows[:4] = x, y, torch.cos(heading), torch.sin(heading)
        if given.twist is not None:
            rows[4:7] = self._tensor(given.twist).unbind(1)
        if given.steering is not None:
            angles = self._tensor(given.steering)
            rows[BODY_ROWS:] = torch.stack((torch.cos(angles), torch.sin(angles)), 2).flatten(1).unbind(1)
        if given.twist is not None:
            directions = torch.stack(rows[BODY_ROWS:]).detach().cpu().double().numpy()
            check_motion(self.robot, np.arctan2(directions[1::2], directions[::2]).T[chosen], given.twist[chosen])
        if by_progress and given.pose is not None and given.place is None:
            before = self._tensor(nearest_row(engine, plain, given.pose[:, :2]))
            progress = self._source.fetch(unpack_state(tuple(rows)), clocks, paths, before).progress
        return self._rolling(torch.stack(rows)), clocks, progress, still

    def _tensor(self, numbers: NDArray[np.float64]) -> Tensor:
        return torch.as_tensor(numbers, dtype=self.dtype, device=self.device)

    def _direction(self, angle: Tensor) -> Direction:
        return torch.cos(angle).to(self.dtype), torch.sin(angle).to(self.dtype)
