"""The page of a run of `python -m scripts.fuzz_files`."""

from caster_gym.report.pages import join_parts
from caster_gym.report.tables import markdown_table
from scripts.fuzzing.trials import FAULTS, OBJECT, SENTENCE, Tally, by_format

_OUTCOMES = (OBJECT, SENTENCE, *FAULTS)


def page(total: Tally, seed: int, seconds: float, workers: int) -> str:
    """What became of all inputs, in Markdown."""
    counts = by_format(total.counts)
    rows = [(name, *(f"{found[outcome]:,}" for outcome in _OUTCOMES)) for name, found in counts.items()]
    sums = [sum(found[outcome] for found in counts.values()) for outcome in _OUTCOMES]
    inputs = sum(sums)
    (slow, slow_name, slow_number), (large, large_name, large_number) = total.slowest, total.largest
    parts = [
        "# Files from strangers, mutated",
        "Whatever a file holds that this package reads, the outcome is an object or one sentence that names the file, "
        "within a second of processor time and 200 MB of memory, and nothing of it is run. Two keys are meant to run "
        "code: `algorithm` of an agent and `environment` of a task may name a class of your own as `module:Name`, "
        "which is imported; policies and folders of runs may not.",
        f"`python -m scripts.fuzz_files --inputs {inputs} --seed {seed}` took valid files of every format, changed "
        "their bits, their text, their values, keys, lists and headers at random, and read them, on "
        f"{workers} processes in {seconds / 60.0:.0f} minutes. Paths were made into trajectories too, of random paths "
        "the first. An audit hook listened for code that runs, processes that start and files that are written.",
        markdown_table(("format", *_OUTCOMES), [*rows, ("**all**", *(f"**{count:,}**" for count in sums))]),
        f"The slowest was input {slow_number:,} ({slow_name}), with {slow:.2f} s; input {large_number:,} "
        f"({large_name}) needed most memory, {large:.0f} MB.",
        "`--first 123 --inputs 1` tries one input again, `--show` prints it; `--resume` goes on with a run that was "
        "interrupted. The tests read some thousand inputs of the same kind.",
        "## What is bounded",
        markdown_table(("what", "at most", "for"), _bounds()),
        "Numbers beyond 10^15 and positive ones below 10^-12 are refused, as nothing can be computed with them. Only "
        "regular files are opened: no pipes, devices, sockets or folders.",
    ]
    return join_parts(parts)


def _bounds() -> list[tuple[str, str, str]]:
    from caster_gym import bounded_files, plain_yaml, table_files
    from caster_gym.configuration import Frozen
    from caster_gym.paths.planner_files import MOST_POINTS
    from caster_gym.paths.trajectory import MOST_STEPS
    from caster_gym.robot import MOST_CASTERS

    mebi = 1 << 20
    return [
        ("YAML file", f"{bounded_files.YAML_BYTES // mebi} MiB", "task with long timed paths: 2 MiB"),
        ("values in it, aliases written out", f"{plain_yaml.MOST_VALUES:,}", "10 minutes of poses at 50 Hz"),
        ("lists and mappings in one another", f"{plain_yaml.DEEPEST}", "settings of a comparison: 8"),
        ("characters of a text, of a number", f"{plain_yaml.LONGEST_TEXT:,}, {plain_yaml.LONGEST_NUMBER}", ""),
        ("items of a list, but for points", f"{Frozen.longest_list:,}", "obstacles of a kind"),
        ("table", f"{bounded_files.TABLE_BYTES // mebi} MiB", "recording of ten minutes at 100 Hz"),
        ("lines of it", f"{table_files.MOST_LINES:,}", "the same"),
        ("points of a path in a file", f"{MOST_POINTS:,}", "10 minutes at 50 Hz"),
        ("planner's file", f"{bounded_files.PLANNED_BYTES // mebi} MiB", "20,000 samples"),
        ("weights of a policy", f"{bounded_files.WEIGHTS_BYTES // mebi} MiB", "33 million, in float32"),
        ("casters of a robot", f"{MOST_CASTERS}", ""),
        ("time steps of a path", f"{MOST_STEPS:,}", "two hours at 20 ms"),
    ]
