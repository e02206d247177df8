"""agents.commands.benchmark: one command leaves everything behind, all agents drive the same, errors are told."""

import csv
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from numpy.testing import assert_array_equal

from caster_gym.agents.commands.benchmark import BenchmarkSettings, read_comparison, run_benchmark
from caster_gym.agents.comparison.evaluation import bare, evaluation_batch, roll_out
from caster_gym.agents.comparison.results import Contender, compare
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.tuning import tune
from caster_gym.agents.comparison.validation import VALIDATION_SEED, read_history
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.agents.learning.bundle import load_policy
from caster_gym.agents.learning.settings import LearnerSettings
from caster_gym.agents.learning.training import Job, train_all
from caster_gym.agents.registry import read_agent
from caster_gym.agents.workers import opening
from caster_gym.agents.workers.local import LocalWorkers
from caster_gym.configuration import ConfigurationError
from caster_gym.engines.tensor.threads import DEFAULT
from caster_gym.own_errors import OwnCodeError
from caster_gym.shipped_files import names_of, read_settings
from caster_gym.tasks.follow.metrics import FollowMetrics, FollowVerdict
from caster_gym.tasks.track.metrics import TrackMetrics, TrackVerdict, measure

SEEDS = [2, 5]
STARTS = 2
PATHS = 3
RANDOM = {"shape": "random_paths", "duration": 3.0, "max_speed": 0.3}
PPO = {
    "algorithm": "ppo",
    "n_timesteps": 9999,
    "net_arch": [8],
    "n_envs": 8,
    "n_steps": 32,
    "batch_size": 64,
    "validations": 2,
}
FREQUENCIES = [1.0, 15.0]


def write(folder, name, content):
    file = folder / f"{name}.yaml"
    file.write_text(yaml.safe_dump(content), encoding="utf-8")
    return str(file)


