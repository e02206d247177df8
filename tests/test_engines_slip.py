"""A floor of finite friction in the engines: native, tensor and NumPy, one robot and many."""

import re
from typing import Any

import numpy as np
import pytest
import torch
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model, load_robot
from caster_gym.arena.arena import Arena, Pillar
from caster_gym.arena.packing import surroundings
from caster_gym.configuration import ConfigurationError
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.tensor.fleet import TorchFleet
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.floor import Floor, Patch
from tests.random_robots import random_robot

STEP = 5e-3  # [s]
ICE = Floor(
    friction=0.4,
    patches=(Patch(friction=0.03, x=0.1, y=0.0, radius=0.15), Patch(friction=0.9, x=0.3, y=0.1, radius=0.1)),
)
COUNT = 35  # more than a block


def starts(robot, count, seed=0):
    """States (count, 7 + 2 N) of moving robots and torques (count, 2 N) that are too much for some wheels."""
    rng, n = np.random.default_rng(seed), robot.caster_count
    state = np.zeros((count, 7 + 2 * n))
    steering = rng.uniform(-np.pi, np.pi, (count, n))
    state[:, 0:2], state[:, 2] = rng.uniform(-0.2, 0.2, (count, 2)), 1.0
    state[:, 4:7] = rng.uniform(-0.5, 0.5, (count, 3))
    state[:, 7::2], state[:, 8::2] = np.cos(steering), np.sin(steering)
    push = 0.4 * 9.81 * robot.platform.mass / n
    levers = np.array([(c.radius, c.trail) for c in robot.casters]).ravel()
    return state, steering, push * levers * rng.uniform(-1.0, 1.0, (count, 2 * n))


def angles_of(state, n):
    """(count, 6 + N) of `Model` from states of a fleet."""
    steering = np.arctan2(state[:, 8 : 7 + 2 * n : 2], state[:, 7 : 7 + 2 * n : 2])
    return np.column_stack((state[:, :2], np.arctan2(state[:, 3], state[:, 2]), state[:, 4:7], steering))


@pytest.mark.parametrize("floor", [Floor(friction=0.3), ICE], ids=["even", "patches"])
def test_a_batch_equals_its_single_robots(floor):
    """To the last bit."""
    robot = load_robot("chung2008")
    state, _, torque = starts(robot, COUNT)
    many, one = Fleet(robot, COUNT, floor=floor), Fleet(robot, floor=floor)
    many.state = state
    many.step(torque, STEP, 30)
    assert np.hypot(*np.moveaxis(many.slip, -1, 0)).max() > 0.1
    for i in range(0, COUNT, 4):
        one.state = state[i : i + 1]
        one.step(torque[i : i + 1], STEP, 30)
        assert_array_equal(one.state[0], many.state[i])


def test_a_batch_among_obstacles_equals_its_single_robots():
    robot = load_robot("chung2008")
    around = surroundings(robot, Arena(room=((-0.4, -0.4), (0.4, 0.4)), pillars=(Pillar(centre=(0.25, 0.25)),)))
    state, _, torque = starts(robot, COUNT)
    many, one = Fleet(robot, COUNT, floor=ICE, around=around), Fleet(robot, floor=ICE, around=around)
    many.state = state
    many.step(torque, STEP, 40)
    assert np.abs(many.state[:, :2]).max() < 0.4  # the hull has a radius
    for i in range(0, COUNT, 7):
        one.state = state[i : i + 1]
        one.step(torque[i : i + 1], STEP, 40)
        assert_array_equal(one.state[0], many.state[i])


