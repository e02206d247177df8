"""A task and settings that commands of tests are tried with, and what a refusal looks like."""

RANDOM = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3}
TASK = {
    "train": [{**RANDOM, "seed": 0, "count": 3}],
    "validation": [{**RANDOM, "seed": 1, "count": 2}],
    "test": [{**RANDOM, "seed": 2, "count": 2}],
}
SIZES = ("n_timesteps=512", "n_envs=8", "n_steps=32", "batch_size=64", "net_arch=[8]")
TINY = [word for size in SIZES for word in ("--set", size)]


def assert_refused(result, message):
    """One sentence that says what is wrong, with exit code 2."""
    assert result.exit_code == 2, result.output
    assert result.stdout == ""
    lines = result.stderr.strip().splitlines()
    assert len(lines) == 1
    assert lines[0].startswith("caster-gym: ")
    assert message in lines[0]
    assert "Traceback" not in result.output
