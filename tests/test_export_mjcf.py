"""A MuJoCo model has the robot's masses, joints, gears and limits; test_mujoco_peer.py shows that it moves alike."""

import warnings
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from numpy.testing import assert_allclose
from typer.testing import CliRunner

from caster_gym import Model, load_robot
from caster_gym.agents.commands.cli import app
from caster_gym.export.mjcf import mjcf
from caster_gym.shipped_files import names_of
from tests.random_robots import random_robot

STEP = 2e-3  # [s]
ROBOTS = names_of("robots")


def compiled(robot, **options):
    return mujoco.MjModel.from_xml_string(mjcf(robot, STEP, **options))


@pytest.mark.parametrize("name", names_of("robots"))
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


def geared(gear, name="chung2008"):
    """A robot whose casters all have a gear, and friction of each kind."""
    robot = load_robot(name)
    motor = robot.casters[0].roll.model_copy(update={"armature": 1e-3, "viscous": 2e-3, "coulomb": 3e-3})
    update = {"gear": gear, "roll": motor, "steer": motor, "scrub": 4e-3}
    return robot.model_copy(update={"casters": tuple(caster.model_copy(update=update) for caster in robot.casters)})


GEARS = {
    "diagonal": ((3.0, 0.0), (0.0, -2.0)),
    "each motor on the other's joint": ((0.0, 2.0), (1.0, 0.0)),
    "one motor on both joints": ((1.0, -0.4), (0.0, 1.0)),
    "both on both": ((1.0, 0.5), (-0.5, 1.0)),
}


def rolling_mass_matrix(robot, model, steering, rng):
    """MuJoCo's mass matrix of all bodies and rotors (3, 3), for velocities at which the wheels roll without slip."""
    data = mujoco.MjData(model)
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    for number, angle in enumerate(steering, start=1):
        data.qpos[index[f"steer_{number}"]] = angle
        data.qpos[index[f"roll_{number}"]] = rng.uniform(-3.0, 3.0)
    mujoco.mj_forward(model, data)
    whole = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, whole)
    rolling = np.zeros((model.nv, 3))
    rolling[[index["x"], index["y"], index["yaw"]]] = np.eye(3)
    rolling[[index[joint] for joint in robot.joints]] = Model(robot).jacobian(steering)
    return rolling.T @ whole @ rolling


def with_rotors(gear):
    """A robot of three unlike casters with rotors and armatures, of which not all joints are driven."""
    robot = geared(gear)
    casters = []
    for i, caster in enumerate(robot.casters):
        roll = caster.roll.model_copy(update={"rotor": 2e-3 * (i + 1)})
        steer = caster.steer.model_copy(update={"rotor": 5e-4, "armature": 3e-4 * i})
        casters.append(caster.model_copy(update={"roll": roll, "steer": steer, "offset": 0.003 * i}))
    return robot.model_copy(update={"casters": tuple(casters), "actuation": ("roll_1", "steer_1", "roll_2")})


@pytest.mark.parametrize("robot", [*map(load_robot, ROBOTS), *map(with_rotors, GEARS.values())], ids=[*ROBOTS, *GEARS])
def test_its_mass_matrix_is_that_of_the_equations(robot):
    """Rotors included, whether their motors are driven or not: rounding of sums over all bodies."""
    rng, model = np.random.default_rng(0), compiled(robot)
    for steering in rng.uniform(-np.pi, np.pi, (10, robot.caster_count)):
        ours = Model(robot).inertia(steering)
        theirs = rolling_mass_matrix(robot, model, steering, rng)
        assert_allclose(theirs, ours, rtol=0.0, atol=1e-12 * np.abs(ours).max())


def without_dry_friction(robot, **platform):
    """MuJoCo's holds, so that it is left out; the platform may be changed."""
    kept = []
    for caster in robot.casters:
        roll, steer = (motor.model_copy(update={"coulomb": 0.0}) for motor in (caster.roll, caster.steer))
        kept.append(caster.model_copy(update={"roll": roll, "steer": steer}))
    changed = {"casters": tuple(kept), "platform": robot.platform.model_copy(update=platform)}
    return robot.model_copy(update=changed)


