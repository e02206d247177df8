"""agents.registry: agents by their names, those of others by module and class, and errors that say what is wrong."""

import hashlib
import sys
from typing import Any

import pytest
import yaml
from pydantic import PositiveFloat

import caster_gym
from caster_gym.agents.control.computed_torque_settings import ComputedTorqueSettings
from caster_gym.agents.control.protocol import AgentSettings, ControllerSettings
from caster_gym.agents.learning.settings import PPOSettings, SACSettings
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse
from caster_gym.own_code import RESULTS
from caster_gym.shipped_files import find, names_of
from caster_gym.tasks.track.parameters import TrackParameters
from caster_gym.wrappers.feature import Feature


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
    settings = read_agent("computed_torque_without_wheels")
    assert isinstance(settings, ComputedTorqueSettings) and settings.known == "without wheels"


@pytest.mark.parametrize("number", ["1e-3", "1E-3", "0.001", ".001"])
def test_exponents_are_numbers(tmp_path, number):
    settings = read_agent(written(tmp_path, f"algorithm: ppo\nlearning_rate: {number}\nn_timesteps: 1e6\n"))
    assert isinstance(settings, PPOSettings)
    assert (settings.learning_rate, settings.n_timesteps) == (1e-3, 1_000_000)
    assert isinstance(settings.n_timesteps, int)


def test_changes_replace_what_the_file_says(tmp_path):
    name = written(tmp_path, {"algorithm": "ppo", "n_timesteps": 5000, "n_envs": 8, "batch_size": 64})
    changed = read_agent(name, {"n_timesteps": 700})
    assert isinstance(changed, PPOSettings)
    assert (changed.n_timesteps, changed.n_envs, changed.batch_size) == (700, 8, 64)
    with pytest.raises(ConfigurationError, match=r"unknown key .*stepz.*; did you mean 'n_steps'\?"):
        read_agent(name, {"stepz": 700})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"algorithm": "ppo", "learning_rat": 1e-3}, r"unknown key .*learning_rat'; did you mean 'learning_rate'\?"),
        ({"algorithm": "ppo", "buffer_size": 10}, "unknown key .*buffer"),  # a key of SAC
        ({"algorithm": "computed torque", "known": "half"}, "known.*'half'"),
        ({"algorithm": "pppo"}, r"unknown algorithm 'pppo'; did you mean 'ppo'\?"),
        ({"n_timesteps": 10}, "algorithm"),
        ({"algorithm": "ppo", "n_timesteps": 0}, "steps.* greater than 0, got 0"),
        ({"algorithm": "ppo", "n_timesteps": "many"}, "steps.* should be a whole number, got 'many'"),
        ({"algorithm": "ppo", "gamma": 1.0}, "gamma.* less than 1, got 1.0"),
        ({"algorithm": "sac", "tau": 0.0}, "tau.* greater than 0"),
        ({"algorithm": "ppo", "net_arch": []}, "net_arch.* at least 1 item"),
        ({"algorithm": "shac", "compile": 1}, "compile.* true or false, got 1"),
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


OWN = """
from caster_gym.agents.control.protocol import ControllerSettings
from caster_gym.agents.learning.settings import LearnerSettings

LIMIT = 3.0

class Still:
    name = "still"

class Resting(ControllerSettings):
    gain: float = 1.0
    def controller(self, layout, period):
        return Still()

class Unfinished(LearnerSettings):
    n_timesteps: int = 10
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """Reads an agent file whose algorithm is a class of a module beside it; the module's name is new in each test."""
    monkeypatch.syspath_prepend(tmp_path / "elsewhere")  # restores sys.path afterwards
    module = f"own_{tmp_path.name}"
    (tmp_path / f"{module}.py").write_text(OWN, encoding="utf-8")
    (tmp_path / f"broken_{module}.py").write_text("1 / 0", encoding="utf-8")
    (tmp_path / f"needy_{module}.py").write_text("import no_such_library", encoding="utf-8")

    def read(algorithm, **settings):
        return read_agent(written(tmp_path, {"algorithm": algorithm.replace("OWN", module), **settings}))

    yield read
    for name in [name for name in sys.modules if name.endswith(module)]:
        del sys.modules[name]


