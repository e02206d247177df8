"""The time step of a robot whose wheels may slip, as laws: grip below the limit, no chatter, energy, orders."""

from itertools import pairwise

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.free_casters import slip_energy
from caster_gym.mechanics.ground import platform_tilt
from caster_gym.mechanics.integration import State, pack_state, rk4_step
from caster_gym.mechanics.parameters import GRAVITY, robot_parameters
from caster_gym.mechanics.scalars import each, pairs, total
from caster_gym.mechanics.slip import slip_step
from caster_gym.mechanics.slip_state import rolling_state, turn_by, unpack_slip_state
from caster_gym.mechanics.slip_tilt import free_tilt
from caster_gym.shipped_files import names_of
from tests.free_motion import slip_dynamics
from tests.kane_free import FreeKane
from tests.random_robots import CASTER_COUNTS, frictionless, random_motion, random_robot

NOTHING = (0.0, 0.0, 0.0)
ROBOTS = names_of("robots")


def directions(steering):
    return tuple((np.cos(angle), np.sin(angle)) for angle in steering)


def rolling(numbers, steering, twist):
    """A state at the origin whose wheels roll."""
    return rolling_state(State((0.0, 0.0), (1.0, 0.0), tuple(twist), directions(steering)), numbers)


def walk(state, torques, friction, h, steps, numbers, wrench=NOTHING):
    """States and what the floor did, step by step."""
    frictions = (friction,) * len(numbers.casters)
    states, footfalls = [state], []
    for _ in range(steps):
        state, footfall = slip_step(state, torques, wrench, h, frictions, numbers)
        states.append(state)
        footfalls.append(footfall)
    return states, footfalls


def slip_speeds(footfalls):
    """|u| (steps, N)."""
    return np.array([[np.hypot(*u) for u in footfall.slips] for footfall in footfalls])


def driven(robot, seed, strength):
    """Joint torques that push each wheel with up to a share of its weight, along and across."""
    rng = np.random.default_rng(seed)
    push = strength * GRAVITY * robot.platform.mass / robot.caster_count
    levers = np.array([(caster.radius, caster.trail) for caster in robot.casters]).ravel()
    return pairs(tuple(push * levers * rng.uniform(-1.0, 1.0, 2 * robot.caster_count)))


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_great_friction_is_rolling_without_slip(caster_count):
    """The plant of section D is the limit: to second order in the step, with wheels that do not slip at all."""
    robot = frictionless(random_robot(20, caster_count))
    numbers, (steering, twist, *_) = robot_parameters(robot), random_motion(20, robot)
    start, torques = rolling(numbers, steering, 0.5 * twist), driven(robot, 20, 0.1)
    exact = State(*start[:4])
    for _ in range(200):
        exact = rk4_step(exact, torques, NOTHING, 1e-3, numbers)
    errors = []
    for steps in (25, 50, 100):
        states, footfalls = walk(start, torques, 1e6, 0.2 / steps, steps, numbers)
        ours = np.array(pack_state(states[-1])[: 7 + 2 * caster_count])
        errors.append(np.abs(ours - np.array(pack_state(exact))).max())
        assert slip_speeds(footfalls).max() < 1e-13  # rounding of 1 m/s
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)  # of second order, with room for the third
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(4))
def test_a_push_below_the_limit_makes_no_wheel_slip_and_one_above_does(name, seed):
    """The limit is that of `Model.ground_forces` and `Model.wheel_loads`, which know of no slip."""
    robot = frictionless(load_robot(name))  # whose friction would grow as it starts to move
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 0.05})})
    model, numbers, rng = Model(robot), robot_parameters(robot), np.random.default_rng(seed)
    steering, n = rng.uniform(-np.pi, np.pi, robot.caster_count), robot.caster_count
    angle = rng.uniform(-np.pi, np.pi)
    push = np.array([np.cos(angle), np.sin(angle), rng.uniform(-0.1, 0.1)])
    still = np.zeros(3), np.zeros(2 * n)

    def use(size):
        forces, loads = (ask(steering, *still, size * push) for ask in (model.ground_forces, model.wheel_loads))
        return np.hypot(*forces.T) / (0.7 * np.maximum(loads, 1e-9))

    low, high = 0.0, 1e4
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if use(middle).max() < 1.0 else (low, middle)
    weakest = int(use(low).argmax())
    for share, slips in ((0.99, False), (1.01, True)):
        # 5 steps of 0.2 ms: the loads have found their shift, and the robot has moved by some µm
        _, footfalls = walk(
            rolling(numbers, steering, NOTHING), ((0.0, 0.0),) * n, 0.7, 2e-4, 5, numbers, tuple(share * low * push)
        )
        speeds = slip_speeds(footfalls)[-1]
        assert (speeds[weakest] > 1e-5) == slips
        if not slips:
            assert speeds.max() < 1e-12


