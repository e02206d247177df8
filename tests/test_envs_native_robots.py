"""envs.native.robots: wrenches, parameters and episodes of each robot, and who learns which robots start."""

from typing import Any

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model
from caster_gym.mechanics.parameters import CasterParameters, PlatformParameters, pack_parameters, robot_parameters
from caster_gym.tasks.follow.environment import CasterFollowVectorEnv

CIRCLE = {"shape": "circle", "radius": 0.5}
EXACT_START: dict[str, Any] = {"start_offset": 0.0, "start_turn": 0.0}
FIELDS = PlatformParameters._fields + CasterParameters._fields * 3


def batch(count=5, **arguments):
    env = CasterFollowVectorEnv(count, path=CIRCLE, **{**EXACT_START, **arguments})
    env.reset(seed=0)
    return env


def test_a_wrench_pushes_the_robot():
    """v̇ by the model, from rest: after 1 ms the casters have hardly turned. It lasts until it is set again."""
    env = batch(control_period=1e-3, substeps=1)
    wrenches = np.random.default_rng(3).normal(0.0, 3.0, (5, 3)) * [1.0, 1.0, 0.1]
    wrenches[4] = 0.0
    env.engine.wrenches = wrenches
    assert_array_equal(env.engine.wrenches, wrenches)
    model = Model(env.robot)
    angles = np.arctan2(env.engine.states[:, 8::2], env.engine.states[:, 7::2])
    rates = model.forward_dynamics(angles, np.zeros((5, 3)), np.zeros((5, 6)), wrenches)
    env.step(np.zeros((5, 6), dtype=np.float32))
    # terms of second order: velocities of 1e-3 of accelerations up to 5 m/s² turn casters at 0.2 rad/s
    assert_allclose(env.engine.states[:, 4:7], 1e-3 * rates, rtol=0.0, atol=2e-2 * 1e-3 * np.abs(rates).max())
    assert_array_equal(env.engine.states[4, 4:7], np.zeros(3))
    env.step(np.zeros((5, 6), dtype=np.float32))
    assert (np.abs(env.engine.states[:4, 4:7]) > 1.5e-3 * np.abs(rates[:4])).any(axis=1).all()


def test_wrenches_of_another_shape_are_refused():
    with pytest.raises(ValueError, match=r"wrenches must have shape \(5, 3\), got \(3,\)"):
        batch().engine.wrenches = np.zeros(3)


def test_parameters_are_those_of_the_robot_until_they_are_set():
    env = batch()
    nominal = np.array(pack_parameters(robot_parameters(env.robot)))
    assert_array_equal(env.engine.parameters, np.tile(nominal, (5, 1)))


def test_set_parameters_change_only_the_selected_robots():
    """They move as the model does with a platform of thrice the mass, all others as where nothing was set."""
    env, plain = batch(), batch()
    before, rows = env.engine.states, env.engine.parameters[[1, 3]]
    rows[:, FIELDS.index("mass")] *= 3.0
    env.engine.set_parameters(np.array([1, 3]), rows)
    assert_array_equal(env.engine.parameters[[1, 3]], rows)
    actions = np.full((5, 6), 0.2, dtype=np.float32)
    infos = env.step(actions)[4]
    plain.step(actions)
    ours, theirs = env.engine.states, plain.engine.states
    assert_array_equal(ours[[0, 2, 4]], theirs[[0, 2, 4]])
    parameters = robot_parameters(env.robot)
    heavy = Model(env.robot, parameters=parameters._replace(platform=parameters.platform._replace(mass=15.0)))
    for robot in (1, 3):
        b = before[robot]
        start = np.array([*b[:2], np.arctan2(b[3], b[2]), *b[4:7], *np.arctan2(b[8::2], b[7::2])])
        end = heavy.simulate(start, infos["torque"][robot], env.task.time_step, env.task.substeps)[-1]
        assert_allclose(ours[robot, 4:7], end[3:6], rtol=0.0, atol=1e-10)  # rounding of motions of order 1 m/s
        assert np.abs(ours[robot, 4:7] - theirs[robot, 4:7]).max() > 1e-3


def test_parameters_of_another_shape_are_refused():
    engine = batch().engine
    width = engine.parameters.shape[1]
    with pytest.raises(ValueError, match=rf"rows must have shape \(2, {width}\), got \(1, {width}\)"):
        engine.set_parameters(np.array([0, 1]), engine.parameters[:1])


@pytest.mark.parametrize("mode", list(AutoresetMode))
def test_hooks_learn_which_robots_start(mode):
    """All at a reset, then each one whose episode has ended, once, at the step or the reset that starts it anew."""
    env = batch(autoreset_mode=mode)
    called = []
    env.engine.on_restart.append(lambda robots: called.append(robots.tolist()))
    env.reset(seed=1)
    assert called == [[0, 1, 2, 3, 4]]
    states = env.engine.states
    states[[1, 4], 0] += 1.0  # out of the corridor
    env.engine.states = states
    still = np.zeros((5, 6), dtype=np.float32)
    env.step(still)
    if mode is AutoresetMode.DISABLED:
        env.reset(options={"reset_mask": np.array([False, True, False, False, True])})
    env.step(still)
    env.step(still)
    assert called == [[0, 1, 2, 3, 4], [1, 4]]


def test_hooks_are_called_before_the_first_observation():
    """What they set is seen there: with a weaker motor, conditioning is another one."""
    env, plain = batch(), batch()
    rows = env.engine.parameters
    rows[:, FIELDS.index("roll_max_torque")] *= 0.5
    env.engine.on_restart.append(lambda robots: env.engine.set_parameters(robots, rows[robots]))
    _, ours = env.reset(seed=2)
    _, theirs = plain.reset(seed=2)
    assert (ours["conditioning"] != theirs["conditioning"]).all()


def test_episodes_count_from_the_seed():
    """Key and number of the coming episode: equal seeds, equal draws."""
    env, other = batch(), batch()
    seen = []
    env.engine.on_restart.append(lambda robots: seen.append(env.engine.episodes(robots)))
    env.reset(seed=7)
    env.reset()
    other.reset(seed=7)
    (keys, first), (same_keys, second) = seen
    assert_array_equal(keys, same_keys)
    assert len(set(keys.tolist())) == 5
    assert_array_equal(first, np.zeros(5))
    assert_array_equal(second, np.ones(5))
    after = other.engine.episodes(np.arange(5))
    assert_array_equal(after[0], keys)
    assert_array_equal(after[1], second)
