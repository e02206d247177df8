"""caster_gym.engines.native.derivatives: against Torch's autograd, finite differences, and the fleet."""

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

import caster_gym.engines.tensor.scalars  # noqa: F401  # tells the mechanics about tensors
from caster_gym import load_robot
from caster_gym.engines.native.compilation import compilations
from caster_gym.engines.native.derivatives import DIFFERENTIABLE, TOGETHER, PeriodDerivatives
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.native.threads import BLOCKS_PER_SHARE, get_threads, set_threads
from caster_gym.mechanics.integration import pack_state, rk4_step, unpack_state
from caster_gym.mechanics.parameters import robot_parameters, with_load
from caster_gym.mechanics.scalars import pairs
from tests.random_robots import random_robot

STEP = 2e-3  # s
OF_ONE = ("radius_1", "trail_2", "steer_viscous_3")
BY = (*DIFFERENTIABLE, *OF_ONE)
ROBOTS = {
    "chung2008": load_robot("chung2008"),
    "random": random_robot(31, 3),
    "tidybot2": load_robot("tidybot2"),
    "xr4000": load_robot("xr4000"),
}
# Robots with four casters need code of their own
NAMES = [
    name if robot.caster_count == 3 else pytest.param(name, marks=pytest.mark.slow) for name, robot in ROBOTS.items()
]


def random_states(seed, count, caster_count=3):
    """States (count, 7 + 2 N) in motion and joint torques (count, 2 N)."""
    rng = np.random.default_rng((seed, caster_count))
    angles = rng.uniform(-np.pi, np.pi, (count, 1 + caster_count))
    units = np.stack((np.cos(angles), np.sin(angles)), 2)
    free = rng.uniform(-1.0, 1.0, (count, 5))
    states = np.concatenate((free[:, :2], units[:, 0], free[:, 2:], units[:, 1:].reshape(count, -1)), 1)
    return states, rng.uniform(-0.3, 0.3, (count, 2 * caster_count))


def varied(numbers, names, values):
    """The robot's numbers, to which values are added: to the platform's, to all casters' or to one caster's."""
    for name, value in zip(names, values, strict=True):
        if name in numbers.platform._fields:
            platform = numbers.platform._replace(**{name: getattr(numbers.platform, name) + value})
            numbers = numbers._replace(platform=platform)
            continue
        field, number = (name[:-2], int(name[-1]) - 1) if name in OF_ONE else (name, None)
        casters = tuple(
            caster._replace(**{field: getattr(caster, field) + value}) if number in (None, k) else caster
            for k, caster in enumerate(numbers.casters)
        )
        numbers = numbers._replace(casters=casters)
    return numbers


def period(state, torque, numbers, substeps):
    """Where the generic mechanics lead; components of any kind of scalar."""
    now = unpack_state(tuple(state))
    for _ in range(substeps):
        now = rk4_step(now, pairs(tuple(torque)), (0.0, 0.0, 0.0), STEP, numbers)
    return pack_state(now)


def autograd(function, *at):
    """Jacobians of a function of vectors by Torch."""
    tensors = tuple(torch.tensor(one, dtype=torch.float64) for one in at)
    jacobians = torch.autograd.functional.jacobian(lambda *given: torch.stack(function(*given)), tensors)
    return [jacobian.numpy() for jacobian in jacobians]


def assert_agree(found, expected):
    """To 1e-12 of the greatest derivative by the same quantity, some thousand times the rounding of 64 bits."""
    assert found.shape == expected.shape
    scale = np.maximum(np.abs(expected).max(axis=0), 1e-300)
    assert_allclose(found / scale, expected / scale, rtol=0.0, atol=1e-12)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_those_of_torch(name):
    robot = ROBOTS[name]
    numbers = robot_parameters(robot)
    states, torques = random_states(3, 2, robot.caster_count)
    found = PeriodDerivatives(robot, STEP, 2, BY).at(states, torques)
    for i in range(2):
        by_state, by_torque, by_parameters = autograd(
            lambda x, u, p: period(x, u, varied(numbers, BY, p), 2), states[i], torques[i], np.zeros(len(BY))
        )
        assert_agree(found.by_state[i], by_state)
        assert_agree(found.by_torque[i], by_torque)
        assert_agree(found.by_parameters[i], by_parameters)
    effect = np.abs(found.by_parameters).max(axis=(0, 1))
    assert (effect > 0.0).all() or name != "random"  # of which no number is zero


