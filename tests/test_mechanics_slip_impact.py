"""Impacts on a floor of finite friction: between wheels that roll through them and wheels that answer freely."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import load_robot
from caster_gym.arena.arena import Arena, HalfPlane
from caster_gym.arena.packing import surroundings
from caster_gym.floor import Floor
from caster_gym.mechanics.contact import guarded_step
from caster_gym.mechanics.floor import Surface, parameters_on
from caster_gym.mechanics.free_casters import slip_energy, slip_velocity
from caster_gym.mechanics.grip_or_slip import impact
from caster_gym.mechanics.ground import wheel_loads
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.separation import Hull, Obstacles
from caster_gym.mechanics.slip_state import rolling_state
from caster_gym.shipped_files import names_of
from tests.free_motion import slip_dynamics
from tests.kane_free import FreeKane

ROBOTS = names_of("robots")
NOTHING = (0.0, 0.0, 0.0)


def met(name, seed, speed=0.5, turn=0.0, restitution=0.5, wall_friction=0.0):
    """A robot whose wheels roll, just before it meets a wall ahead of it; with the wall."""
    robot = load_robot(name)
    rng = np.random.default_rng(seed)
    steering = rng.uniform(-np.pi, np.pi, robot.caster_count)
    f = tuple((float(np.cos(angle)), float(np.sin(angle))) for angle in steering)
    outline = robot.platform.footprint
    front = outline.disc or max(x for x, _ in outline.polygon or ())
    wall = Arena(
        half_planes=(HalfPlane(point=(front, 0.0), normal=(-1.0, 0.0)),),
        restitution=restitution,
        friction=wall_friction,
    )
    around = surroundings(robot, wall)
    tables = (tuple(part.tolist() if isinstance(part, np.ndarray) else part for part in table) for table in around)
    hull, obstacles = (kind(*parts) for kind, parts in zip((Hull, Obstacles), tables, strict=True))
    state = State((0.0, 0.0), (1.0, 0.0), (speed, 0.0, turn), f)
    return robot, steering, state, hull, obstacles


def struck(name, seed, friction, contact_time, **how):
    """Numbers, state before and after, what hit, and the greatest share of the floor's friction."""
    robot, steering, rolling, hull, obstacles = met(name, seed, **how)
    numbers = parameters_on(robot, "exact", Floor(friction=friction, contact_time=contact_time))
    before = rolling_state(rolling, numbers)
    surface = Surface((friction,) * robot.caster_count, contact_time)
    after, hits, used = impact(before, how.get("restitution", 0.5), numbers, hull, obstacles, 0, 1, surface)
    return robot, steering, numbers, before, after, hits, used


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(4))
def test_a_floor_that_holds_everything_makes_the_impact_of_rolling_wheels(name, seed):
    """(S16) with a great limit: the impulse, the twist after it, and wheels that still roll."""
    _, _, numbers, _, after, hits, used = struck(name, seed, 1e3, 1.0)
    _, _, rolling, hull, obstacles = met(name, seed)
    expected, pressure, _ = impact(rolling, 0.5, numbers, hull, obstacles, 0, 1, None)
    assert hits.normal == pytest.approx(pressure.normal, rel=1e-9)
    assert_allclose(after.twist, expected.twist, rtol=0.0, atol=1e-9)
    slips = [
        slip_velocity(after.twist, *one) for one in zip(after.directions, after.rates, numbers.casters, strict=True)
    ]
    assert np.abs(slips).max() < 1e-9
    assert used < 0.01


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize("seed", range(4))
def test_without_a_floor_the_casters_answer_freely(name, seed):
    """(S16) with no limit: a flush hit without turning meets the inertia that Kane's free bodies have."""
    robot, steering, _, before, after, hits, _ = struck(name, seed, 1e-6, 1e-3)
    answer = FreeKane(robot).inertia_beside(steering)
    change = np.linalg.solve(answer, hits.wrench)
    assert_allclose(np.subtract(after.twist, before.twist), change, rtol=0.0, atol=1e-5)  # the floor's 1 µN s a wheel


