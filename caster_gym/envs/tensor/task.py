"""A task's control period as a function of tensors: state and actions in, state and outcome out, differentiable.

`TorchTask.step` calls what moves the robots (`drive`), and then what fetches, evaluates, observes and reports (`look`).
Nothing waits for the device where there are no obstacles, and nothing is written in place.
"""

from functools import partial
from typing import TYPE_CHECKING, Any

import numpy as np
import torch
from numpy.typing import NDArray
from torch import Tensor

from caster_gym.engines.tensor.compiler import compiled
from caster_gym.engines.tensor.motion import torch_floor
from caster_gym.engines.tensor.scalars import check_memory, checked_device, checked_dtype
from caster_gym.envs.inputs import Actuation, ArenaLike, RobotLike, check_counts
from caster_gym.envs.native.engine import DRAW_A_PATH
from caster_gym.envs.specification import describe_environment
from caster_gym.envs.starts import DRAWN, Start, check_free
from caster_gym.envs.tensor.drive import TorchDrive
from caster_gym.envs.tensor.look import TorchLook
from caster_gym.envs.tensor.obstacles import torch_surroundings
from caster_gym.envs.tensor.reference import torch_source
from caster_gym.envs.tensor.saved import check_arrays, state_arrays, tensors_of
from caster_gym.envs.tensor.starts import BEFORE_START, TorchStarts
from caster_gym.envs.tensor.state import Given, TaskOutcome, TaskState, empty_record
from caster_gym.mechanics.integration import state_rows
from caster_gym.mechanics.parameters import RobotParameters, robot_parameters
from caster_gym.paths.specification import PathLike
from caster_gym.states import AnyState, State, check_description, without

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task

DIAGNOSTICS = ("traction_use", "wheels_lifted", "conditioning")


