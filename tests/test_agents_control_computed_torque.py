"""caster_gym.agents.control.computed_torque: errors obey the linear equation that the gains promise, for any robot."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents.comparison.evaluation import roll_out
from caster_gym.agents.control.computed_torque import ComputedTorque, Gains, gains, known_model
from caster_gym.analysis.actuation import ActuationWarning
from caster_gym.engines.numpy_model import Model
from caster_gym.envs.observation import ObservationLayout
from caster_gym.robot import load_robot
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from caster_gym.tasks.track.metrics import measure

COUNT = 16
FREQUENCY = 10.0  # [rad/s]
PATHS = {"shape": "random_paths", "seed": 7, "count": COUNT, "duration": 5.0, "max_speed": 0.6}
FAST = {"shape": "random_paths", "seed": 3, "count": COUNT, "duration": 5.0, "max_speed": 1.2, "max_acceleration": 2.0}


def make(robot="chung2008", path=PATHS, known="exact", frequency=FREQUENCY, actuation=None, **task):
    batch = CasterTrackVectorEnv(COUNT, robot=robot, path=path, actuation=actuation, **task)
    return batch, ComputedTorque(batch.engine.layout, frequency, batch.task.control_period, known)


def errors_in_the_world(batch, observations, info):
    """Errors of x, y and heading (robots, 3), and their rates."""
    c, s = info["pose"][:, 2], info["pose"][:, 3]
    ahead, left, turning = batch.engine.layout.physical(observations, "twist_error").T
    x, y = (info["reference_pose"] - info["pose"])[:, :2].T
    error = np.stack([x, y, info["heading_error"]], axis=1)
    return error, np.stack([c * ahead - s * left, s * ahead + c * left, turning], axis=1)


def simulated_errors(period, substeps, duration):
    """Errors (steps + 1, robots, 3) from small offsets on, their first rates, and the controller."""
    batch, agent = make(control_period=period, substeps=substeps, start_offset=0.003, start_turn=0.01)
    observations, info = batch.reset(seed=1, options={"path": np.arange(COUNT)})
    error, rate = errors_in_the_world(batch, observations, info)
    series = [error]
    for _ in range(round(duration / period)):
        actions = agent.act(observations)
        assert np.abs(actions).max() < 0.99  # the law holds while no motor is at its limit
        observations, _, _, _, info = batch.step(actions)
        series.append(errors_in_the_world(batch, observations, info)[0])
    return np.array(series), rate, agent


def test_errors_obey_their_linear_equation():
    """(T1): ë + k_d ė + k_p e = 0, solved in closed form, while the robot drives along its paths."""
    period = 0.002
    series, rate, agent = simulated_errors(period, substeps=1, duration=1.0)
    roots = np.roots([1.0, agent.gains.damping, agent.gains.stiffness])
    time = period * np.arange(len(series))[:, None, None]
    first = (rate - roots[1] * series[0]) / (roots[0] - roots[1])
    expected = (first * np.exp(roots[0] * time) + (series[0] - first) * np.exp(roots[1] * time)).real
    assert_allclose(np.abs(series[0]).max(axis=0), [0.003, 0.003, 0.01], rtol=0.2)
    # the feedback is held, an error of first order in the period: 0.4 % of the start
    assert np.abs(series - expected)[..., :2].max() < 2e-5
    assert np.abs(series - expected)[..., 2].max() < 6e-5


def test_errors_under_held_torques_obey_their_recursion():
    """At 20 ms e' = e + T ė + ½ T² u and ė' = ė + T u with u = −k_p e − k_d ė, from the first step to the last."""
    period = 0.02
    series, rate, agent = simulated_errors(period, substeps=4, duration=2.0)
    error, expected = series[0], [series[0]]
    for _ in range(len(series) - 1):
        u = -agent.gains.stiffness * error - agent.gains.damping * rate
        error, rate = error + period * rate + 0.5 * period**2 * u, rate + period * u
        expected.append(error)
    difference = np.abs(series - np.array(expected))
    # torques, not accelerations, are held, which tells while a caster flips: 0.3 and 0.8 % of the start at worst
    assert difference[..., :2].max() < 3e-5
    assert difference[..., 2].max() < 3e-4
    # mostly it is far less: gains that are wrong by 0.5 % would show
    assert np.median(difference[..., :2]) < 2e-6
    assert np.median(difference[..., 2]) < 2e-5


@pytest.mark.parametrize("robot", ["chung2008", "xr4000"])
def test_what_held_torques_cost_is_of_second_order_in_the_period(robot):
    """(T4): at the same gains half the period leaves about a quarter of the error; torques for its start, a half."""
    errors = []
    for period, substeps in ((0.02, 8), (0.01, 4)):
        batch, agent = make(robot, control_period=period, substeps=substeps)
        agent.gains = Gains(FREQUENCY**2, 2.0 * FREQUENCY)
        metrics = measure(roll_out(agent, batch, seed=5), 2.0)
        errors.append([metrics.position_rmse, metrics.heading_rmse])
    coarse, fine = np.array(errors)
    orders = np.log2(np.median(coarse / fine, axis=1))
    # single precision and the estimated jerk add errors of their own: measured 1.6 to 1.9
    assert (orders > 1.5).all()


def test_the_velocity_changes_in_the_world_as_wanted_while_robot_and_casters_turn():
    """(T3): over a period from given casters, without feedback. What it misses falls with the square of the period."""
    omega, wanted = 2.0, [0.5, 0.3, 0.0]
    robot = load_robot("chung2008")
    layout, model = ObservationLayout(robot, ()), Model(robot)
    places = {part.name: part for part in layout.parts}
    steering = np.array([0.4, -1.0, 2.0])
    observation = np.zeros((1, layout.size), dtype=np.float32)
    for name, values in (
        ("heading_error", [1.0, 0.0]),
        ("twist", [0.0, 0.0, omega]),
        ("reference_acceleration", wanted),
        ("directions", np.column_stack([np.cos(steering), np.sin(steering)]).ravel()),
    ):
        observation[0, places[name].place] = np.array(values) / places[name].scale
    missed = []
    for period in (0.02, 0.005, 0.0025):
        action = ComputedTorque(layout, FREQUENCY, period).act(observation)[0]
        torque = np.zeros(len(robot.joints))
        torque[robot.driven_indices] = action * robot.max_torques[robot.driven_indices]
        after = model.simulate([0.0, 0.0, 0.0, 0.0, 0.0, omega, *steering], torque, period / 20, 20)[-1]
        c, s = np.cos(after[2]), np.sin(after[2])
        gained = np.array([c * after[3] - s * after[4], s * after[3] + c * after[4], after[5] - omega])
        missed.append(np.linalg.norm(gained / period - wanted))
    assert missed[0] < 6e-3  # [m/s²]; a frame of the start turns the wrench by 20 mrad: 12e-3, and casters add to that
    assert missed[1] / missed[2] == pytest.approx(4.0, rel=0.05)  # the next order is some per cent


@pytest.mark.parametrize("frequency", [0.1, 5.0, 20.0, 100.0])
@pytest.mark.parametrize("period", [0.001, 0.02, 0.1])
def test_gains_put_both_poles_of_the_sampled_double_integrator(frequency, period):
    """(T2)"""
    stiffness, damping = gains(frequency, period)
    step = np.array([[1.0, period], [0.0, 1.0]])
    held = np.array([[0.5 * period**2], [period]])
    poles = np.linalg.eigvals(step - held @ np.array([[stiffness, damping]]))
    # a double root moves by the square root of the round-off of its polynomial
    assert_allclose(poles, np.exp(-frequency * period), rtol=0.0, atol=1e-6)


def test_gains_of_a_short_period_are_those_of_continuous_control():
    """k_p → ω² and k_d → 2 ω, with an error of first order in the period."""
    for period in (1e-3, 1e-4, 1e-5):
        stiffness, damping = gains(7.0, period)
        assert stiffness == pytest.approx(49.0, rel=1.1 * 7.0 * period)
        assert damping == pytest.approx(14.0, rel=1.1 * 7.0 * period)


def test_the_more_a_controller_knows_the_better_it_tracks():
    """At equal gains on fast paths: the exact model, without (D1), without the wheels."""
    errors = []
    for known in ("exact", "without D1", "without wheels"):
        batch, agent = make(path=FAST, known=known)
        metrics = measure(roll_out(agent, batch, seed=5), 2.0)
        assert metrics.failed.sum() == 0
        errors.append(np.sqrt(np.mean(metrics.position_rmse**2)))
    exact, without_d1, without_wheels = errors
    assert 5.0 * exact < without_d1  # measured: 0.005, 0.09 and 2.4 mm
    assert 5.0 * without_d1 < without_wheels


def test_what_the_controllers_know_of_the_robot():
    robot = load_robot("chung2008")
    rng = np.random.default_rng(0)
    steering, twist = rng.uniform(-np.pi, np.pi, (20, 3)), rng.uniform(-1.0, 1.0, (20, 3))
    exact = Model(robot)
    assert_array_equal(known_model(robot, "exact").bias(steering, twist), exact.bias(steering, twist))
    assert_array_equal(known_model(robot, "without D1").inertia(steering), exact.inertia(steering))
    assert np.all(np.any(known_model(robot, "without D1").bias(steering, twist) != exact.bias(steering, twist), axis=1))
    body = np.diag([robot.platform.mass, robot.platform.mass, robot.platform.inertia])
    assert_allclose(known_model(robot, "without wheels").inertia(steering), np.broadcast_to(body, (20, 3, 3)))
    with pytest.raises(ValueError, match="known must be 'exact', 'without D1' or 'without wheels', got 'half'"):
        known_model(robot, "half")  # type: ignore[arg-type]


@pytest.mark.parametrize("robot", ["chung2008", "tidybot2"])
def test_actions_are_within_their_limits_and_come_from_the_observation_alone(robot):
    """Whatever is observed; the same again, and for one robot as for many."""
    layout = ObservationLayout(load_robot(robot), (0.1, 0.2, 0.4))
    agent = ComputedTorque(layout, 30.0, 0.02)
    rng = np.random.default_rng(1)
    size = rng.choice([0.01, 1.0, 20.0], (300, 1))
    observations = np.clip(size * rng.normal(size=(300, layout.size)), -20.0, 20.0).astype(np.float32)
    actions = agent.act(observations)
    assert actions.shape == (300, len(layout.robot.driven))
    assert actions.dtype == np.float32
    assert np.all(np.abs(actions) <= 1.0)
    assert (np.abs(actions) == 1.0).any()
    assert_array_equal(agent.act(observations.copy()), actions)
    alone = np.concatenate([agent.act(one[None]) for one in observations])
    assert_allclose(alone, actions, rtol=0.0, atol=1e-6)  # float32, of numbers that LAPACK may round otherwise


def test_the_heading_error_is_taken_the_short_way():
    """Half a turn away, the yaw that is asked for changes its sign and nothing else."""
    layout = ObservationLayout(load_robot("chung2008"), ())
    agent = ComputedTorque(layout, 2.0, 0.02)
    observations = np.zeros((2, layout.size), dtype=np.float32)
    directions = next(part.place for part in layout.parts if part.name == "directions")
    observations[:, directions] = [1.0, 0.0] * 3
    observations[:, 2] = np.cos(3.1)
    observations[:, 3] = [np.sin(3.1), np.sin(-3.1)]
    left, right = agent.act(observations)
    assert np.abs(left).max() > 0.01
    assert_allclose(left, -right, atol=1e-6)  # float32


@pytest.mark.parametrize("robot", ["tidybot2", "xr4000"])
def test_robots_with_coupled_motors_track(robot):
    """Four casters, friction, and drive motors that turn with the steering.

    What is left comes from caster flips within a held torque: measured 0.04 and 0.06 mm at worst, 0.01 mm rms.
    With a gear that the controller does not know, torques would be wrong by half of those of the other motor.
    """
    batch, agent = make(robot)
    assert any(caster.gear != ((1.0, 0.0), (0.0, 1.0)) for caster in batch.robot.casters)
    metrics = measure(roll_out(agent, batch, seed=5), 2.0)
    assert metrics.failed.sum() == 0
    assert metrics.worst_position.max() < 1e-4
    assert metrics.position_rmse.mean() < 3e-5


def test_two_casters_with_both_motors_are_enough():
    """The set that is never singular while the trail is short; measured 0.012 mm at worst."""
    with warnings.catch_warnings():
        warnings.simplefilter("error", ActuationWarning)
        batch, agent = make(actuation=["roll_1", "steer_1", "roll_2", "steer_2"])
    metrics = measure(roll_out(agent, batch, seed=5), 2.0)
    assert metrics.failed.sum() == 0
    assert metrics.worst_position.max() < 3e-5


@pytest.mark.parametrize("joints", [["roll_1", "roll_2", "roll_3"], ["steer_1", "steer_2", "steer_3"], ["roll_1"]])
def test_a_singular_set_gets_finite_torques_within_its_limits(joints):
    """At singular configurations too: all casters parallel, and all on a common centre."""
    robot = load_robot("chung2008").with_actuation(joints)
    layout = ObservationLayout(robot, ())
    with pytest.warns(ActuationWarning):
        agent = ComputedTorque(layout, FREQUENCY, 0.02)
    rng = np.random.default_rng(2)
    observations = rng.normal(size=(200, layout.size)).astype(np.float32)
    place = next(part.place for part in layout.parts if part.name == "directions")
    angles = rng.uniform(-np.pi, np.pi, (200, 3))
    angles[:50] = angles[:50, :1]  # parallel
    towards_centre = [np.arctan2(caster.y, caster.x) for caster in robot.casters]
    angles[50:100] = np.array(towards_centre) + rng.choice([0.0, np.pi], (50, 3))
    observations[:, place] = np.stack([np.cos(angles), np.sin(angles)], axis=-1).reshape(200, -1)
    assert known_model(robot, "exact").conditioning(angles[:50]).max() < 1e-7  # root of round-off
    actions = agent.act(observations)
    assert np.isfinite(actions).all()
    assert np.abs(actions).max() <= 1.0
    assert np.abs(actions).max() > 0.0


def test_what_cannot_be_is_refused():
    layout = ObservationLayout(load_robot("chung2008"), ())
    with pytest.raises(ValueError, match=r"natural_frequency must be positive, got 0\.0"):
        ComputedTorque(layout, 0.0, 0.02)


def test_names_say_what_the_controller_knows():
    layout = ObservationLayout(load_robot("chung2008"), ())
    names = [ComputedTorque(layout, 5.0, 0.02, known).name for known in ("exact", "without D1", "without wheels")]
    assert names == ["computed torque", "computed torque without D1", "computed torque without wheels"]
