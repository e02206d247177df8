"""A vector environment whose observations, actions and rewards stay on the device."""

import copy
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Self

import numpy as np
import torch
from gymnasium.utils import seeding
from gymnasium.vector import AutoresetMode
from numpy.typing import NDArray
from torch import Tensor

from caster_gym.engines.model_inputs import listed_robots
from caster_gym.engines.tensor.compiler import replayed
from caster_gym.engines.tensor.scalars import check_memory, parameter_rows, parameters_of
from caster_gym.envs.inputs import Actuation, ArenaLike, RobotLike, Seeds, check_counts, checked_seeds
from caster_gym.envs.native.engine import DRAW_A_PATH
from caster_gym.envs.spaces import action_space, observation_space
from caster_gym.envs.specification import describe_environment
from caster_gym.envs.starts import read_options, read_start
from caster_gym.envs.tensor.saved import check_arrays, parameter_array, parameters_from, state_arrays, tensors_of
from caster_gym.envs.tensor.state import TaskOutcome, TaskState
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters
from caster_gym.paths.specification import PathLike
from caster_gym.robot import Robot
from caster_gym.states import (
    AnyState,
    State,
    check_description,
    check_state,
    generator_words,
    join_states,
    part_of,
    set_generator,
    without,
)

if TYPE_CHECKING:
    from caster_gym.tasks.task import Task


