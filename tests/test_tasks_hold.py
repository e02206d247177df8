"""caster_gym.tasks.hold: a pose is reached and held; single, batch and tensors agree; what is measured of it."""

from typing import Any

import gymnasium as gym
import numpy as np
import pytest
import torch
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.envs.tensor.task import TorchTask
from caster_gym.envs.tracking import Errors
from caster_gym.tasks.hold import TASK
from caster_gym.tasks.hold.environment import CasterHoldEnv, CasterHoldVectorEnv
from caster_gym.tasks.hold.metrics import HoldVerdict, measure
from caster_gym.tasks.hold.parameters import HoldParameters
from tests.cheats import Cheat, FullTorque, park, scores, spin
from tests.moments import NO_ERROR, terms_of, weights_of
from tests.series import PERIOD, STEPS, column, episodes

TARGET = (1.0, 0.5, 1.2)  # [m, m, rad]
POSE = (1.0, 0.5, np.cos(1.2), np.sin(1.2))
ROBOTS = 6


@pytest.fixture(scope="module")
def driven():
    """Computed torque on a batch: initial and final infos, rewards, and how many periods there were."""
    batch = CasterHoldVectorEnv(ROBOTS, target=TARGET)
    agent = ComputedTorque(batch.engine.layout, 10.0, batch.task.control_period)
    observations, first = batch.reset(seed=0)
    rewards, truncated = [], np.zeros(ROBOTS, dtype=np.bool_)
    while not truncated.any():
        observations, reward, terminated, truncated, info = batch.step(agent.act(observations))
        rewards.append(reward)
        assert not terminated.any()
    assert truncated.all()
    return batch, first, info, np.array(rewards)


def test_the_reference_is_the_pose_at_rest(driven):
    batch, first, last, rewards = driven
    for info in (first, last):
        assert_allclose(info["reference_pose"], [POSE] * ROBOTS, rtol=0.0, atol=1e-15)
    assert len(rewards) == 200  # 4 s of 20 ms
    assert not batch.engine.plan.source.samples[:, 4:].any()


def test_starts_are_drawn_in_the_area_around_the_pose(driven):
    """On all sides of it, and turned both ways."""
    _, first, _, _ = driven
    x, y = (first["pose"][:, :2] - TARGET[:2]).T
    away = np.stack([POSE[2] * x + POSE[3] * y, POSE[2] * y - POSE[3] * x])  # along the axes of the pose
    assert np.abs(away).max() <= 0.3
    assert (away.min(axis=1) < 0.0).all()
    assert (away.max(axis=1) > 0.0).all()
    assert np.abs(first["heading_error"]).max() <= 1.0
    assert first["heading_error"].min() < 0.0 < first["heading_error"].max()


def test_computed_torque_reaches_the_pose_and_stays(driven):
    """Poles of 10 rad/s leave e^-40 of the start after 4 s; what is left is rounding of positions of 1 m."""
    _, _, last, rewards = driven
    assert_allclose(last["position_error"], 0.0, atol=1e-9)
    assert_allclose(last["heading_error"], 0.0, atol=1e-9)
    assert_allclose(rewards[-1], 1.02, atol=1e-9)


def test_without_a_target_poses_are_the_ends_of_paths():
    """Each episode has that of its own path."""
    env = CasterHoldEnv(path=[[[0.0, 0.0, 0.0], [1.0, 0.5, 1.2]], [[0.0, 0.0, 0.0], [0.5, -1.0, 0.0]]])
    for path, pose in enumerate((POSE, (0.5, -1.0, 1.0, 0.0))):
        _, info = env.reset(options={"path": path})
        assert_allclose(info["reference_pose"], pose, rtol=0.0, atol=1e-12)  # rounding of the spline


def test_a_pose_has_no_place_along_it():
    env = CasterHoldEnv(target=TARGET)
    for name in ("time", "progress"):
        with pytest.raises(ValueError, match=f"reset knows no option '{name}'"):
            env.reset(options={name: 0.5})
    _, info = env.reset(seed=0, options={"pose": [0.9, 0.5, 0.0]})
    assert info["position_error"] == pytest.approx(0.1, abs=1e-12)
    with pytest.raises(ValueError, match="outside the corridor of 1 m"):
        env.reset(options={"pose": [3.0, 0.5, 0.0]})


