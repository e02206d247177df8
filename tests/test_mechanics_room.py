"""caster_gym.mechanics.room: bounds that tell which robots may touch something in a step."""

import numpy as np

from caster_gym import load_robot
from caster_gym.mechanics.integration import State, pack_state, rk4_step
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.room import CLOSE, should_measure, speed_bound, step_within_room

ROBOT = load_robot("chung2008")
REACH = ROBOT.platform.footprint.outline.reach
H = 0.005  # [s]
ROOM = 0.015  # [m] that some use up in a step


def motions(count):
    """Random states, and where a step under random torques leads them."""
    rng, robot = np.random.default_rng(0), robot_parameters(ROBOT)
    for _ in range(count):
        x, y, beta, *steering = rng.uniform(-np.pi, np.pi, 6)
        unit = [(np.cos(angle), np.sin(angle)) for angle in (beta, *steering)]
        state = State((x, y), unit[0], tuple(rng.normal(0.0, (1.0, 1.0, 4.0))), tuple(unit[1:]))
        torques = tuple(map(tuple, rng.uniform(-0.2, 0.2, (3, 2))))
        yield state, rk4_step(state, torques, (0.0, 0.0, 0.0), H, robot)


def rim(state):
    """Points of a disc of the hull's reach, in W."""
    around = REACH * np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 73))
    return complex(*state.position) + complex(*state.heading) * around


def test_no_point_of_the_robot_is_faster_than_the_bound():
    rng = np.random.default_rng(1)
    for vx, vy, omega in rng.normal(0.0, 2.0, (200, 3)):
        points = REACH * np.exp(1j * rng.uniform(0.0, 2.0 * np.pi, 50))
        fastest = np.abs(complex(vx, vy) + 1j * omega * points).max()
        assert fastest <= speed_bound((vx, vy, omega), REACH) * (1.0 + 1e-15)  # rounding


def test_a_robot_that_goes_has_used_up_at_least_its_way():
    """The room that is left is still no more than the gap that is: every point has come nearer by its way at most."""
    went = 0
    for state, end in motions(200):
        after, left, goes = step_within_room((), ROOM, state, end, H, REACH)
        if goes:
            went += 1
            assert after == pack_state(end)
            assert np.abs(rim(end) - rim(state)).max() <= ROOM - left
            assert left >= CLOSE
        else:
            assert (after, left) == (pack_state(state), -1.0)
    assert 20 < went < 180  # both cases are there


def test_without_obstacles_every_step_is_ordinary():
    state, end = next(motions(1))
    assert step_within_room(None, -5.0, state, end, H, REACH) == (pack_state(end), -5.0, 1.0)


def test_gaps_are_measured_in_time():
    """Whoever may use up its room within a step has had it measured before."""
    for state, end in motions(100):
        _, left, _ = step_within_room((), ROOM, state, end, H, REACH)
        speeds = [speed_bound(one.twist, REACH) for one in (state, end)]
        if left == -1.0 and speeds[1] < 2.0 * speeds[0]:  # torques cannot do more in 5 ms, but from rest
            assert should_measure(ROOM, state.twist, H, REACH)
