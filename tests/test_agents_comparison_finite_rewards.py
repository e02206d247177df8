"""agents.comparison.finite_rewards: a reward that is not finite is told by what gave it, wherever robots get any."""

import math

import numpy as np
import pytest
import torch

from caster_gym.agents.comparison.evaluation import roll_out
from caster_gym.agents.comparison.finite_rewards import check_rewards
from caster_gym.agents.learning.sb3_environment import SB3VecEnv
from caster_gym.agents.learning.settings import SHACSettings
from caster_gym.agents.learning.shac import ShortHorizon
from caster_gym.configuration import parse
from caster_gym.envs.report import REPORT_ROWS
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.own_errors import OwnCodeError
from caster_gym.tasks.track import TASK
from caster_gym.tasks.track.environment import CasterTrackVectorEnv

TERM = TASK.terms._fields[1]
SAID = (
    rf"the reward term {TERM!r} of task 'track' \(.*reward\.py, line \d+\) was nan in a step: it must always be finite"
)


def spoilt_batch(mode):
    """Robots of which the second gets a term that is not a number."""
    batch = CasterTrackVectorEnv(3, path={"shape": "circle", "radius": 0.5}, autoreset_mode=mode)
    step = batch.step

    def spoilt(actions):
        observations, rewards, terminated, truncated, infos = step(actions)
        rewards, infos["reward_terms"] = rewards.copy(), {**infos["reward_terms"], TERM: np.array([0.0, math.nan, 0.0])}
        rewards[1] = math.nan
        return observations, rewards, terminated, truncated, infos

    batch.step = spoilt  # type: ignore[method-assign]
    return batch


class Still:
    name = "still"

    def act(self, observations):
        return np.zeros((len(observations), 6), dtype=np.float32)


def test_learning_on_arrays_stops_at_the_first_one():
    environment = SB3VecEnv(spoilt_batch("SameStep"))
    environment.reset()
    with pytest.raises(OwnCodeError, match=SAID):
        environment.step(np.zeros((3, 6), dtype=np.float32))


def test_episodes_of_an_evaluation_stop_at_the_first_one():
    with pytest.raises(OwnCodeError, match=SAID):
        roll_out(Still(), spoilt_batch("NextStep"), seed=0)


def test_learning_on_tensors_stops_at_the_first_one():
    task = TorchTask("track", path={"shape": "circle", "radius": 0.5})
    settings = {"algorithm": "shac", "n_timesteps": 18, "n_envs": 3, "n_steps": 2, "batch_size": 6, "net_arch": (8,)}
    learner = ShortHorizon(task, parse(SHACSettings, {**settings, "compile": False}, "agent"), 0)
    step = task.step

    def spoilt(state, actions, wrench=None):
        state, outcome = step(state, actions, wrench)
        report = outcome.report.clone()
        report[REPORT_ROWS + 1, 1] = math.nan
        return state, outcome._replace(report=report, rewards=outcome.rewards * math.nan)

    task.step = spoilt  # type: ignore[method-assign]
    with pytest.raises(OwnCodeError, match=SAID):
        learner.improve(0.0)


@pytest.mark.parametrize(
    ("infos", "said"),
    [
        (
            {"reward_terms": {"shaped": np.array([math.inf])}},
            "the reward term 'shaped' of the features was inf in a step",
        ),
        ({"final_info": {"reward_terms": {TERM: torch.tensor([math.nan])}}}, SAID),
        ({}, r"a reward of task 'track' \(.*reward\.py, line \d+\) was -inf in a step: it must always be finite"),
    ],
)
def test_what_gave_a_reward_is_told_as_far_as_it_is_known(infos, said):
    with pytest.raises(OwnCodeError, match=said):
        check_rewards(TASK, torch.tensor([1.0, -math.inf]), lambda: infos)


def test_finite_rewards_need_no_infos():
    def tell():
        raise AssertionError

    check_rewards(TASK, np.array([1.0, -2.0]), tell)
    check_rewards(TASK, torch.tensor([1.0, -2.0]), tell)
