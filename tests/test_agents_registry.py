"""agents.registry: agents by their names, those of others by module and class, and errors that say what is wrong."""

import pytest
import yaml

from caster_gym.agents.control.computed_torque import ComputedTorqueSettings
from caster_gym.agents.control.protocol import AgentSettings
from caster_gym.agents.learning.settings import PPOSettings, SACSettings
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError
from caster_gym.shipped_files import find, names_of


def written(tmp_path, content):
    file = tmp_path / "settings.yaml"
    file.write_text(content if isinstance(content, str) else yaml.safe_dump(content), encoding="utf-8")
    return str(file)


@pytest.mark.parametrize("name", names_of("agents"))
def test_each_agent_that_comes_with_the_package_loads(name):
    assert isinstance(read_agent(name), AgentSettings)


def test_the_kinds_of_agents_are_told_by_their_algorithm():
    kinds = [type(read_agent(name)) for name in ("ppo", "sac", "computed_torque", "computed_torque_without_d1")]
    assert kinds == [PPOSettings, SACSettings, ComputedTorqueSettings, ComputedTorqueSettings]
    assert read_agent("computed_torque_without_wheels").known == "without wheels"


@pytest.mark.parametrize("number", ["1e-3", "1E-3", "0.001", ".001"])
def test_exponents_are_numbers(tmp_path, number):
    settings = read_agent(written(tmp_path, f"algorithm: ppo\nlearning_rate: {number}\nsteps: 1e6\n"))
    assert (settings.learning_rate, settings.steps) == (1e-3, 1_000_000)
    assert isinstance(settings.steps, int)


def test_changes_replace_what_the_file_says(tmp_path):
    name = written(tmp_path, {"algorithm": "ppo", "steps": 5000, "robots": 8, "batch": 64})
    changed = read_agent(name, {"steps": 700})
    assert (changed.steps, changed.robots, changed.batch) == (700, 8, 64)
    with pytest.raises(ConfigurationError, match=r"unknown key .*stepz.*; did you mean 'steps'\?"):
        read_agent(name, {"stepz": 700})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"algorithm": "ppo", "learning_rat": 1e-3}, r"unknown key .*learning_rat'; did you mean 'learning_rate'\?"),
        ({"algorithm": "ppo", "buffer": 10}, "unknown key .*buffer"),  # a key of SAC
        ({"algorithm": "computed torque", "known": "half"}, "known.*'half'"),
        ({"algorithm": "pppo"}, r"unknown algorithm 'pppo'; did you mean 'ppo'\?"),
        ({"steps": 10}, "algorithm"),
        ({"algorithm": "ppo", "steps": 0}, "steps.* greater than 0, got 0"),
        ({"algorithm": "ppo", "steps": "many"}, "steps.* should be a whole number, got 'many'"),
        ({"algorithm": "ppo", "discount": 1.0}, "discount.* less than 1, got 1.0"),
        ({"algorithm": "sac", "soft_update": 0.0}, "soft_update.* greater than 0"),
        ({"algorithm": "ppo", "hidden": []}, "hidden.* at least 1 item"),
        ({"algorithm": "ppo", "falling": 1}, "falling.* true or false, got 1"),
        ({"algorithm": "computed torque", "natural_frequencies": [10.0, -1.0]}, "natural_frequencies.*-1.0"),
    ],
)
def test_what_is_wrong_with_an_agent_is_named(tmp_path, content, message):
    with pytest.raises(ConfigurationError, match=f"settings.yaml: .*{message}"):
        read_agent(written(tmp_path, content))


def test_a_path_is_taken_as_it_is(tmp_path):
    assert find("agents", str(tmp_path / "mine.yaml")) == tmp_path / "mine.yaml"
    with pytest.raises(ConfigurationError, match=r"there is no file '.*mine\.yaml'"):
        read_agent(str(tmp_path / "mine.yaml"))