def test_a_batch_is_equal_to_single_environments_bit_for_bit():
    """Across the ends of episodes, which last for 0.2 s here."""
    how: dict[str, Any] = {"target": TARGET, "duration": 0.2}
    batch = CasterHoldVectorEnv(3, autoreset_mode=AutoresetMode.SAME_STEP, **how)
    singles = [CasterHoldEnv(**how) for _ in range(3)]
    seen, _ = batch.reset(seed=7)
    assert_array_equal(seen, [env.reset(seed=7 + i)[0] for i, env in enumerate(singles)])
    rng = np.random.default_rng(1)
    for _ in range(25):
        actions = rng.uniform(-1.0, 1.0, (3, 6)).astype(np.float32)
        seen, rewards, _, truncated, _ = batch.step(actions)
        for i, env in enumerate(singles):
            alone, reward, _, over, _ = env.step(actions[i])
            alone = env.reset()[0] if over else alone
            assert_array_equal(seen[i], alone)
            assert (rewards[i], truncated[i]) == (reward, over)


def test_tensors_do_the_same():
    """In double precision, up to rounding of 100 steps; observations in single precision."""
    batch = CasterHoldVectorEnv(4, target=TARGET, arena={"room": [[-1.0, -1.0], [3.0, 3.0]]})
    task = TorchTask("hold", arena={"room": [[-1.0, -1.0], [3.0, 3.0]]}, target=TARGET, dtype=torch.float64)
    seen, _ = batch.reset(seed=2)
    keys = torch.tensor([int(gym.utils.seeding.np_random(2 + i)[0].integers(2**63)) for i in range(4)])
    state, outcome = task.begin(keys)
    assert_allclose(outcome.observations, seen, atol=1e-6)
    rng = np.random.default_rng(0)
    for _ in range(25):
        actions = rng.uniform(-1.0, 1.0, (4, 6)).astype(np.float32)
        seen, rewards, *_ = batch.step(actions)
        state, outcome = task.step(state, torch.as_tensor(actions))
        assert_allclose(outcome.observations, seen, atol=1e-5)
        assert_allclose(outcome.rewards, rewards, atol=1e-9)


def test_the_environment_keeps_gymnasiums_contract():
    check_env(CasterHoldEnv(target=TARGET, render_mode="rgb_array"), skip_render_check=True)


@pytest.mark.parametrize("drive", [park, spin])
def test_no_cheat_earns_what_computed_torque_earns(driven, drive):
    batch, _, _, rewards = driven
    cheat = Cheat(batch.engine.layout, batch.task.control_period, drive)
    assert (scores(cheat, batch, 0) < 0.7 * rewards.sum(axis=0)).all()
    assert (scores(FullTorque(6), batch, 0) < 0.5 * rewards.sum(axis=0)).all()


WEIGHTS = weights_of(TASK, impact_weight=0.3)


def test_terms_are_what_the_documentation_says():
    def k(e, scale):
        return 0.5 / (1.0 + (e / scale) ** 2) + 0.5 / (1.0 + (e / (30.0 * scale)) ** 2)

    rng = np.random.default_rng(3)
    for _ in range(300):
        x, y, vx, vy, omega = 10.0 ** rng.uniform(-4.0, 1.0, 5) * rng.choice((-1.0, 1.0), 5)
        turn, effort, pressing = rng.uniform(-np.pi, np.pi), rng.uniform(), rng.uniform(0.0, 3.0)
        near, turned = k(np.hypot(x, y), 0.01), k(2.0 * np.sin(0.5 * turn), 0.02)
        expected = {
            "position": 0.4 * near,
            "heading": 0.3 * turned,
            "rest": 0.3 * near * turned / (1.0 + (vx**2 + vy**2) / 0.05**2 + omega**2 / 0.2**2),
            "effort": -0.02 * effort,
            "impact": -0.3 * pressing / (pressing + 0.5),
            "alive": 0.32,
        }
        errors = Errors(x, y, np.cos(turn), np.sin(turn), vx, vy, omega)
        terms = terms_of(TASK, WEIGHTS, errors, effort=effort, pressing=pressing)._asdict()
        assert list(terms) == list(expected)
        # 1 − cos of a small heading error loses 1e-16, in units of the scale's square 4e-4
        assert_allclose(list(terms.values()), list(expected.values()), rtol=0.0, atol=1e-11)
        assert sum(terms.values()) >= 0.0


