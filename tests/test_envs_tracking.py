"""caster_gym.envs.tracking and its compiled form, against the same from angles and matrices."""

import warnings

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model
from caster_gym.analysis.actuation import ActuationWarning
from caster_gym.engines.numba_fleet import Fleet
from caster_gym.envs import tracking
from caster_gym.envs.caster_track import CasterTrackEnv
from caster_gym.envs.track_task import TrackTask
from caster_gym.envs.tracking import Errors, Record, Reference, Situation, Terms, Weights
from caster_gym.mechanics.integration import unpack_state
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.scalars import pairs
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


def test_traction_use_is_the_worst_wheels_share_of_its_friction(moments):
    for m in moments:
        robot, model = m.env.robot, Model(m.env.robot)
        gear = np.array([caster.gear for caster in robot.casters])
        joints = np.einsum("nij,ni->nj", gear, m.info["torque"].reshape(-1, 2)).ravel()
        force = np.linalg.norm(model.ground_forces(m.steering, m.twist, joints), axis=-1)
        share = force / (robot.floor_friction * model.wheel_loads(m.steering))
        assert_allclose(m.info["traction_use"], share.max(), rtol=1e-10)  # rounding in angles and a 3 × 3 solve


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
        parameters, weights = robot_parameters(m.env.robot), m.env.task.weights()
        state = unpack_state(tuple(map(float, m.state)))
        reference = Reference(*map(float, m.reference))
        points = tuple(tuple(map(float, row[:7])) for row in m.coming)
        errors = tracking.tracking_errors(state, reference)
        observation = tracking.observe(state, reference, errors, points, (), parameters)
        assert_array_equal(np.array(observation, dtype=np.float32), m.observation)
        torques = pairs(tuple(map(float, m.info["torque"])))
        record = untouched(m.info["power"])
        ended = tracking.endings(state, errors, record, weights.corridor, weights.touching_ends)
        terms = tracking.reward_terms(errors, tracking.mean_effort(torques, parameters), record, 0.0, weights)
        assert terms._asdict() == m.info["reward_terms"]
        situation = Situation(0.0, 0.0, np.inf)
        report = tracking.report(state, reference, errors, torques, record, situation, ended, terms, parameters)
        assert report.position_error == m.info["position_error"]
        assert report.traction_use == m.info["traction_use"]
        assert report.conditioning == m.info["conditioning"]
        assert report.endings == (0.0, 0.0, 0.0)
        assert np.arctan2(report.heading_sin, report.heading_cos) == pytest.approx(m.info["heading_error"], abs=1e-15)
        assert_array_equal(report.pose, m.info["pose"])
        assert_array_equal(report.reference_pose, m.info["reference_pose"])


def test_without_obstacles_nothing_touches(moments):
    for m in moments:
        assert (m.info["impacts"], m.info["normal_impulse"], m.info["touched"]) == (0.0, 0.0, False)
        assert_array_equal(m.info["impulse"], [0.0, 0.0])
        assert m.info["clearance"] == np.inf
        assert (m.info["progress"], m.info["progress_share"]) == (0.0, 0.0)


