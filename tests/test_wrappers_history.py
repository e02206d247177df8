"""caster_gym.wrappers.history: what was seen and done before, behind what is seen now."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import ActionDelay, History, SensorNoise, Smoothness, wrap

COUNT, STEPS, LONGEST = 6, 40, 15
NOISE = SensorNoise(position=0.01, heading=0.02)


def drive(mode, *features):
    """Observations (steps + 1, robots, size), actions (steps, robots, width), and where episodes began."""
    env = wrap(
        CasterTrackVectorEnv(COUNT, path="lemniscate", corridor=100.0, autoreset_mode=mode, max_episode_steps=LONGEST),
        *features,
    )
    actions = np.random.default_rng(0).uniform(-1.4, 1.4, (STEPS, COUNT, 6)).astype(np.float32)
    seen, begun, ended = [env.reset(seed=4)[0]], [np.ones(COUNT, dtype=np.bool_)], np.zeros(COUNT, dtype=np.bool_)
    for action in actions:
        observations, _, terminated, truncated, _ = env.step(action)
        before, ended = ended, terminated | truncated
        seen.append(observations)
        begun.append(ended if mode is AutoresetMode.SAME_STEP else before)
    return np.array(seen), actions, np.array(begun)


@pytest.mark.parametrize("mode", [AutoresetMode.SAME_STEP, AutoresetMode.NEXT_STEP])
def test_it_shows_what_was_seen_and_done_in_the_same_episode(mode):
    shown, actions, begun = drive(mode, NOISE, History(observations=2, actions=3))
    plain, _, same = drive(mode, NOISE)
    assert_array_equal(begun, same)
    assert begun[1:].any()
    size = plain.shape[-1]
    assert shown.shape[-1] == 3 * size + 3 * 6
    assert_array_equal(shown[..., :size], plain)
    first = np.maximum.accumulate(np.where(begun, np.arange(STEPS + 1)[:, None], 0), axis=0)
    for robot in range(COUNT):
        for step in range(STEPS + 1):
            begin = first[step, robot]
            seen = [plain[max(step - back, begin), robot] for back in (1, 2)]
            done = [
                np.clip(actions[step - back, robot], -1.0, 1.0) if step - back >= begin else np.zeros(6, np.float32)
                for back in (1, 2, 3)
            ]
            assert_array_equal(shown[step, robot, size:], np.concatenate(seen + done), f"{robot}, {step}")


def test_the_space_holds_what_is_shown():
    env = wrap(CasterTrackVectorEnv(2, path="lemniscate"), History())
    observations, _ = env.reset(seed=0)
    assert env.observation_space.contains(observations)
    assert env.single_observation_space.shape == observations.shape[1:]


def test_only_reward_terms_may_follow():
    batch = CasterTrackVectorEnv(2, path="lemniscate")
    wrap(batch, NOISE, History(), Smoothness())
    with pytest.raises(ValueError, match="feature 'action_delay' must stand before 'history', which only reward terms"):
        wrap(CasterTrackVectorEnv(2, path="lemniscate"), History(), ActionDelay())
    wrap(CasterTrackVectorEnv(2, path="lemniscate"), History(observations=0, actions=0), ActionDelay())
