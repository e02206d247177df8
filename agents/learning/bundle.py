"""Policies on disk: a folder with weights as safetensors and everything else as YAML. Loading one runs no code.

policy.yaml            what the policy is, for which robot and task, and how it came about
weights.safetensors    the actor's weights
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import torch
import yaml
from numpy.typing import NDArray
from pydantic import Field, PositiveInt, SerializeAsAny
from safetensors.torch import save

from caster_gym.agents.comparison.task_settings import ChosenTask, in_brief
from caster_gym.agents.learning.actor import Actor, LearnedAgent, Squash
from caster_gym.agents.learning.settings import MOST_LAYERS
from caster_gym.agents.learning.weights import actor_shapes, read_weights
from caster_gym.bounded_files import expanded
from caster_gym.brief import brief
from caster_gym.configuration import ConfigurationError, parse, read_yaml
from caster_gym.durable_files import replace_folder, scratch_folder, write_file
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import Robot
from caster_gym.tasks.building import observation_layout
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.registry import all_tasks, find_task, refuse_imports
from caster_gym.wrappers.feature import Feature
from caster_gym.wrappers.specification import FeatureSpecification

FORMAT = 1
SHOWN = 3  # of the policies that a message may name
DESCRIPTION, WEIGHTS = "policy.yaml", "weights.safetensors"


class PolicyDescription(ChosenTask):
    """All that is needed to act again, and to know where the policy came from."""

    format: Literal[1]
    name: str
    squash: Squash
    hidden: Annotated[tuple[PositiveInt, ...], Field(max_length=MOST_LAYERS)]
    robot: Robot
    task: SerializeAsAny[TaskParameters]
    wrappers: tuple[FeatureSpecification, ...] = ()  # features of the environment that it acts in
    actions: PositiveInt | None = None  # None: one for each driven joint
    trained_with: dict[str, Any]  # settings, seed, steps
    versions: dict[str, str]

    @property
    def layout(self) -> ObservationLayout:
        """What the policy's observations mean."""
        return observation_layout(find_task(self.environment), self.robot, self.task)

    def observed(self, actions: int) -> int:
        """Numbers in an observation, where there are so many actions."""
        size = self.layout.size
        return size + sum(feature.added(size, actions) for feature in self.wrappers)


