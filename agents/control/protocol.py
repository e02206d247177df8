"""The protocol of agents, model-based or learned, and the settings of model-based controllers."""

import hashlib
import sys
from abc import abstractmethod
from collections.abc import Generator, Sequence
from pathlib import Path
from typing import Protocol, Self

import numpy as np
from numpy.typing import NDArray

from caster_gym.configuration import Extensible
from caster_gym.envs.observation import ObservationLayout
from caster_gym.wrappers.feature import Feature


class Agent(Protocol):
    """Acts on what the environment shows, and on nothing else: same sensors, same preview, same limits for all.

    An agent that remembers what it saw and did also has a method `reset(mask)`. mask (robots,) says which robots begin
    a new episode with the next observation; all do before the first action. Robots are told apart by their place in the
    arrays, and what an agent does for one must not depend on the others. Agents without memory need no `reset`.
    """

    @property
    def name(self) -> str:
        """Short name for tables and figures."""
        ...

    def act(self, observations: NDArray[np.float32]) -> NDArray[np.float32]:
        """Actions (robots, driven joints) in −1 … 1 for observations (robots, size).

        Numbers beyond ±1 are clipped, and count as saturated.
        """
        ...


class AgentSettings(Extensible):
    """Settings of an agent, as its YAML file gives them."""

    algorithm: str  # a name in caster_gym.agents.registry, or module:Name of a class like this one

    @property
    def is_own(self) -> bool:
        """Whether it is a class of a user's own, named as module:Name."""
        return ":" in self.algorithm

    @property
    def source(self) -> dict[str, str]:
        """The module that defines the agent and its version; without a version, the SHA-256 of its file."""
        module = sys.modules[type(self).__module__]
        version = getattr(sys.modules[module.__name__.partition(".")[0]], "__version__", None)
        if version is None and module.__file__ is not None:
            version = f"sha256:{hashlib.sha256(Path(module.__file__).read_bytes()).hexdigest()}"
        return {"module": module.__name__, "version": str(version)}


class ControllerSettings(AgentSettings):
    """Settings of a model-based controller, which does not learn."""

    @property
    def calmness(self) -> float:
        """Share of the least error, or of the greatest reward, that is given away for calmer torques."""
        return 0.0

    @abstractmethod
    def controller(self, layout: ObservationLayout, period: float) -> Agent:
        """The controller that acts on observations of this layout, once every period [s]."""

    def candidates(self) -> Sequence[Self]:
        """Settings to try on the validation paths, where the best are chosen; by default, only these."""
        return [self]

    def informed(self, layout: ObservationLayout, features: Sequence[Feature]) -> Self:
        """The settings with what they leave to the plant's features to say; by default, they leave nothing.

        Raises ValueError where they contradict the features.
        """
        return self

    def search(self) -> Generator[Sequence[Self], Self, None]:
        """Lists of settings to try, each after being sent the best ones so far; by default, the candidates alone."""
        yield self.candidates()