@pytest.mark.parametrize("h", [5e-3, 1e-2])
@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_energy_never_rises_without_motors(caster_count, h):
    """Whatever slips, grips, lifts or turns: by no more than the error of an explicit step, of third order in it."""
    for seed in range(6):
        robot = frictionless(random_robot(seed, caster_count))
        numbers, rng = robot_parameters(robot), np.random.default_rng(seed)
        numbers = numbers._replace(platform=numbers.platform._replace(height=0.1))
        start = rolling(numbers, rng.uniform(-np.pi, np.pi, caster_count), rng.uniform(-1.0, 1.0, 3))
        start = start._replace(rates=tuple(map(tuple, rng.uniform(-10.0, 10.0, (caster_count, 2)))))
        states, _ = walk(start, ((0.0, 0.0),) * caster_count, rng.choice((0.02, 0.2, 0.7)), h, 40, numbers)
        energies = np.array([slip_energy(one.twist, one.directions, one.rates, numbers) for one in states])
        assert np.diff(energies).max() < 60.0 * h**3 * energies[0]  # (10 rad/s · h)³ / 16; 36 seen at both steps
        assert energies[-1] < 0.99 * energies[0]


def kinetic(state, numbers):
    """Kinetic energy of all bodies [J], by the equations' own (S7), which test_mechanics_free_casters holds."""
    return slip_energy(state.twist, state.directions, state.rates, numbers)


def turning(state):
    """How fast platform and casters turn, all together. [rad/s]"""
    return np.abs(state.twist[2]) + np.sum(np.abs([eta for eta, _ in state.rates]), axis=0)


def many_slides(robot, frictions, starts):
    """States of one robot, a lane for each friction and start, and the friction of each lane."""
    n = robot.caster_count
    rng = np.random.default_rng(50)
    twist, steering = 0.7 * rng.uniform(-1.0, 1.0, (3, starts)), rng.uniform(-np.pi, np.pi, (n, starts))
    rates = rng.uniform(-10.0, 10.0, (n, 2, starts))
    twist, steering, rates = (np.tile(part, len(frictions)) for part in (twist, steering, rates))
    zero = np.zeros(starts * len(frictions))
    directions = tuple((np.cos(angle), np.sin(angle)) for angle in steering)
    state = State((zero, zero), (zero + 1.0, zero), tuple(twist), directions, tuple(map(tuple, rates)), (zero, zero))
    return state, np.repeat(frictions, starts)


@pytest.mark.parametrize("height", [0.3, *(pytest.param(one, marks=pytest.mark.slow) for one in (0.0, 0.1, 0.6))])
@pytest.mark.parametrize("name", [3, *(pytest.param(one, marks=pytest.mark.slow) for one in (*ROBOTS, 4, 5))])
def test_energy_never_rises_where_wheels_lift(name, height):
    """(S11): on floors from ice to glue, of robots as tall as they like."""
    robot = frictionless(random_robot(3, name) if isinstance(name, int) else load_robot(name))
    numbers = robot_parameters(robot)
    numbers = numbers._replace(platform=numbers.platform._replace(height=height))
    start, frictions = many_slides(robot, (0.1, 0.3, 1.0, 3.0, 10.0, 30.0, 100.0, 1000.0), 8)
    zero, h = 0.0 * frictions, 1e-3
    none, still = ((zero, zero),) * robot.caster_count, (zero, zero, zero)
    state, energies, rates = start, [kinetic(start, numbers)], [turning(start)]
    for _ in range(200):
        state, _ = slip_step(state, none, still, h, (frictions,) * robot.caster_count, numbers)
        energies.append(kinetic(state, numbers))
        rates.append(turning(state))
    before, angles = np.array(energies)[:-1], h * (np.array(rates)[:-1] + np.array(rates)[1:])
    assert (
        np.diff(energies, axis=0) <= 0.07 * angles**3 * before
    ).all()  # of third order in the angle that it turns by
    least = np.minimum.accumulate(energies)
    assert (energies - least).max() < 1e-3 * energies[0].max()  # the sum of that over 200 steps; up to 0.4 before
    assert all(np.isfinite(part).all() for part in pack_state(state))


