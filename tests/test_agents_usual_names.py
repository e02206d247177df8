"""caster_gym.agents.usual_names: names of other libraries get advice that names what there is, and that helps."""

import inspect
import re

import pytest
import stable_baselines3
from typer.main import get_command

from caster_gym.agents.agent_settings import read_agent
from caster_gym.agents.cli import app
from caster_gym.agents.settings import BenchmarkSettings, TaskSettings
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.envs.caster_track import CasterTrackEnv
from caster_gym.envs.follow_task import FollowTask
from caster_gym.envs.task import Task
from caster_gym.envs.track_task import TrackTask
from caster_gym.floor import Floor

LEARNERS = ("ppo", "ppo_gpu", "sac", "shac")
INTERNAL = {  # of SB3's constructors, which nobody sets from a command line
    "self",
    "rollout_buffer_class",
    "rollout_buffer_kwargs",
    "replay_buffer_class",
    "replay_buffer_kwargs",
    "optimize_memory_usage",
    "stats_window_size",
    "_init_setup_model",
}
RANDOM = {"shape": "random_paths"}
PATHS = {kind: [{**RANDOM, "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))}
AGENTS = {"agents": ["computed_torque"]}
OPTIONS = {option for command in get_command(app).commands.values() for one in command.params for option in one.opts}


def kind(agent):
    return type(read_agent(agent))


def refusal(read, content):
    with pytest.raises(ConfigurationError) as caught:
        read(content)
    return str(caught.value)


def test_usual_names_and_those_of_fields_are_different_ones():
    """Otherwise the answer would never be given."""
    for model in (*map(kind, LEARNERS), TaskSettings, BenchmarkSettings, TrackTask, FollowTask):
        assert not model.usual_names.keys() & model.model_fields.keys()


@pytest.mark.parametrize("agent", LEARNERS)
def test_renamed_settings_of_learners_are_accepted_as_advised(agent):
    """The value that was given under the usual name is taken under the one that the message names."""
    values = read_agent(agent).model_dump()
    renamed = {usual: here for usual, here in kind(agent).usual_names.items() if here in values}
    assert {"total_timesteps", "n_envs", "num_envs", "gamma", "lr", "net_arch"} <= renamed.keys()
    for usual, here in renamed.items():
        said = refusal(lambda content: read_agent(agent, content), {usual: values[here]})
        assert said.endswith(f"unknown key {usual!r}; it is called {here!r} here")
        assert read_agent(agent, {here: values[here]}) == read_agent(agent)


@pytest.mark.parametrize(
    ("agent", "usual", "here"),
    [
        ("ppo", "n_steps", "horizon"),
        ("ppo", "batch_size", "batch"),
        ("ppo", "n_epochs", "epochs"),
        ("ppo", "gae_lambda", "trace"),
        ("ppo", "clip_range", "clip"),
        ("ppo", "ent_coef", "entropy"),
        ("ppo_gpu", "num_steps_per_env", "horizon"),
        ("sac", "buffer_size", "buffer"),
        ("sac", "learning_starts", "first_random"),
        ("sac", "tau", "soft_update"),
        ("sac", "gradient_steps", "updates"),
        ("shac", "max_grad_norm", "greatest_gradient"),
        ("shac", "n_steps", "window"),
    ],
)
def test_what_the_usual_names_mean(agent, usual, here):
    """As sb3_learning and rsl_rl hand them over: SB3's n_steps is the horizon, not the steps in all."""
    assert kind(agent).usual_names[usual] == here


@pytest.mark.parametrize(("agent", "theirs"), [("ppo", stable_baselines3.PPO), ("sac", stable_baselines3.SAC)])
def test_every_parameter_of_stable_baselines_has_an_answer(agent, theirs):
    names = set(inspect.signature(theirs.__init__).parameters) - INTERNAL
    assert names <= kind(agent).usual_names.keys() | kind(agent).model_fields.keys()


def test_answers_name_fields_and_options_that_exist():
    for model in (
        *map(kind, LEARNERS),
        kind("computed_torque"),
        TrackTask,
        FollowTask,
        TaskSettings,
        BenchmarkSettings,
    ):
        known = {*model.model_fields, *TaskSettings.model_fields, *BenchmarkSettings.model_fields, *Floor.model_fields}
        known |= {"duration", "laps", "seed", "device", "path", "robots"}  # of paths, agents and environments
        for answer in model.usual_names.values():
            assert set(re.findall(r"'(\w+)'", answer)) <= known, answer
            assert set(re.findall(r"(--\w+)", answer)) <= OPTIONS, answer


def test_keys_of_a_task_are_sent_where_they_belong():
    said = refusal(lambda content: parse(TaskSettings, content, "task"), {**PATHS, "control_period": 0.01})
    assert said == "task: unknown key 'control_period'; write it inside of 'task', as task: {control_period: …}"
    parse(TaskSettings, {**PATHS, "task": {"control_period": 0.01}}, "task")
    said = refusal(lambda content: parse(TaskSettings, content, "task"), {**PATHS, "frame_skip": 5})
    assert said.endswith("write it inside of 'task', as task: {substeps: …}")
    said = refusal(lambda content: parse(TaskSettings, content, "task"), {**PATHS, "task": {"dt": 0.01}})
    assert said == "task: unknown key 'task.dt'; it is called 'control_period' here"


def test_settings_of_learners_are_sent_away_from_comparisons():
    said = refusal(lambda content: parse(BenchmarkSettings, content, "comparison"), {**AGENTS, "steps": 1000})
    assert said.endswith(
        "unknown key 'steps'; it belongs to the agents: write steps into their files, or give --set steps=…"
    )
    said = refusal(lambda content: parse(BenchmarkSettings, content, "comparison"), {**AGENTS, **PATHS})
    assert "it is a key of a task, whose name or file is given as 'task'" in said


@pytest.mark.parametrize("name", ["dt", "frame_skip", "decimation", "lookahead"])
def test_usual_names_of_environments_get_an_answer(name):
    """In their constructors too, and what is advised is accepted."""
    here = Task.usual_names[name]
    with pytest.raises((TypeError, ValueError), match=f"it is called '{here}' here"):
        CasterTrackEnv(path=RANDOM, **{name: 1})
    CasterTrackEnv(path=RANDOM, **{here: TrackTask().model_dump()[here]})
