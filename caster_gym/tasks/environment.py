"""The environments of a task, from its object: a subclass names the task and documents it."""

from typing import Any, ClassVar

from gymnasium.vector import AutoresetMode

from caster_gym.envs.caster_env import CasterEnv
from caster_gym.envs.caster_vector_env import CasterVectorEnv
from caster_gym.envs.inputs import Actuation, ArenaLike, RobotLike, check_counts
from caster_gym.paths.specification import PathLike
from caster_gym.tasks.building import build_engine
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.task import Task


class TaskEnv(CasterEnv):
    """One robot at a task. Arguments are those of `CasterTrackEnv`, and the fields of the task's parameters."""

    definition: ClassVar[Task]
    task: TaskParameters

    def __init__(
        self,
        robot: RobotLike = "chung2008",
        path: PathLike | None = None,
        actuation: Actuation = None,
        arena: ArenaLike = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        super().__init__(*build_engine(self.definition, robot, path, actuation, arena, task, 1), render_mode)


class TaskVectorEnv(CasterVectorEnv):
    """Many robots at a task, equal bit for bit to a SyncVectorEnv of single ones, infos included.

    max_episode_steps truncates episodes earlier. All other arguments are those of the single environment; seeds,
    autoreset modes and options are those of `CasterVectorEnv`.
    """

    definition: ClassVar[Task]
    task: TaskParameters

    def __init__(
        self,
        num_envs: int = 1,
        robot: RobotLike = "chung2008",
        path: PathLike | None = None,
        actuation: Actuation = None,
        arena: ArenaLike = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        render_mode: str | None = None,
        **task: Any,
    ) -> None:
        check_counts(num_envs, max_episode_steps)
        made = build_engine(self.definition, robot, path, actuation, arena, task, num_envs, max_episode_steps)
        super().__init__(*made, autoreset_mode, render_mode)
