"""Time steps among obstacles: impacts, lasting contacts, and what keeps the robot from going through a wall."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from caster_gym import Model, load_robot
from caster_gym.mechanics.contact_impulses import STILL
from caster_gym.mechanics.first_contact import FOUND
from caster_gym.mechanics.integration import rk4_step
from caster_gym.mechanics.parameters import robot_parameters
from tests.random_robots import frictionless, random_robot
from tests.walks import (
    ALLOWED,
    BOX,
    FLOOR,
    TRIANGLE,
    Walk,
    around_it,
    corners_of,
    energy,
    floats,
    shaped,
    state_of,
    steering_of,
)


@pytest.mark.parametrize("e", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("h", [1e-3, 2.7e-3, 1e-2])
def test_a_disc_thrown_straight_at_a_wall_bounces_where_and_when_it_must(e, h):
    """By hand: it goes 0.05 m at 2 m/s, then back at e times that; no force acts along aligned wheels."""
    robot = shaped(load_robot("chung2008"), 0.1)
    around = around_it(robot, {"half_planes": [{"point": [1.0, 0.0], "normal": [-1.0, 0.0]}]}, restitution=e)
    walk = Walk(robot, around, floats(state_of(0.85, 0.0, 0.0, (2.0, 0.0), 0.0, np.zeros(3))))
    total = 40e-3
    steps = round(total / h)
    walk.step(h, steps)
    expected = 0.9 - e * 2.0 * (steps * h - 0.025)
    assert_allclose(walk.state.position, (expected, 0.0), rtol=0.0, atol=2.0 * FOUND)  # the search stops that early
    assert_allclose(walk.state.twist, (-2.0 * e, 0.0, 0.0), rtol=0.0, atol=1e-12)  # rounding
    mass = Model(robot).inertia(np.zeros(3))[0, 0]
    assert_allclose(walk.impulse, (-(1.0 + e) * mass * 2.0, 0.0), rtol=0.0, atol=1e-9)  # rests without a force
    assert_allclose(walk.pressing, (1.0 + e) * mass * 2.0, rtol=0.0, atol=1e-9)


@pytest.mark.slow
@settings(deadline=None, max_examples=20)
@given(seed=st.integers(0, 10**6), outline=st.sampled_from([0.2, TRIANGLE]), mu=st.sampled_from([0.0, 0.3]))
def test_a_step_with_an_impact_is_free_motion_the_impulse_and_free_motion(seed, outline, mu):
    """Against steps ten times finer up to the contact, Model.collide there, and such steps again."""
    rng = np.random.default_rng(seed)
    robot, h, e = shaped(random_robot(seed, 3), outline), 2e-3, 0.6
    torque = rng.uniform(-0.2, 0.2, 6)
    velocity = (rng.uniform(-1.0, 1.0), -1.0)
    start = floats(state_of(0.0, 0.0, rng.uniform(-3, 3), velocity, rng.uniform(-1, 1), rng.uniform(-3, 3, 3)))
    torques, parameters = tuple(zip(torque[::2].tolist(), torque[1::2].tolist(), strict=True)), robot_parameters(robot)

    def later(state, t):
        for _ in range(10):
            state = rk4_step(state, torques, (0.0, 0.0, 0.0), t / 10, parameters)
        return state

    def power(state):
        _, rolling, steering = Model(robot).rates(steering_of(state), state.twist)
        speeds = [
            np.array(c.gear) @ pair for c, pair in zip(robot.casters, zip(rolling, steering, strict=True), strict=True)
        ]
        motors = [np.linalg.solve(np.transpose(c.gear), pair) for c, pair in zip(robot.casters, torques, strict=True)]
        return np.vdot(motors, speeds)

    def work(state, t):
        return t * np.mean([power(later(state, (k + 0.5) * t / 20)) for k in range(20)])

    def heights(state):
        if isinstance(outline, float):
            return np.array([state.position[1] - outline])
        return corners_of(outline, state)[:, 1]

    floor = heights(later(start, 0.4 * h)).min()
    touches = brentq(lambda t: heights(later(start, t)).min() - floor, 0.0, h, xtol=1e-12)
    there = later(start, touches)
    if (heights(there) < floor + 5e-3).sum() > 1:
        return  # both ends of a face may touch within this step
    c, s = there.heading
    low = (
        np.array([0.0, -outline]) if isinstance(outline, float) else corners_of(outline, there)[heights(there).argmin()]
    )
    arm = low if isinstance(outline, float) else low - there.position
    point = (c * arm[0] + s * arm[1], c * arm[1] - s * arm[0])
    hit, twist = Model(robot).collide(steering_of(there), there.twist, point, (s, c), e, mu)
    expected = later(there._replace(twist=tuple(map(float, twist))), h - touches)
    floor_there = {"half_planes": [{"point": [0.0, floor], "normal": [0.0, 1.0]}]}
    walk = Walk(robot, around_it(robot, floor_there, restitution=e, friction=mu), start, torque).step(h)
    assert walk.impacts == 1.0
    # the search stops 1 µm before the contact, so that the impact is 1 µs early: twists change by 1e-3 in that time at
    # most; RK4 at 2 ms adds less, and the slip at which friction changes its mind makes some of it twice as large
    assert_allclose(walk.impulse, (-hit[1], hit[0]), rtol=0.0, atol=2e-3 * hit[0])
    assert_allclose(walk.state.position, expected.position, rtol=0.0, atol=3.0 * FOUND)
    assert_allclose(walk.state.twist, expected.twist, rtol=0.0, atol=2e-3)
    done = work(start, touches) + work(there._replace(twist=tuple(map(float, twist))), h - touches)
    # J; twists as above, and the mean of both ends of a piece is off by a share of the change between them
    assert_allclose(walk.work, done, rtol=0.02, atol=2e-3 * h * np.abs(torque).sum() / 0.03)


@pytest.mark.parametrize("e", [0.0, 0.5])
def test_an_impact_asks_of_the_floor_what_spins_its_wheels_up(e):
    """(G9): by hand, for aligned wheels that are stopped: P = I_s (1 + e) v / r², over 0.7 of a third of the weight."""
    robot = shaped(load_robot("chung2008"), 0.1)
    around = around_it(robot, {"half_planes": [{"point": [1.0, 0.0], "normal": [-1.0, 0.0]}]}, restitution=e)
    walk = Walk(robot, around, floats(state_of(0.85, 0.0, 0.0, (2.0, 0.0), 0.0, np.zeros(3))))
    walk.step(5e-3, 4)
    assert walk.asked == 0.0
    walk.step(5e-3, 2)
    wheel, radius = robot.casters[0].wheel, robot.casters[0].radius
    impulse = wheel.spin_inertia * (1.0 + e) * 2.0 / radius**2
    loads = Model(robot).wheel_loads(np.zeros(3))
    assert_allclose(walk.asked, impulse / (robot.floor_friction * loads.min() * 0.01), rtol=1e-9)


def tied_to_the_floor(model, row, torque, radius, mu, duration):
    """x, y, β, twist and steering (…) of a disc whose lowest point stays on y = 0, by Lagrange's multiplier."""
    n_casters = len(row) - 6

    def rate(_, q):
        c, s = np.cos(q[2]), np.sin(q[2])
        v, steering = q[3:6], q[6:]
        n = np.array([s, c, 0.0])
        t = np.array([-c, s, -radius])  # the normal turned by +90°: −x of the world
        along = t @ v
        push = n - mu * np.sign(along) * t
        m, turning = model.inertia(steering), np.array([v[2] * c, -v[2] * s, 0.0])  # ṅ: the axis turns in B at −ω
        free = model.forward_dynamics(steering, v, torque)
        multiplier = -(n @ free + turning @ v) / (n @ np.linalg.solve(m, push))
        assert multiplier > 0.0  # pressed, never pulled
        acceleration = free + np.linalg.solve(m, push) * multiplier
        _, _, delta = model.rates(steering, v)
        return np.concatenate(([c * v[0] - s * v[1], s * v[0] + c * v[1], v[2]], acceleration, delta))

    assert len(row) == 6 + n_casters
    return solve_ivp(rate, (0.0, duration), row, rtol=1e-10, atol=1e-12).y[:, -1]