def test_holding_without_effort_is_worth_most():
    assert sum(terms_of(TASK, weights_of(TASK))) == pytest.approx(1.02, abs=1e-15)
    moving = NO_ERROR._replace(vx=0.05)
    assert terms_of(TASK, WEIGHTS, moving).rest == pytest.approx(0.15, abs=1e-15)


def held(*arguments, **changed):
    reference = np.broadcast_to([1.0, 0.0, 1.0, 0.0], (STEPS, 1, 4))
    return measure(episodes(*arguments, **{"reference": reference, **changed}), 2.0 * PERIOD)


def test_it_has_settled_once_it_stays_within_1_cm_and_1_degree():
    """Series begin after one control period; a visit in between does not count."""
    found = held(position_error=column(0.5, 0.009, 0.02, 0.009, 0.001, 0.0))
    assert found.settled.tolist() == [1.0]
    assert found.settling_time == pytest.approx([4 * PERIOD])
    turned = held(
        position_error=column(0.5, 0.0, 0.0, 0.0, 0.0, 0.0), heading_error=np.radians(column(9, 9, 9, 1.1, 0.9, -0.9))
    )
    assert turned.settling_time == pytest.approx([5 * PERIOD])
    assert held().settling_time == pytest.approx([PERIOD])


def test_who_leaves_again_or_fails_has_not_settled():
    for found in (held(position_error=column(0.5, 0.0, 0.0, 0.0, 0.0, 0.02)), held((3,))):
        assert found.settled.tolist() == [0.0]
        assert np.isnan(found.settling_time).all()


def test_steady_errors_are_those_after_settling():
    found = held(position_error=column(9, 9, 3, 4, 3, 4), heading_error=column(2, 2, 0.3, -0.4, 0.3, -0.4))
    assert found.steady_position == pytest.approx([np.sqrt(12.5)])
    assert found.steady_heading == pytest.approx([np.sqrt(0.125)])


def test_overshoot_is_the_way_beyond_the_pose():
    """Along the line from the start; sideways does not count, and who never gets there has none."""
    pose = np.zeros((STEPS, 1, 4))
    pose[:, 0, 0] = [0.0, 0.9, 1.2, 1.1, 1.0, 1.0]
    pose[:, 0, 1] = [0.0, 5.0, 5.0, 0.0, 0.0, 0.0]
    assert held(pose=pose).overshoot == pytest.approx([0.2])
    assert held(pose=0.5 * pose).overshoot.tolist() == [0.0]


def test_fewer_failures_are_better_then_settling_then_more_reward():
    first = HoldVerdict(1.0, 0.001, 1, 0, 0.8)
    assert first.merit > first._replace(failures=1, unsettled=0, reward=2.0).merit
    assert first.merit > first._replace(unsettled=2, reward=2.0).merit
    assert first._replace(reward=0.9, settling_time=2.0).merit > first.merit
    both = HoldVerdict.of(held((STEPS, 3), position_error=0.0, reference=np.ones((STEPS, 2, 4)), reward=1.0))
    assert (both.unsettled, both.failures, both.settling_time, both.reward) == (1, 1, PERIOD, 0.75)


def test_the_table_of_the_docstring_has_the_defaults():
    text, task = CasterHoldEnv.__doc__, HoldParameters()
    for words in (
        f"({task.coarse:g} ℓ)²",
        f"{task.position_weight:g} k(distance to the pose, {task.position_scale:g} m)",
        f"{task.heading_weight:g} k(chord of the heading error, {task.heading_scale:g})",
        f"{task.rest_weight:g} times both",
        f"(speed/{task.speed_scale:g} m/s)² + (yaw rate/{task.yaw_rate_scale:g} rad/s)²",
        f"corridor ({task.corridor:g} m)",
        f"({task.duration:g} s)",
        f"{task.start_offset:g} m along each of its axes and\n    {task.start_turn:g} rad",
    ):
        assert text is not None and words in text
