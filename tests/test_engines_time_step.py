"""Time steps that follow a robot: refused ones diverge, allowed ones do not, and what a refusal advises does help."""

import re

import numpy as np
import pytest
import torch

from caster_gym import Model, Robot, load_robot
from caster_gym.engines.native.fleet import Fleet
from caster_gym.engines.tensor.fleet import TorchFleet
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.engines.time_scales import limits
from caster_gym.engines.time_step import (
    check_time_step,
    longest_of_robots,
    longest_of_rows,
    longest_time_step,
    substeps_for,
)
from caster_gym.envs.tensor.vector_env import TorchVectorEnv
from caster_gym.mechanics.dynamics import kinetic_energy
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import pack_parameters, robot_parameters, unpack_parameters
from caster_gym.mechanics.plant import driven_step
from caster_gym.shipped_files import names_of
from caster_gym.tasks.track.environment import CasterTrackEnv, CasterTrackVectorEnv
from caster_gym.wrappers import Friction, Payload, WheelErrors, wrap
from tests.random_robots import random_robot

ROBOTS = names_of("robots")
PATH = {"shape": "circle", "radius": 0.5, "duration": 2000.0}  # so slow that robots full of friction can follow
pytestmark = pytest.mark.filterwarnings("ignore::caster_gym.plausibility.RobotWarning")


def changed(name, **fields):
    """A robot all of whose casters have other numbers: roll_viscous=0.5, scrub=1.0, coulomb_speed=0.01, …"""
    robot = load_robot(name)
    content = robot.model_dump()
    for key, value in fields.items():
        if key == "coulomb_speed":
            content[key] = value
            continue
        joint, _, kind = key.partition("_")
        for caster in content["casters"]:
            if joint in ("roll", "steer"):
                caster[joint][kind] = value
            else:
                caster[key] = value
    return Robot.model_validate(content)


STIFF = {
    "viscous": changed("chung2008", roll_viscous=1.0),
    "viscous steering": changed("chung2008", steer_viscous=0.5),
    "scrub": changed("chung2008", scrub=1.0),
    "dry": changed("xr4000", steer_coulomb=2.0),
    "sharp": changed("tidybot2", coulomb_speed=0.01),
    "strong": changed("chung2008", roll_max_torque=100.0),
    "slow motors": changed("xr4000", roll_max_speed=0.2),
    "geared": changed("chung2008", gear=((0.1, 0.0), (0.0, 1.0))),
    "fast steering": changed("chung2008", steer_max_speed=1000.0),
    "short trail": changed("xr4000", trail=0.005),
    "light": changed("chung2008", wheel={"mass": 1e-4, "spin_inertia": 1e-8, "yaw_inertia": 5e-9}, roll_viscous=1.0),
}


def columns(robots):
    return np.array([pack_parameters(robot_parameters(robot)) for robot in robots])


def greatest_energies(rows, steps, h, hold, seed=0):
    """Greatest kinetic energies (R,) of robots of given numbers under commands that change every `hold` steps."""
    robots = unpack_parameters(tuple(rows.T))
    count, n = len(rows), len(robots.casters)
    rng = np.random.default_rng(seed)
    angles = rng.uniform(-np.pi, np.pi, (n, count))
    zero, one = np.zeros(count), np.ones(count)
    state = State((zero, zero), (one, zero), (zero,) * 3, tuple((np.cos(a), np.sin(a)) for a in angles))
    greatest = zero
    with np.errstate(all="ignore"):
        for k in range(steps):
            if k % hold == 0:
                commands = np.clip(rng.uniform(-2.0, 2.0, (n, 2, count)), -1.0, 1.0)
            state, _ = driven_step(state, tuple((a, b) for a, b in commands), (0.0, 0.0, 0.0), h, robots)
            energy = kinetic_energy(state.twist, state.directions, robots)
            greatest = np.maximum(greatest, np.where(np.isfinite(energy), energy, np.inf))
    return greatest