def rows(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


@pytest.fixture(scope="module")
def settings(tmp_path_factory):
    folder = tmp_path_factory.mktemp("configs")
    task = {
        "train": [{**RANDOM, "seed": 0, "count": 4}],
        "validation": [{**RANDOM, "seed": 1, "count": 3}],
        "test": [{**RANDOM, "seed": 2, "count": PATHS}],
    }
    controller = {"algorithm": "computed torque", "natural_frequencies": FREQUENCIES}
    return BenchmarkSettings(
        task=write(folder, "task", task),
        agents=(write(folder, "controller", controller), write(folder, "ppo", PPO)),
        seeds=tuple(SEEDS),
        starts=STARTS,
        settling=1.0,
    )


@pytest.fixture(scope="module")
def task(settings):
    return read_settings(TaskSettings, "tasks", settings.task)


@pytest.fixture(scope="module")
def finished(settings, tmp_path_factory):
    """Folder and table of a small comparison: a controller and two seeds of a learned agent."""
    folder = tmp_path_factory.mktemp("benchmark")
    return folder, run_benchmark(read_comparison(settings, {"n_timesteps": 512}), folder)


@pytest.mark.slow
def test_a_comparison_leaves_everything_behind(finished):
    folder, text = finished
    assert (folder / "table.md").read_text(encoding="utf-8") == text + "\n"
    assert "computed torque" in text
    assert "PPO, 2 seeds" in text
    for name in ("paths", "errors", "torques", "learning", "overview"):
        picture = (folder / f"{name}.png").read_bytes()
        assert picture.startswith(b"\x89PNG")
        assert len(picture) > 5000  # an empty picture of that size has less
    episodes = rows(folder / "episodes.csv")
    assert len(episodes) == (1 + len(SEEDS)) * PATHS * STARTS
    assert [(row["agent"], row["seed"]) for row in episodes[:: PATHS * STARTS]] == [
        ("computed torque", ""),
        *[("PPO", str(seed)) for seed in SEEDS],
    ]
    assert len(rows(folder / "summary.csv")) == 2 * len(TrackMetrics._fields)
    assert len(rows(folder / "tuning.csv")) == len(FREQUENCIES)
    assert f"{PATHS * 150 * len(FREQUENCIES):,} (2 settings); ppo, each of 2 seeds 512." in text


@pytest.mark.slow
def test_run_yaml_holds_what_the_comparison_was(finished, settings):
    folder, _ = finished
    facts = yaml.safe_load((folder / "run.yaml").read_text(encoding="utf-8"))
    assert BenchmarkSettings(**facts["benchmark"]) == settings
    assert {"versions", "command", "task", "robot"} <= set(facts)
    controller, learner = (Path(agent).stem for agent in settings.agents)
    assert facts["agents"][learner]["n_timesteps"] == 512  # the change, not the file's
    assert facts["tuned"][controller]["natural_frequencies"] == [15.0]


@pytest.mark.slow
def test_every_seed_is_trained_for_itself(finished):
    folder, _ = finished
    policies = sorted(file.parent for file in (folder / "policies").rglob("run.yaml"))
    assert len(policies) == len(SEEDS)
    seeds = [load_policy(policy / "best").description.trained_with["seed"] for policy in policies]
    assert sorted(seeds) == SEEDS
    for policy in policies:
        history = read_history(policy / "validation.csv", TrackVerdict)
        assert [str(one.steps) for one in history] == [row["steps"] for row in rows(policy / "validation.csv")]
        assert history[-1].steps == 512


@pytest.mark.slow
def test_episodes_can_be_measured_again_from_the_policies(finished, settings, task):
    """The numbers of each seed are those of its policy on the same starts."""
    folder, _ = finished
    batch = evaluation_batch(task, task.test, STARTS)
    for policy in (file.parent for file in (folder / "policies").rglob("run.yaml")):
        bundle = load_policy(policy / "best")
        metrics = measure(roll_out(bundle.agent, batch, settings.start_seed), settings.settling)
        seed = str(bundle.description.trained_with["seed"])
        written = [row for row in rows(folder / "episodes.csv") if row["seed"] == seed]
        for name in TrackMetrics._fields:
            assert_array_equal([float(row[name]) for row in written], getattr(metrics, name), name)


class Recorder:
    """A controller that keeps what it was shown first."""

    def __init__(self, agent, name):
        self.agent, self.name, self.first = agent, name, None

    def act(self, observations):
        self.first = observations.copy() if self.first is None else self.first
        return self.agent.act(observations)


def test_all_agents_get_the_same_starts_and_paths(settings, task):
    batch = evaluation_batch(task, task.test, STARTS)
    agents = [
        Recorder(ComputedTorque(bare(batch).engine.layout, frequency, bare(batch).task.control_period), f"{frequency}")
        for frequency in (5.0, 10.0)
    ]
    results, shown = compare([Contender(agent.name, agent, None) for agent in agents], batch, settings.start_seed)
    assert_array_equal(agents[0].first, agents[1].first)
    assert results[0].paths == results[1].paths == ("random_paths 0", "random_paths 1", "random_paths 2") * STARTS
    first, second = shown.values()
    assert_array_equal(first.reference, second.reference)
    assert np.any(first.pose != second.pose)


def test_the_natural_frequency_is_chosen_on_validation_paths(task):
    """The best of those listed there, whatever would do better elsewhere."""
    batch = evaluation_batch(task, task.validation, starts=1)
    listed = (3.0, 30.0, 1.0, 12.0)
    errors = {}
    for frequency in listed:
        agent = ComputedTorque(bare(batch).engine.layout, frequency, bare(batch).task.control_period)
        metrics = measure(roll_out(agent, batch, VALIDATION_SEED), 2.0)
        errors[frequency] = metrics.position_rmse.mean()
    settings = ComputedTorqueSettings(algorithm="computed torque", natural_frequencies=listed)
    tuned, best, tried = tune(settings, batch)
    assert [one.settings for one in tried] == settings.candidates()
    frequency = min(errors, key=lambda one: errors[one])
    assert best == settings.model_copy(update={"natural_frequencies": (frequency,)})
    assert isinstance(tuned, ComputedTorque)
    assert tuned.gains == ComputedTorque(bare(batch).engine.layout, frequency, bare(batch).task.control_period).gains


@pytest.mark.slow
def test_an_error_in_a_training_process_is_raised(tmp_path, settings, task):
    """Here the folder of a run cannot be made, since a file is there."""
    (tmp_path / "taken").write_text("", encoding="utf-8")
    agent = read_agent(settings.agents[1], {"n_timesteps": 512})
    assert isinstance(agent, LearnerSettings)
    with pytest.raises(OSError, match="taken"):
        train_all([Job("ppo seed 0", task, agent, 0, tmp_path / "taken" / "run")])


@pytest.mark.parametrize(("threads", "processes"), [((1,), 5), ((4,), 4), ((64,), 1)])
def test_sixteen_cores_change_no_numbers(tmp_path, settings, task, monkeypatch, threads, processes):
    """Each training run has the threads that are asked for; cores only say how many run at a time."""
    places, submitted = [], []

    class Workers(LocalWorkers):
        def __init__(self, most):
            places.append(most)

        def submit(self, call):
            submitted.append(call.arguments[1])

        def events(self):
            return iter(())

        def __exit__(self, *_):
            pass

    monkeypatch.setattr(opening, "LocalWorkers", Workers)
    monkeypatch.setattr(opening, "usable_cores", lambda: 16)
    agent = read_agent(settings.agents[1], {"n_timesteps": 512})
    assert isinstance(agent, LearnerSettings)
    train_all([Job(f"ppo seed {seed}", task, agent, seed, tmp_path) for seed in range(5)], *threads)
    assert places == [processes]
    assert submitted == 5 * [threads[0]]


@pytest.mark.slow
def test_run_yaml_has_the_threads_of_everybody(finished):
    folder, _ = finished
    files = [folder / "run.yaml", *(folder / "policies").rglob("run.yaml")]
    assert len(files) == 1 + len(SEEDS)
    assert all(yaml.safe_load(file.read_text(encoding="utf-8"))["threads"] == DEFAULT for file in files)


def test_no_jobs_are_no_work():
    train_all([])


def test_an_unknown_agent_is_told_before_anything_is_trained(tmp_path, settings):
    other = settings.model_copy(update={"agents": (*settings.agents, "nobody")})
    with pytest.raises(ConfigurationError, match="there is no 'nobody' in agents; known are computed_torque"):
        run_benchmark(read_comparison(other), tmp_path)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_following_is_compared_in_the_same_way(tmp_path):
    """One definition serves both tasks: another table, another figure, the same files."""
    task = {
        "environment": "follow",
        "arena": {"beside": {"pillars": 1, "walls": 1}},
        "shaping": [{"kind": "tolerance", "quantity": "heading_error", "margin": 0.5}],
        **{
            kind: [{"shape": "random_paths", "seed": seed, "count": 2, "reversing": 0.0, "min_radius": 0.3}]
            for seed, kind in enumerate(("train", "validation", "test"))
        },
    }
    controller = {"algorithm": "computed torque", "natural_frequencies": [10.0]}
    settings = BenchmarkSettings(
        task=write(tmp_path, "task", task),
        agents=(write(tmp_path, "controller", controller), write(tmp_path, "ppo", PPO)),
        seeds=(2,),
    )
    folder = tmp_path / "results"
    text = run_benchmark(read_comparison(settings, {"n_timesteps": 512}), folder)
    assert "time for the path [s]" in text
    assert (folder / "speeds.png").read_bytes().startswith(b"\x89PNG")
    controlled, learned = rows(folder / "episodes.csv")[::2]
    assert list(controlled)[4:] == list(FollowMetrics._fields)
    assert (controlled["finished"], controlled["failed"]) == ("1.0", "0.0")
    assert learned["seed"] == "2"
    policy = folder / "policies" / "ppo-2"
    history = read_history(policy / "validation.csv", FollowVerdict)
    assert [str(one.steps) for one in history] == [row["steps"] for row in rows(policy / "validation.csv")]
    best = load_policy(policy / "best").description
    assert (best.environment, best.wrappers, best.actions) == ("follow", (), 6)


def test_computed_torque_is_refused_where_actions_are_no_torques(task):
    commanded = TaskSettings.model_validate({**task.model_dump(), "wrappers": ["twist_commands"]})
    settings = ComputedTorqueSettings(algorithm="computed torque")
    with pytest.raises(ValueError, match=r"computed torque gives torques, but .* of \{kind: twist_commands\}: leave"):
        tune(settings, evaluation_batch(commanded, commanded.validation, starts=1))


class Silent:
    """Acts once or never; says how often it was asked."""

    name = "silent"
    asked = 0

    def __init__(self, actions: Any) -> None:
        self.actions = actions

    def act(self, observations):
        self.asked += 1
        return self.actions


@pytest.mark.parametrize("actions", [None, np.zeros((PATHS, 6), dtype=np.float32)])
def test_a_controller_of_ones_own_is_tried_before_anything_is_trained(task, actions):
    """And the one that takes part has seen nothing before its first episode."""
    made = []

    class Own(ControllerSettings):
        def controller(self, layout, period):
            made.append(Silent(actions))
            return made[-1]

    settings, batch = Own(algorithm="mine:Own"), evaluation_batch(task, task.validation, starts=1)
    if actions is None:
        with pytest.raises(
            OwnCodeError, match=r"agent 'lazy' \(mine:Own\): its method act must return actions of shape"
        ):
            tune(settings, batch, "lazy")
    else:
        assert tune(settings, batch, "lazy").settings == settings
    assert [one.asked for one in made] == [0, 1]


@pytest.mark.parametrize("name", names_of("benchmarks"))
def test_each_benchmark_that_comes_with_the_package_names_what_there_is(name):
    settings = read_settings(BenchmarkSettings, "benchmarks", name)
    read_settings(TaskSettings, "tasks", settings.task)
    agents = [read_agent(one.agent) for one in settings.entrants]
    assert any(isinstance(agent, ControllerSettings) for agent in agents)
    assert any(isinstance(agent, LearnerSettings) for agent in agents) is (name != "model_based")
    assert len(set(settings.seeds)) == len(settings.seeds) >= 3


def blocks(section, language):
    """Code of a language in a section of CONTRIBUTING.md."""
    text = (Path(__file__).parents[1] / "CONTRIBUTING.md").read_text(encoding="utf-8")
    return re.findall(
        rf"```{language}\n(.*?)```", text.partition(f"## {section}\n")[2].partition("\n## ")[0], re.DOTALL
    )


@pytest.mark.slow
def test_agents_of_ones_own_take_part_as_contributing_tells(tmp_path, settings, monkeypatch):
    """The controller and the learner of that page, as they stand there, beside computed torque."""
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")  # restores sys.path afterwards
    for section, module, agent in (("Add a controller", "springs", "spring"), ("Add a learner", "search", "search")):
        (tmp_path / f"{module}.py").write_text(blocks(section, "python")[0], encoding="utf-8")
        (tmp_path / f"{agent}.yaml").write_text(blocks(section, "yaml")[0], encoding="utf-8")
    agents = (settings.agents[0], *(str(tmp_path / f"{agent}.yaml") for agent in ("spring", "search")))
    folder = tmp_path / "results"
    comparison = read_comparison(settings.model_copy(update={"agents": agents, "seeds": (2,)}), {"validations": 2})
    text = run_benchmark(comparison, folder)
    assert [name in text for name in ("computed torque", "spring", "Search")] == [True] * 3
    driven = {row["agent"]: row for row in rows(folder / "episodes.csv")}
    assert driven["spring"]["failed"] == "0.0"
    assert float(driven["spring"]["position_rmse"]) < 0.05  # [m] a spring without feed-forward lags behind
    facts = yaml.safe_load((folder / "run.yaml").read_text(encoding="utf-8"))
    assert facts["agents"]["spring"] == {"algorithm": "springs:Spring", "stiffness": 150.0, "damping": 20.0}
    assert {name: one["module"] for name, one in facts["sources"].items()} == {
        "controller": "caster_gym.agents.control.computed_torque_settings",
        "spring": "springs",
        "search": "search",
    }
    assert all(facts["sources"][name]["version"].startswith("sha256:") for name in ("spring", "search"))
    best = load_policy(folder / "policies" / "search-2" / "best").description
    assert (best.name, best.hidden, best.squash) == ("Search", (8,), "tanh")