def central(function, at, step):
    """Jacobian of a function of columns by central differences."""
    nudges = step * np.eye(len(at))
    return (function(at[:, None] + nudges) - function(at[:, None] - nudges)) / (2.0 * step)


@pytest.mark.parametrize("name", NAMES)
def test_derivatives_are_the_limits_of_central_differences(name):
    """Within the differences' own error: a quarter of it at half the step, and rounding of 100 operations."""
    robot = ROBOTS[name]
    numbers = robot_parameters(robot)
    (states, torques), substeps, step = random_states(4, 1, robot.caster_count), 2, 1e-5
    found = PeriodDerivatives(robot, STEP, substeps, BY).at(states[0], torques[0])
    rows = len(states[0])
    free = rows + len(torques[0])

    def end(at):
        moved = period(at[:rows], at[rows:free], varied(numbers, BY, at[free:]), substeps)
        return np.stack(np.broadcast_arrays(*moved))

    at = np.concatenate((states[0], torques[0], np.zeros(len(BY))))
    coarse, fine = central(end, at, step), central(end, at, 0.5 * step)
    rounding = 100.0 * np.finfo(float).eps * (1.0 + np.abs(found.state[:, None])) / step
    exact = np.concatenate((found.by_state, found.by_torque, found.by_parameters), axis=1)
    assert (np.abs(exact - fine) <= np.abs(coarse - fine) + rounding).all()
    assert rounding.max() < 1e-8 * np.abs(exact).max()


@pytest.mark.parametrize("by", [(), ("mass",)])
def test_robots_move_as_in_a_fleet_to_the_last_bit(by):
    """A batch of robots that differ, shared by threads; and each robot of it alone, with the same derivatives."""
    count = 2 * BLOCKS_PER_SHARE * TOGETHER + 3
    robots = [random_robot(200 + i % 5, 3) for i in range(count)]
    states, torques = random_states(5, count)
    fleet = Fleet(robots)
    fleet.state = states
    fleet.step(torques, STEP, 3)
    before = get_threads()
    set_threads(2)
    try:
        found = PeriodDerivatives(robots, STEP, 3, by).at(states, torques)
    finally:
        set_threads(before)
    assert_array_equal(found.state, fleet.state)
    for i in (0, 7, count - 1):
        alone = PeriodDerivatives(robots[i], STEP, 3, by).at(states[i], torques[i])
        for one, all_of_them in zip(alone, found, strict=True):
            assert_array_equal(one, all_of_them[i])


def test_a_period_is_a_chain_of_shorter_ones():
    """Chain rule over the substeps, to the rounding of a product of 13 × 13 matrices of order 1."""
    robot = ROBOTS["random"]
    states, torques = random_states(6, 1)
    once, twice = PeriodDerivatives(robot, STEP), PeriodDerivatives(robot, STEP, 2)
    first = once.at(states, torques)
    second, whole = once.at(first.state, torques), twice.at(states, torques)
    assert_array_equal(second.state, whole.state)
    assert_allclose(second.by_state @ first.by_state, whole.by_state, rtol=0.0, atol=1e-13)
    chained = second.by_state @ first.by_torque + second.by_torque
    assert_allclose(chained, whole.by_torque, rtol=0.0, atol=1e-13)


def test_a_batch_of_batches():
    """Leading axes are kept: five moments of three robots each."""
    robots = [random_robot(200 + i, 3) for i in range(3)]
    states, torques = random_states(7, 15)
    found = PeriodDerivatives(robots, STEP).at(states.reshape(5, 3, 13), torques.reshape(5, 3, 6))
    assert found.by_torque.shape == (5, 3, 13, 6)
    assert found.by_parameters.shape == (5, 3, 13, 0)
    alone = PeriodDerivatives(robots[1], STEP).at(states[1::3], torques[1::3])
    assert_array_equal(found.by_state[:, 1], alone.by_state)


