"""scripts.measure_saving: the page says what saving costs, and how large a state is."""

import pytest

from caster_gym.agents.learning.settings import SHACSettings
from caster_gym.configuration import parse
from scripts.measure_saving import Cost, measure, page
from tests.test_agents_learning_resuming import LEARNERS, ON_TENSORS


def test_the_page_has_a_line_for_each_agent():
    text = page([Cost("sac", 15.0, 4, 0.2, 60.0, 2_500_000, 40_000_000)], "python -m scripts.measure_saving")
    assert "| sac | 15 | 4 | 50 | 0.3333 | 2.50 MB | 40.0 MB |" in text


@pytest.mark.slow
def test_every_save_is_counted():
    settings = LEARNERS["shac"]
    assert isinstance(settings, SHACSettings)
    cost = measure("shac", ON_TENSORS, parse(SHACSettings, settings.model_dump(), "shac"), 60.0)
    assert cost.saves == settings.n_timesteps / (settings.n_envs * settings.n_steps)
    assert 0.0 < cost.seconds < cost.training
    assert cost.state > 1000
    assert cost.replay == 0