def pressed(angle, beta=0.4):
    """A robot on the floor y = 0 whose wheels push it downwards at an angle from the x-axis, and its torques."""
    robot = shaped(load_robot("chung2008"), 0.1)
    steering = np.full(3, angle - beta) + np.array([0.02, -0.01, 0.0])
    torque = np.tile([0.05, 0.0], 3)
    return robot, np.array([0.0, 0.1, beta, 0.0, 0.0, 0.0, *steering]), torque


@pytest.mark.parametrize("mu", [0.0, 0.2])
def test_a_robot_slides_along_a_wall_as_one_that_is_tied_to_it(mu):
    """(O10): the error falls in proportion to the time step. Pushed at 45°, with friction slower but not stuck."""
    robot, row, torque = pressed(-np.pi / 4)
    model, duration = Model(robot), 0.4
    # friction needs a direction from the start
    row[3:5] = 0.05 * np.array([np.cos(row[2]), -np.sin(row[2])])
    expected = tied_to_the_floor(model, row, torque, 0.1, mu, duration)
    errors = []
    for h in (4e-3, 2e-3, 1e-3):
        start = floats(state_of(0.0, 0.1, row[2], (0.05, 0.0), 0.0, row[6:]))
        walk = Walk(robot, around_it(robot, FLOOR, friction=mu), start, torque).step(h, round(duration / h))
        assert walk.impacts == 0.0
        errors.append(np.hypot(*(np.array(walk.state.position) - expected[:2])))
    assert expected[0] > 0.05
    assert errors[0] < 0.02 * expected[0]
    assert errors[2] < 0.7 * errors[1] < 0.5 * errors[0]


