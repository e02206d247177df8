"""caster_gym.wrappers.rewards: shaping that changes no optimal policy, and terms that add up."""

import itertools
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import (
    Effort,
    Impact,
    Potential,
    Pushes,
    Smoothness,
    Tolerance,
    TractionUse,
    read_features,
    wrap,
)
from caster_gym.wrappers.rewards import Shape, falloff, shaping

PATH = {"shape": "circle", "radius": 0.5}
ROBOT = load_robot("chung2008")
LIMITS = np.array([motor.max_torque for caster in ROBOT.casters for motor in (caster.roll, caster.steer)])
DISCOUNT = 0.9
NEAR: dict[str, Any] = {"quantity": "position_error", "margin": 0.4}
TERMS = (
    Potential(**NEAR, discount=0.97, weight=3.0),
    Tolerance(quantity="heading_error", bounds=(-0.1, 0.1), margin=0.2, weight=0.3),
    Effort(weight=0.05),
    Smoothness(weight=0.1),
    TractionUse(weight=0.2, threshold=0.0),
)


def batch(*features, count=6, **task):
    return wrap(CasterTrackVectorEnv(count, path=PATH, **task), *features)


def actions(steps, count, size=1.0, seed=0):
    return (size * np.random.default_rng(seed).uniform(-1.0, 1.0, (steps, count, 6))).astype(np.float32)


def episode(env, size):
    """Terms and infos of one episode of one robot, its reset first, and whether it failed."""
    _, info = env.reset(seed=1)
    told = [(0.0, info)]
    for action in actions(2000, 1, size)[:, 0]:
        _, reward, terminated, truncated, info = env.step(action)
        told.append((reward, info))
        if terminated or truncated:
            return told, terminated
    raise AssertionError("the episode did not end")


@pytest.mark.parametrize("size", [0.0, 1.0])
def test_shaping_telescopes(size):
    """Σ γᵗ F_t = γᵀ Φ_T − Φ_0, where Φ_T is zero after failure and that of the last state after the time is over."""
    path = {"shape": "circle", "radius": 0.05, "duration": 4.0}
    feature = Potential(**NEAR, discount=DISCOUNT, weight=3.0)
    env = wrap(CasterTrackEnv(path=path, corridor=0.3 if size else 5.0), feature)
    told, failed = episode(env, size)
    assert failed == bool(size)
    terms = [info["reward_terms"]["potential_position_error"] for _, info in told[1:]]
    potentials = [3.0 * max(0.0, 1.0 - info["position_error"] / 0.4) for _, info in told]
    last = 0.0 if failed else potentials[-1]
    assert potentials[-1] > 0.1
    discounted = np.dot(DISCOUNT ** np.arange(len(terms)), terms)
    assert_allclose(
        discounted, DISCOUNT ** len(terms) * last - potentials[0], atol=1e-12
    )  # round-off of sums of order 1


class Rail:
    """A cart of places and speeds on a grid is pushed left, not at all, or right; beyond the ends it fails."""

    places, speeds, pushes = np.arange(-6, 7), np.arange(-3, 4), (-1, 0, 1)

    def transitions(self):
        """Next place and speed, failure and reward of every state and push."""
        place, speed, push = np.meshgrid(self.places, self.speeds, self.pushes, indexing="ij")
        faster = np.clip(speed + push, -3, 3)
        after = place + faster
        failed = np.abs(after) > 6
        reward = np.where(failed, 0.0, 1.0 / (1.0 + after**2) - 0.3 * np.abs(push))
        return np.clip(after, -6, 6) + 6, faster + 3, failed, reward

    def greedy(self, added):
        """Which pushes are best in every state, by value iteration."""
        place, speed, failed, reward = self.transitions()
        values = np.zeros((13, 7))
        for _ in range(600):  # 0.9^600 = 3e-28
            worth = reward + added + DISCOUNT * np.where(failed, 0.0, values[place, speed])
            values = worth.max(axis=-1)
        return worth >= worth.max(axis=-1, keepdims=True) - 1e-9


def test_a_potential_changes_no_optimal_policy():
    """Ng, Harada and Russell (1999); a bonus that is no difference of potentials does change it."""
    rail = Rail()
    place, speed, failed, reward = rail.transitions()
    plain = rail.greedy(np.zeros_like(reward))
    rng = np.random.default_rng(0)
    for potential in (rng.normal(size=(13, 7)), np.tile(5.0 * rail.places[:, None], (1, 7))):
        before = np.broadcast_to(potential[:, :, None], reward.shape)
        assert_array_equal(rail.greedy(shaping(before, potential[place, speed], DISCOUNT, failed)), plain)
    bonus = potential[place, speed]
    assert (rail.greedy(bonus) != plain).mean() > 0.1