class TorchVectorEnv:
    """Many robots at one of the tasks, on tensors: the batch of `gym.make_vec`, without leaving the device.

    The same seeds give the same episodes as `gym.make_vec` with AutoresetMode.SAME_STEP does. Arguments are those of
    its batch there, such as `CasterTrackVectorEnv` ("track"). `reset` and `step` return new tensors on the device at
    every call: observations (num_envs, size) and rewards (num_envs,) in `dtype`, `terminated` and
    `truncated` (num_envs,) as booleans, and infos with the same keys. Robots whose episode ends start a new one in the
    same step: what they saw last is in info["final_obs"] and info["final_info"], true where info["_final_obs"] is. (On
    a CPU these are the observations and infos themselves in steps where nobody's ends.)

    No gradients pass: `TorchTask`, in `task`, is the same as a differentiable function. Nothing waits for the device
    where there are no obstacles, hence actions are not checked: one that is not a number ends its robot's episode as
    not finite.

    compile fuses the step into few kernels; its first call then takes half a minute to a minute, or 10 s where Torch's
    cache on disk has it. On a CUDA device they are replayed as graphs, unless there are obstacles. On the CPU more than
    one of Torch's threads is faster only where nothing else keeps the cores busy. diagnostics: see `TorchTask`.

    >>> import caster_gym, torch
    >>> batch = caster_gym.TorchVectorEnv("track", num_envs=16, path="lemniscate", device="cpu")
    >>> observations, infos = batch.reset(seed=0)
    >>> observations, rewards, terminated, truncated, infos = batch.step(torch.zeros(16, 6))
    >>> observations.shape == (16, batch.task.layout.size), rewards.shape
    (True, torch.Size([16]))
    """

    autoreset_mode = AutoresetMode.SAME_STEP

    def __init__(
        self,
        task: "str | Task" = "track",
        num_envs: int = 1,
        robot: RobotLike = "chung2008",
        path: PathLike | None = None,
        actuation: Actuation = None,
        arena: ArenaLike = None,
        max_episode_steps: int | None = None,
        *,
        device: torch.device | str = "cpu",
        dtype: torch.dtype = torch.float32,
        compile: bool = False,
        diagnostics: bool = True,
        **fields: Any,
    ) -> None:
        check_counts(num_envs, max_episode_steps)
        graphs = compile and torch.device(device).type == "cuda"
        self.task = TorchTask(
            task,
            robot,
            path,
            actuation,
            arena,
            max_episode_steps,
            device=device,
            dtype=dtype,
            compile=compile,
            graphs=graphs,
            diagnostics=diagnostics,
            **fields,
        )
        self.num_envs, self.device, self.dtype, self.robot = num_envs, self.task.device, dtype, self.task.robot
        check_memory(num_envs, 4 * self.task.layout.size, dtype, self.device)
        self.single_observation_space = observation_space(self.task.engine)
        self.single_action_space = action_space(self.task.engine)
        self._now: tuple[TaskState, TaskOutcome] | None = None
        self._replay()

    def _replay(self) -> None:
        self._advance = replayed(self._advanced) if self.task.graphs else self._advanced

    def __getstate__(self) -> dict[str, Any]:
        return {name: value for name, value in vars(self).items() if name != "_advance"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        self._replay()

    def __copy__(self) -> Self:
        """As independent as a deep copy: the parameters of both would be those of one task."""
        return copy.deepcopy(self)

    def reset(
        self, seed: Seeds = None, path: Tensor | int = DRAW_A_PATH, options: Mapping[str, Any] | None = None
    ) -> tuple[Tensor, dict[str, Any]]:
        """Start episodes of all robots; robot i is seeded with seed + i, as in Gymnasium's batches.

        Without a seed the robots go on with their sequences of episodes. path: index in the pool, for all or each.
        options: those of the single environment, with one entry for all robots or one for each, robots in front.
        """
        given = read_options(options, self.task.engine)
        start = read_start(given, self.task.engine, np.ones(self.num_envs, dtype=np.bool_))
        path = given.get("path", path)
        with torch.no_grad():
            if seed is not None or self._now is None:
                self._now = self.task.begin(self._fresh_keys(seed), path, start)
            else:
                everybody = torch.ones(self.num_envs, dtype=torch.bool, device=self.device)
                self._now = self.task.restart(*self._now, everybody, path, start)
        outcome = self._now[1]
        return outcome.observations, self.task.info(outcome.report)

    def step(self, actions: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor, dict[str, Any]]:
        """Hold actions (num_envs, driven joints) in −1 … 1 for a control period."""
        if self._now is None:
            raise RuntimeError("reset the batch before its first step")
        with torch.no_grad():
            state, final, outcome = self._advance(self._now[0], actions)
        self._now = state, outcome
        infos = self.task.info(outcome.report)
        infos |= {
            "final_obs": final.observations,
            "final_info": self.task.info(final.report),
            "_final_obs": final.ended,
        }
        return outcome.observations, outcome.rewards, outcome.terminated, outcome.truncated, infos

    def get_state(self) -> State:
        """Copies of all that the batch goes on from, on the CPU, as a flat dictionary of arrays; see `set_state`."""
        own: State = {
            "made_of": self._made_of,
            "parameters": parameter_array(self.task.parameters),
            "action_space": generator_words(self.single_action_space.np_random),
        }
        return own if self._now is None else own | join_states(robots=state_arrays(*self._now))

    def set_state(self, state: AnyState) -> None:
        """Go on, to the last bit, as the batch did whose `get_state` gave the state: also in another process.

        That holds on a device of the same kind, compiled if the other one was. The arrays are copied. Raises
        ValueError, with nothing changed, for a state of a batch that was made in another way.
        """
        check_description(state, self._made_of)
        own, robots = without(state, "made_of", "robots"), part_of(state, "robots")
        fields = len(pack_parameters(robot_parameters(self.robot)))
        expected = {"parameters": np.zeros((self.num_envs, fields)), "action_space": np.zeros(6, dtype=np.uint64)}
        check_state("the batch", own, expected, ("parameters",))
        if robots:
            check_arrays(self.task.engine, self.dtype, robots, self.num_envs)
        self._now = tensors_of(robots, self.device) if robots else None
        rows = own["parameters"]
        self.task.parameters = (
            parameters_from(rows, self.dtype, self.device) if rows.size else robot_parameters(self.robot)
        )
        set_generator(self.single_action_space.np_random, own["action_space"])

    @property
    def _made_of(self) -> NDArray[np.uint8]:
        """What tells the batch from others."""
        kind = {"number of robots": self.num_envs, "dtype": str(self.dtype), "diagnostics": self.task.diagnostics}
        return describe_environment(self.task.task, self.task.engine, **kind)

    @property
    def states(self) -> Tensor:
        """A copy of all states (num_envs, 7 + 2 N), laid out as in `caster_gym.engines.tensor.fleet.TorchFleet`.

        Where wheels may slip, the rates of all casters and the tilt follow (num_envs, 9 + 4 N), as in `pack_state`.
        """
        if self._now is None:
            raise RuntimeError("reset the batch before its states are read")
        return self._now[0].bodies.T.clone()

    @states.setter
    def states(self, value: Tensor) -> None:
        if self._now is None or tuple(value.shape) != tuple(self.states.shape):
            raise ValueError(f"states must have shape {tuple(self.states.shape)}, got {tuple(value.shape)}")
        state, outcome = self._now
        bodies = value.to(self.device, self.dtype, copy=True).T.contiguous()
        self._now = state._replace(bodies=bodies, room=torch.zeros_like(state.room)), outcome

    def set_robots(self, robots: Sequence[Robot]) -> None:
        """Give every robot numbers of its own, for instance randomised ones, at once; paths stay as they are.

        Raises ValueError for robots with another number of casters than the task's.
        """
        listed_robots([self.robot, *robots], None)
        self.set_parameters(parameter_rows(listed_robots(robots, self.num_envs), self.dtype, self.device))

    def set_parameters(self, rows: Tensor) -> None:
        """Every robot's numbers (num_envs, fields), in the order of `pack_parameters`.

        Raises ValueError for robots that the task's time step cannot follow.
        """
        shape = (self.num_envs, len(pack_parameters(robot_parameters(self.robot))))
        if tuple(rows.shape) != shape:
            raise ValueError(f"rows must have shape {shape}, got {tuple(rows.shape)}")
        self.task.engine.check_parameters(rows.detach().double().cpu().numpy())
        self.task.parameters = parameters_of(rows.to(self.device, self.dtype, copy=True))

    def _advanced(self, state: TaskState, actions: Tensor) -> tuple[TaskState, TaskOutcome, TaskOutcome]:
        state, final = self.task.step(state, actions)
        if self.device.type == "cpu" and not bool(final.ended.any()):  # another device would be waited for
            return state, final, final
        state, outcome = self.task.restart(state, final)
        return state, final, outcome

    def _fresh_keys(self, seed: Seeds) -> Tensor:
        """A key for each robot, as Gymnasium's seeding gives it."""
        if seed is None:
            return torch.randint(2**63 - 1, (self.num_envs,), dtype=torch.int64)
        seeds = checked_seeds(seed, self.num_envs)
        return torch.tensor([int(seeding.np_random(one)[0].integers(2**63)) for one in seeds], dtype=torch.int64)
