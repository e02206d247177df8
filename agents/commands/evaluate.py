"""The command `evaluate`: one agent on the test paths of a task."""

from pathlib import Path

from caster_gym.agents.commands.benchmark import BenchmarkSettings
from caster_gym.agents.commands.command_line import files_among
from caster_gym.agents.commands.selection import choose_agent, choose_task
from caster_gym.agents.comparison.evaluation import evaluation_batch
from caster_gym.agents.comparison.results import FILES, Contender, compare, write_results
from caster_gym.agents.comparison.tuning import TUNING, told, write_tuning
from caster_gym.engines.tensor.threads import limit_threads
from caster_gym.report.provenance import write_provenance
from caster_gym.report.run_folder import staged


def evaluate(policy: str, task: str | None, starts: int, out: Path, overwrite: bool, threads: int) -> str:
    """Write table, episodes and figures of an agent into the folder `out`; returns the table."""
    settings, words = choose_task(policy, task)
    how = BenchmarkSettings(agents=(policy,), starts=starts)
    kept = (Path(policy), *files_among(task, settings.robot))
    with limit_threads(threads), staged(out, overwrite, (*FILES, TUNING, "run.yaml"), kept) as folder:
        test = evaluation_batch(settings, settings.test, starts)
        agent, tuned = choose_agent(policy, settings, test)
        compared = compare([Contender(agent.name, agent, None)], test, how.start_seed)
        if tuned is not None and tuned.tried:
            write_tuning(folder / TUNING, {agent.name: tuned})
            words = f"{words}\n\n{told({agent.name: tuned})}"
        text = write_results(folder, compared, test, how.confidence, {}, words)
        best = None if tuned is None else tuned.settings
        model_based = {} if best is None else {"agent": best.model_dump(mode="json"), "source": best.source}
        write_provenance(
            folder, policy=policy, **model_based, task=settings.model_dump(mode="json"), starts=starts, threads=threads
        )
    return text