def odd_robots(count, seed):
    """Numbers (R, fields) of robots with friction, motors, trails and gears of any size, each alike in all casters."""
    rng = np.random.default_rng(seed)
    ranges = {
        "roll_viscous": (1e-3, 3.0),
        "steer_viscous": (1e-3, 3.0),
        "roll_coulomb": (1e-2, 3.0),
        "steer_coulomb": (1e-2, 3.0),
        "scrub": (1e-3, 3.0),
        "roll_max_torque": (0.1, 1e5),
        "steer_max_torque": (0.1, 1e5),
        "roll_max_speed": (1e-2, 300.0),
        "steer_max_speed": (1e-2, 300.0),
        "trail": (5e-3, 5e-2),
        "gear_rr": (0.1, 10.0),
        "roll_armature": (1e-6, 1e-2),
        "steer_armature": (1e-6, 1e-2),
    }
    rows = []
    for k in range(count):
        numbers = robot_parameters(random_robot(k, 3) if k % 2 else load_robot("chung2008"))
        drawn = {f: np.exp(rng.uniform(*np.log(r))) for f, r in ranges.items() if rng.random() < 0.3}
        casters = tuple(caster._replace(**drawn) for caster in numbers.casters)
        speed = float(np.exp(rng.uniform(*np.log((1e-3, 1.0)))))
        rows.append(
            pack_parameters(numbers._replace(casters=casters, platform=numbers.platform._replace(coulomb_speed=speed)))
        )
    return np.array(rows)


@pytest.mark.slow
def test_allowed_steps_stay_as_bounded_as_short_ones():
    """Robots of any numbers, at their longest steps: no more energy than at a quarter of these."""
    rows = odd_robots(60, 5)
    longest = longest_of_rows(rows)
    allowed = greatest_energies(rows, 120, longest, 4)
    short = greatest_energies(rows, 480, longest / 4.0, 16)
    assert np.isfinite(allowed).all()
    # the same commands, so alike; chaotic ones part, yet none by more than the motors' overshoot of a step or two
    assert (allowed < 5.0 * short).all()


@pytest.mark.parametrize("field", ["roll_viscous", "steer_viscous", "scrub", "steer_coulomb"])
def test_the_bound_of_friction_is_that_of_stability(field):
    """At rest a small push dies out at 0.97 of the longest step and grows at 1.06 of it, without any command."""
    robot = robot_parameters(load_robot("chung2008"))
    stiff = robot._replace(casters=tuple(c._replace(**{field: 3.0}) for c in robot.casters))
    rows = np.array([pack_parameters(stiff)])
    found = limits(rows)
    assert found.friction[0] / 2.785 > 3.0 * max(found.turning[0], 2.0 * found.motors[0])  # friction it is
    rng = np.random.default_rng(0)
    angles = rng.uniform(-np.pi, np.pi, (3, 600))  # the stiffest posture is nearly among them
    grown = []
    for share in (0.97, 1.06):
        h = share * found.longest[0]
        push = 1e-9 * rng.normal(size=(3, 600))
        state = State((0.0, 0.0), (1.0, 0.0), tuple(push), tuple((np.cos(a), np.sin(a)) for a in angles))
        energy = [kinetic_energy(state.twist, state.directions, stiff)]
        nothing = ((0.0, 0.0),) * 3
        for _ in range(60):
            state, _ = driven_step(state, nothing, (0.0, 0.0, 0.0), h, stiff)
        energy.append(kinetic_energy(state.twist, state.directions, stiff))
        grown.append((energy[1] > energy[0]).any())
    assert grown == [False, True]


@pytest.mark.parametrize("name", ROBOTS)
def test_robots_of_the_package_are_bounded_by_their_trail_alone(name):
    robot = load_robot(name)
    assert longest_time_step(robot) == pytest.approx(min(c.trail for c in robot.casters) / robot.top_speed, rel=1e-12)
    check_time_step(robot, 0.005)


