"""agents.learning.usual_names: names of other libraries get advice that names what there is, and that helps."""

import inspect
import re
from typing import Any

import pytest
import stable_baselines3
import yaml
from typer.main import get_command

from caster_gym.agents.commands.benchmark import BenchmarkSettings
from caster_gym.agents.commands.cli import app
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.registry import read_agent
from caster_gym.arena.arena import Arena, read_arena
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.floor import Floor
from caster_gym.robot import Platform, Robot, load_robot
from caster_gym.tasks.follow.parameters import FollowParameters
from caster_gym.tasks.parameters import TaskParameters
from caster_gym.tasks.track.environment import CasterTrackEnv
from caster_gym.tasks.track.parameters import TrackParameters
from caster_gym.wrappers import Friction, read_features

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
RANDOM: Any = {"shape": "random_paths"}
PATHS = {kind: [{**RANDOM, "seed": seed}] for seed, kind in enumerate(("train", "validation", "test"))}
AGENTS = {"agents": ["computed_torque"]}
GROUP: Any = get_command(app)
OPTIONS = {option for command in GROUP.commands.values() for one in command.params for option in one.opts}


def kind(agent):
    return type(read_agent(agent))


def refusal(read, content):
    with pytest.raises(ConfigurationError) as caught:
        read(content)
    return str(caught.value)


def test_usual_names_and_those_of_fields_are_different_ones():
    """Otherwise the answer would never be given."""
    for model in (*map(kind, LEARNERS), TaskSettings, BenchmarkSettings, TrackParameters, FollowParameters):
        assert not model.usual_names.keys() & model.model_fields.keys()


@pytest.mark.parametrize("agent", LEARNERS)
def test_renamed_settings_of_learners_are_accepted_as_advised(agent):
    """The value that was given under the usual name is taken under the one that the message names."""
    values = read_agent(agent).model_dump()
    renamed = {usual: here for usual, here in kind(agent).usual_names.items() if here in values}
    assert {"total_timesteps", "steps", "robots", "num_envs", "discount", "lr", "hidden"} <= renamed.keys()
    for usual, here in renamed.items():
        said = refusal(lambda content: read_agent(agent, content), {usual: values[here]})
        assert said.endswith(f"unknown key {usual!r}; it is called {here!r} here")
        assert read_agent(agent, {here: values[here]}) == read_agent(agent)


@pytest.mark.parametrize(
    ("agent", "usual", "here"),
    [
        ("ppo", "steps", "n_timesteps"),
        ("ppo", "horizon", "n_steps"),
        ("ppo", "batch", "batch_size"),
        ("ppo", "epochs", "n_epochs"),
        ("ppo", "trace", "gae_lambda"),
        ("ppo", "clip", "clip_range"),
        ("ppo", "entropy", "ent_coef"),
        ("ppo", "initial_log_std", "log_std_init"),
        ("ppo_gpu", "num_steps_per_env", "n_steps"),
        ("sac", "buffer", "buffer_size"),
        ("sac", "first_random", "learning_starts"),
        ("sac", "soft_update", "tau"),
        ("sac", "updates", "gradient_steps"),
        ("shac", "greatest_gradient", "max_grad_norm"),
        ("shac", "window", "n_steps"),
        ("shac", "critic_batch", "batch_size"),
    ],
)
def test_what_the_usual_names_mean(agent, usual, here):
    """Older files and rsl-rl-lib say so; SB3's n_steps is what lies between updates, not the steps in all."""
    assert kind(agent).usual_names[usual] == here


@pytest.mark.parametrize(("agent", "theirs"), [("ppo", stable_baselines3.PPO), ("sac", stable_baselines3.SAC)])
def test_every_parameter_of_stable_baselines_has_an_answer(agent, theirs):
    names = set(inspect.signature(theirs.__init__).parameters) - INTERNAL
    assert names <= kind(agent).usual_names.keys() | kind(agent).model_fields.keys()


SB3_NAMES = {
    "ppo": {"n_steps", "batch_size", "n_epochs", "gamma", "gae_lambda", "clip_range", "ent_coef", "learning_rate"},
    "sac": {"buffer_size", "train_freq", "gradient_steps", "tau", "learning_starts", "batch_size", "gamma", "ent_coef"},
}


@pytest.mark.parametrize(("agent", "theirs"), [("ppo", stable_baselines3.PPO), ("sac", stable_baselines3.SAC)])
def test_settings_bear_the_names_of_stable_baselines(agent, theirs):
    """n_envs and n_timesteps are rl_zoo3's, net_arch that of SB3's policies."""
    ours = kind(agent).model_fields.keys()
    assert SB3_NAMES[agent] | {"learning_rate", "n_envs", "n_timesteps", "net_arch"} <= ours
    assert SB3_NAMES[agent] <= inspect.signature(theirs.__init__).parameters.keys()