class TorchTask:
    """One of the tasks, for robots of one kind, as functions of tensors.

        state, outcome = task.begin(keys)
        state, outcome = task.step(state, actions)  # actions (robots, driven joints) in −1 … 1
        state, outcome = task.restart(state, outcome)  # new episodes where they have ended
        state = state.detached()  # between windows of a rollout

    Gradients pass from rewards, observations and reports to actions, states, wrenches and parameters of the robots,
    wherever motor limits and kernels have a slope, and end where an episode starts anew. An action that is not a number
    ends its robot's episode as not finite, since to look for it would wait for the device.

    task: its name, as "track" or "my_module:MY_TASK", or its object. All other arguments are those of `TorchVectorEnv`.
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
    >>> outcome.observations.shape == (16, task.layout.size), actions.grad.shape
    (True, torch.Size([16, 6]))
    """

    def __init__(
        self,
        task: "str | Task" = "track",
        robot: RobotLike = "chung2008",
        path: PathLike | None = None,
        actuation: Actuation = None,
        arena: ArenaLike = None,
        max_episode_steps: int | None = None,
        *,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
        compile: bool = False,
        graphs: bool = False,
        diagnostics: bool = True,
        **fields: Any,
    ) -> None:
        from caster_gym.tasks.building import build_engine  # tasks stand above, and are looked up when one is asked for
        from caster_gym.tasks.registry import find_task

        check_counts(1, max_episode_steps)
        self.definition = definition = find_task(task)
        self.dtype, self.device = checked_dtype(dtype), checked_device(device)
        self.engine, self.task = build_engine(definition, robot, path, actuation, arena, fields, 1, max_episode_steps)
        self.robot, self.layout, self.diagnostics = self.engine.robot, self.engine.layout, diagnostics
        self.parameters: RobotParameters = robot_parameters(self.robot)
        plan, casters, where = self.engine.plan, self.robot.caster_count, (self.dtype, self.device)
        floor = None if self.task.slippery is None else torch_floor(self.task.slippery)
        around = torch_surroundings(plan, *where)
        source = torch_source(plan.source, definition.name, *where)
        self._drive = TorchDrive(casters, self.task.substeps, self.task.time_step, floor, around, diagnostics)
        self._looking = TorchLook(definition, plan, source, self.layout, floor, around, diagnostics, *where)
        self._starts = TorchStarts(definition.name, self.engine, source, floor, *where)
        driven = self.robot.driven
        self._slots = tuple(driven.index(joint) if joint in driven else -1 for joint in self.robot.joints)
        self._compiled = compile
        self.graphs = compile and graphs and around is None  # obstacles wait for the device
        self._compile()

    def _compile(self) -> None:
        self._move, self._look, self._place = self._drive.move, self._looking.look, self._starts.place
        if self._compiled:
            self._move = compiled(self._move, self.device, self.graphs)
            self._look = compiled(self._look, self.device, self.graphs)
            self._place = compiled(self._place, self.device, self.graphs)

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
        body_rows = state_rows(self.robot.caster_count, self.engine.slipping > 0)
        none = torch.zeros((body_rows, count), dtype=self.dtype, device=self.device)
        own = torch.as_tensor(keys, device=self.device).clone()
        state = TaskState(none, none[0], none[0], clocks=whole, paths=whole, keys=own, episodes=whole)
        wanted = torch.as_tensor(path, device=self.device).expand(count)
        return self._start(state, wanted, start, torch.ones_like(whole, dtype=torch.bool))

    def step(self, state: TaskState, actions: Tensor, wrench: Tensor | None = None) -> tuple[TaskState, TaskOutcome]:
        """Hold actions (robots, driven joints) for a control period; nobody is restarted.

        wrench (robots, 3): external, at C, in B [N, N, N m].
        """
        given = self._given(actions, wrench, len(state.clocks))
        if given.commands.requires_grad:
            state = self._differentiable(state)
        bodies, record = self._drive.drive(self._move, state, given)
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

    def to_arrays(self, state: TaskState, outcome: TaskOutcome) -> State:
        """Copies of a state and an outcome on the CPU, as a flat dictionary of arrays; see `from_arrays`."""
        return {"made_of": self._made_of} | state_arrays(state, outcome)

    def from_arrays(self, arrays: AnyState) -> tuple[TaskState, TaskOutcome]:
        """The state and outcome that `to_arrays` gave, also in another process: robots go on from them, bit for bit.

        They have no past, through which gradients pass, and `parameters` is not part of them. Raises ValueError for
        arrays of another task.
        """
        check_description(arrays, self._made_of)
        own = without(arrays, "made_of")
        check_arrays(self.engine, self.dtype, own, len(own.get("clocks", ())))
        return tensors_of(own, self.device)

    @property
    def _made_of(self) -> NDArray[np.uint8]:
        return describe_environment(self.task, self.engine, dtype=str(self.dtype), diagnostics=self.diagnostics)

    def info(self, report: Tensor) -> dict[str, Any]:
        """Named quantities of all robots, as `CasterTrackEnv` describes them: tensors with robots in front."""
        infos: dict[str, Any] = self.engine.info(report)  # type: ignore[arg-type]  # slices tensors as it does arrays
        return infos if self.diagnostics else {name: infos[name] for name in infos if name not in DIAGNOSTICS}

    def _given(self, actions: Tensor, wrench: Tensor | None, count: int) -> Given:
        """Checked actions and wrench as what drives the robots."""
        commands = self._commands(actions, count)
        if wrench is not None and wrench.shape != (count, 3):
            raise ValueError(f"wrench must have shape {(count, 3)}, got {tuple(wrench.shape)}")
        doubt = (commands - commands).sum(0)  # not a number where a command is none
        push = doubt.expand(3, -1) if wrench is None else doubt + wrench.to(self.dtype).T
        return Given(commands, push, self.parameters)

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

    def _start(self, state: TaskState, wanted: Tensor, given: Start, checked: Tensor) -> tuple[TaskState, TaskOutcome]:
        """Everybody at the start of the next episode, on the wanted path or, where it is negative, a drawn one.

        checked: the robots (robots,) whose given start is looked at.
        """
        bodies, paths = self._place(state.keys, state.episodes, wanted)
        clocks, before = torch.zeros_like(state.clocks), torch.full_like(state.progress, BEFORE_START)
        look = self._look
        if not given.drawn:
            bodies, clocks, before, still = self._starts.move_to(given, bodies, state, paths, checked, self.parameters)
            look = partial(self._looking.look, source=still)
        fresh = TaskState(bodies, before, state.room, clocks, paths, state.keys, state.episodes + 1)
        fresh = self._differentiable(fresh)
        nothing = empty_record(fresh.bodies, self.robot.caster_count, self.engine.slipping)
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
