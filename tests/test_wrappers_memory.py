"""caster_gym.wrappers.memory: what features remember is saved and comes back, whatever they are."""

import copy
import subprocess
import sys
from collections import deque
from typing import Any, ClassVar, get_args

import gymnasium as gym
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_array_equal

from caster_gym import wrappers
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.wrappers import Feature, FeatureEnv, SensorNoise, read_features, wrap
from caster_gym.wrappers.feature import Place, Runtime
from tests.test_states import AFTER, BEFORE, TASK, assert_same, ends, go_on

REDEFINING = ("residual_torque", "twist_commands", "joint_speeds")


class Follower:
    """An agent that pushes towards the reference."""

    def act(self, observations):
        return np.clip(0.2 * observations[:, :6], -1.0, 1.0)


def settings(kind, rng):
    """A feature of a kind with random settings."""
    low, high = np.sort(rng.uniform(0.0, 1.0, 2))
    fields: dict[str, Any] = {
        "action_delay": {"periods": [0, int(rng.integers(1, 5))]},
        "dropped_packets": {"probability": high},
        "effort": {"weight": high},
        "friction": {"added_viscous": [1e-3 * low, 1e-3 * high], "floor_friction": [0.3, 0.9]},
        "history": {"observations": int(rng.integers(0, 3)), "actions": int(rng.integers(0, 4))},
        "impact": {"weight": high},
        "joint_speeds": {"bandwidth": 50.0 * high},
        "motor_failure": {"after": [0.0, 0.4 * high]},
        "motor_lag": {"time_constant": [0.1 * low, 0.1 * high]},
        "odometry": {},
        "payload": {"mass": [2.0 * low, 2.0 * high], "x": [-0.05, 0.05]},
        "potential": {"quantity": "position_error", "margin": 0.5, "discount": high},
        "pushes": {"rate": 10.0 * high, "force": [5.0 * low, 5.0 * high], "duration": 0.2},
        "residual_torque": {"agent": Follower(), "share": high},
        "sensor_noise": {"position": 0.01 * high, "heading": 0.02, "speed_bias": 0.1 * low, "joint_rate": high},
        "smoothness": {"weight": high},
        "steering_offset": {"angle": [-0.1 * high, 0.1 * high]},
        "tolerance": {"quantity": "heading_error", "bounds": [-0.1 * high, 0.1 * high], "margin": 0.3},
        "traction_use": {"threshold": 0.5 * low},
        "twist_commands": {"bandwidth": 20.0 * high, "frame": "body"},
        "wheel_errors": {"trail": [-0.002, 0.002], "radius": [-1e-3 * high, 1e-3 * high]},
    }[kind]
    classes = {get_args(one.model_fields["kind"].annotation)[0]: one for one in features()}
    return classes[kind](**fields)


def features():
    """All kinds of features that the package offers."""
    return [one for one in vars(wrappers).values() if "kind" in getattr(one, "model_fields", {})]


KINDS = sorted(get_args(one.model_fields["kind"].annotation)[0] for one in features())
ALONE = [(kind,) for kind in KINDS]
TOGETHER = [
    (*(kind for kind in KINDS if kind not in (*REDEFINING, "history") or kind == one), "history") for one in REDEFINING
]


def made(kinds, mode=None, seed=0):
    rng = np.random.default_rng(seed)
    chosen = [settings(kind, rng) for kind in kinds]
    if mode is None:
        return wrap(gym.make("caster_gym:CasterTrack-v0", max_episode_steps=20, **TASK), *chosen)
    return wrap(CasterTrackVectorEnv(5, autoreset_mode=mode, max_episode_steps=20, **TASK), *chosen)


@pytest.mark.parametrize(
    ("kinds", "mode"),
    [
        *((kinds, mode) for kinds in [(), *ALONE] for mode in (None, AutoresetMode.SAME_STEP)),
        *((kinds, mode) for kinds in TOGETHER for mode in (None, *AutoresetMode)),
    ],
)
def test_fresh_features_go_on_from_a_state(kinds, mode):
    env, other = made(kinds, mode), made(kinds, mode)
    env.reset(seed=3)
    go_on(env, 1, BEFORE)
    state = {name: array.copy() for name, array in env.get_state().items()}
    expected = go_on(env, 2, AFTER)
    other.set_state(state)
    assert_same(go_on(other, 2, AFTER), expected)
    assert ends(expected) >= 2
    assert_array_equal(other.action_space.sample(), env.action_space.sample())


CHILD = """
import sys, numpy as np
from gymnasium.vector import AutoresetMode
from tests.test_states import go_on
from tests.test_wrappers_memory import TOGETHER, made
env = made(TOGETHER[1], AutoresetMode.SAME_STEP)
env.set_state(dict(np.load(sys.argv[1])))
brought = go_on(env, 2, 60)
np.savez(sys.argv[2], observations=np.stack([step[0] for step in brought]), rewards=np.stack([s[1] for s in brought]))
"""