def test_a_start_that_once_made_energy_from_nothing():
    """chung2008 on a floor of friction 100, where it lifts two wheels at once: 1.5 J of 0.6 J, before."""
    numbers = robot_parameters(load_robot("chung2008"))
    steering = (-2.656448420, -2.983528762, -1.829042870)
    start = rolling(numbers, steering, (0.3643755631, -0.2213036810, -0.3172600706))
    rates = ((-3.166496318, 8.562268420), (7.794565770, -0.3899796671), (-0.9048036283, 3.339860877))
    states, _ = walk(start._replace(rates=rates), ((0.0, 0.0),) * 3, 100.0, 1e-3, 500, numbers)
    energies = np.array([kinetic(state, numbers) for state in states])
    assert np.diff(energies).max() < 1e-5 * energies[0]  # (0.04 rad)³ / 16
    assert (energies - np.minimum.accumulate(energies)).max() < 1e-3 * energies[0]


@pytest.mark.parametrize("name", ROBOTS)
def test_motors_give_what_energy_is_gained(name):
    """Random torques on a floor of friction 100, changed every 15 steps, where wheels lift and fall."""
    robot = frictionless(load_robot(name))
    numbers, rng, h = robot_parameters(robot), np.random.default_rng(8), 2e-3
    state = rolling(numbers, rng.uniform(-np.pi, np.pi, robot.caster_count), NOTHING)
    given = gained = 0.0
    for _ in range(20):
        torques = driven(robot, rng.integers(1000), 0.3)
        states, _ = walk(state, torques, 100.0, h, 15, numbers)
        for one, other in pairwise(states):
            work = 0.0
            for (roll, steer), before, after in zip(torques, one.rates, other.rates, strict=True):
                eta, theta = 0.5 * (before[0] + after[0]), 0.5 * (before[1] + after[1])
                work += h * (roll * theta + steer * (eta - 0.5 * (one.twist[2] + other.twist[2])))
            given += work
        state = states[-1]
        gained = kinetic(state, numbers)
        assert gained <= given + 0.02 * abs(given) + 1e-3  # third order of steps that turn wheels by up to 0.1 rad


def momentum(state, numbers):
    """Of all bodies in the world [N s]: the derivative of the kinetic energy, which is a quadratic form."""
    v, unit = np.array(state.twist), np.eye(3)
    x, y, _ = (
        0.5 * (kinetic(state._replace(twist=v + e), numbers) - kinetic(state._replace(twist=v - e), numbers))
        for e in unit
    )
    c, s = state.heading
    return np.array((c * x - s * y, s * x + c * y))


def along_world(state, f, force):
    """A force along f and f⊥, in the world. [N]"""
    (c, s), (p, q) = state.heading, force
    x, y = p * f[0] - q * f[1], p * f[1] + q * f[0]
    return np.array((c * x - s * y, s * x + c * y))


def unexplained(states, footfalls, h, numbers):
    """Momentum (2,) that the floor's forces did not give, and the sum of what they gave. [N s]"""
    rest, given = momentum(states[-1], numbers) - momentum(states[0], numbers), 0.0
    for (before, after), footfall in zip(pairwise(states), footfalls, strict=True):
        ends = [
            sum(map(along_world, (one,) * len(footfall.forces), one.directions, footfall.forces))
            for one in (before, after)
        ]
        impulse = 0.5 * h * (ends[0] + ends[1])
        rest, given = rest - impulse, given + np.hypot(*impulse)
    return np.abs(rest).max(), given


@pytest.mark.parametrize("name", ROBOTS)
def test_the_floor_alone_changes_momentum(name):
    """To second order while wheels carry; where they lift and fall, to a tenth or so of what the floor gives."""
    robot = frictionless(load_robot(name))
    numbers, none = robot_parameters(robot), ((0.0, 0.0),) * robot.caster_count
    numbers = numbers._replace(platform=numbers.platform._replace(height=0.1))
    rng = np.random.default_rng(51)
    start = rolling(numbers, rng.uniform(-np.pi, np.pi, robot.caster_count), 0.7 * rng.uniform(-1.0, 1.0, 3))
    start = start._replace(rates=tuple(map(tuple, rng.uniform(-10.0, 10.0, (robot.caster_count, 2)))))
    for h in (2e-3, 1e-3):
        states, footfalls = walk(start, none, 0.3, h, round(0.05 / h), numbers)
        rest, given = unexplained(states, footfalls, h, numbers)
        assert rest < 200.0 * h**2 * given  # (10 rad/s · h)² is 100 of it; 125 seen
        states, footfalls = walk(start, none, 100.0, h, round(0.05 / h), numbers)
        rest, given = unexplained(states, footfalls, h, numbers)
        assert rest < 0.15 * given