def test_arrays_may_lie_in_memory_as_they_like():
    """Such as those that nobody may write to; nothing is compiled for them, and nothing is written to any."""
    states, torques = random_states(10, 4)
    derivatives = PeriodDerivatives(ROBOTS["chung2008"], STEP)
    expected, before = derivatives.at(states, torques), (states.copy(), compilations())
    turned, locked = np.asfortranarray(states), torques.copy()
    turned.flags.writeable = locked.flags.writeable = False
    for one, other in zip(derivatives.at(turned, locked.tolist()), derivatives.at(states, locked), strict=True):
        assert_array_equal(one, other)
    assert_array_equal(derivatives.at(states, locked).by_torque, expected.by_torque)
    assert_array_equal(states, before[0])
    assert compilations() == before[1]


def test_a_payload_by_the_chain_rule():
    """The numbers of a loaded platform depend on the load as `with_load` says; Torch differentiates both at once."""
    robot, place = ROBOTS["chung2008"], (0.05, -0.03)
    numbers, names = robot_parameters(robot), ("mass", "inertia", "com_x", "com_y")

    def loaded(mass):
        return numbers._replace(platform=with_load(numbers.platform, mass, *place))

    states, torques = random_states(8, 1)
    derivatives = PeriodDerivatives(robot, STEP, 1, names, parameters=loaded(2.0))
    (by_load,) = autograd(lambda m: period(states[0], torques[0], loaded(m[0]), 1), [2.0])
    (of_platform,) = autograd(lambda m: [getattr(loaded(m[0]).platform, name) for name in names], [2.0])
    assert_agree(derivatives.at(states[0], torques[0]).by_parameters @ of_platform, by_load)


def test_what_cannot_be_differentiated_is_refused():
    robot = ROBOTS["chung2008"]
    with pytest.raises(ValueError, match=r"no parameter 'mas' to differentiate by: did you mean 'mass'\?"):
        PeriodDerivatives(robot, STEP, by=["mas"])
    with pytest.raises(ValueError, match="parameter 'floor_friction' has no effect on wheels that roll without slip"):
        PeriodDerivatives(robot, STEP, by=["floor_friction"])
    with pytest.raises(ValueError, match="parameter 'roll_max_torque_2' has no effect"):
        PeriodDerivatives(robot, STEP, by=["roll_max_torque_2"])
    with pytest.raises(ValueError, match="parameter 'radius_4' must end in a caster's number, 1 … 3"):
        PeriodDerivatives(robot, STEP, by=["radius_4"])
    with pytest.raises(ValueError, match="substeps must be 1 or more, got 0"):
        PeriodDerivatives(robot, STEP, 0)
    with pytest.raises(ValueError, match="a time step of 1 s cannot follow"):
        PeriodDerivatives(robot, 1.0)
    numbers = robot_parameters(ROBOTS["tidybot2"])
    with pytest.raises(ValueError, match="parameters must be of 3 casters, got 4"):
        PeriodDerivatives(robot, STEP, parameters=numbers)
    with pytest.raises(ValueError, match="parameters replace the numbers of one robot, got a list of 2"):
        PeriodDerivatives([robot] * 2, STEP, parameters=robot_parameters(robot))
    nothing = numbers.platform._replace(mass=np.nan)
    with pytest.raises(ValueError, match="a robot's numbers must be finite, got nan"):
        PeriodDerivatives(robot, STEP, parameters=numbers._replace(casters=numbers.casters[:3], platform=nothing))


def test_states_and_torques_that_no_robot_can_have_are_refused():
    states, torques = random_states(9, 2)
    derivatives = PeriodDerivatives(ROBOTS["chung2008"], STEP)
    for places, values, message in (
        ([0], [np.inf], "state must be finite, got inf"),
        ([2, 3], [0.0, 2.0], "directions must be unit vectors, got a length of 2"),
        ([11, 12], [3.0, 0.0], "directions must be unit vectors, got a length of 3"),
    ):
        wrong = states.copy()
        wrong[1, places] = values
        with pytest.raises(ValueError, match=message):
            derivatives.at(wrong, torques)
    with pytest.raises(ValueError, match="torque must be finite, got nan"):
        derivatives.at(states, np.full_like(torques, np.nan))
    with pytest.raises(
        ValueError, match=r"a last axis of 13 and torque one of 6, .* got shapes \(2, 13\) and \(3, 6\)"
    ):
        derivatives.at(states, np.zeros((3, 6)))
    several = PeriodDerivatives([ROBOTS["chung2008"]] * 3, STEP)
    with pytest.raises(ValueError, match=r"state must hold 3 robots along its last axis but one, got shape \(2, 13\)"):
        several.at(states, torques)