@pytest.mark.parametrize("restitution", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("wall_friction", [0.0, 0.5])
@pytest.mark.parametrize("name", ROBOTS)
def test_an_impact_takes_energy(name, wall_friction, restitution):
    """Whatever the floor holds and however the robot turns."""
    for seed in range(4):
        for floor in (0.01, 0.3, 0.7, 50.0):
            how = {"speed": 0.6, "turn": 0.5 - 0.3 * seed, "restitution": restitution, "wall_friction": wall_friction}
            _, _, numbers, before, after, hits, used = struck(name, seed, floor, 0.01, **how)
            energies = [slip_energy(one.twist, one.directions, one.rates, numbers) for one in (before, after)]
            assert energies[1] <= energies[0] * (1.0 + 1e-9)  # rounding
            assert hits.normal > 0.0
            assert used <= 1.0 + 1e-9


def test_the_impulse_of_tidybot2_is_that_of_a_floor_that_lets_go():
    """At 0.5 m/s and e = 0.5 MuJoCo's floor of 0.7 gives 41 to 46 N s and 0.04 m/s sideways, in 10 ms; see the page of
    the comparison. Wheels that roll through it would take more than twice that."""
    found = [struck("tidybot2", seed, 0.7, 0.01) for seed in range(12)]
    impulses = [hits.normal for *_, hits, _ in found]
    assert 41.0 < min(impulses) < max(impulses) < 48.0
    assert max(abs(after.twist[1]) for _, _, _, _, after, _, _ in found) < 0.05
    rolling = []
    for seed in range(12):
        robot, _, state, hull, obstacles = met("tidybot2", seed)
        numbers = parameters_on(robot, "exact", None)
        rolling.append(impact(state, 0.5, numbers, hull, obstacles, 0, 1, None)[1].normal)
    assert min(rolling) > 1.3 * max(impulses)
    assert np.median(rolling) > 2.0 * max(impulses)


@pytest.mark.parametrize("name", ROBOTS)
def test_an_impact_is_that_of_a_force_over_the_contact_time(name):
    """The same impulse spread over a short time, integrated in small steps with friction that is steep, not a jump.

    A thousandth of a second on a floor that holds ten times as much, in the posture of its start: nothing moves on.
    """
    for seed in range(3):
        robot, _, numbers, before, after, hits, _ = struck(name, seed, 0.7, 0.01)
        loads = wheel_loads(before.directions, (0.0, 0.0), numbers)
        v, rates, still, h = before.twist, before.rates, ((0.0, 0.0),) * robot.caster_count, 1e-6
        push = tuple(1e3 * part for part in hits.wrench)
        frictionless = numbers._replace(
            casters=tuple(
                one._replace(roll_viscous=0.0, roll_coulomb=0.0, steer_viscous=0.0, steer_coulomb=0.0, scrub=0.0)
                for one in numbers.casters
            )
        )
        at_rest = slip_dynamics(v, before.directions, rates, still, still, NOTHING, frictionless)  # what turns momenta
        for _ in range(1000):
            slips = [slip_velocity(v, *one) for one in zip(before.directions, rates, numbers.casters, strict=True)]
            floor = tuple(
                tuple(-7.0 * load * part / np.hypot(np.hypot(*u), 2e-3) for part in u)
                for load, u in zip(loads, slips, strict=True)
            )
            a, own = slip_dynamics(before.twist, before.directions, before.rates, still, floor, push, frictionless)
            v = tuple(x + h * (y - z) for x, y, z in zip(v, a, at_rest[0], strict=True))
            rates = tuple(
                (eta + h * (p - r), theta + h * (q - s))
                for (eta, theta), (p, q), (r, s) in zip(rates, own, at_rest[1], strict=True)
            )
        scale = np.abs(np.subtract(after.twist, before.twist)).max()
        # the limit holds at every instant, not only in the sum: a slip that turns meanwhile tells them apart
        assert_allclose(after.twist, v, rtol=0.0, atol=0.02 * scale)


def test_a_wheel_that_slides_is_not_held_by_the_impact():
    """(S16): its friction acts over the time step anyway, and would be counted twice."""
    robot, _, rolling, hull, obstacles = met("tidybot2", 1, restitution=0.0)
    numbers = parameters_on(robot, "exact", Floor(friction=0.7))
    state = rolling_state(rolling, numbers)
    spinning = state._replace(rates=tuple((eta, theta + 30.0) for eta, theta in state.rates))
    held = impact(spinning, 0.0, numbers, hull, obstacles, 0, 1, Surface((0.7,) * 4, 0.01))
    free = impact(spinning, 0.0, numbers, hull, obstacles, 0, 1, Surface((1e-6,) * 4, 0.01))
    assert_allclose(held[0].twist, free[0].twist, rtol=0.0, atol=1e-6)


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_that_leans_on_a_wall_stays_there(name):
    """(O10) on a floor of finite friction: pushed harder than wheels can hold, it neither sinks in nor bounces."""
    robot, _, rolling, hull, obstacles = met(name, 3, speed=0.0)
    numbers = parameters_on(robot, "exact", Floor(friction=0.3))
    state, surface = rolling_state(rolling, numbers), Surface((0.3,) * robot.caster_count, 0.01)
    weight = 9.81 * robot.platform.mass
    for _ in range(60):
        state, touch = guarded_step(
            state,
            ((0.0, 0.0),) * robot.caster_count,
            (0.6 * weight, 0.0, 0.0),
            5e-3,
            numbers,
            hull,
            obstacles,
            0,
            1,
            surface,
        )
    assert abs(state.position[0]) < 1e-3  # it is lifted out of what an order of the step leaves
    assert abs(state.twist[0]) < 5e-3
    assert touch.held[0] < 0.0
