"""caster_gym.agents.workers.on_ray: a call goes on elsewhere when its machine is lost, and ends with the same bytes."""

import csv
import logging
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest
import ray
import yaml
from ray.cluster_utils import Cluster

from caster_gym.agents.learning.settings import PPOSettings
from caster_gym.agents.learning.training import Job, train, train_all
from caster_gym.agents.workers.calls import Call, Finished, Reported
from caster_gym.agents.workers.on_ray import RayWorkers, _Signs
from tests.guesses import write_guesses
from tests.test_agents_learning_training import TASK

PPO = PPOSettings(
    algorithm="ppo",
    n_timesteps=4096,
    n_envs=8,
    n_steps=64,
    batch_size=64,
    net_arch=(8,),
    validations=4,
    save_every=1e-3,
)
CLOCK = "seconds"  # column that no two trainings share
SEEDS = (1, 2)
SILENT = 8.0  # [s]


def test_signs_of_an_attempt_that_no_longer_counts_are_refused():
    signs = _Signs(SILENT)
    signs.expect(0, 1)
    assert signs.hear(0, 1, "one", ["first"])
    signs.expect(0, 2)
    assert not signs.hear(0, 1, "one", ["late"])
    assert signs.hear(0, 2, "other", ["second"])
    assert signs.take() == ([(0, "first"), (0, "second")], [])
    assert signs.take() == ([], [])


def test_a_call_is_silent_once_and_one_that_has_not_begun_is_not(monkeypatch):
    now = [100.0]
    monkeypatch.setattr(time, "monotonic", lambda: now[0])
    signs = _Signs(SILENT)
    signs.expect(0, 1)
    signs.expect(1, 1)
    signs.hear(0, 1, "one", [])
    now[0] += SILENT
    assert signs.take() == ([], [])
    now[0] += 1.0
    assert signs.take() == ([], [(0, "one")])
    assert signs.take() == ([], [])


@pytest.fixture(scope="module")
def cluster():
    """A real one with a machine for whoever submits, and two that work, each with one core."""
    quick = {
        "health_check_period_ms": 500,
        "health_check_timeout_ms": 2000,
        "health_check_failure_threshold": 4,
        "worker_niceness": 0,
    }
    head = {"num_cpus": 0, "object_store_memory": 80_000_000, "_system_config": quick, "include_dashboard": False}
    made = Cluster(initialize_head=True, head_node_args=head)
    nodes = [made.add_node(num_cpus=1, object_store_memory=80_000_000) for _ in range(2)]
    ray.init(address=made.address, log_to_driver=False, logging_level=logging.ERROR)
    yield made, nodes
    ray.shutdown()
    made.shutdown()


def stop_once(folder, report):
    """Whoever is first is frozen, with all its threads."""
    if not (folder / "stopped").exists():
        (folder / "stopped").touch()
        os.kill(os.getpid(), signal.SIGSTOP)
    report("begun once more")
    return "done"


def fail(report):
    raise ValueError("nothing to do")


def files(folder):
    """All that a training leaves but clock times."""
    found = {str(one.relative_to(folder)): one.read_bytes() for one in folder.rglob("*.safetensors")}
    with (folder / "validation.csv").open(newline="", encoding="utf-8") as file:
        rows = [{name: value for name, value in row.items() if name != CLOCK} for row in csv.DictReader(file)]
    return found, rows, (folder / "best" / "policy.yaml").read_bytes()


@pytest.fixture(scope="module")
def local(tmp_path_factory):
    """Trainings in this process."""
    folder = tmp_path_factory.mktemp("local")
    for seed in SEEDS:
        train(TASK, PPO, seed, folder / str(seed), lambda steps, words: None, threads=1)
    return folder


@pytest.mark.slow
def test_errors_name_the_call(cluster):
    with pytest.raises(ValueError, match=r"^ppo seed 3: nothing to do$"), RayWorkers(1, 2) as workers:
        workers.submit(Call("ppo seed 3", fail, ()))
        list(workers.events())


@pytest.mark.slow
def test_a_call_that_falls_silent_is_begun_elsewhere(cluster, tmp_path):
    """Ray itself would wait for it for ever."""
    with RayWorkers(1, 2, SILENT) as workers:
        workers.submit(Call("frozen", stop_once, (tmp_path,)))
        events = list(workers.events())
    assert events == [Reported(0, "begun once more"), Finished(0, "done")]