@pytest.mark.parametrize("bad", [0.0, -0.01, float("nan"), float("inf"), 0.0101])
def test_what_is_no_step_or_too_long_is_refused(bad):
    check_time_step(load_robot("chung2008"), 0.01)  # 0.025 m / 2.5 m/s
    with pytest.raises(
        ValueError, match=r"the casters of robot 'chung2008': with a trail of 0.025 m .* at most 0.01 s$"
    ):
        check_time_step(load_robot("chung2008"), bad)


@pytest.mark.parametrize("case", STIFF)
def test_stiff_robots_are_refused_by_every_engine(case):
    robot = STIFF[case]
    n = robot.caster_count
    torque = np.zeros(2 * n)
    message = rf"a time step of 0.005 s cannot follow (the casters of )?robot '{robot.name}'.* at most "
    for use in (
        lambda: Model(robot).simulate(np.zeros(6 + n), torque, 0.005, 1),
        lambda: TorchModel(robot).simulate(np.zeros(6 + n), torque, 0.005, 1),
        lambda: Fleet(robot).step(torque[None], 0.005),
        lambda: Fleet([load_robot(robot.name), robot]).step(np.zeros((2, 2 * n)), 0.005),
        lambda: TorchFleet(robot).step(torch.as_tensor(torque[None]), 0.005),
        lambda: CasterTrackEnv(robot, PATH),
        lambda: CasterTrackVectorEnv(3, robot=robot, path=PATH),
        lambda: TorchVectorEnv("track", 3, robot=robot, path=PATH),
    ):
        with pytest.raises(ValueError, match=message):
            use()


@pytest.mark.slow
@pytest.mark.parametrize("case", STIFF)
def test_the_number_of_substeps_that_a_refusal_names_would_do(case):
    """It is accepted, one less is not, and 1,000 random steps are then finite, no wilder than with three times it."""
    robot = STIFF[case]
    with pytest.raises(ValueError, match="'substeps' of") as caught:
        CasterTrackEnv(robot, PATH)
    count = int(re.findall(r"'substeps' of (\d+) would suffice, in place of 4", str(caught.value))[0])
    with pytest.raises(ValueError, match="cannot follow"):
        CasterTrackEnv(robot, PATH, substeps=count - 1)
    greatest = []
    for substeps, steps in ((count, 1000), (3 * count, 300)):
        env = CasterTrackEnv(robot, PATH, substeps=substeps, corridor=1e6)
        observation, _ = env.reset(seed=0)
        rng = np.random.default_rng(0)
        energies = []
        for _ in range(steps):
            action = rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32)
            observation, reward, terminated, truncated, info = env.step(action)
            assert np.isfinite(observation).all()
            assert np.isfinite(reward)
            assert not info["not_finite"]
            state = env.engine.states[0]
            energies.append(Model(robot).kinetic_energy(np.arctan2(state[8::2], state[7::2]), state[4:7]))
            if terminated or truncated:
                env.reset()
        greatest.append(max(energies))
    assert greatest[0] < 4.0 * greatest[1]  # motions part in time, and the shorter one has seen less


def test_where_no_number_of_substeps_would_do_something_else_is_named_that_does():
    robot = changed("chung2008", roll_max_torque=1e6)
    with pytest.raises(ValueError, match="more than a task may have") as caught:
        CasterTrackEnv(robot, PATH)
    ((torque, period),) = re.findall(
        r"'roll.max_torque' of at most (\S+) N m in every caster or a 'control_period' of (\S+) s in 1000 'substeps'",
        str(caught.value),
    )
    CasterTrackEnv(changed("chung2008", roll_max_torque=float(torque)), PATH)
    CasterTrackEnv(robot, {"shape": "circle", "radius": 0.5}, control_period=float(period), substeps=1000)


def test_the_number_to_blame_is_named():
    """The greatest part of the greatest rate: of caster 2, whose steering friction it is."""
    robot = load_robot("xr4000")
    casters = list(robot.casters)
    casters[1] = casters[1].model_copy(update={"steer": casters[1].steer.model_copy(update={"viscous": 20.0})})
    with pytest.raises(
        ValueError, match=r"friction brakes it too fast, .* 'steer.viscous' of 20 N m s/rad at caster 2"
    ):
        check_time_step(robot.model_copy(update={"casters": tuple(casters)}), 0.005)


