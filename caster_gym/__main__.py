"""The command caster-gym, also as `python -m caster_gym`; it needs the training dependencies."""

import sys
from importlib import import_module
from importlib.util import find_spec

import caster_gym
from caster_gym.processes import exit_code, interruptible

NEEDED = ("typer", "tqdm")  # of the extra `train`, whatever the command


def main() -> None:
    """Run the command line, or say what it lacks."""
    if missing := [name for name in NEEDED if find_spec(name) is None]:
        if sys.argv[1:] == ["--version"]:
            print(f"caster_gym {caster_gym.__version__}")
            return
        sys.exit(_refuse(missing))
    try:
        with interruptible():
            app = import_module("caster_gym.agents.commands.cli").app
    except KeyboardInterrupt as error:  # afterwards each command says what is left
        print("caster-gym: interrupted; nothing was written", file=sys.stderr)
        sys.exit(exit_code(error))
    app(prog_name="caster-gym")


def _refuse(missing: list[str]) -> int:
    print(
        f"caster-gym: the command needs {' and '.join(missing)}, which simulation does without: "
        "pip install 'caster_gym[train]'",
        file=sys.stderr,
    )
    return 2


if __name__ == "__main__":
    main()