SWEEP = {"task": "task.yaml", "agent": "guess.yaml", "trials": 3, "at_once": 2, "storage": "journal"}
GAIN = {"agent.gain": {"low": 0.01, "high": 1.0, "log": True}}
BENCHMARK = {"task": "task.yaml", "agents": ["guess.yaml"], "seeds": [0, 1]}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("command", "settings", "same"),
    [
        (["sweep"], {**SWEEP, "space": GAIN}, ["table.md", "trials.csv", "best.yaml", "search.png"]),
        (["benchmark", "--config"], BENCHMARK, ["table.md", "episodes.csv", "summary.csv"]),
    ],
)
def test_commands_on_the_cluster_of_ray_address_leave_the_bytes_of_local_processes(
    cluster, tmp_path, command, settings, same
):
    """All but clock times, and what Optuna and TensorBoard write."""
    write_guesses(tmp_path)
    (tmp_path / "settings.yaml").write_text(yaml.safe_dump(settings), encoding="utf-8")
    found = []
    for kind in ("local", "ray"):
        words = [*command, "settings.yaml", "--workers", kind, "--out", kind]
        run_python(cluster, ["-m", "caster_gym", *words], tmp_path)
        content = [tmp_path / kind / name for name in same]
        weights = sorted((tmp_path / kind).rglob("*.safetensors"))
        assert len(weights) >= 4
        found.append({str(one.relative_to(tmp_path / kind)): one.read_bytes() for one in (*content, *weights)})
    assert found[0] == found[1]


STOPPED = """
import os
import signal
import sys
from pathlib import Path

import typer

from caster_gym.agents.commands.command_line import plain_errors
from caster_gym.agents.workers.calls import Call
from caster_gym.agents.workers.on_ray import RayWorkers

def work(parent, report):
    os.kill(parent, int(sys.argv[1]))  # which waits for it meanwhile
    try:
        while True:
            pass
    except KeyboardInterrupt:
        Path(sys.argv[2]).touch()
        raise

def main(number: int, kept: Path):
    with plain_errors("all is kept"), RayWorkers(1, 1) as workers:
        workers.submit(Call("endless", work, (os.getpid(),)))
        list(workers.events())

if __name__ == "__main__":
    signal.signal(signal.SIGINT, signal.default_int_handler)
    typer.run(main)
"""


@pytest.mark.slow
@pytest.mark.parametrize(("number", "code"), [(signal.SIGINT, 130), (signal.SIGTERM, 143)])
def test_an_interrupted_command_lets_the_cluster_save_its_work(cluster, tmp_path, number, code):
    """Ray itself would end it at SIGTERM, and kill what it had begun."""
    script, kept = tmp_path / "stopped.py", tmp_path / "kept"
    script.write_text(STOPPED, encoding="utf-8")
    ended = run_python(cluster, [str(script), str(int(number)), str(kept)], tmp_path, code)
    assert ended.stderr == "caster-gym: interrupted; all is kept\n"
    assert kept.exists()


def run_python(cluster, arguments, folder, code=0):
    """Run Python in a folder, with RAY_ADDRESS."""
    environment = {**os.environ, "RAY_ADDRESS": cluster[0].address, "PYTHONPATH": str(Path(__file__).parents[1])}
    ended = subprocess.run(
        [sys.executable, *arguments], cwd=folder, env=environment, capture_output=True, text=True, check=False
    )
    assert ended.returncode == code, ended.stderr
    return ended


def test_a_cluster_that_cannot_be_joined_is_told(monkeypatch):
    def refuse(**_):
        raise ConnectionError("Failed to connect")

    monkeypatch.setenv("RAY_ADDRESS", "10.0.0.1:6379")
    monkeypatch.setattr(ray, "is_initialized", lambda: False)
    monkeypatch.setattr(ray, "init", refuse)
    with pytest.raises(ConnectionError, match=r"no Ray cluster could be joined at 10\.0\.0\.1:6379: .*RAY_AUTH_MODE=t"):
        RayWorkers(1, 1).__enter__()


@pytest.mark.slow
def test_trainings_end_with_the_same_bytes_though_a_machine_is_killed(cluster, local, tmp_path):
    """While it trains: the other one takes up its training, from the state on storage that both see."""
    made, nodes = cluster
    killed: list[Any] = []

    class Watched(RayWorkers):
        def events(self):
            for event in super().events():
                if not killed:
                    assert isinstance(event, Reported)  # nobody has finished yet
                    made.remove_node(nodes[0], allow_graceful=False)
                    killed.append(nodes[0])
                yield event

    jobs = [Job(f"ppo seed {seed}", TASK, PPO, seed, tmp_path / str(seed)) for seed in SEEDS]
    train_all(jobs, 1, workers=Watched(1, 2))
    assert len(killed) == 1
    for seed in SEEDS:
        assert files(tmp_path / str(seed)) == files(local / str(seed))