def test_answers_name_fields_and_options_that_exist():
    for model in (
        *map(kind, LEARNERS),
        kind("computed_torque"),
        TrackParameters,
        FollowParameters,
        TaskSettings,
        BenchmarkSettings,
        Arena,
        Robot,
        Platform,
        Friction,
    ):
        known = {*model.model_fields, *TaskSettings.model_fields, *BenchmarkSettings.model_fields, *Floor.model_fields}
        known |= {*Robot.model_fields, "floor"}
        known |= {"duration", "laps", "seed", "device", "path", "n_envs"}  # of paths, agents and environments
        for answer in model.usual_names.values():
            assert set(re.findall(r"'(\w+)'", answer)) <= known, answer
            assert set(re.findall(r"(--\w+)", answer)) <= OPTIONS, answer


ELSEWHERE: dict[str, dict[str, Any]] = {
    "impact_law": {"arena": {"impact_law": "stronge"}},
    "restitution": {"arena": {"restitution": 0.5}},
    "impact_friction": {"arena": {"friction": 0.2}},
    "patches": {"floor": {"patches": [{"friction": 0.05, "x": 1.0, "y": 0.0, "radius": 0.4}]}},
    "contact_time": {"floor": {"friction": 0.3, "contact_time": 0.01}},
    "mu": {"floor": {"friction": 0.3}},
    "friction": {"floor": {"friction": 0.3}},
    "ice": {"floor": {"friction": 0.05}},
    "slip": {"floor": {"friction": 0.05}},
}


@pytest.mark.parametrize("name", ELSEWHERE)
def test_keywords_that_belong_inside_of_another_are_sent_there(name):
    """And what is advised is accepted."""
    ((keyword, content),) = ELSEWHERE[name].items()
    with pytest.raises(TypeError, match=f"unexpected keyword argument '{name}'") as error:
        CasterTrackEnv(**{"path": RANDOM, name: 1})
    assert f"'{keyword}'" in str(error.value)
    advised = yaml.safe_load(re.findall(r"\{.*\}", str(error.value))[0])
    assert advised == content
    CasterTrackEnv(path=RANDOM, **{keyword: advised})


def test_a_height_is_sent_to_the_platform_of_the_robot():
    with pytest.raises(TypeError, match="'height'; it belongs to the 'platform' of the 'robot'"):
        CasterTrackEnv(path=RANDOM, height=0.1)
    robot = load_robot("chung2008").model_dump(mode="json")
    with pytest.raises(ConfigurationError, match=r"'height'; it belongs to the 'platform', as \{height: 0.1\}"):
        load_robot({**robot, "height": 0.1})
    for name in ("z", "com_height"):
        with pytest.raises(ConfigurationError, match=f"'platform.{name}'; it is called 'height' here"):
            load_robot({**robot, "platform": {**robot["platform"], name: 0.1}})
    assert load_robot({**robot, "platform": {**robot["platform"], "height": 0.1}}).platform.height == 0.1


@pytest.mark.parametrize(
    ("read", "given", "here"),
    [
        (read_arena, {"mu": 0.3}, "friction"),
        (read_arena, {"law": "stronge"}, "impact_law"),
        (lambda one: read_features([{"kind": "friction", **one}]), {"friction": 0.3}, "floor_friction"),
        (lambda one: read_features([{"kind": "friction", **one}]), {"mu": 0.3}, "floor_friction"),
        (lambda one: load_robot({**load_robot("chung2008").model_dump(), **one}), {"mu": 0.3}, "floor_friction"),
    ],
)
def test_usual_names_of_frictions_get_an_answer(read, given, here):
    ((name, value),) = given.items()
    with pytest.raises(ConfigurationError, match=f"unknown key '{name}'; it is called '{here}' here"):
        read(given)
    read({here: value})


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
        "unknown key 'steps'; it belongs to the agents: write n_timesteps into their files, or give --set n_timesteps=…"
    )
    said = refusal(lambda content: parse(BenchmarkSettings, content, "comparison"), {**AGENTS, **PATHS})
    assert "it is a key of a task, whose name or file is given as 'task'" in said


@pytest.mark.parametrize("name", ["dt", "frame_skip", "decimation", "lookahead"])
def test_usual_names_of_environments_get_an_answer(name):
    """In their constructors too, and what is advised is accepted."""
    here = TaskParameters.usual_names[name]
    with pytest.raises((TypeError, ValueError), match=f"it is called '{here}' here"):
        CasterTrackEnv(**{"path": RANDOM, name: 1})
    CasterTrackEnv(path=RANDOM, **{here: TrackParameters().model_dump()[here]})
