"""How tests are spread over the cores, and which come first; and how they call a command."""

import gc
import os
from collections import Counter
from importlib.util import find_spec

import pytest
import yaml

if "PYTEST_XDIST_WORKER" in os.environ:  # there is one worker for each core
    os.environ["OMP_NUM_THREADS"] = "1"
    os.environ["OMP_WAIT_POLICY"] = "PASSIVE"  # where a test asks for two threads, none spins while it waits

# What needs packages of the extra `scale`, where those are not installed; `dev` has them
collect_ignore_glob = [
    *(["test_agents_sweep_s*.py", "test_measure_scaling.py"] if find_spec("optuna") is None else []),
    *(["test_agents_workers_on_ray.py"] if find_spec("ray") is None else []),
]


@pytest.hookimpl(wrapper=True)
def pytest_collection():
    """Collects tests without garbage collections, which would look again and again at objects that all stay.

    Later collections leave them out: each would else take half a second for what thousands of tests and Torch hold.
    """
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()


def pytest_collection_modifyitems(items):
    """Files with slow tests first, so that no core is left alone with one of them at the end."""
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: -slow[item.path])


@pytest.fixture
def call(tmp_path, monkeypatch):
    """Runs a command in a folder that holds only task.yaml; returns its result."""
    from typer.testing import CliRunner  # most tests need neither

    from caster_gym.agents.commands.cli import app
    from tests.command_calls import TASK

    monkeypatch.chdir(tmp_path)
    (tmp_path / "task.yaml").write_text(yaml.safe_dump(TASK), encoding="utf-8")
    runner = CliRunner(env={"COLUMNS": "200", "NO_COLOR": "1", "TERM": "dumb"})
    return lambda *arguments: runner.invoke(app, [str(argument) for argument in arguments])
