"""agents.learning.settings: what does not fit together is refused, with advice that helps."""

import pytest

from caster_gym.agents.learning.settings import LinearSchedule, PPOSettings, SACSettings, SHACSettings, scheduled
from caster_gym.agents.registry import read_agent
from caster_gym.configuration import ConfigurationError, parse


def test_a_batch_must_fit_into_what_is_collected():
    PPOSettings(algorithm="ppo", n_envs=4, n_steps=8, batch_size=32)
    with pytest.raises(ConfigurationError, match="'batch_size' must be at most n_envs · n_steps = 32 steps, got 33"):
        parse(PPOSettings, {"algorithm": "ppo", "n_envs": 4, "n_steps": 8, "batch_size": 33}, "ppo")


@pytest.mark.parametrize(
    ("agent", "wrong", "advised"),
    [
        ("ppo", {"n_envs": 4}, {"n_envs": 4, "batch_size": 512}),
        ("ppo", {"n_envs": 4}, {"n_envs": 16}),
        ("ppo", {"n_envs": 4}, {"n_envs": 4, "n_steps": 512}),
        ("ppo_gpu", {"batch_size": 1000}, {"batch_size": 512}),
        ("ppo_gpu", {"n_envs": 1, "n_steps": 127, "batch_size": 2}, {"n_envs": 1, "n_steps": 127, "batch_size": 127}),
        ("ppo", {"n_envs": 1, "n_steps": 1}, {"n_envs": 2048, "n_steps": 1}),
        ("shac", {"n_envs": 8}, {"n_envs": 8, "batch_size": 128}),
        ("shac", {"n_envs": 8}, {"n_envs": 8, "n_steps": 32}),
        ("sac", {"n_timesteps": 5000}, {"n_timesteps": 5000, "learning_starts": 4999}),
    ],
)
def test_advice_on_settings_that_do_not_fit_together_helps(agent, wrong, advised):
    """What is advised stands in the message, and is accepted."""
    with pytest.raises(ConfigurationError) as caught:
        read_agent(agent, wrong)
    for key, value in advised.items():
        if wrong.get(key) != value:
            assert key in str(caught.value)
            assert agent != "ppo_gpu" or str(value) in str(caught.value)  # the nearest that divides
    read_agent(agent, advised)


def test_a_schedule_goes_from_its_start_to_its_end():
    """As Stable-Baselines3 counts: the share of the training that remains goes from 1 to 0, and may end below."""
    schedule = LinearSchedule(start=3e-3, end=1e-3)
    assert [schedule.at(remaining) for remaining in (1.0, 0.5, 0.0, -0.1)] == pytest.approx([3e-3, 2e-3, 1e-3, 1e-3])
    ppo, constant = read_agent("ppo"), read_agent("ppo", {"learning_rate": 1e-4})
    assert isinstance(ppo, PPOSettings) and isinstance(constant, PPOSettings)
    falling = ppo.learning_rate
    assert [scheduled(falling, remaining) for remaining in (1.0, 0.25, 0.0)] == [7e-4, 0.25 * 7e-4, 0.0]
    assert [scheduled(constant.learning_rate, remaining) for remaining in (1.0, 0.1)] == [1e-4, 1e-4]
    changed = read_agent("shac", {"critic_learning_rate": {"start": 1e-2, "end": 1e-3}})
    assert isinstance(changed, SHACSettings)
    assert scheduled(changed.critic_learning_rate, 0.0) == pytest.approx(1e-3)


@pytest.mark.parametrize(
    ("content", "message"),
    [
        ({"learning_rate": "high"}, "'learning_rate' should be .*number.*got 'high'"),
        ({"learning_rate": -1e-3}, "'learning_rate' should be greater than 0 or .*, got -0.001"),
        ({"learning_rate": {"start": 1e-3, "stop": 0}}, r"unknown key 'learning_rate\.stop'; known are end, start"),
        ({"ent_coef": "much"}, "'ent_coef' must be a number, or begin with one .* as auto_0.05, got 'much'"),
        ({"ent_coef": "auto_-1"}, "'ent_coef' must be a number, or begin with one"),
        ({"ent_coef": 0}, "'ent_coef'.* greater than 0"),
    ],
)
def test_what_is_wrong_with_a_schedule_or_a_coefficient_is_named(content, message):
    with pytest.raises(ConfigurationError, match=message):
        read_agent("sac", content)


@pytest.mark.parametrize("coefficient", ["auto", "auto_0.1", 0.1])
def test_coefficients_of_the_entropy_are_those_of_stable_baselines(coefficient):
    settings = read_agent("sac", {"ent_coef": coefficient})
    assert isinstance(settings, SACSettings) and settings.ent_coef == coefficient