def test_every_robot_of_a_batch_is_looked_at():
    """One of many is stiff, wherever it stands; the numbers of a Model, of an engine and of a Torch batch alike."""
    good, bad = load_robot("chung2008"), STIFF["scrub"]
    rows = columns([good] * 300)
    rows[217] = columns([bad])[0]
    assert longest_of_rows(rows).argmin() == 217
    assert longest_of_rows(rows)[217] == longest_time_step(bad)
    assert list(longest_of_robots([good, bad])) == [longest_time_step(good), longest_time_step(bad)]
    mixed = Model(good, parameters=unpack_parameters(tuple(rows.T)))
    with pytest.raises(
        ValueError, match=r"robots like 'chung2008' whose numbers were replaced: .* 'scrub' of 1 N m s/rad"
    ):
        mixed.simulate(np.zeros((300, 9)), np.zeros(6), 0.005, 1)
    batch = CasterTrackVectorEnv(3, robot=good, path=PATH)
    batch.reset(seed=0)
    with pytest.raises(ValueError, match=r"robots like 'chung2008' of other numbers.* 'scrub'.* 'substeps' of"):
        batch.engine.set_parameters(np.array([1]), columns([bad]))
    torch_batch = TorchVectorEnv("track", 2, robot=good, path=PATH)
    with pytest.raises(ValueError, match=r"robots like 'chung2008' of other numbers.* 'scrub'"):
        torch_batch.set_robots([good, bad])


@pytest.mark.parametrize(
    "features",
    [
        [Friction(added_viscous=(0.0, 10.0))],
        [Friction(coulomb_scale=(1.0, 40.0))],
        [Friction(added_coulomb=(0.0, 1.0)), WheelErrors(trail=(-0.005, 0.0))],
        [Payload(mass=(5.0, 20.0)), Friction(added_viscous=(0.0, 10.0))],
        [WheelErrors(radius=(0.0, 0.05))],
    ],
)
def test_features_that_could_make_a_robot_stiff_are_refused_with_substeps_that_do(features):
    """At their construction, not in whichever episode draws such a robot."""

    def made(**task):
        env = CasterTrackVectorEnv(40, robot="tidybot2", path=PATH, corridor=1e6, **task)
        return wrap(env, *features)

    with pytest.raises(ValueError, match="features may make them") as caught:
        made()
    env = made(substeps=int(re.findall(r"'substeps' of (\d+) would suffice", str(caught.value))[0]))
    env.reset(seed=0)
    rng = np.random.default_rng(0)
    for _ in range(200):
        _, rewards, _, _, infos = env.step(rng.uniform(-1.0, 1.0, env.action_space.shape).astype(np.float32))
        assert np.isfinite(rewards).all()
        assert not infos["not_finite"].any()
    assert np.abs(env.unwrapped.engine.states[:, 4:6]).max() < 5.0  # [m/s] of 2 at the top


def test_features_within_reach_of_the_step_pass():
    env = CasterTrackVectorEnv(4, robot="tidybot2", path=PATH)
    wrap(env, Friction(coulomb_scale=(0.5, 2.0)), Payload(mass=(0.0, 20.0)), WheelErrors(trail=(-0.002, 0.002)))


def test_substeps_are_as_few_as_a_period_allows():
    assert [substeps_for(0.02, longest) for longest in (0.02, 0.0199, 0.01, 0.005, 1.0)] == [1, 2, 2, 4, 1]


def test_numbers_that_no_robot_has_are_refused():
    rows = columns([load_robot("chung2008")] * 2)
    rows[1, 7] = np.nan
    with pytest.raises(ValueError, match="numbers must be finite, got nan as number 8"):
        longest_of_rows(rows)
    rows[1] = rows[0]
    rows[1, 0] = -50.0  # kg
    with pytest.raises(ValueError, match="needs positive masses and inertias"):
        longest_of_rows(rows)