def loads_on_wheels(robot, share, push, angle=0.3, step=2e-4):
    """Normal forces (N,) of MuJoCo's contacts and of the model, means over 40 ms in which the robot accelerates.

    A free platform settles, then all rolling motors give a share of their torque, and a push (2,) [N] in W acts at its
    mass centre. The mean is taken 40 ms later, when contacts have stopped to ring.
    """
    model = mujoco.MjModel.from_xml_string(mjcf(robot, step, tips=True))
    data, ours, count = mujoco.MjData(model), Model(robot), robot.caster_count
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    steers = [index[f"steer_{i + 1}"] for i in range(count)]
    data.qpos[steers] = angle
    mujoco.mj_step(model, data, round(0.3 / step))
    motors = np.array([[share * caster.roll.max_torque, 0.0] for caster in robot.casters])
    data.ctrl[:] = motors.ravel()
    data.xfrc_applied[model.body("platform").id, :2] = push
    mujoco.mj_step(model, data, round(0.04 / step))
    torque = np.concatenate([np.array(c.gear).T @ pair for c, pair in zip(robot.casters, motors, strict=True)])
    seen, expected, force = [], [], np.zeros(6)
    for _ in range(round(0.04 / step)):
        mujoco.mj_step(model, data)
        loads = np.zeros(count)
        for k in range(data.ncon):
            mujoco.mj_contactForce(model, data, k, force)
            wheel = max(int(model.geom_bodyid[geom]) for geom in (data.contact[k].geom1, data.contact[k].geom2))
            loads[int(model.body(wheel).name.removeprefix("wheel_")) - 1] += force[0]
        back = np.exp(-1j * data.qpos[index["yaw"]])
        velocity = back * complex(data.qvel[index["x"]], data.qvel[index["y"]])
        felt = back * complex(*push)
        twist = velocity.real, velocity.imag, data.qvel[index["yaw"]]
        seen.append(loads)
        expected.append(ours.wheel_loads(data.qpos[steers], twist, torque, (felt.real, felt.imag, 0.0)))
    return np.mean(seen, axis=0), np.mean(expected, axis=0), ours.wheel_loads(np.full(count, angle))


@pytest.mark.parametrize("name", ROBOTS)
@pytest.mark.parametrize(("share", "pushes"), [(0.5, (0.0, 0.0)), (0.0, (0.05, 0.1)), (0.4, (0.0, -0.1))])
def test_loads_shift_as_under_a_platform_that_can_tip(name, share, pushes):
    """Under acceleration and a push, with a free platform: their sum and moments, which are all there is of three.

    More wheels rest on a floor that yields: then 1 … 2 % of the mean load is left in each mode without sum and moment,
    such as that in which two opposite wheels of four carry more and the others less.
    """
    robot = without_dry_friction(load_robot(name))
    weight = 9.81 * robot.platform.mass
    seen, expected, rest = loads_on_wheels(robot, share, weight * np.array(pushes))
    assert np.abs(expected - rest).max() > 0.01 * rest.mean()  # they do shift
    statics = np.array([(1.0, caster.x, caster.y) for caster in robot.casters])
    determined = statics @ np.linalg.lstsq(statics, seen - expected, rcond=None)[0]
    assert_allclose(determined, 0.0, rtol=0.0, atol=1e-3 * rest.mean())
    assert_allclose(seen, expected, rtol=0.0, atol=max(1e-3, 0.02 * (robot.caster_count - 3)) * rest.mean())


def test_a_wheel_is_about_to_lift_where_mujoco_says_so():
    """XR4000 at full torque, whose casters steer as they roll: with its mass centre at 0.35 m a wheel carries nothing.

    Opposite wheels then share a tenth of the mean load as the contacts yield, and as they ring. At 0.2 m all carry.
    """
    robot = load_robot("xr4000")
    for height, near, least in ((0.2, 0.02, 0.3), (0.35, 0.12, -0.01)):
        seen, expected, rest = loads_on_wheels(without_dry_friction(robot, height=height), 1.0, np.zeros(2), angle=0.0)
        assert_allclose(seen, expected, rtol=0.0, atol=near * rest.mean())
        assert min(seen.min(), expected.min()) > least * rest.mean()
    assert seen.min() < 0.1 * rest.mean()
    assert expected.min() < 0.02 * rest.mean()