@pytest.mark.slow
def test_another_process_goes_on_from_a_state(tmp_path):
    env = made(TOGETHER[1], AutoresetMode.SAME_STEP)
    env.reset(seed=3)
    go_on(env, 1, BEFORE)
    np.savez(tmp_path / "state.npz", **env.get_state())
    subprocess.run([sys.executable, "-c", CHILD, tmp_path / "state.npz", tmp_path / "brought.npz"], check=True)
    expected, brought = go_on(env, 2, AFTER), np.load(tmp_path / "brought.npz")
    assert_array_equal(brought["observations"], np.stack([step[0] for step in expected]))
    assert_array_equal(brought["rewards"], np.stack([step[1] for step in expected]))


def test_features_of_another_kind_order_or_setting_are_refused():
    effort, delay = read_features([{"kind": "effort", "weight": 0.5}, "action_delay"])
    batch = wrap(CasterTrackVectorEnv(2, **TASK), effort, delay)
    before = batch.get_state()
    others = {
        r"features\.0\.feature is 'ActionDelay', and here it is 'Effort'": (delay, effort),
        r"features\.0\.weight is 0\.02, and here it is 0\.5": read_features(["effort", "action_delay"]),
        r"its features is \[\{'feature': 'Effort'": (effort,),
    }
    for message, features in others.items():
        with pytest.raises(ValueError, match=message):
            batch.set_state(wrap(CasterTrackVectorEnv(2, **TASK), *features).get_state())
    with pytest.raises(ValueError, match="'Delay' lacks '_next'"):
        batch.set_state({name: array for name, array in before.items() if not name.endswith("_next")})
    with pytest.raises(ValueError, match="number of robots is 3, and here it is 2"):
        batch.set_state(wrap(CasterTrackVectorEnv(3, **TASK), effort, delay).get_state())
    assert_same(batch.get_state(), before)


class Recall(Feature):
    """Shows observations of a few periods ago, by many kinds of attributes."""

    kind: ClassVar[str] = "recall"

    def runtime(self, place: Place) -> Runtime:
        return RecallRuntime(place)


class RecallRuntime(Runtime):
    def __init__(self, place: Place) -> None:
        self.place, self.seeds, self.clocks = place, place.seeds, place.clocks  # of which two are the stack's
        self.queue: deque[Any] = deque(maxlen=3)
        self.last: Any = None
        self.generator = np.random.default_rng(0)
        self.totals: dict[str, float] = {"seen": 0, "drawn": 0.0}
        self.pair: tuple[Any, ...] = (np.zeros(place.count), "constant", [1, "two"])

    def observe(self, observations, robots):
        if isinstance(robots, slice):
            self.queue.append(observations.copy())
            self.last = observations[:, 0].copy()
            self.totals["seen"] += 1
            self.totals["drawn"] += float(self.generator.uniform())
            self.pair[0][:] += self.seeds % 7 + self.clocks
            self.pair[2][0] += 1
        shown = (self.queue[0] if self.queue else observations)[robots if len(self.queue) else slice(None)].copy()
        shown[:, 0] = self.totals["drawn"] + self.totals["seen"] + (0.0 if self.last is None else self.last[robots])
        shown[:, 1] = self.pair[0][robots] + self.pair[2][0]
        return shown


def test_a_users_own_feature_needs_to_write_nothing():
    env, other = (wrap(CasterTrackVectorEnv(5, max_episode_steps=20, **TASK), Recall(), SensorNoise()) for _ in "ab")
    env.reset(seed=3)
    begun = env.get_state()
    first = go_on(env, 1, BEFORE)
    state = env.get_state()
    expected = go_on(env, 2, AFTER)
    other.set_state(state)
    assert_same(go_on(other, 2, AFTER), expected)
    other.set_state(begun)  # when nothing had been seen yet
    assert_same(go_on(other, 1, BEFORE), first)


def test_what_cannot_be_saved_is_told():
    class Odd(Feature):
        def runtime(self, place: Place) -> Runtime:
            runtime = Runtime()
            runtime.seen = {1, 2}  # type: ignore[attr-defined]
            return runtime

    batch = wrap(CasterTrackVectorEnv(2, **TASK), Odd())
    with pytest.raises(TypeError, match=r"'Runtime' keeps 'seen', a set, whose state cannot be saved: keep arrays"):
        batch.get_state()


def test_a_time_limit_inside_is_part_of_the_state():
    env, other = made(("effort",)), made(("effort",))
    env.reset(seed=1)
    for _ in range(15):
        env.step(np.zeros(6, np.float32))
    other.set_state(env.get_state())
    truncated = [other.step(np.zeros(6, np.float32))[3] for _ in range(5)]
    assert isinstance(other, FeatureEnv)
    assert truncated == [False, False, False, False, True]
    assert copy.copy(other).get_state().keys() == other.get_state().keys()
