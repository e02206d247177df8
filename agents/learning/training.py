"""Training a policy, by Stable-Baselines3 or on tensors; the best one is chosen on validation paths.

With the same settings, seed, number of threads and versions on the same machine, a training run repeats bit for bit.
"""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from caster_gym.agents.learning.agent_settings import LearnedSettings, RslPPOSettings, SHACSettings
from caster_gym.agents.learning.sb3_learning import learn_with_sb3
from caster_gym.agents.learning.training_run import Report, Run, Validation
from caster_gym.agents.settings import TaskSettings
from caster_gym.engines.tensor.threads import DEFAULT, limited_to
from caster_gym.report.provenance import write_provenance


def train(
    task: TaskSettings, settings: LearnedSettings, seed: int, folder: Path, report: Report, threads: int = DEFAULT
) -> Validation:
    """Train into a folder: bundles best/ and checkpoints/, validation.csv, progress.csv, TensorBoard events, run.yaml.

    Interrupted by Ctrl-C, it validates and keeps what it has learned so far, then raises KeyboardInterrupt.
    """
    learn = _learning(settings)
    run = Run(folder, task, settings, seed, report)
    completed = False
    try:
        with limited_to(threads):
            learn(run, settings)
        completed = True
    finally:
        if run.history:
            write_provenance(
                folder,
                task=task.model_dump(mode="json"),
                agent=settings.model_dump(mode="json"),
                seed=seed,
                threads=threads,
                completed=completed,
                seconds=run.history[-1].seconds,
                validations=[result.numbers for result in run.history],
            )
        run.logger.close()
    assert run.best is not None  # whoever learns finishes with a validation
    return run.best


def _learning(settings: LearnedSettings) -> Callable[[Run, Any], None]:
    """Who learns with such settings."""
    if isinstance(settings, SHACSettings):
        from caster_gym.agents.learning.shac import learn_through_simulator

        return learn_through_simulator
    if isinstance(settings, RslPPOSettings):
        from caster_gym.agents.learning.rsl_rl import learn_with_rsl_rl

        return learn_with_rsl_rl
    return learn_with_sb3