@pytest.mark.parametrize(("angle", "sticks"), [(-1.2, True), (-0.9, False)])
def test_friction_holds_inside_its_cone_and_not_outside(angle, sticks):
    """A box on its long side; its motors push at 21° and 38° from the normal, friction of 0.5 holds up to 27°."""
    robot, torque = shaped(load_robot("chung2008"), BOX), np.tile([0.05, 0.0], 3)
    start = floats(state_of(0.0, 0.08, 0.0, (0.0, 0.0), 0.0, np.full(3, angle)))
    walk = Walk(robot, around_it(robot, FLOOR, friction=0.5), start, torque).step(4e-3, 50)
    force = 3 * 0.05 / 0.025  # N, for 0.2 s
    if sticks:
        assert abs(walk.state.position[0]) < 10.0 * STILL * 0.2
        assert_allclose(walk.impulse, (-0.2 * force * np.cos(angle), -0.2 * force * np.sin(angle)), rtol=1e-4)
    else:
        assert walk.state.position[0] > 1e-3
        assert_allclose(walk.impulse[0], -0.5 * walk.impulse[1], rtol=1e-3)


@pytest.mark.parametrize(("mu", "rolls"), [(0.5, True), (0.02, False)])
def test_a_disc_rolls_along_a_wall_that_is_rough_enough(mu, rolls):
    robot, row, torque = pressed(-1.2)
    start = floats(state_of(0.0, 0.1, row[2], (0.0, 0.0), 0.0, row[6:]))
    walk = Walk(robot, around_it(robot, FLOOR, friction=mu), start, torque).step(4e-3, 50)
    c, s = walk.state.heading
    slip = c * walk.state.twist[0] - s * walk.state.twist[1] + 0.1 * walk.state.twist[2]
    if rolls:
        assert abs(slip) < 1e-3
        assert 0.0 < -walk.impulse[0] < 0.5 * walk.impulse[1]
        assert walk.state.twist[2] < -0.05
    else:
        assert slip > 1e-2
        assert_allclose(walk.impulse[0], -0.02 * walk.impulse[1], rtol=1e-3)


@pytest.mark.parametrize("h", [2e-3, 1e-2])
@pytest.mark.parametrize("e", [0.0, 0.4])
def test_a_robot_that_leans_against_a_wall_comes_to_rest(h, e):
    robot, _, torque = pressed(-np.pi / 2)
    steering = np.full(3, -np.pi / 2)
    start = floats(state_of(0.0, 0.15, 0.0, (0.0, -0.3), 0.0, steering))
    walk = Walk(robot, around_it(robot, FLOOR, restitution=e, friction=0.3), start, torque).step(h, round(2.0 / h))
    impacts = walk.impacts
    for _ in range(100):
        walk.step(h)
        assert abs(walk.gap) < 2e-5
        assert abs(walk.state.twist[1]) < 10.0 * STILL
    assert walk.impacts == impacts