@pytest.mark.parametrize("size", [0.2, 1.0])
def test_terms_add_up_to_the_reward(size):
    """To the last bit, and the task's own reward is that of the environment without features."""
    env, plain = wrap(CasterTrackEnv(path=PATH), *TERMS), CasterTrackEnv(path=PATH)
    plain.reset(seed=1)
    told, _ = episode(env, size)
    assert told[0][1]["task_reward"] == 0.0
    assert set(told[0][1]["reward_terms"]) >= {"potential_position_error", "tolerance_heading_error", "extra_effort"}
    for (reward, info), action in zip(told[1:], actions(2000, 1, size)[:, 0], strict=False):
        _, task_reward, _, _, plain_info = plain.step(action)
        assert info["task_reward"] == task_reward
        assert {name: info["reward_terms"][name] for name in plain_info["reward_terms"]} == plain_info["reward_terms"]
        assert reward == sum(info["reward_terms"].values())
        added = set(info["reward_terms"]) - set(plain_info["reward_terms"])
        assert len(added) == len(TERMS)


def test_torque_terms_are_those_of_the_torques():
    env = batch(Effort(weight=0.5), Smoothness(weight=2.0), TractionUse(weight=3.0, threshold=0.2), corridor=50.0)
    env.reset(seed=0)
    last = np.zeros((6, 6))
    excesses = []
    for given in actions(40, 6, 0.4):
        info = env.step(given)[4]
        terms, shares = info["reward_terms"], info["torque"] / LIMITS
        excess = info["traction_use"] - 0.2
        assert_allclose(terms["extra_effort"], -0.5 * (shares**2).mean(axis=1), rtol=1e-12)
        assert_allclose(terms["smoothness"], -2.0 * ((shares - last) ** 2).mean(axis=1), rtol=1e-12)
        assert_allclose(terms["traction"], -3.0 * np.clip(excess, 0.0, 1.0), rtol=1e-12)
        last = shares
        excesses.append(excess)
    assert (np.array(excesses) < 0.0).any()
    assert ((np.array(excesses) > 0.0) & (np.array(excesses) < 1.0)).any()


def test_impacts_cost_by_their_impulse():
    """Robots are pushed around in a small room."""
    walls = {"room": [[-0.8, -0.8], [0.8, 0.8]]}
    pushes, impact = Pushes(rate=5.0, force=(10.0, 30.0)), Impact(weight=3.0)
    env = batch(pushes, impact, count=50, corridor=10.0, arena=walls)
    env.reset(seed=0)
    impacts = 0
    for given in actions(80, 50, 0.1):
        info = env.step(given)[4]
        assert_array_equal(info["reward_terms"]["extra_impact"], -3.0 * info["normal_impulse"])
        impacts += (info["normal_impulse"] > 0.0).sum()
    assert impacts > 20


def test_clearance_can_be_kept():
    """Near a wall it is worth less; without obstacles there is all the room in the world."""
    feature = Tolerance(quantity="clearance", bounds=(0.5, None), margin=0.5, shape="linear", value_at_margin=0.0)
    for arena in (None, {"room": [[-0.9, -0.9], [0.9, 0.9]]}):
        env = batch(feature, corridor=10.0, arena=arena)
        env.reset(seed=0)
        info = env.step(actions(1, 6)[0])[4]
        clearance = info["clearance"]
        assert np.isfinite(clearance).all() == (arena is not None)
        assert_allclose(info["reward_terms"]["tolerance_clearance"], np.minimum(clearance / 0.5, 1.0), rtol=1e-12)


@pytest.mark.parametrize("shape", ["gaussian", "long_tail", "linear", "quadratic"])
def test_worth_is_one_within_bounds_and_falls_to_its_value_at_the_margin(shape):
    values = np.array([-5.0, 0.5, 1.0, 2.0, 3.0, 3.5, 5.0, np.nan, np.inf])
    term = Tolerance(quantity="power", bounds=(1.0, 3.0), margin=2.0, value_at_margin=0.2, shape=shape)
    worth = term.falloff(values)
    assert_array_equal(worth[2:5], 1.0)
    assert_allclose(worth[6], 0.2, rtol=1e-12)
    assert worth[1] == worth[5]  # both 0.5 outside
    assert 0.2 < worth[5] < 1.0
    assert_array_equal(worth[7:], 0.0)
    outside = falloff(np.linspace(0.0, 5.0, 500), 0.2, shape)
    assert (np.diff(outside) <= 0.0).all()
    assert outside.min() >= 0.0


