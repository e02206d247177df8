"""docs/scaling.md: the search on the page is one, with the defaults of its table; so are those of the package."""

import re
from pathlib import Path

import pytest
import yaml

from caster_gym.agents.sweep.settings import SweepSettings, read_sweep
from caster_gym.configuration import parse
from caster_gym.shipped_files import names_of, read_settings

PAGE = (Path(__file__).parents[1] / "docs" / "scaling.md").read_text(encoding="utf-8")


def test_the_search_of_the_page_is_read():
    (text,) = re.findall(r"```yaml\n(.*?)```", PAGE, re.S)
    settings = parse(SweepSettings, yaml.safe_load(text.replace("1e-4", "0.0001").replace("3e-3", "0.003")), "page")
    point = {"agent.n_epochs": 3, "agent.net_arch": [64, 64], "task.task.position_weight": 0.75}
    task, agent = read_sweep(settings).candidate(point)
    found = agent.model_dump()
    assert (found["n_epochs"], found["net_arch"], found["n_timesteps"]) == (3, (64, 64), 400_000)
    assert task.task.model_dump()["position_weight"] == 0.75


def test_the_table_has_the_keys_and_defaults_that_there_are():
    rows = re.findall(r"^\| (`.*?) \| (.*?) \| ", PAGE, re.M)
    named = [key for keys, _ in rows for key in re.findall(r"`(\w+)`", keys)]
    fields = SweepSettings.model_fields
    assert set(named) == fields.keys() - {"task", "agent", "fixed", "space"}
    settings = parse(SweepSettings, {"space": {"agent.gamma": {"low": 0.9, "high": 0.99}}}, "defaults")
    for keys, defaults in rows:
        values = yaml.safe_load(f"[{re.sub('`', '', defaults)}]")
        assert [settings.model_dump(mode="json")[key] for key in re.findall(r"`(\w+)`", keys)] == values


@pytest.mark.parametrize("name", names_of("sweeps"))
def test_each_search_that_comes_with_the_package_can_begin(name):
    assert read_sweep(read_settings(SweepSettings, "sweeps", name)).candidate({}).agent.n_timesteps > 0