class Bundle:
    """A learned policy together with its description; it acts as every `Agent` does, and as models of SB3 do."""

    def __init__(self, description: PolicyDescription, actor: Actor) -> None:
        self.description = description
        self.agent = LearnedAgent(actor, description.name)

    @property
    def name(self) -> str:
        """Name of the algorithm, or what the description says."""
        return self.agent.name

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) in −1 … 1 for observations (robots, size)."""
        return self.agent.act(observations)

    def predict(
        self,
        observation: NDArray[np.float32],
        state: tuple[NDArray[Any], ...] | None = None,
        episode_start: NDArray[np.bool_] | None = None,
        deterministic: bool = True,
    ) -> tuple[NDArray[np.float32], tuple[NDArray[Any], ...] | None]:
        """Actions for one observation (size,) or several (robots, size), and the state as it was given.

        The signature is that of Stable-Baselines3. A bundle has no memory and no noise: the state is not used, and
        deterministic=False is refused.
        """
        if not deterministic:
            raise ValueError("a saved policy acts without noise: deterministic must be True, got False")
        several = observation[None] if observation.ndim == 1 else observation
        actions = self.act(several)
        return (actions[0] if observation.ndim == 1 else actions), state

    def check_fits(self, layout: ObservationLayout, period: float, features: Sequence[Feature] = ()) -> None:
        """Raises ValueError if the policy cannot act on observations of that layout, every period [s].

        features: those of the environment; a policy needs those that say what its actions mean.
        """
        ours = self.description.layout
        if ours.robot.joints != layout.robot.joints or ours.robot.driven != layout.robot.driven:
            raise ValueError(
                f"the policy drives {', '.join(ours.robot.driven)} of {ours.robot.name!r}, "
                f"the task {', '.join(layout.robot.driven)} of {layout.robot.name!r}"
            )
        if self.description.task.control_period != period:
            raise ValueError(
                f"the policy acts every {self.description.task.control_period:g} s, the task every {period:g} s"
            )
        if ours.unit != layout.unit:
            learned, asked = (_purpose(unit) for unit in (ours.unit, layout.unit))
            raise ValueError(f"the policy has learned to {learned}, the task is to {asked}")
        if ours.preview != layout.preview:
            raise ValueError(
                f"the policy needs a preview of {ours.preview} {ours.unit}, the task shows {layout.preview} {ours.unit}"
            )
        if ours.nearest != layout.nearest:
            raise ValueError(f"the policy sees {ours.nearest} obstacles, the task shows {layout.nearest}")
        meant, understood = (
            [feature for feature in some if feature.redefines_actions] for some in (self.description.wrappers, features)
        )
        if meant != understood:
            raise ValueError(f"the policy's actions are {_named(meant)}, the task takes {_named(understood)}")
        learned_from, shown = (
            [feature for feature in some if feature.added(1, 1)] for some in (self.description.wrappers, features)
        )
        if learned_from != shown:
            raise ValueError(
                f"the policy has learned from {_seen(learned_from)}, the task shows {_seen(shown)}: set its wrappers so"
            )


def _purpose(unit: str) -> str:
    """What the first task is for whose previews have that unit."""
    task = next(one for one in all_tasks() if one.preview_unit == unit)
    return f"{task.purpose} (environment {task.name!r})"


def _seen(features: Sequence[Feature]) -> str:
    return ", ".join(map(in_brief, features)) or "the present observation alone"


def _named(features: Sequence[Feature]) -> str:
    return ", ".join(map(in_brief, features)) or "torques"


def save_bundle(folder: Path, bundle: Bundle) -> None:
    """Write a bundle to a folder that comes into being whole or not at all; one that is there is replaced at once."""
    folder.parent.mkdir(parents=True, exist_ok=True)
    with scratch_folder(folder.parent) as fresh:
        weights = {name: tensor.contiguous() for name, tensor in bundle.agent.actor.state_dict().items()}
        write_file(fresh / WEIGHTS, save(weights))
        content = bundle.description.model_dump(mode="json")
        write_file(fresh / DESCRIPTION, yaml.safe_dump(content, sort_keys=False, allow_unicode=True))
        replace_folder(fresh, folder)


def load_policy(folder: str | Path) -> Bundle:
    """A policy from the folder that training wrote: what it was trained for, and how to act.

    Reading runs no code, so that folders from strangers are safe to load: the weights are safetensors, the description
    is YAML that is checked. `description` holds robot, task, settings and versions. `act` takes observations
    (robots, size) and returns actions (robots, driven joints) in −1 … 1, float32; `predict` has the signature of
    Stable-Baselines3. Raises ConfigurationError that says what is missing or does not fit.

    >>> import caster_gym, gymnasium
    >>> policy = caster_gym.load_policy("runs/ppo/best")  # which `caster-gym train ppo --out runs/ppo` writes
    >>> task = policy.description.task.model_dump()
    >>> batch = gymnasium.make_vec("caster_gym:CasterTrack-v0", num_envs=16, **task)
    >>> observations, infos = batch.reset(seed=0)
    >>> policy.act(observations).shape, policy.predict(observations[0])[0].shape
    ((16, 6), (6,))
    """
    folder = _folder_named(folder)
    if not (folder / DESCRIPTION).is_file():
        raise ConfigurationError(_no_policy(folder))
    content = read_yaml(folder / DESCRIPTION)
    if content.get("format") != FORMAT:
        raise ConfigurationError(
            f"{folder / DESCRIPTION} has format {brief(content.get('format'))}; this version of caster_gym reads "
            f"{FORMAT}"
        )
    refuse_imports(content.get("environment"), str(folder / DESCRIPTION))
    description = parse(PolicyDescription, content, str(folder / DESCRIPTION))
    actions = description.actions or len(description.robot.driven)
    sizes = description.observed(actions), description.hidden, actions
    weights = read_weights(folder / WEIGHTS, actor_shapes(*sizes))
    with torch.device("meta"):  # nothing is allocated, and nothing drawn at random
        actor = Actor(*sizes, description.squash)
    actor.load_state_dict(weights, assign=True)
    return Bundle(description, actor)


def _folder_named(name: str | Path) -> Path:
    try:
        expanded(Path(name) / DESCRIPTION)  # it may be too long to be a name
        return expanded(name)
    except ValueError as error:
        raise ConfigurationError(str(error)) from None


def _no_policy(folder: Path) -> str:
    """What to say of a folder that is no policy: where the policies are that it was perhaps meant for."""
    if folder.is_file():
        ours = folder.name in (DESCRIPTION, WEIGHTS)
        return f"{folder} is a file{f' of a policy; give its folder, {folder.parent}' if ours else ', not a policy'}"
    if not folder.is_dir():
        near = sorted(one.parent for one in folder.parent.glob(f"*/{DESCRIPTION}"))
        there = f"; there is {' and '.join(map(str, near[:SHOWN]))}" if near else ""
        return f"there is no folder {str(folder)!r} of a policy{there}"
    if (folder / "best" / DESCRIPTION).is_file():
        return f"{folder} is the folder of a training run; give the policy in it that did best, {folder / 'best'}"
    kept = sorted(one.parent for one in folder.glob(f"**/best/{DESCRIPTION}"))
    inside = kept or sorted(one.parent for one in folder.glob(f"*/{DESCRIPTION}"))
    if inside:
        some = " or ".join(map(str, inside[:SHOWN])) + (
            f" or one of {len(inside) - SHOWN} more" * (len(inside) > SHOWN)
        )
        return f"{folder} is no policy itself, but has policies in it: give {some}"
    return f"there is no policy in {folder}: it has no {DESCRIPTION}, as folders have that `caster-gym train` writes"