@pytest.mark.parametrize(("e", "mu"), [(0.3, 0.3), pytest.param(0.7, 0.5, marks=pytest.mark.slow)])
def test_a_robot_that_is_pushed_into_a_corner_comes_to_rest(e, mu):
    """Two walls whose friction loads each other: neither may be given more than both need together."""
    robot = load_robot("chung2008")
    sides = [{"point": [-0.5, 0.0], "normal": [1.0, 0.0]}, {"point": [0.0, -0.5], "normal": [0.0, 1.0]}]
    around = around_it(robot, {"half_planes": sides}, restitution=e, friction=mu)
    walk = Walk(robot, around, floats(state_of(-0.2, -0.1, 0.3, (0.0, 0.0), 0.0, np.array([0.4, 1.9, -2.0]))))

    def pushed(steps):
        for _ in range(steps):
            c, s = walk.state.heading
            walk.wrench = (-20.0 * c - 14.0 * s, 20.0 * s - 14.0 * c, 0.0)  # (−20, −14) N in W
            walk.step(5e-3)

    pushed(800)
    impacts = walk.impacts
    pushed(200)
    assert walk.impacts == impacts
    assert abs(walk.gap) < 2e-5
    assert np.abs(walk.state.twist).max() < 1e-3  # casters still turn a little, against nothing but their inertia


@pytest.mark.parametrize("mu", [0.0, 0.3])
@pytest.mark.parametrize("outline", [0.1, TRIANGLE, BOX], ids=["disc", "triangle", "box"])
def test_the_order_of_walls_does_not_matter_on_the_way(outline, mu):
    """Thrown and pushed into a corner, for a second of impacts, sliding and rest."""
    robot = shaped(load_robot("chung2008"), outline)
    sides = [{"point": [-0.5, 0.0], "normal": [1.0, 0.0]}, {"point": [0.0, -0.5], "normal": [0.3, 1.0]}]
    ends = []
    for order in (sides, sides[::-1]):
        around = around_it(robot, {"half_planes": order}, restitution=0.5, friction=mu)
        start = floats(state_of(0.0, 0.0, 0.3, (-0.8, -0.9), 0.5, np.array([0.4, 1.9, -2.0])))
        walk = Walk(robot, around, start, np.array([0.05, 0.02, -0.03, 0.01, 0.06, -0.01]))
        for _ in range(200):
            c, s = walk.state.heading
            walk.wrench = (-6.0 * c - 5.0 * s, 6.0 * s - 5.0 * c, 0.0)  # (−6, −5) N in W
            walk.step(5e-3)
        ends.append([*walk.state.position, *walk.state.heading])
        assert walk.impacts > 1
    assert_allclose(ends[0], ends[1], rtol=0.0, atol=STILL)  # contacts are found still to that speed


def test_numbers_that_are_not_finite_are_not_hidden_by_obstacles():
    """Far beyond the speeds that a step can follow, the robot is lost, not frozen where it was."""
    robot = load_robot("chung2008")
    around = around_it(robot, {"room": [[-2.0, -2.0], [2.0, 2.0]]})
    start = floats(state_of(0.0, 0.0, 0.0, (1e200, 0.0), 0.0, np.array([0.4, 1.9, -2.0])))
    walk = Walk(robot, around, start).step(5e-3)
    assert not np.isfinite([*walk.state.position, *walk.state.twist]).all()


@pytest.mark.parametrize("outline", [0.1, TRIANGLE, BOX], ids=["disc", "triangle", "box"])
@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
def test_an_acute_corner_neither_lets_the_robot_in_nor_holds_its_time(outline, e):
    """Two half-planes at 30°: pushed into the corner and out of it again."""
    half = np.radians(15.0)
    sides = [
        {"point": [0.0, 0.0], "normal": [-np.sin(half), np.cos(half)]},
        {"point": [0.0, 0.0], "normal": [-np.sin(half), -np.cos(half)]},
    ]
    robot = shaped(load_robot("chung2008"), outline)
    around = around_it(robot, {"half_planes": sides}, restitution=e, friction=0.1)
    start = floats(state_of(-1.6, 0.02, 0.1, (1.5, 0.1), 0.5, np.zeros(3)))
    walk = Walk(robot, around, start, np.tile([0.1, 0.0], 3))
    assert walk.gap > 0.0
    for _ in range(200):
        assert walk.step(5e-3).gap >= -ALLOWED
    walk.torques = ((-0.1, 0.0),) * 3
    farthest = 0.0
    for _ in range(200):
        assert walk.step(5e-3).gap >= -ALLOWED
        farthest = max(farthest, walk.gap)
    assert walk.impacts > 0
    assert farthest > 5e-3