@pytest.mark.parametrize("gear", GEARS.values(), ids=GEARS)
def test_power_passes_the_gears(gear):
    """Motor torques times motor speeds = generalised forces times velocities, whatever the gear."""
    robot = geared(gear)
    model = compiled(robot)
    data = mujoco.MjData(model)
    rng = np.random.default_rng(0)
    data.qvel[:] = rng.normal(size=model.nv)
    data.ctrl[:] = rng.uniform(-0.1, 0.1, model.nu)
    mujoco.mj_forward(model, data)
    index = {model.joint(i).name: int(model.jnt_dofadr[i]) for i in range(model.njnt)}
    rates = np.array([data.qvel[index[joint]] for joint in robot.joints]).reshape(-1, 2)
    speeds = np.concatenate([np.array(c.gear) @ pair for c, pair in zip(robot.casters, rates, strict=True)])
    assert_allclose(data.ctrl @ speeds, data.qfrc_actuator @ data.qvel, rtol=1e-12)


@pytest.mark.parametrize(("gear", "on_tendons"), list(zip(GEARS.values(), (0, 0, 3, 6), strict=True)), ids=GEARS)
def test_only_motors_of_both_joints_act_on_tendons(gear, on_tendons):
    """Drake drops motors on tendons, and the rotor inertias with them."""
    model = compiled(geared(gear))
    assert model.nu == 6
    assert (model.actuator_trntype == mujoco.mjtTrn.mjTRN_TENDON).sum() == on_tendons


def test_a_robot_without_scrub_and_coupled_joints_has_no_tendons():
    assert "tendon" not in mjcf(load_robot("chung2008"), STEP)
    scrubbed = compiled(geared(GEARS["diagonal"]))
    assert_allclose(scrubbed.tendon_damping.reshape(3, -1)[:, 0], 4e-3)


def sunk(friction, **option):
    """How far [m] wheels sink after 1 s in a scene of somebody else's that the model was attached to."""
    robot = load_robot("chung2008")
    scene = mujoco.MjSpec()
    scene.option.timestep = STEP
    for name, value in option.items():
        setattr(scene.option, name, value)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # that the scene keeps its own options
        scene.attach(
            mujoco.MjSpec.from_string(mjcf(robot, STEP, friction)), frame=scene.worldbody.add_frame(), prefix="a_"
        )
        model = scene.compile()
    data = mujoco.MjData(model)
    mujoco.mj_step(model, data, 500)
    return robot.casters[0].radius - data.body("a_wheel_1").xpos[2]


def test_what_the_comment_says_of_scenes_is_true():
    """The pyramidal cone at friction 5 lets wheels of 25 mm sink 3.7 mm; both ways out that the comment names help."""
    elliptic = {"cone": mujoco.mjtCone.mjCONE_ELLIPTIC, "impratio": 100.0}
    whole = sunk(5.0, **elliptic)
    assert whole == pytest.approx(2.5e-5, rel=0.02)
    assert sunk(5.0) > 3e-3
    assert sunk(1.0) == pytest.approx(whole, rel=0.01)
    told = mjcf(load_robot("chung2008"), STEP)
    assert 'cone="elliptic" and impratio="100"' in told and "friction 1" in told and "0.002 s" in told


def test_the_drawn_platform_is_a_closed_surface_seen_from_outside():
    """Every edge belongs to two faces that run along it in opposite ways, and the volume is area times height."""
    robot = load_robot("tidybot2")
    model = compiled(robot)
    mesh = ElementTree.fromstring(mjcf(robot, STEP)).find("asset/mesh")
    assert mesh is not None
    faces = np.array(mesh.attrib["face"].split(), dtype=int).reshape(-1, 3)
    vertices = np.array(mesh.attrib["vertex"].split(), dtype=float).reshape(-1, 3)
    edges = [(int(face[i]), int(face[(i + 1) % 3])) for face in faces for i in range(3)]
    assert len(set(edges)) == len(edges)
    assert {(b, a) for a, b in edges} == set(edges)
    volume = np.linalg.det(vertices[faces]).sum() / 6.0
    (x, y), height = np.array(robot.platform.footprint.polygon).T, np.ptp(vertices[:, 2])
    area = 0.5 * (x @ np.roll(y, -1) - y @ np.roll(x, -1))
    assert volume == pytest.approx(area * height, rel=1e-9)
    assert model.mesh("platform").id == 0


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