@pytest.mark.parametrize("h", [4e-3, 1e-3, 1e-4])
def test_ice_without_friction_brakes_no_more_in_short_steps(h):
    """What holds a wheel that nothing holds is a force of 1 µN, whatever the step."""
    robot = frictionless(load_robot("tidybot2"))
    numbers = robot_parameters(robot)
    start = rolling(numbers, np.zeros(4), (0.0, 0.0, 0.0))._replace(twist=(0.5, 0.0, 0.0))
    states, _ = walk(start, ((0.0, 0.0),) * 4, 0.0, h, 40, numbers)
    slower = (0.5 - states[-1].twist[0]) / (40.0 * h)
    assert abs(slower) < 1e-6  # 4 µN on some tens of kg: 1e-7 m/s²


@pytest.mark.parametrize("h", [1e-2, 2e-2])
@pytest.mark.parametrize("seed", range(3))
def test_slip_starts_ends_and_turns_back_without_chatter(h, seed):
    """A robot that is driven beyond the limit, let go, and driven the other way: no wheel's slip flickers."""
    robot = random_robot(seed, 4)
    numbers, twist = robot_parameters(robot), (0.0, 0.0, 0.0)
    aligned = rolling(numbers, np.zeros(4), twist)
    push = 0.3 * GRAVITY * robot.platform.mass / 4
    forward = tuple((1.5 * push * caster.radius, 0.0) for caster in robot.casters)
    back = tuple((-roll, 0.0) for roll, _ in forward)
    state, rows = aligned, []
    for torques, steps in ((forward, 12), (((0.0, 0.0),) * 4, 25), (back, 12), (((0.0, 0.0),) * 4, 40)):
        states, footfalls = walk(state, torques, 0.3, h, steps, numbers)
        state = states[-1]
        rows += [[u[0] for u in footfall.slips] for footfall in footfalls]
    slips = np.array(rows)
    held = np.abs(slips) < 1e-6
    signs = np.where(held, 0, np.sign(slips))
    changes = (np.diff(signs, axis=0) != 0).sum(axis=0)
    assert (np.abs(slips).max(axis=0) > 0.01).any()
    assert (changes <= 5).all()  # starts, ends, starts the other way, ends; once more as a caster swings round
    assert held[-1].all()


def test_wheels_that_are_locked_skid_to_a_stop_and_stay():
    """Slip falls by μ g to zero and does not come back, at the tasks' steps."""
    robot = random_robot(4, 3)
    numbers = robot_parameters(robot)
    locked = numbers._replace(casters=tuple(caster._replace(roll_viscous=1.0) for caster in numbers.casters))
    start = rolling(numbers, np.zeros(3), (0.6, 0.0, 0.0))._replace(rates=((0.0, 0.0),) * 3)
    for h in (5e-3, 1e-2, 2e-2):
        states, footfalls = walk(start, ((0.0, 0.0),) * 3, 0.5, h, round(0.4 / h), locked)
        speeds = slip_speeds(footfalls)
        assert (np.diff(speeds, axis=0) < 1e-9).all()
        assert speeds[-1].max() < 1e-4  # the brake creeps
        way = states[-1].position[0]
        assert way == pytest.approx(0.6**2 / (2.0 * 0.5 * GRAVITY), rel=0.03)  # v² / (2 μ g); casters swing a little


@pytest.mark.parametrize("caster_count", CASTER_COUNTS)
def test_tilt_is_the_change_of_all_spins(caster_count):
    """(S10): height times force is what turns the robot about a horizontal axis on the floor, by Kane's bodies."""
    robot = random_robot(30, caster_count)
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 0.2})})
    numbers, (steering, twist, torque, wrench) = robot_parameters(robot), random_motion(30, robot)
    rng = np.random.default_rng(30)
    rates, floor = rng.uniform(-6, 6, (caster_count, 2)), rng.uniform(-20, 20, (caster_count, 2))
    f, v, own = directions(steering), tuple(twist), tuple(map(tuple, rates))
    given = pairs(tuple(torque)), tuple(map(tuple, floor)), tuple(wrench)
    v_rate, own_rate = slip_dynamics(v, f, own, *given, numbers)
    motions = tuple(zip(own, own_rate, strict=True))
    casters = total(each(free_tilt, (v, v_rate), f, motions, numbers.casters))
    ours = np.add(casters, platform_tilt(v, v_rate, tuple(wrench), numbers.platform))
    theirs = FreeKane(robot).tilt(steering, twist, rates, torque, floor, wrench)
    assert_allclose(ours, theirs, rtol=0.0, atol=1e-11 * np.abs(theirs).max())  # rounding