def untouched(power=0.0):
    """The record of a control period without impacts."""
    return Record(power, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


WEIGHTS = TrackTask().weights()
WITH_IMPACTS = TrackTask(impact_weight=0.3, impact_scale=0.4).weights()
NO_ERROR = Errors(0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0)


def reward_terms(errors, effort, failed=0.0, weights=WEIGHTS, pressing=0.0):
    return tracking.reward_terms(errors, effort, untouched()._replace(pressing=pressing), failed, weights)


def random_errors(count):
    """Errors of all sizes, from 1e-4 of their usual scale to a hundred times it."""
    rng = np.random.default_rng(3)
    for _ in range(count):
        size = 10.0 ** rng.uniform(-4.0, 2.0, 5) * rng.choice((-1.0, 1.0), 5)
        turn = rng.uniform(-np.pi, np.pi) * 10.0 ** rng.uniform(-4.0, 0.0)
        yield Errors(size[0], size[1], np.cos(turn), np.sin(turn), *size[2:]), rng.choice([0.0, rng.uniform(), 1.0])


def test_reward_terms_stay_in_their_ranges():
    """Whatever the errors, the effort and the normal impulse [N s]."""
    for k, (errors, effort) in enumerate(random_errors(2000)):
        terms = reward_terms(errors, effort, 0.0, WITH_IMPACTS, pressing=(0.0, 1e-3 * k, 1e9)[k % 3])
        assert 0.0 < terms.position <= 0.5
        assert 0.0 < terms.heading <= 0.3
        assert 0.0 < terms.speed <= 0.2
        assert -0.02 <= terms.effort <= 0.0
        assert -0.3 <= terms.impact <= 0.0
        assert terms.alive == 0.02 + 0.3


def test_perfect_tracking_without_effort_is_worth_most():
    """All weights of quality and the one for being alive, which is as great as the greatest costs."""
    assert sum(reward_terms(NO_ERROR, 0.0)) == pytest.approx(1.02, abs=1e-15)
    assert sum(reward_terms(NO_ERROR, 0.0, 0.0, WITH_IMPACTS)) == pytest.approx(1.32, abs=1e-15)


def test_surviving_always_beats_dying():
    """No step in the task is worth less than nothing, whatever errors, effort and impacts; a failing one is worth 0."""
    for errors, effort in random_errors(2000):
        for weights, pressing in ((WEIGHTS, 0.0), (WITH_IMPACTS, 0.1), (WITH_IMPACTS, 1e6)):
            assert sum(reward_terms(errors, effort, 0.0, weights, pressing)) > 0.0
            assert reward_terms(errors, effort, 1.0, weights, pressing) == (0.0,) * len(Terms._fields)


def test_impacts_cost_what_the_documentation_says():
    """−w J / (J + J₀), and nothing where the weight is 0, as it is by default."""
    for pressing in (0.0, 0.01, 0.4, 3.0):
        expected = -0.3 * pressing / (pressing + 0.4)
        terms = reward_terms(NO_ERROR, 0.5, 0.0, WITH_IMPACTS, pressing)
        assert terms.impact == pytest.approx(expected, abs=1e-15)
        assert reward_terms(NO_ERROR, 0.5, 0.0, WEIGHTS, pressing) == reward_terms(NO_ERROR, 0.5)
        same = reward_terms(NO_ERROR, 0.5, 0.0, WITH_IMPACTS)._replace(impact=terms.impact)
        assert terms == same


@pytest.mark.parametrize("name", ["ahead", "left", "turn", "vx", "vy", "omega"])
def test_each_error_alone_lowers_the_reward(name):
    """All the way from nothing to far out, on both sides."""

    def reward(size):
        change = {"cos": np.cos(size), "sin": np.sin(size)} if name == "turn" else {name: size}
        return sum(reward_terms(NO_ERROR._replace(**change), 0.0))

    sizes = np.linspace(0.0, np.pi, 300)
    for side in (sizes, -sizes):
        assert (np.diff([reward(size) for size in side]) < 0.0).all()


def test_effort_lowers_the_reward():
    values = [sum(reward_terms(NO_ERROR, effort)) for effort in np.linspace(0.0, 1.0, 11)]
    assert (np.diff(values) < 0.0).all()


def test_full_torque_everywhere_is_an_effort_of_one():
    """Per driven motor, however many there are."""
    robot = random_robot(301, 3)
    for driven in (robot, robot.with_actuation(["roll_1", "steer_3"])):
        full = tuple(
            tuple(
                (1.0 if f"{kind}_{i}" in driven.driven else 0.0) * motor.max_torque
                for kind, motor in (("roll", caster.roll), ("steer", caster.steer))
            )
            for i, caster in enumerate(driven.casters, start=1)
        )
        assert tracking.mean_effort(full, robot_parameters(driven)) == pytest.approx(1.0, abs=1e-15)


@pytest.mark.parametrize(("distance", "outside"), [(0.4999999, 0.0), (0.5000001, 1.0), (np.inf, 1.0)])
@pytest.mark.parametrize("angle", [0.0, 0.7, 2.5, -1.6])
def test_the_corridor_is_a_circle(distance, outside, angle):
    ahead, left = (distance, 0.0) if np.isinf(distance) else (distance * np.cos(angle), distance * np.sin(angle))
    assert tracking.left_corridor(NO_ERROR._replace(ahead=ahead, left=left), WEIGHTS.corridor) == outside


@pytest.mark.parametrize("bad", [np.nan, np.inf, -np.inf])
def test_any_number_that_is_not_finite_is_noticed(bad):
    good = Fleet(random_robot(302, 3)).state[0]
    assert tracking.not_finite(unpack_state(tuple(good))) == 0.0
    for i in range(len(good)):
        broken = good.copy()
        broken[i] = bad
        with np.errstate(invalid="ignore"):
            assert tracking.not_finite(unpack_state(tuple(broken))) == 1.0


@pytest.mark.parametrize(("touching", "pressing", "ends"), [("ends", 1e-9, 1), ("ends", 0.0, 0), ("allowed", 5.0, 0)])
def test_touching_ends_an_episode_only_where_the_task_says_so(touching, pressing, ends):
    weights = TrackTask(touching=touching).weights()
    assert tracking.touched(untouched()._replace(pressing=pressing), weights.touching_ends) == ends


def test_an_obstacle_is_seen_from_the_robot():
    """Gap, at most 1 m, and the direction from it turned into B; too far away it has none."""
    state = unpack_state((1.0, 2.0, np.cos(0.7), np.sin(0.7), 0.1, 0.2, 0.3, 1.0, 0.0, 0.0, 1.0))
    gap, nx, ny = tracking.neighbour_seen(state, (0.4, np.cos(1.1), np.sin(1.1)))
    assert_allclose([gap * 0.25, nx, ny], [0.4, np.cos(0.4), np.sin(0.4)], rtol=0.0, atol=EXACT)
    assert tracking.neighbour_seen(state, (-0.01, 1.0, 0.0))[0] == -0.04
    for far in (1.0, 3.0, np.inf):
        assert tracking.neighbour_seen(state, (far, 1.0, 0.0)) == (4.0, 0.0, 0.0)


def test_observed_numbers_stay_within_the_space():
    given = [-np.inf, -21.0, -20.0, 0.5, 20.0, 21.0, np.inf, np.nan]
    assert [tracking.observed(x) for x in given] == [-20, -20, -20, 0.5, 20, 20, 20, -20]


def test_a_start_lies_in_the_frame_of_the_trajectory():
    """Offset ahead and left of the reference, turned from its heading, at rest."""
    heading, turn = 0.8, -0.3
    reference = Reference(1.0, 2.0, np.cos(heading), np.sin(heading), 0.3, 0.1, 0.2, 0.0, 0.0, 0.0)
    state = tracking.start(reference, (0.04, -0.02), (np.cos(turn), np.sin(turn)), ((0.6, 0.8), (0.0, 1.0)))
    rotation = np.array([[np.cos(heading), -np.sin(heading)], [np.sin(heading), np.cos(heading)]])
    assert_allclose(state.position, [1.0, 2.0] + rotation @ [0.04, -0.02], rtol=0.0, atol=EXACT)
    assert_allclose(state.heading, [np.cos(heading + turn), np.sin(heading + turn)], rtol=0.0, atol=EXACT)
    assert state.twist == (0.0, 0.0, 0.0)
    assert state.directions == ((0.6, 0.8), (0.0, 1.0))


def test_weights_carry_every_number_of_the_task():
    """Each into the field that means it."""
    fields = [name for name in Weights._fields if name not in ("coarse", "corridor", "touching_ends")]
    named = {f"{name}_weight" if f"{name}_weight" in TrackTask.model_fields else name: name for name in fields}
    for i, (field, weight) in enumerate(named.items()):
        value = 0.111 * (i + 1)
        assert getattr(TrackTask(**{field: value}).weights(), weight) == value
    weights = TrackTask(coarse=7.0, corridor=0.9).weights()
    assert (weights.coarse, weights.corridor, weights.touching_ends) == (7.0, 0.9, 0.0)
    assert TrackTask(touching="ends").weights().touching_ends == 1.0