def test_an_agent_of_ones_own_is_read_from_the_module_beside_its_file(own):
    settings = own("OWN:Resting", gain=2)
    assert isinstance(settings, ControllerSettings)
    assert (type(settings).__name__, settings.model_dump()["gain"]) == ("Resting", 2.0)
    nothing: Any = None  # it does not look
    assert settings.controller(nothing, 0.02).name == "still"
    assert list(settings.candidates()) == [settings]


def test_the_source_of_an_agent_is_its_module_and_version(own, tmp_path):
    found = own("OWN:Resting").source
    (file,) = tmp_path.glob("own_*.py")
    assert found == {"module": file.stem, "version": f"sha256:{hashlib.sha256(OWN.encode()).hexdigest()}"}
    assert read_agent("ppo").source == {
        "module": "caster_gym.agents.learning.settings",
        "version": caster_gym.__version__,
    }


@pytest.mark.parametrize(
    ("algorithm", "message"),
    [
        (
            "nowhere:Resting",
            "no module 'nowhere' in .*, in the working folder or among the installed packages",
        ),
        ("OWN:Restin", r"has no 'Restin'; did you mean 'Resting'\?"),
        ("json:Resting", "module 'json' has no 'Resting'; no class in it has settings of an agent"),
        ("OWN:LIMIT", "LIMIT must be a class of your own, derived from ControllerSettings or LearnerSettings, got 3.0"),
        (
            "OWN:Still",
            "Still must be a class of your own, derived from .*, got <class .*; there is 'Resting' or 'Unfinished' in "
            "the same module",
        ),
        ("OWN:ControllerSettings", "must be a class of your own, derived from ControllerSettings"),
        ("OWN:Unfinished", "Unfinished must define the method learn"),
        ("OWN.py:Resting", r"a module is named without \.py: algorithm own_.*:Resting, got 'own_.*\.py:Resting'"),
        (
            "broken_OWN:Resting",
            r"cannot be imported: ZeroDivisionError: division by zero \(.*broken_own_.*\.py, line 1\)",
        ),
        ("needy_OWN:Resting", "needs 'no_such_library', which is not installed"),
        (":Resting", "is written as module:Name, got algorithm ':Resting'"),
        ("OWN:", "is written as module:Name, got algorithm"),
        ("../own:Resting", "is written as module:Name, got algorithm"),
        ("Resting", "unknown algorithm 'Resting'; .*a class of your own is written as module:Name"),
    ],
)
def test_what_is_wrong_with_an_agent_of_ones_own_is_said_in_a_sentence(own, algorithm, message):
    with pytest.raises(ConfigurationError, match=f"settings.yaml: .*{message}"):
        own(algorithm)


@pytest.mark.parametrize("algorithm", [[None], None, {}, [["ppo"]], 7, [], {"ppo": None}])
def test_an_algorithm_that_is_no_name_is_told(tmp_path, algorithm):
    with pytest.raises(ConfigurationError, match=r"settings\.yaml: .*algorithm.* module:Name$"):
        read_agent(written(tmp_path, {"algorithm": algorithm}))


def test_settings_of_ones_own_are_checked_like_all_others(own):
    with pytest.raises(ConfigurationError, match=r"unknown key 'gian'; did you mean 'gain'\?"):
        own("OWN:Resting", gian=1.0)


@pytest.mark.parametrize("result", RESULTS)
def test_no_code_is_run_for_a_file_among_results(own, tmp_path, result):
    (tmp_path / result).touch()
    with pytest.raises(ConfigurationError, match="is a folder of results, from which no code is run"):
        own("OWN:Resting")
    assert f"own_{tmp_path.name}" not in sys.modules


@pytest.mark.parametrize("base", [ControllerSettings, TrackParameters, Feature])
def test_defaults_of_a_users_own_fields_are_checked(base):
    class Own(base):  # type: ignore[misc, valid-type]
        stiffness: PositiveFloat = -100.0

        def controller(self, layout, period): ...

        def runtime(self, place): ...

    content = {"algorithm": "springs:Own"} if base is ControllerSettings else {}
    with pytest.raises(ConfigurationError, match=r"settings: 'stiffness' should be greater than 0, got -100\.0"):
        parse(Own, content, "settings")
    assert parse(Own, {**content, "stiffness": 3.0}, "settings").stiffness == 3.0
