"""The equations against MuJoCo, which knows bodies, joints and friction but nothing of casters."""

import mujoco
import numpy as np
import pytest

from caster_gym import Model, Robot, load_robot
from caster_gym.export.mjcf import mjcf
from scripts.dry_friction import creep
from scripts.mujoco_peer import STEPS, compare, draw_convergence, page, write_table
from scripts.mujoco_robot import joint_indices, path_length, simulate, slip, strong_drives, without_dry_friction
from tests.random_robots import random_robot

STEP = 2e-3  # [s] of the equations
CHUNG = load_robot("chung2008")
START = np.array([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, -0.5, -2.7, -2.7])  # at rest, wheels askew
TORQUE = np.array([0.031, 0.015, 0.002, -0.011, -0.045, -0.006])  # [N m] up to a quarter of the greatest


def solid_wheels(robot: Robot) -> Robot:
    """The robot with wheels that a solid body can have: no less inertia about a diameter than half of the spin's."""
    casters = tuple(
        caster.model_copy(update={"wheel": caster.wheel.model_copy(update={"yaw_inertia": caster.wheel.spin_inertia})})
        for caster in robot.casters
    )
    return robot.model_copy(update={"casters": casters})


def ends(robot, state, torque, duration, timesteps):
    """Poses where the equations and MuJoCo, once for each of its time steps, end."""
    exact = Model(robot).simulate(state, torque, STEP, round(duration / STEP))[-1, :3]
    return exact, [simulate(robot, state, torque, timestep, duration).pose[-1] for timestep in timesteps]


def assert_limit_is_exact(robot, state, torque, duration):
    """MuJoCo's error is of first order: extrapolated to a step of zero, it ends where the equations do."""
    exact, (coarse, middle, fine) = ends(robot, state, torque, duration, (1e-3, 5e-4, 2.5e-4))
    errors = [float(np.linalg.norm(end - exact)) for end in (coarse, middle, fine)]  # an angle counts as the way at 1 m
    assert errors[0] > errors[1] > errors[2]
    # the extrapolation removes the error of first order; a tenth is room for the second order, half would be too much
    assert np.linalg.norm(2.0 * fine - middle - exact) < 0.1 * errors[1]


def test_mujoco_converges_to_the_equations():
    assert_limit_is_exact(CHUNG, START, TORQUE, 4.0)


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(3))
def test_mujoco_converges_for_a_robot_of_which_nothing_is_zero(seed):
    """Offsets, mass centres, rotors, armatures, viscous friction, scrub, a motion at the start; four unlike casters.

    For a second: one of them is then led past a posture from which casters may flip either way.
    """
    robot = solid_wheels(without_dry_friction(random_robot(seed, 4)))
    rng = np.random.default_rng(seed)
    state = np.concatenate(([0.1, -0.2, 0.5, 0.3, -0.2, 0.5], rng.uniform(-np.pi, np.pi, 4)))
    assert_limit_is_exact(robot, state, rng.uniform(-0.3, 0.3, 8), 1.0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tidybot2", "xr4000"])
def test_mujoco_converges_for_the_robots_that_were_built(name):
    robot = without_dry_friction(load_robot(name))
    state = np.concatenate((np.zeros(6), [2.0, -1.0, 0.5, -2.5]))
    assert_limit_is_exact(robot, state, np.tile([0.2, 0.1], 4), 2.0)


def test_mujoco_contains_the_term_that_chung2008_lacks():
    """(D1) is no matter of taste: without it the equations end far from where the bodies do."""
    peer = simulate(CHUNG, START, TORQUE, 5e-4, 4.0).pose
    exact, printed = (
        Model(CHUNG, dynamics).simulate(START, TORQUE, STEP, round(4.0 / STEP))[-1]
        for dynamics in ("exact", "chung2008")
    )
    assert path_length(peer) > 1.0  # [m]
    off_exact, off_printed = (float(np.hypot(*(peer[-1] - end[:3])[:2])) for end in (exact, printed))
    assert off_printed > 10.0 * off_exact  # 58 mm and 0.5 mm; 10 is room


def test_joints_stand_where_their_names_say():
    """Turning one joint of the peer moves what the robot's joint of that name moves."""
    model = mujoco.MjModel.from_xml_string(mjcf(CHUNG, STEP))
    platform, joints = joint_indices(CHUNG, model)
    assert [model.joint(int(model.dof_jntid[i])).name for i in (*platform, *joints)] == ["x", "y", "yaw", *CHUNG.joints]
    assert [model.actuator(i).name for i in range(model.nu)] == list(CHUNG.joints)


def test_mass_of_the_peer_is_that_of_the_robot():
    model = mujoco.MjModel.from_xml_string(mjcf(CHUNG, STEP))
    assert model.body_mass.sum() == pytest.approx(5.0 + 3 * (0.5 + 0.1), rel=1e-12)  # rounding of a sum


def test_strong_drives_stay_within_the_motors():
    """The ninth draw of chung2008 would outrun them, and is left out."""
    drives = strong_drives(CHUNG, 10)
    assert [drive.draw for drive in drives] == [*range(9), 10]
    limits = np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in CHUNG.casters]).ravel()
    assert all((np.abs(drive.torque) < limits).all() for drive in drives)


def test_slip_falls_with_the_step():
    """It is of the contact's softness, which MuJoCo ties to its step: half a step, half the slip."""
    coarse, fine = (slip(CHUNG, START, TORQUE, step, 1.0) for step in (1e-3, 5e-4))
    assert coarse / fine == pytest.approx(2.0, rel=0.1)  # second order in the step


@pytest.mark.slow
def test_page_tells_what_was_compared(tmp_path):
    """Smoke of page, table and figure; the limit of MuJoCo is ours."""
    one = compare(CHUNG, strong_drives(CHUNG, 1)[0])
    assert one.limit < 0.1 * one.from_exact[-1]
    write_table(tmp_path / "convergence.csv", [one])
    draw_convergence(tmp_path / "convergence.png", [one])
    assert len((tmp_path / "convergence.csv").read_text().splitlines()) == 1 + len(STEPS)
    text = page([one], [creep(load_robot("xr4000"))], "python -m scripts.mujoco_peer")
    assert "| chung2008 | 1.4 " in text
    assert "In 1 of 1 drives" in text
    assert "| xr4000 | 0.1 | " in text
    assert "Dry friction does not hold" not in page([one], [], "")  # of robots that have none


@pytest.mark.slow
@pytest.mark.parametrize("name", ["tidybot2", "xr4000"])
def test_creep_below_breakaway_is_that_of_the_law(name):
    """s / √(1 − s²) of `coulomb_speed`; viscous friction and getting there take some of it, less of a sharper law."""
    found = creep(load_robot(name))
    missing = 1.0 - np.array(found.ways) / found.law
    assert (missing > 0.0).all()
    assert missing[0] < 0.15  # viscous · rate is 6 % of the load on xr4000, 5 % on tidybot2 at 0.06 rad/s; the start
    assert missing[-1] < 0.01
    assert found.substeps[0] < found.substeps[-1]
    assert found.peer < 0.3 * found.ways[0]  # MuJoCo's constraint holds, as softly as all of them
