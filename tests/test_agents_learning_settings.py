"""agents.learning.settings: what does not fit together is refused, with advice that helps."""

import pytest

from caster_gym.agents.learning.settings import PPOSettings
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse


def test_a_batch_must_fit_into_what_is_collected():
    PPOSettings(algorithm="ppo", robots=4, horizon=8, batch=32)
    with pytest.raises(ConfigurationError, match="'batch' must be at most robots · horizon = 32 steps, got 33"):
        parse(PPOSettings, {"algorithm": "ppo", "robots": 4, "horizon": 8, "batch": 33}, "ppo")


@pytest.mark.parametrize(
    ("agent", "wrong", "advised"),
    [
        ("ppo", {"robots": 4}, {"robots": 4, "batch": 512}),
        ("ppo", {"robots": 4}, {"robots": 16}),
        ("ppo", {"robots": 4}, {"robots": 4, "horizon": 512}),
        ("ppo_gpu", {"batch": 1000}, {"batch": 512}),
        ("ppo_gpu", {"robots": 1, "horizon": 127, "batch": 2}, {"robots": 1, "horizon": 127, "batch": 127}),
        ("ppo", {"robots": 1, "horizon": 1}, {"robots": 2048, "horizon": 1}),
        ("shac", {"robots": 8}, {"robots": 8, "critic_batch": 128}),
        ("shac", {"robots": 8}, {"robots": 8, "window": 32}),
        ("sac", {"steps": 5000}, {"steps": 5000, "first_random": 4999}),
    ],
)
def test_advice_on_settings_that_do_not_fit_together_helps(agent, wrong, advised):
    """What is advised stands in the message, and is accepted."""
    with pytest.raises(ConfigurationError) as caught:
        read_agent(agent, wrong)
    words = {"robots": "more robots", "horizon": "longer horizon", "window": "longer window", "steps": "steps in all"}
    for key, value in advised.items():
        if wrong.get(key) != value:
            assert words.get(key, key) in str(caught.value)
            assert key in words or key == "first_random" or str(value) in str(caught.value)
    read_agent(agent, advised)