@pytest.mark.parametrize("floor", [Floor(friction=0.3), ICE], ids=["even", "patches"])
def test_all_engines_agree(floor):
    """The same source: what is left is the order of roundings and sines."""
    robot, n = load_robot("chung2008"), 3
    state, steering, torque = starts(robot, 5)
    native, tensor = Fleet(robot, 5, floor=floor), TorchFleet(robot, 5, floor=floor, dtype=torch.float64)
    native.state, tensor.state = state, torch.tensor(state)
    native.step(torque, STEP, 12)
    tensor.step(torch.tensor(torque), STEP, 12)
    # two rounds leave some µm/s, and rounding decides at a wheel that just starts to slip which
    assert_allclose(tensor.state.numpy(), native.state, rtol=0.0, atol=1e-5)
    given = np.column_stack((state[:, :2], np.zeros(5), state[:, 4:7], steering))
    course = Model(robot).simulate(given, torque, STEP, 12, floor=floor)
    assert course.shape == (13, 5, 6 + 3 * n)
    assert_allclose(course[-1, :, :6], angles_of(native.state, n)[:, :6], rtol=0.0, atol=1e-5)
    assert_allclose(course[-1, :, 6 + n :], native.state[:, 7 + 2 * n : -2], rtol=0.0, atol=1e-3)  # over a radius of mm


def test_simulate_goes_on_from_its_own_states():
    """With rates given; the tilt starts anew, which a robot without height hardly has."""
    robot = load_robot("chung2008")
    _, steering, torque = starts(robot, 1)
    state = np.concatenate((np.zeros(3), (0.3, 0.1, 0.2), steering[0]))
    floor = Floor(friction=0.2)
    whole = Model(robot).simulate(state, torque[0], 1e-3, 20, floor=floor)
    rest = Model(robot).simulate(whole[10], torque[0], 1e-3, 10, floor=floor)
    assert_allclose(rest[-1, :9], whole[-1, :9], rtol=0.0, atol=1e-3)


def test_patches_change_the_friction_under_the_wheels_that_stand_on_them():
    """A robot that slides off ice onto a floor that grips stops there; on ice alone it goes on."""
    robot = load_robot("chung2008")
    state = np.zeros((1, 13))
    state[:, 2], state[:, 4], state[:, 7::2] = 1.0, 0.6, 0.0
    state[:, 8::2] = 1.0  # all wheels across
    ice = Floor(friction=0.6, patches=(Patch(friction=0.0, x=0.0, y=0.0, radius=0.15),))
    ways = []
    for floor in (ice, Floor(friction=1e-3), Floor(friction=0.6)):
        fleet = Fleet(robot, floor=floor)
        fleet.state = state
        now = fleet.state
        now[:, 13:19:2], now[:, 14:19:2] = 0.0, 0.0  # neither yaw nor roll: they slide
        fleet.state = now
        fleet.step(np.zeros((1, 6)), STEP, 60)
        ways.append(fleet.state[0, 0])
    on_patch, on_ice, on_floor = ways
    assert on_floor < on_patch < on_ice
    assert on_ice == pytest.approx(0.6 * 0.3, rel=0.02)


def test_gradients_pass_through_a_slipping_step():
    """By torques, against finite differences, where wheels slide and where they are held."""
    robot = random_robot(3, 3)
    state, _, torque = starts(robot, 2, seed=4)

    def ends(torques):
        fleet = TorchFleet(robot, 2, floor=Floor(friction=0.3), dtype=torch.float64)
        fleet.state = torch.tensor(state)
        fleet.step(torques, 2e-3, 3)
        return fleet.state

    given = torch.tensor(torque, requires_grad=True)
    # the limits by loads lag and cut: smooth where no wheel changes between holding and sliding
    assert torch.autograd.gradcheck(ends, (given,), eps=1e-6, atol=1e-5, rtol=1e-4, fast_mode=True)


def test_each_robot_may_have_its_own_numbers():
    robots = [random_robot(seed, 3) for seed in (11, 12)]
    fleet = Fleet(robots, floor=Floor())
    state = np.concatenate([starts(robot, 1, seed)[0] for seed, robot in enumerate(robots)])
    torque = np.concatenate([starts(robot, 1, seed)[2] for seed, robot in enumerate(robots)])
    fleet.state = state
    fleet.step(torque, STEP, 10)
    for i, robot in enumerate(robots):
        given = np.concatenate((state[i, :2], [0.0], state[i, 4:7], np.arctan2(state[i, 8::2], state[i, 7::2])))
        course = Model(robot).simulate(given, torque[i], STEP, 10, floor=Floor())
        assert_allclose(course[-1, :2], fleet.state[i, :2], rtol=0.0, atol=1e-10)


