"""What tracking delivers in an episode, plain and compiled, against the same from angles and matrices."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model
from caster_gym.analysis.actuation import ActuationWarning
from caster_gym.envs import tracking
from caster_gym.envs.observation import View, observe
from caster_gym.envs.report import Situation
from caster_gym.envs.tracking import Point, Reference
from caster_gym.mechanics.grip_or_slip import all_joint_rates
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.tasks.track import TASK
from caster_gym.tasks.track.environment import CasterTrackEnv
from tests.moments import untouched, weights_of
from tests.random_robots import random_robot

PATH = {"shape": "circle", "radius": 0.3, "heading": "tangent", "duration": 24.0}  # 1200 steps
EXACT = 1e-12  # rounding of a few hundred operations on numbers of order 1


class Moment:
    """What the environment knew at one time, with angles."""

    def __init__(self, env, before, action, observation, reward, info, clock):
        self.env, self.before, self.action = env, before, action
        self.observation, self.reward, self.info = observation, reward, info
        self.state = env.engine.states[0]
        self.position, self.twist = self.state[:2], self.state[4:7]
        self.beta = np.arctan2(self.state[3], self.state[2])
        self.steering = np.arctan2(self.state[8::2], self.state[7::2])
        table = env.engine.plan.tables[0]
        self.reference = table[min(clock, len(table) - 1)]
        periods = [round(horizon / env.task.control_period) for horizon in env.task.preview]
        self.coming = [table[min(clock + k, len(table) - 1)] for k in periods]

    def physical(self, name):
        return self.env.engine.layout.physical(self.observation, name)

    def in_body(self, vector):
        c, s = np.cos(self.beta), np.sin(self.beta)
        return np.array([[c, s], [-s, c]]) @ vector


def drive(robot, **task):
    """The start of an episode, and every twentieth step of it, to the trajectory's end, under random actions."""
    env = CasterTrackEnv(robot, PATH, **task)
    observation, info = env.reset(seed=1)
    moments = [Moment(env, None, None, observation, None, info, 0)]
    rng = np.random.default_rng(2)
    for clock in range(1, len(env.engine.plan.tables[0])):
        before = env.engine.states[0]
        action = rng.uniform(-1.3, 1.3, env.action_space.shape).astype(np.float32)
        observation, reward, *_, info = env.step(action)
        if clock % 20 == 0:
            moments.append(Moment(env, before, action, observation, reward, info, clock))
    return moments


@pytest.fixture(scope="module", params=["all", ["roll_1", "steer_1", "roll_2", "steer_3"]], ids=["all", "four"])
def moments(request):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ActuationWarning)  # four joints that cannot push everywhere are meant here
        return drive(random_robot(300, 3), actuation=request.param, corridor=50.0)


def wrapped(angle):
    return np.arctan2(np.sin(angle), np.cos(angle))


def assert_observed(moment, name, expected):
    """Observed to single precision, 6e-8 of the value, and limited to 20 units."""
    (part,) = [part for part in moment.env.engine.layout.parts if part.name == name]
    limited = np.clip(expected, -20.0 * part.scale, 20.0 * part.scale)
    assert_allclose(moment.physical(name), limited, rtol=1e-7, atol=1e-11)


def test_errors_are_reference_minus_robot_seen_from_the_robot(moments):
    for m in moments:
        x, y, cos, sin, vx, vy, omega, *_ = m.reference
        turn = np.arctan2(sin, cos) - m.beta
        offset = m.in_body(np.array([x, y]) - m.position)
        assert_observed(m, "position_error", offset)
        assert_observed(m, "heading_error", [np.cos(turn), np.sin(turn)])
        assert_observed(m, "twist_error", np.append(m.in_body([vx, vy]), omega) - m.twist)
        assert_allclose(m.info["position_error"], np.hypot(*offset), rtol=0.0, atol=50 * EXACT)
        assert_allclose(wrapped(m.info["heading_error"] - turn), 0.0, atol=EXACT)


def test_poses_are_those_of_robot_and_reference(moments):
    for m in moments:
        assert_array_equal(m.info["pose"], m.state[:4])
        assert_array_equal(m.info["reference_pose"], m.reference[:4])


def test_acceleration_of_the_reference_is_shown_in_the_body_frame(moments):
    for m in moments:
        expected = np.append(m.in_body(m.reference[7:9]), m.reference[9])
        assert_observed(m, "reference_acceleration", expected)


