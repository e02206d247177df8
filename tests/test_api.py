"""caster_gym: the names that it hands on. Each says what it is, with an example that runs; docs/api.md lists them."""

import ast
import doctest
import inspect
import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import pytest

import caster_gym
from caster_gym import mechanics, wrappers

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").rglob("*.md"))]
NAMES = [
    "Arena",
    "CasterFollowEnv",
    "CasterFollowVectorEnv",
    "CasterHoldEnv",
    "CasterHoldVectorEnv",
    "CasterTrackEnv",
    "CasterTrackVectorEnv",
    "ComputedTorque",
    "ConfigurationError",
    "Fleet",
    "Floor",
    "Model",
    "ObservationLayout",
    "ObserverTorque",
    "PeriodDerivatives",
    "PredictiveControl",
    "Robot",
    "SB3VecEnv",
    "TorchFleet",
    "TorchModel",
    "TorchTask",
    "TorchVectorEnv",
    "Trajectory",
    "build_trajectories",
    "load_policy",
    "load_robot",
    "mechanics",
    "mjcf",
    "read_paths",
    "surroundings",
    "wrappers",
]
MODULES = {"mechanics": mechanics, "wrappers": wrappers}  # which hand on names of their own
TRAINING = {"SB3VecEnv", "TorchFleet", "TorchModel", "TorchTask", "TorchVectorEnv", "load_policy"}
KINDS = [f"wrappers.{name}" for name, it in vars(wrappers).items() if getattr(it, "model_fields", {}).get("kind")]
DOCUMENTED = [*NAMES, *KINDS, "wrappers.read_features", "wrappers.wrap"]


def found(name):
    """What a name stands for."""
    first, *rest = name.split(".")
    return getattr(getattr(caster_gym, first), rest[0]) if rest else getattr(caster_gym, first)


def examples_of(name):
    """The docstring's examples, without those of methods."""
    thing = found(name)
    text = doctest.DocTestParser().get_doctest(inspect.getdoc(thing) or "", {}, name, None, 0)
    return text if text.examples else None


@pytest.fixture(scope="module")
def prepared(tmp_path_factory):
    """A folder with what examples read: an untrained policy where a trained one would stand."""
    folder = tmp_path_factory.mktemp("prepared")
    if find_spec("torch") is None:
        return folder
    from caster_gym.agents.learning.actor import Actor
    from caster_gym.agents.learning.bundle import Bundle, PolicyDescription, save_bundle
    from caster_gym.tasks.track.parameters import TrackParameters

    robot, task = caster_gym.load_robot("chung2008"), TrackParameters()
    described: dict[str, Any] = {
        "format": 1,
        "name": "PPO",
        "squash": "clip",
        "hidden": (8,),
        "trained_with": {},
        "versions": {},
    }
    description = PolicyDescription(robot=robot, task=task, **described)
    actor = Actor(description.layout.size, (8,), len(robot.driven), "clip")
    save_bundle(folder / "runs" / "ppo" / "best", Bundle(description, actor))
    return folder


def test_these_names_are_handed_on_and_no_others():
    assert caster_gym.__all__ == NAMES
    assert [name for name in dir(caster_gym) if not name.startswith("_")] == NAMES
    for module in MODULES.values():
        assert module.__all__ == sorted(module.__all__)
        assert all(hasattr(module, name) for name in module.__all__)


def test_what_is_imported_is_what_type_checkers_see():
    """Two lists say where a name comes from: one for the interpreter, one for mypy and editors."""
    tree = ast.parse(inspect.getsource(caster_gym))
    (checked,) = [node for node in tree.body if isinstance(node, ast.If)]
    lines = [line for line in checked.body if isinstance(line, ast.ImportFrom)]
    homes = {alias.name: line.module for line in lines for alias in line.names}
    assert homes == {**dict.fromkeys(MODULES, "caster_gym"), **caster_gym._HOMES}


def test_a_name_that_nobody_hands_on_is_an_attribute_error():
    with pytest.raises(AttributeError, match="module 'caster_gym' has no attribute 'Robots'"):
        caster_gym.Robots  # noqa: B018


def test_a_name_says_which_extra_it_needs(monkeypatch):
    def without_torch(home):
        raise ModuleNotFoundError("No module named 'torch'", name="torch")

    monkeypatch.setattr(caster_gym, "import_module", without_torch)
    monkeypatch.delitem(vars(caster_gym), "TorchTask", raising=False)
    with pytest.raises(ImportError, match=r"caster_gym.TorchTask needs torch, .*: pip install 'caster_gym\[train\]'"):
        caster_gym.TorchTask  # noqa: B018


@pytest.mark.parametrize("name", DOCUMENTED)
def test_every_name_is_documented_by_an_example_that_runs(name, prepared, monkeypatch):
    if name in TRAINING:
        pytest.importorskip("torch")
        pytest.importorskip("stable_baselines3")
    examples = examples_of(name)
    assert examples is not None, f"the docstring of {name} has no example"
    monkeypatch.chdir(prepared)
    said: list[str] = []
    runner = doctest.DocTestRunner(optionflags=doctest.ELLIPSIS | doctest.NORMALIZE_WHITESPACE)
    assert runner.run(examples, out=said.append).failed == 0, "".join(said)


def test_the_page_lists_every_name_once():
    page = (ROOT / "docs" / "api.md").read_text(encoding="utf-8")
    assert sorted(re.findall(r"^\| `([\w.]+)` \| .+ \|$", page, re.M)) == NAMES


def test_the_example_of_a_saved_state_runs(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (code,) = re.findall(r"^```python\n(.+?)^```$", (ROOT / "docs" / "api.md").read_text(encoding="utf-8"), re.M | re.S)
    exec(compile(code, "docs/api.md", "exec"), {})


@pytest.mark.parametrize("page", PAGES, ids=[str(page.relative_to(ROOT)) for page in PAGES])
def test_pages_import_from_nowhere_deeper(page):
    """Modules may move; these names stay. A page that means a file writes its path."""
    text = page.read_text(encoding="utf-8")
    for name in re.findall(r"(?<![\w/])caster_gym\.(\w+(?:\.\w+)?)", text):
        first, *rest = name.split(".")
        assert first in NAMES or first == "__version__", f"{page.name}: caster_gym.{name}"
        assert first not in MODULES or not rest or rest[0] in MODULES[first].__all__, f"{page.name}: caster_gym.{name}"
    for module, names in re.findall(r"from caster_gym(\.\w+)* import (.+)", text):
        assert module.strip(".") in ("", *MODULES), f"{page.name}: caster_gym{module}"
        listed = MODULES[module.strip(".")].__all__ if module else NAMES
        assert set(re.findall(r"\w+", names)) <= set(listed), f"{page.name}: {names}"
