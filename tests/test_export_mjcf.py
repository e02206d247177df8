"""A MuJoCo model has the robot's masses, joints, gears and limits; test_mujoco_peer.py shows that it moves alike."""

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from caster_gym import load_robot
from caster_gym.agents.cli import app
from caster_gym.export.mjcf import mjcf
from tests.random_robots import random_robot

STEP = 2e-3  # [s]


def compiled(robot, **options):
    return mujoco.MjModel.from_xml_string(mjcf(robot, STEP, **options))


@pytest.mark.parametrize("name", ["chung2008", "tidybot2", "xr4000"])
def test_masses_are_those_of_the_robot(name):
    robot = load_robot(name)
    total = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
    assert compiled(robot).body_mass.sum() == pytest.approx(
        total, rel=1e-12
    )  # rounding of a sum; what is drawn has none


def test_motors_are_the_driven_ones_with_their_limits():
    robot = load_robot("tidybot2").with_actuation(["roll_1", "steer_1", "steer_3"])
    model = compiled(robot)
    assert [model.actuator(i).name for i in range(model.nu)] == list(robot.driven)
    assert_allclose(model.actuator_ctrlrange[:, 1], [1.58, 9.93, 9.93])
    assert_allclose(model.actuator_ctrlrange[:, 0], [-1.58, -9.93, -9.93])


def test_power_passes_the_gears():
    """Motor torques times motor speeds = generalised forces times velocities, whatever the gear."""
    robot = load_robot("tidybot2")
    model = compiled(robot)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    data.qvel[:] = rng.normal(size=model.nv)
    data.ctrl[:] = rng.uniform(-1.0, 1.0, model.nu)
    mujoco.mj_forward(model, data)
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    rates = np.array([data.qvel[index[joint]] for joint in robot.joints]).reshape(-1, 2)
    speeds = np.concatenate([np.array(c.gear) @ pair for c, pair in zip(robot.casters, rates, strict=True)])
    assert_allclose(data.ctrl @ speeds, data.qfrc_actuator @ data.qvel, rtol=1e-12)


def test_the_platform_rests_on_its_wheels():
    """Its weight is carried, and the wheels stay at the height of their radius within MuJoCo's softness."""
    robot = load_robot("xr4000")
    model = compiled(robot)
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    centre = data.body("wheel_1").xpos[2]
    assert centre == pytest.approx(robot.casters[0].radius, abs=1e-4)  # [m] contacts give way by a few µm a kg


def test_a_name_with_signs_of_xml_is_kept():
    robot = load_robot("chung2008").model_copy(update={"name": 'the "3 < 4" robot & co'})
    assert 'the "3 < 4" robot & co' in mujoco.MjModel.from_xml_string(mjcf(robot, STEP)).names.decode()


@pytest.mark.parametrize("seed", range(3))
def test_every_robot_can_be_written_or_is_refused_with_a_reason(seed):
    robot = random_robot(seed, 2 + seed)
    try:
        text = mjcf(robot, STEP)
    except ValueError as error:
        assert "spin_inertia of at most twice its yaw_inertia" in str(error)
    else:
        assert mujoco.MjModel.from_xml_string(text).nu == len(robot.driven)


def test_bodies_without_mass_are_refused():
    with pytest.raises(ValueError, match=r"caster 1: wheel.mass must be positive for a model of solid bodies, got 0"):
        mjcf(load_robot("chung2008").without_wheels(), STEP)


@pytest.mark.parametrize(("time_step", "friction", "name"), [(0.0, 1.0, "time_step"), (1e-3, -1.0, "friction")])
def test_wrong_numbers_are_refused(time_step, friction, name):
    with pytest.raises(ValueError, match=f"{name} must be positive"):
        mjcf(load_robot("chung2008"), time_step, friction)


def test_command_writes_a_model_and_replaces_nothing(tmp_path):
    file = tmp_path / "robot.xml"
    arguments = ["export", "tidybot2", "--mjcf", str(file), "--time-step", "0.001"]
    assert CliRunner().invoke(app, arguments).exit_code == 0
    assert mujoco.MjModel.from_xml_path(str(file)).opt.timestep == 0.001
    refused = CliRunner().invoke(app, arguments)
    assert refused.exit_code == 2
    assert "is there already" in refused.output
    assert CliRunner().invoke(app, [*arguments, "--overwrite"]).exit_code == 0


def test_command_names_an_unknown_robot(tmp_path):
    result = CliRunner().invoke(app, ["export", "tidybot3", "--mjcf", str(tmp_path / "robot.xml")])
    assert result.exit_code == 2
    assert "unknown robot 'tidybot3'" in result.output
    assert not list(tmp_path.iterdir())


def test_the_model_says_where_its_dry_friction_differs():
    """Half of the breakaway torque turns a joint by coulomb_speed / √3: 0.1 rad/s · 50.8 mm / 1.732 = 2.93 mm/s."""
    assert "lets wheels creep at 2.9 mm/s" in mjcf(load_robot("tidybot2"), 2e-3)
    sharper = load_robot("tidybot2").model_copy(update={"coulomb_speed": 0.01})
    assert "lets wheels creep at 0.29 mm/s" in mjcf(sharper, 2e-3)
    assert "frictionloss holds" not in mjcf(load_robot("chung2008"), 2e-3)  # has no dry friction