def test_own_motion_is_observed(moments):
    for m in moments:
        _, theta, delta = Model(m.env.robot).rates(m.steering, m.twist)
        assert_observed(m, "twist", m.twist)
        assert_observed(m, "directions", np.stack((np.cos(m.steering), np.sin(m.steering)), -1).ravel())
        assert_observed(m, "joint_rates", np.stack((theta, delta), -1).ravel())


def test_preview_is_the_coming_trajectory_and_rests_at_its_end(moments):
    """Beyond the end the last row, which is at rest, stays."""
    assert moments[-1].coming[-1] is not None
    assert_array_equal(moments[-1].coming[0], moments[-1].coming[-1])
    for m in moments:
        for horizon, (x, y, cos, sin, vx, vy, omega, *_) in zip(m.env.task.preview, m.coming, strict=True):
            turn = np.arctan2(sin, cos) - m.beta
            place, velocity = m.in_body(np.array([x, y]) - m.position), m.in_body([vx, vy])
            assert_observed(m, f"preview_{horizon:g}s", [*place, np.cos(turn), np.sin(turn), *velocity, omega])


def test_conditioning_is_the_ratio_of_singular_values(moments):
    """Columns: wrenches of the driven motors at full torque, moments over the root mean square distance of pivots."""
    for m in moments:
        robot = m.env.robot
        rows = Model(robot).jacobian(m.steering).reshape(3, 2, 3)
        wrenches = []
        for i, caster in enumerate(robot.casters):
            most = (caster.roll.max_torque, caster.steer.max_torque)
            for name, gear, size in zip((f"roll_{i + 1}", f"steer_{i + 1}"), caster.gear, most, strict=True):
                if name in robot.driven:
                    wrenches.append(size * np.array(gear) @ rows[i])
        length = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in robot.casters]))
        sigma = np.linalg.svd(np.array(wrenches) / [1.0, 1.0, length], compute_uv=False)
        # the square root of an eigenvalue that is known to rounding of the largest one
        assert_allclose(m.info["conditioning"], sigma[-1] / sigma[0], rtol=1e-9, atol=1e-7)


def simulated(m):
    """The step once more: motors with speed-dependent limits by the books, motion by `Model`."""
    robot, substeps = m.env.robot, m.env.task.substeps
    model, gear = Model(robot), np.array([caster.gear for caster in robot.casters])
    top = np.array([[c.roll.max_speed, c.steer.max_speed] for c in robot.casters])
    most = np.array([[c.roll.max_torque, c.steer.max_torque] for c in robot.casters])
    most *= np.array([joint in robot.driven for joint in robot.joints]).reshape(-1, 2)
    command = np.zeros(2 * robot.caster_count)
    command[[robot.joints.index(joint) for joint in robot.driven]] = np.clip(m.action.astype(float), -1.0, 1.0)
    b = m.before
    now = np.array([b[0], b[1], np.arctan2(b[3], b[2]), *b[4:7], *np.arctan2(b[8::2], b[7::2])])
    torques, powers = [], []
    for _ in range(substeps):
        _, theta, delta = model.rates(now[6:], now[3:6])
        speed = np.einsum("nij,nj->ni", gear, np.stack((theta, delta), -1))
        high, low = most * np.clip(1.0 - speed / top, 0.0, 1.0), -most * np.clip(1.0 + speed / top, 0.0, 1.0)
        torque = np.clip(command.reshape(-1, 2) * most, low, high)
        joints = np.einsum("nij,ni->nj", gear, torque).ravel()
        torques.append(torque.ravel())
        now = model.simulate(now, joints, m.env.task.time_step, 1)[-1]
        _, theta, delta = model.rates(now[6:], now[3:6])
        after = np.einsum("nij,nj->ni", gear, np.stack((theta, delta), -1))
        powers.append((torque * (speed + after)).sum() / 2.0)
    return now, np.mean(torques, axis=0), np.mean(powers)