def test_what_has_no_equations_is_refused():
    robot = load_robot("chung2008")
    for make in (Fleet, TorchFleet):
        with pytest.raises(ValueError, match=r'a floor of finite friction needs dynamics="exact", got \'chung2008\''):
            make(robot, 2, "chung2008", floor=Floor())
        with pytest.raises(ValueError, match=r"caster 1 of robot .* has none about its axle: give it a 'wheel.spin_in"):
            make(robot.without_wheels(), 2, floor=Floor())
    with pytest.raises(ValueError, match="needs dynamics="):
        Model(robot, "chung2008").simulate(np.zeros(9), np.zeros(6), STEP, 1, floor=Floor())
    fleet = Fleet(robot, floor=Floor())
    assert fleet.slip.shape == (1, 3, 2)
    assert (Fleet(robot).slip == 0.0).all()


@pytest.mark.parametrize("floor", [{"friction": 0.4}, {"friction": 0.4, "patches": [{**ICE.patches[0].model_dump()}]}])
def test_engines_take_floors_as_environments_do(floor):
    robot = load_robot("chung2008")
    state, _, torque = starts(robot, 1)
    checked = Floor.model_validate(floor)
    ends = []
    for make in (Fleet, TorchFleet):
        for given in (floor, checked):
            precise: dict[str, Any] = {"dtype": torch.float64} if make is TorchFleet else {}
            fleet = make(robot, 1, floor=given, **precise)
            fleet.state = state if make is Fleet else torch.as_tensor(state)
            fleet.step(torque if make is Fleet else torch.as_tensor(torque), STEP, 3)
            ends.append(np.array(fleet.state))
        assert_array_equal(ends[-1], ends[-2])
        assert make(robot, 1, floor="grip").state.shape == make(robot, 1).state.shape == (1, 13)
        with pytest.raises(ConfigurationError, match="the floor: unknown key 'mu'; it is called 'friction' here"):
            make(robot, 1, floor={"mu": 0.3})
    model, plain = Model(robot), angles_of(state, 3)
    one, other = (model.simulate(plain, torque, STEP, 3, floor=given) for given in (floor, checked))
    assert_array_equal(one, other)
    assert one.shape == (4, 1, 15)
    assert model.simulate(plain, torque, STEP, 3, floor="grip").shape == (4, 1, 9)
    with pytest.raises(ConfigurationError, match="floor must be 'grip' or a mapping such as"):
        model.simulate(plain, torque, STEP, 3, floor="ice")


@pytest.mark.parametrize("make", [Fleet, TorchFleet, Model, TorchModel])
@pytest.mark.parametrize(("casters", "length"), [(3, 5), (3, 14), (2, 30)])
def test_states_of_a_wrong_length_are_told_all_that_are_right(make, casters, length):
    """Those that are right on a floor that grips, and on one where wheels may slip."""
    robot = random_robot(1, casters)
    fleet = make in (Fleet, TorchFleet)
    rolling, slipping = (7 + 2 * casters, 9 + 4 * casters) if fleet else (6 + casters, 6 + 3 * casters)

    def said(width, floor):
        with pytest.raises(ValueError, match="state must have") as error:
            if fleet:
                make(robot, 1, floor=floor).state = torch.zeros((1, width)) if make is TorchFleet else [[0.0] * width]
            else:
                make(robot).simulate(np.zeros(width), np.zeros(2 * casters), STEP, 1, floor=floor)
        return str(error.value)

    on_ice = said(length, {"friction": 0.1})
    assert all(re.search(rf"\b{number}\b", on_ice) for number in (rolling, slipping, length)), on_ice
    gripping = said(length, "grip")
    assert f"{rolling}" in gripping
    assert "floor" not in gripping
    assert "floor={'friction': 0.7}" in said(slipping, None)
    if not fleet:  # as the message says
        walk = make(robot).simulate(np.zeros(slipping), np.zeros(2 * casters), 1e-4, 1, floor={"friction": 0.7})
        assert walk.shape == (2, slipping)
