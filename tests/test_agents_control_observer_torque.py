"""caster_gym.agents.control.observer_torque: late actions, lags, noise and forces, and what is left of their errors."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents.comparison.evaluation import roll_out
from caster_gym.agents.control.beliefs import Beliefs, Prediction, Sensors
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.agents.control.observer_torque import ObserverTorque
from caster_gym.agents.control.reference_ahead import course_of
from caster_gym.configuration import ConfigurationError
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.tasks.track.metrics import measure
from caster_gym.wrappers import ActionDelay, DroppedPackets, MotorLag, SensorNoise, wrap

COUNT = 8
PERIOD = 0.02
PATHS = {"shape": "random_paths", "seed": 7, "count": COUNT, "duration": 4.0, "max_speed": 0.6}
LATE = (MotorLag(time_constant=0.02), ActionDelay(periods=2))
KNOWN = Prediction(delay=2, lag=0.02)
NOISE = {"position": 0.002, "heading": 0.004, "speed": 0.01, "yaw_rate": 0.02, "steering": 0.005}


NOTHING = Beliefs()


def make(*features: Any, beliefs: Beliefs = NOTHING, frequency: float = 20.0, **task: Any) -> Any:
    bare = CasterTrackVectorEnv(COUNT, path=PATHS, **task)
    return (wrap(bare, *features) if features else bare), ObserverTorque(bare.engine.layout, frequency, PERIOD, beliefs)


def drive(env: Any, agent: Any, steps: int) -> Any:
    """Observations, infos and what the agent saw, period by period."""
    observations, info = env.reset(seed=1, options={"path": np.arange(COUNT)})
    agent.reset(np.ones(COUNT, dtype=np.bool_))
    look, rows = agent.estimator.look, []

    def noted(seen: Any) -> Any:
        rows.append((seen, look(seen)))
        return rows[-1][1]

    agent.estimator.look = noted
    infos = [info]
    for _ in range(steps):
        observations, _, terminated, _, info = env.step(agent.act(observations))
        infos.append(info)
        assert not terminated.any()
    return rows, infos


def position_errors(env: Any, agent: Any, settling: float = 1.0) -> Any:
    return measure(roll_out(agent, env, seed=5), settling).position_rmse


def test_a_predicted_state_is_the_state_in_which_the_action_arrives():
    """After two periods of delay and with a lag, from rest on, while motors saturate at first."""
    env, agent = make(*LATE, beliefs=Beliefs(prediction=KNOWN))
    rows, _ = drive(env, agent, 60)
    layout = agent.layout
    for k in range(len(rows) - 2):
        foreseen, shown = rows[k][1], rows[k + 2][0]
        # single precision of what is observed; the reference's velocity is that of a polynomial
        assert_allclose(foreseen.twist, layout.physical(shown, "twist"), atol=1e-5)
        assert_allclose(foreseen.error[:, :2], layout.physical(shown, "position_error"), atol=1e-6)
        assert_allclose(foreseen.rate, layout.physical(shown, "twist_error"), atol=1e-4)
        c, s = np.cos(foreseen.steering), np.sin(foreseen.steering)
        directions = np.stack([c, s], axis=2).reshape(COUNT, -1)
        assert_allclose(directions, layout.physical(shown, "directions"), atol=1e-4)  # rad: fast casters


def test_the_course_of_the_reference_is_where_it_will_be():
    """(X1), (X2): 2 periods ahead within the first piece, 8 within the second."""
    env, agent = make(beliefs=Beliefs(prediction=KNOWN))
    rows, infos = drive(env, agent, 60)
    for ahead, exactness in ((2, 2e-6), (8, 2e-5)):  # [m], [rad] of a quartic up to 0.1 s and of a cubic up to 0.2 s
        for k in range(20, 50, 10):
            now, later = infos[k]["reference_pose"], infos[k + ahead]["reference_pose"]
            place = course_of(agent.layout, rows[k][0], 0.2).at(np.full(COUNT, ahead * PERIOD)).place
            turn = np.arctan2(later[:, 3], later[:, 2]) - np.arctan2(now[:, 3], now[:, 2])
            x, y = (later - now)[:, :2].T
            expected = [now[:, 2] * x + now[:, 3] * y, now[:, 2] * y - now[:, 3] * x]
            assert_allclose(place[:, :2].T, expected, atol=exactness)
            assert_allclose(np.sin(place[:, 2] - turn), 0.0, atol=exactness)


def test_late_actions_and_lags_cost_nothing_once_they_are_known():
    """(X10), against the same controller where nothing is late, and one that does not know."""
    late, agent = make(*LATE, beliefs=Beliefs(prediction=KNOWN))
    punctual, plain = make()
    ours, best = position_errors(late, agent), position_errors(punctual, plain)
    assert_allclose(np.median(ours / best), 1.0, atol=0.05)
    ignorant = ComputedTorque(agent.layout, 5.0, PERIOD)
    assert (position_errors(late, ignorant) > 50.0 * ours).all()


def test_without_delay_noise_and_forces_it_is_computed_torque():
    env, agent = make()
    mine = roll_out(agent, env, seed=5).torque
    theirs = roll_out(ComputedTorque(agent.layout, 20.0, PERIOD), env, seed=5).torque
    # jerk and rotations are worked out in another order
    assert_allclose(mine, theirs, atol=1e-5)  # [N m]


def test_an_observer_halves_what_noise_costs_with_calmer_torques():
    """(X8), (X11): at gains that suit each of them."""
    env, agent = make(SensorNoise.model_validate(NOISE), beliefs=Beliefs(sensors=Sensors(**NOISE), unmodelled=0.1))
    plain = ComputedTorque(agent.layout, 10.0, PERIOD)
    mine, theirs = (measure(roll_out(one, env, seed=5), 1.0) for one in (agent, plain))
    assert np.median(theirs.position_rmse / mine.position_rmse) > 2.0
    assert np.median(theirs.torque_variation / mine.torque_variation) > 5.0


def test_an_observer_bridges_observations_that_get_lost():
    """A fifth of them: it moves on by its model, where computed torque acts on a place that is 1 cm behind."""
    beliefs = Beliefs(sensors=Sensors(**NOISE), unmodelled=0.1)
    env, agent = make(SensorNoise.model_validate(NOISE), DroppedPackets(probability=0.2), beliefs=beliefs)
    whole, _ = make(SensorNoise.model_validate(NOISE))
    mine, best = position_errors(env, agent), position_errors(whole, agent)
    plain = position_errors(env, ComputedTorque(agent.layout, 10.0, PERIOD))
    assert np.median(mine / best) < 1.3
    assert np.median(plain / mine) > 3.0


@pytest.mark.parametrize("noise", [{}, NOISE])
def test_an_observer_that_is_wrong_comes_back_to_what_is_measured(noise):
    """Displaced by 5 mm; without noise of the sensors stated, within a few periods."""
    env, agent = make(beliefs=Beliefs(sensors=Sensors(**noise), unmodelled=0.3), start_offset=0.0, start_turn=0.0)
    rows, _ = drive(env, agent, 20)
    agent.estimator._states[:, 0] += 0.005
    nothing = np.zeros((COUNT, 6), dtype=np.float32)
    agent.estimator.sent(nothing)
    observations, errors = env.step(nothing)[0], []
    for _ in range(100 if noise else 15):
        observations = env.step(agent.act(observations))[0]
        errors.append(np.abs(rows[-1][1].error[:, :2] - agent.layout.physical(rows[-1][0], "position_error")).max())
    # noisy places are weighed little beside good speeds: a time constant of about 1 s
    assert errors[-1] < (1e-3 if noise else 1e-6)


def test_a_constant_force_leaves_no_offset_once_it_is_found():
    """(X9): it is found as it is; computed torque keeps an offset of M⁻¹ w / k_p."""
    force = np.array([1.0, -0.5, 0.05])
    env, agent = make(beliefs=Beliefs(sensors=Sensors(), unmodelled=1.0, drift=10.0))
    agent.reset(np.ones(COUNT, dtype=np.bool_))
    errors = []
    for one in (agent, ComputedTorque(agent.layout, 20.0, PERIOD)):
        observations, _ = env.reset(seed=1, options={"path": np.arange(COUNT)})
        env.engine.wrenches = np.tile(force, (COUNT, 1))  # an episode begins without any
        for _ in range(150):
            observations, _, _, _, info = env.step(one.act(observations))
        errors.append(info["position_error"])
    found, plain = errors
    offset = np.hypot(*np.linalg.solve(agent._model.inertia(np.zeros(3)), force)[:2]) / agent.gains.stiffness
    assert_allclose(np.median(plain), offset, rtol=0.3)  # inertia depends on the casters
    assert (found < 0.02 * plain).all()
    # what the motors' held torques turn with the robot looks like a force: some per cent of what drives it
    assert_allclose(agent.estimator._wrenches, env.engine.wrenches, atol=0.02)


def test_robots_do_not_touch_one_another():
    """One alone acts as it does among others; a new episode of one leaves the others alone."""
    beliefs = Beliefs(prediction=KNOWN, sensors=Sensors(**NOISE), unmodelled=1.0, drift=1.0)
    env, agent = make(*LATE, beliefs=beliefs)
    alone, again = (ObserverTorque(agent.layout, 20.0, PERIOD, beliefs) for _ in range(2))
    observations, _ = env.reset(seed=1)
    for one, count in ((agent, COUNT), (alone, 1), (again, COUNT)):
        one.reset(np.ones(count, dtype=np.bool_))
    for k in range(30):
        if k == 15:
            again.reset(np.arange(COUNT) == 0)
        actions, renewed = agent.act(observations), again.act(observations)
        assert_allclose(alone.act(observations[2:3]), actions[2:3], atol=1e-6)  # single precision
        assert_array_equal(renewed[1:], actions[1:])
        assert (renewed[0] != actions[0]).any() == (k >= 15)
        observations = env.step(actions)[0]


def test_what_cannot_be_is_refused():
    robot = load_robot("chung2008")
    layout = ObservationLayout(robot, (0.1, 0.2))
    with pytest.raises(
        ValueError, match=r"no farther than the preview, which ends after 0\.2 s, got a delay of 11 con"
    ):
        ObserverTorque(layout, 5.0, PERIOD, {"prediction": {"delay": 11}})
    with pytest.raises(
        ValueError, match="need a reference that a clock leads, with a preview in s, got one in m along"
    ):
        ObserverTorque(ObservationLayout(robot, (0.1,), "m"), 5.0, PERIOD, Beliefs())
    with pytest.raises(ConfigurationError, match=r"beliefs: .*delays.*delay"):
        ObserverTorque(layout, 5.0, PERIOD, {"prediction": {"delays": 1}})
    agent = ObserverTorque(layout, 5.0, PERIOD, Beliefs())
    with pytest.raises(ValueError, match="remembers 0 robots got observations of 2: call its method reset first"):
        agent.act(np.zeros((2, layout.size), dtype=np.float32))