def test_a_step_is_the_motion_under_motors_with_limits(moments):
    """Torque and power are means over the control period; joints without a motor get none."""
    driven = np.array([joint in moments[0].env.robot.driven for joint in moments[0].env.robot.joints])
    for m in moments[1:]:
        end, torque, power = simulated(m)
        # four RK4 steps of motions with joint rates of up to 100 rad/s, whose rounding is 1e-14
        assert_allclose(m.state[:2], end[:2], rtol=0.0, atol=1e-11)
        assert_allclose(m.twist, end[3:6], rtol=0.0, atol=1e-10)
        assert_allclose(wrapped(np.append(m.beta, m.steering) - [end[2], *end[6:]]), 0.0, atol=1e-10)
        assert_allclose(m.info["torque"], torque, rtol=0.0, atol=1e-10)
        assert_allclose(m.info["power"], power, rtol=0.0, atol=1e-8)  # torques times speeds of up to 100 rad/s
        assert (m.info["torque"][~driven] == 0.0).all()
    assert any((np.abs(m.info["torque"]) > 0.0)[driven].all() for m in moments)


def by_the_docstring(distance, turn, speed, omega, shares, driven):
    """Reward terms as the environment's documentation states them, with its numbers."""

    def k(e, scale):
        return 0.5 / (1.0 + (e / scale) ** 2) + 0.5 / (1.0 + (e / (10.0 * scale)) ** 2)

    return {
        "position": 0.5 * k(distance, 0.01),
        "heading": 0.3 * k(2.0 * np.sin(turn / 2.0), 0.02),
        "speed": 0.2 * k(np.hypot(speed / 0.1, omega / 0.3), 1.0),
        "effort": -0.02 * np.square(shares).sum() / driven,
        "impact": 0.0,
        "alive": 0.02,
    }


def test_reward_is_what_the_documentation_says(moments):
    for m in moments:
        robot = m.env.robot
        most = np.array([size for c in robot.casters for size in (c.roll.max_torque, c.steer.max_torque)])
        speed = m.in_body(m.reference[4:6]) - m.twist[:2]
        expected = by_the_docstring(
            np.hypot(*(m.reference[:2] - m.position)),
            np.arctan2(m.reference[3], m.reference[2]) - m.beta,
            np.hypot(*speed),
            m.reference[6] - m.twist[2],
            m.info["torque"] / most,
            len(robot.driven),
        )
        terms = m.info["reward_terms"]
        assert set(terms) == set(expected)
        for name, value in expected.items():
            # rounding; 1 − cos of a small heading error loses 1e-16, in units of the scale's square 4e-4
            assert_allclose(terms[name], value, rtol=0.0, atol=1e-11, err_msg=name)
        if m.reward is not None:
            assert m.reward == pytest.approx(sum(terms.values()), abs=1e-15)


def test_plain_python_gives_what_the_compiled_code_delivers(moments):
    """The same lines on Python floats, to the last bit: one source, and strict arithmetic."""
    for m in moments:
        parameters = robot_parameters(m.env.robot)
        state = unpack_state(tuple(map(float, m.state)))
        reference = Reference(*map(float, m.reference))
        points = tuple(Point(*map(float, row[: len(Point._fields)])) for row in m.coming)
        errors = tracking.tracking_errors(state, reference)
        view = View(state, reference, errors, points, (), all_joint_rates(state, parameters, None), parameters)
        assert_array_equal(np.array(observe(view), dtype=np.float32), m.observation)
        torques = pairs(tuple(map(float, m.info["torque"])))
        record = untouched(m.info["power"])
        situation = Situation(0.0, 0.0, np.inf)
        effort = tracking.mean_effort(torques, parameters)
        moment, weights = (
            tracking.Moment(state, reference, errors, effort, record, situation),
            weights_of(TASK, corridor=m.env.task.corridor),
        )
        ended, terms = tracking.endings(moment, weights), TASK.reward(moment, weights)
        assert terms._asdict() == m.info["reward_terms"]
        report = tracking.report(state, reference, errors, record, situation, ended, parameters)
        assert report.deviation.position_error == m.info["position_error"]
        assert report.deviation.conditioning == m.info["conditioning"]
        assert not any(report.endings)
        turn = np.arctan2(report.deviation.heading_sin, report.deviation.heading_cos)
        assert turn == pytest.approx(m.info["heading_error"], abs=1e-15)
        assert_array_equal(report.pose, m.info["pose"])
        assert_array_equal(report.reference_pose, m.info["reference_pose"])


def test_without_obstacles_nothing_touches(moments):
    for m in moments:
        assert (m.info["impacts"], m.info["normal_impulse"], m.info["touched"]) == (0.0, 0.0, False)
        assert_array_equal(m.info["impulse"], [0.0, 0.0])
        assert m.info["clearance"] == np.inf
        assert (m.info["progress"], m.info["progress_share"]) == (0.0, 0.0)