def test_a_flush_edge_does_not_turn():
    """A box on its long side, pushed off its middle: the two ends of the edge carry what one could not."""
    robot = shaped(load_robot("chung2008"), BOX)
    torque = np.array([0.1, 0.0, 0.02, 0.0, 0.02, 0.0])
    start = floats(state_of(0.0, 0.08, 0.0, (0.0, 0.0), 0.0, np.full(3, -np.pi / 2)))
    walk = Walk(robot, around_it(robot, FLOOR, friction=0.1), start, torque)
    for _ in range(400):
        walk.step(5e-3)
        assert abs(walk.state.heading[1]) < ALLOWED / 0.15
        assert abs(walk.gap) < ALLOWED
    assert_allclose(walk.pressing, 0.14 / 0.025 * 2.0, rtol=1e-3)  # N s: all of the motors' force, for 2 s


@pytest.mark.parametrize("outline", [0.1, BOX], ids=["disc", "box"])
@pytest.mark.parametrize("room", [1e-2, 1e-3, 1e-4, 0.0])
def test_a_robot_between_two_walls_that_it_barely_fits_stays_between_them(outline, room):
    """More impacts than a time step may have: it ends all the same, and nothing gets through."""
    robot = shaped(load_robot("chung2008"), outline)
    height = 0.1 if isinstance(outline, float) else 0.08
    walls = [
        {"start": [-1.0, side * (height + 0.5 * room)], "end": [1.0, side * (height + 0.5 * room)]} for side in (-1, 1)
    ]
    walk = Walk(
        robot,
        around_it(robot, {"walls": walls}, restitution=1.0),
        floats(state_of(0.0, 0.0, 0.0, (0.1, 2.0), 0.0, np.full(3, 1.5))),
        np.tile([0.05, 0.0], 3),
    )
    before = energy(Model(robot), walk.state)
    for _ in range(60):
        walk.step(1e-2)
        assert walk.gap >= -ALLOWED
        assert abs(walk.state.position[1]) < 0.5 * room + ALLOWED
    assert walk.impacts > 0
    assert np.isfinite(walk.state.twist).all()
    assert energy(Model(robot), walk.state) < before + 0.15 / 0.025 * 1.0


def test_far_obstacles_change_nothing():
    """To the last bit."""
    robot = shaped(random_robot(3, 4), TRIANGLE)
    rng = np.random.default_rng(1)
    start = floats(state_of(0.0, 0.0, 0.3, (1.0, -0.5), 2.0, rng.uniform(-3, 3, 4)))
    torque = rng.uniform(-0.5, 0.5, 8)
    walk = Walk(robot, around_it(robot, {"room": [[-5, -5], [5, 5]]}), start, torque)
    free = start
    for _ in range(50):
        walk.step(2e-3)
        free = rk4_step(free, walk.torques, (0.0, 0.0, 0.0), 2e-3, walk.parameters)
    assert_array_equal(np.concatenate([np.ravel(p) for p in walk.state]), np.concatenate([np.ravel(p) for p in free]))


@pytest.mark.slow
@settings(deadline=None, max_examples=6)
@given(seed=st.integers(0, 10**6), outline=st.sampled_from([0.2, TRIANGLE]), e=st.sampled_from([0.0, 0.5, 1.0]))
def test_a_coasting_robot_gains_no_energy(seed, outline, e):
    """Without motors the energy falls, but for the error of the time step, which the free robot shows."""
    robot = shaped(frictionless(random_robot(seed, 3)), outline)
    model, rng, count, h = Model(robot), np.random.default_rng(seed), 20, 2e-3
    arena = {"room": [[-0.42, -0.42], [0.42, 0.42]]}
    start = state_of(
        rng.uniform(-0.1, 0.1, count),
        rng.uniform(-0.1, 0.1, count),
        rng.uniform(-3.0, 3.0, count),
        rng.uniform(-1.0, 1.0, (2, count)),
        rng.uniform(-2.0, 2.0, count),
        rng.uniform(-3.0, 3.0, (3, count)),
    )
    walk = Walk(robot, around_it(robot, arena, restitution=e, friction=0.2), start)
    for _ in range(120):
        before, old = energy(model, walk.state), walk.state
        free = rk4_step(old, walk.torques, (0.0, 0.0, 0.0), h, walk.parameters)
        error = abs(energy(model, free) - before)
        pressed_before = np.array(walk.pressing)
        walk.step(h)
        loose = STILL * (np.array(walk.pressing) - pressed_before)  # J, contacts are found still to that speed
        assert (energy(model, walk.state) <= before + 10.0 * error + loose + 1e-9).all()
    assume(np.any(walk.impacts > 0))  # some robots turn about themselves and never reach a wall