def test_loads_follow_within_half_a_step():
    """A push for one step tilts the loads of the next; (G5) with the tilt of the acceleration that it made."""
    robot = load_robot("tidybot2")
    robot = frictionless(robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 0.2})}))
    numbers, steering, push = robot_parameters(robot), np.zeros(4), (100.0, 0.0, 0.0)
    none = ((0.0, 0.0),) * 4
    _, footfalls = walk(rolling(numbers, steering, NOTHING), none, 10.0, 1e-4, 4, numbers, push)
    expected = Model(robot).wheel_loads(steering, np.zeros(3), np.zeros(8), push)
    assert_allclose(footfalls[-1].loads, expected, rtol=1e-4)  # the robot moves by some µm and mm/s
    assert np.ptp(expected) > 1.0


def test_joint_friction_stops_a_light_wheel_and_does_not_turn_it_back():
    """(S8): a lifted wheel, whose dry friction would stop it ten times over in one step."""
    numbers = robot_parameters(random_robot(5, 3))
    stiff = numbers._replace(casters=tuple(c._replace(roll_viscous=3.0, steer_viscous=3.0) for c in numbers.casters))
    start = rolling(stiff, np.zeros(3), NOTHING)._replace(rates=((4.0, 20.0),) * 3)
    states, _ = walk(start, ((0.0, 0.0),) * 3, 0.0, 1e-2, 30, stiff)
    rates = np.array([[[eta - state.twist[2], theta] for eta, theta in state.rates] for state in states])
    # J_θδ and the platform couple them: a hundredth of the start is room for what is no friction of the joint itself
    assert (rates > -1e-2 * rates[0]).all()
    assert (rates[-1] < 1e-2 * rates[0]).all()


def test_directions_keep_their_length():
    """(S9): to rounding, however fast; and turn by the angle to second order."""
    f = (0.6, 0.8)
    for _ in range(1000):
        f = turn_by(f, 0.7)
    assert np.hypot(*f) == pytest.approx(1.0, abs=1e-13)
    errors = []
    for angle in (0.2, 0.1):
        c, s = turn_by((1.0, 0.0), angle)
        errors.append(abs(np.arctan2(s, c) - angle))
    assert errors[0] / errors[1] == pytest.approx(8.0, rel=0.05)  # of third order in one step


def test_a_slide_that_lasts_is_of_second_order():
    """(S15): on ice, where no wheel is ever held. Where the robot is; the loads' lag leaves a little in the rates."""
    robot = frictionless(random_robot(7, 4))
    numbers, (steering, twist, *_) = robot_parameters(robot), random_motion(7, robot)
    start = rolling(numbers, steering, twist)._replace(rates=((5.0, 40.0), (-4.0, -30.0), (3.0, 50.0), (-5.0, 60.0)))
    ends = []
    for steps in (10, 20, 40, 320):
        states, footfalls = walk(start, ((0.0, 0.0),) * 4, 0.05, 0.05 / steps, steps, numbers)
        assert slip_speeds(footfalls).min() > 0.1
        end = states[-1]
        ends.append(np.array((*end.position, *end.heading, *np.ravel(end.directions))))
    errors = [np.abs(end - ends[-1]).max() for end in ends[:3]]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.2)


def test_a_lifted_wheel_has_no_friction():
    """Nothing of the floor acts on a wheel without load, and nothing divides by that load."""
    robot = load_robot("xr4000")
    robot = robot.model_copy(update={"platform": robot.platform.model_copy(update={"height": 1.5})})
    numbers = robot_parameters(robot)
    _, footfalls = walk(
        rolling(numbers, np.zeros(4), NOTHING), ((0.0, 0.0),) * 4, 0.7, 1e-3, 10, numbers, (300.0, 0.0, 0.0)
    )
    loads, forces = np.array(footfalls[-1].loads), np.array(footfalls[-1].forces)
    assert (loads == 0.0).any()
    assert (np.abs(forces[loads == 0.0]) <= 1.001e-6).all()  # the least force, 1 µN
    assert np.isfinite(forces).all()


def test_packing_and_unpacking_are_inverse():
    state = rolling(robot_parameters(random_robot(8, 5)), np.arange(5.0), (0.1, 0.2, 0.3))
    assert unpack_slip_state(pack_state(state)) == state