def test_halfway_to_the_margin():
    """By hand: 0.2^(1/4), 1 / (1 + 4/4), 1 − 0.8/2, 1 − 0.8/4."""
    half = np.array([0.5])
    expected: dict[Shape, float] = {"gaussian": 0.2**0.25, "long_tail": 0.5, "linear": 0.6, "quadratic": 0.8}
    for shape, value in expected.items():
        assert_allclose(falloff(half, 0.2, shape), value, rtol=1e-12)


def test_bounds_may_be_open_and_margins_sharp():
    values = np.array([-1.0, 0.29, 0.3, 1e9, np.inf])
    sharp = Tolerance(quantity="clearance", bounds=(0.3, None))
    assert_array_equal(sharp.falloff(values), [0.0, 0.0, 1.0, 1.0, 1.0])
    below = Tolerance(quantity="clearance", bounds=(None, 0.3), margin=0.1, shape="linear", value_at_margin=0.0)
    assert_allclose(below.falloff(values[:3]), 1.0)
    assert_array_equal(below.falloff(values[3:]), 0.0)


def test_rewards_stay_finite_when_a_state_does_not():
    env = batch(*TERMS, count=2)
    env.reset(seed=0)
    states = env.unwrapped.engine.states
    states[1, 5] = np.nan
    env.unwrapped.engine.states = states
    _, rewards, terminated, _, info = env.step(actions(1, 2)[0])
    assert terminated.tolist() == [False, True]
    assert np.isfinite(rewards).all()
    assert all(np.isfinite(term).all() for name, term in info["reward_terms"].items() if name[0] != "_")


@pytest.mark.parametrize(
    ("feature", "message"),
    [
        ({"kind": "potential", **NEAR}, "'discount' is missing"),
        ({"kind": "potential", "quantity": "position_error", "discount": 0.9}, "'margin' is missing"),
        ({"kind": "potential", **NEAR, "discount": 1.1}, "'discount' should be less than or equal to 1"),
        ({"kind": "potential", **NEAR, "discount": 0.9, "quantity": "power"}, "depend on the state alone.*got 'power'"),
        ({"kind": "tolerance"}, "'quantity' is missing"),
        ({"kind": "tolerance", **NEAR, "bounds": [2, 1]}, "bounds must rise from the first to the second"),
        ({"kind": "tolerance", **NEAR, "value_at_margin": 0}, "never reaches a value_at_margin of 0"),
        ({"kind": "tolerance", **NEAR, "shape": "flat"}, "'shape'.*'gaussian', 'long_tail', 'linear' or 'quadratic'"),
        ({"kind": "smoothness", "weight": -1}, "'weight' should be greater than or equal to 0"),
    ],
)
def test_wrong_numbers_are_refused(feature, message):
    with pytest.raises(ConfigurationError, match=message):
        read_features([feature])


@pytest.mark.parametrize(
    ("features", "message"),
    [
        ([Tolerance(quantity="postion_error")], "no quantity 'postion_error' here; did you mean 'position_error'"),
        ([Tolerance(quantity="torque")], "needs a quantity of one number, 'torque' has 6"),
    ],
)
def test_what_the_task_does_not_offer_is_refused_at_the_first_reset(features, message):
    for env in (batch(*features), wrap(CasterTrackEnv(path=PATH), *features)):
        with pytest.raises(ConfigurationError, match=message):
            env.reset(seed=0)


def test_two_terms_need_two_names():
    for name in ("effort", "position"):
        with pytest.raises(ValueError, match=f"the task has a reward term '{name}' of its own: give yours another"):
            batch(Effort(name=name))
    with pytest.raises(ValueError, match="the reward term 'smoothness' is there twice"):
        batch(Smoothness(), Smoothness())
    names = [f"tolerance_{i}" for i in range(2)]
    env = batch(
        *(Tolerance(quantity="power", bounds=(None, limit), name=n) for limit, n in zip((1, 2), names, strict=True))
    )
    _, info = env.reset(seed=0)
    assert all(name in info["reward_terms"] for name in itertools.chain(names, (f"_{name}" for name in names)))
