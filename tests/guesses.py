"""A learner that takes a millisecond and needs no robots, for tests of what is around learners; written to a module."""

from pathlib import Path

import yaml

MODULE = """
import os
import signal
from pathlib import Path

import torch
from pydantic import PositiveInt

from caster_gym.agents.learning.actor import Actor
from caster_gym.agents.learning.settings import LearnerSettings


class Guess(LearnerSettings):
    n_timesteps: PositiveInt = 300
    validations: PositiveInt = 3
    gain: float = 0.5
    width: PositiveInt = 4
    dies_at: str = ""  # a file: whoever finds it takes it away and is killed after the first validation

    def learn(self, run):
        torch.manual_seed(run.seed)
        steps = 0
        try:
            while steps < self.n_timesteps:
                actor = Actor(run.layout.size, (self.width,), run.actions, "tanh")
                for weights in actor.parameters():
                    weights.data *= self.gain
                if self.gain > 1.0:
                    weights.data *= float("nan")
                steps += 100
                run.advance(steps, lambda: actor)
                if self.dies_at and Path(self.dies_at).exists():
                    Path(self.dies_at).unlink()
                    os.kill(os.getpid(), signal.SIGKILL)
        finally:
            run.finish(steps, lambda: actor)
"""
PATHS = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3}
TASK = {
    "train": [{**PATHS, "seed": 0, "count": 1}],
    "validation": [{**PATHS, "seed": 1, "count": 2}],
    "test": [{**PATHS, "seed": 2, "count": 1}],
}


def write_guesses(folder: Path, **settings: object) -> Path:
    """Write the module, an agent file that names it, and a task; returns the agent file."""
    (folder / "guesses.py").write_text(MODULE, encoding="utf-8")
    (folder / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    agent = folder / "guess.yaml"
    agent.write_text(yaml.safe_dump({"algorithm": "guesses:Guess", **settings}), encoding="utf-8")
    return agent
