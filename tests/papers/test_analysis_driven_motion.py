"""Robots led along motions of their platform, against geometry, Newton's law, work and Kane's equations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.paths.headings import Fixed, Spinning
from caster_gym.paths.shapes import Circle, Ellipse
from caster_gym.paths.trailing import trailing_directions
from caster_gym.paths.trajectory import Trajectory
from papers.analysis.driven_motion import inertial_force, lead, steady_steering, work
from tests.kane import Kane
from tests.random_robots import random_robot

CHUNG = load_robot("chung2008")
ROBOTS = [CHUNG, *(random_robot(seed, count) for seed, count in ((0, 2), (1, 4)))]
ELLIPSE = Ellipse(semi_axes=(2.0, 1.0), duration=20.0, heading=Spinning(angle=0.4))


def on_ellipse(robot, time_step=0.02, duration=20.0):
    return lead(ELLIPSE.model_copy(update={"duration": duration}).trajectories(time_step)[0], robot)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_steady_casters_trail_steer_no_more_and_come_back(robot):
    """(F1): δ̇ = 0, the pivot moves ahead of the axle, and a caster that is turned a little turns back."""
    twists = np.random.default_rng(0).normal(size=(50, 3)) * (1.0, 1.0, 0.5) + (3.0, 0.0, 0.0)
    steering = steady_steering(robot, twists)
    model = Model(robot)
    assert_allclose(model.rates(steering, twists)[2], 0.0, atol=1e-11)  # round-off of rates of order 100
    for turn in (-1e-3, 1e-3):
        assert (model.rates(steering + turn, twists)[2] * turn < 0.0).all()


def test_pivot_within_its_trail_of_the_centre_of_rotation_has_no_steady_angle():
    near = CHUNG.casters[2].model_copy(update={"x": 0.0, "y": 0.01})
    robot = CHUNG.model_copy(update={"casters": (*CHUNG.casters[:2], near)})
    with pytest.raises(ValueError, match=r"caster 3 .* pivot moves at 0.01 m/s and must be faster .* 0.025 m/s"):
        steady_steering(robot, [0.0, 0.0, 1.0])
    with pytest.raises(ValueError, match="caster 1"):
        steady_steering(CHUNG, [0.0, 0.0, 0.0])


def test_casters_keep_their_angles_on_a_circle_and_roll_its_length():
    """(F2): by hand, each wheel's centre runs round a circle of radius √(pivot² − trail²)."""
    radius = 0.8
    motion = lead(Circle(radius=radius, duration=20.0, heading=Spinning()).trajectories(0.05)[0], CHUNG)
    assert_allclose(motion.steering, motion.steering[:1] + 0.0 * motion.steering, atol=1e-7)  # LSODA's tolerance 1e-10
    pivots = np.array([(radius + caster.x) ** 2 + caster.y**2 for caster in CHUNG.casters])
    ways = 2.0 * np.pi * np.sqrt(pivots - CHUNG.casters[0].trail ** 2)
    assert_allclose(motion.rolling[-1] * CHUNG.casters[0].radius, ways, rtol=1e-8)  # the same, over 200 rad


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_wheels_go_where_they_point_as_far_as_they_roll(robot):
    """(F2): the wheels' centres, placed by pose and steering, move along f by r θ: no slip, seen from outside."""
    motion = on_ellipse(robot)
    heading = np.exp(1j * motion.pose[:, 2])
    for i, caster in enumerate(robot.casters):
        f = heading * np.exp(1j * motion.steering[:, i])
        pivot = motion.pose[:, 0] + 1j * motion.pose[:, 1] + heading * complex(caster.x, caster.y)
        way = np.diff(pivot - caster.trail * f + 1j * caster.offset * f)
        along = np.diff(motion.rolling[:, i]) * caster.radius
        middle = f[1:] + f[:-1]
        # between samples 0.02 s apart the direction turns by ~0.02 rad: a chord is off by its cube
        assert_allclose(way * (middle / np.abs(middle)).conj(), along, atol=3e-6)


def test_steering_agrees_with_the_maps_along_paths():
    """(F2) against the paths' own casters, whose error falls with the fourth power of the step."""
    errors = []
    for time_step in (0.04, 0.02):
        trajectory = ELLIPSE.trajectories(time_step)[0]
        motion = lead(trajectory, CHUNG)
        directions = trailing_directions(trajectory.samples[None], trajectory.time_step, CHUNG)[0]
        apart = np.abs(np.exp(1j * (motion.steering + motion.pose[:, 2:])) - directions)
        errors.append(apart[len(apart) // 2 :].max())  # metres after the start, which those guess otherwise
    assert errors[1] < 1e-5
    assert errors[0] / errors[1] > 10.0


def test_casters_started_anywhere_come_to_trail():
    start = steady_steering(CHUNG, [1.0, 0.0, 0.0])
    trajectory = Circle(duration=20.0, heading=Spinning()).trajectories(0.02)[0]
    other, steady = lead(trajectory, CHUNG, start), lead(trajectory, CHUNG)
    assert_allclose(other.steering[0], start, atol=1e-12)
    assert_allclose(other.steering[-1], steady.steering[-1], atol=1e-6)  # 250 trails forget all but LSODA's 1e-10


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_force_is_that_of_kanes_equations(robot):
    """(F3): at moments along the motion, whatever the friction."""
    motion = on_ellipse(robot)
    force, kane = inertial_force(motion, Model(robot)), Kane(robot)
    for k in (100, 400, 700):
        steering, twist = motion.steering[k], motion.twist[k]
        expected = kane.inertia(steering) @ motion.twist_rate[k] + kane.bias(steering, twist)
        assert_allclose(force[k], expected, rtol=0.0, atol=1e-10)  # round-off of forces of order 10


@pytest.mark.parametrize("dynamics", ["exact", "chung2008"])
@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_work_is_the_change_of_kinetic_energy(robot, dynamics):
    """(F4): for the printed model as well, since what it lacks has no power."""
    motion, model = on_ellipse(robot), Model(robot, dynamics)
    energy = model.kinetic_energy(motion.steering, motion.twist)
    done = work(motion, inertial_force(motion, model))
    assert energy.max() > 1.0
    assert_allclose(done, energy, rtol=0.0, atol=1e-6 * energy.max())  # the spline's error at 0.02 s


def test_force_on_a_platform_without_wheels_is_newtons():
    """(F3) in the world frame: mass times acceleration, and the spin's rate."""
    motion = on_ellipse(CHUNG)
    trajectory = ELLIPSE.trajectories(0.02)[0]
    force = motion.in_world(inertial_force(motion, Model(CHUNG.without_wheels())))
    platform = CHUNG.platform
    expected = trajectory.samples[:, 7:10] * (platform.mass, platform.mass, platform.inertia)
    assert_allclose(force, expected, rtol=0.0, atol=1e-12)  # round-off of forces of order 1


def test_forces_go_with_the_square_of_the_speed():
    slow, fast = (on_ellipse(ROBOTS[1], *at) for at in ((0.04, 40.0), (0.02, 20.0)))
    forces = [inertial_force(motion, Model(ROBOTS[1])) for motion in (slow, fast)]
    assert_allclose(fast.steering, slow.steering, atol=1e-7)  # LSODA's tolerance 1e-10
    assert_allclose(forces[1], 4.0 * forces[0], rtol=0.0, atol=1e-6 * np.abs(forces[1]).max())  # and so the forces


def test_bad_input_is_named():
    trajectory = Circle(duration=2.0).trajectories(0.02)[0]
    with pytest.raises(ValueError, match=r"steering must have a last axis of 3, got shape \(2,\)"):
        lead(trajectory, CHUNG, [0.0, 0.0])
    with pytest.raises(ValueError, match=r"steering must have shape \(3,\), got \(1, 3\)"):
        lead(trajectory, CHUNG, [[0.0, 0.0, 0.0]])
    with pytest.raises(ValueError, match="steering must be finite, got nan"):
        lead(trajectory, CHUNG, [0.0, np.nan, 0.0])
    with pytest.raises(ValueError, match=r"twist must have a last axis of 3, got shape \(2,\)"):
        steady_steering(CHUNG, [1.0, 0.0])
    with pytest.raises(ValueError, match="tolerance must lie between 0 and 1, got -1"):
        lead(trajectory, CHUNG, tolerance=-1.0)
    still = Trajectory("nowhere", 0.1, trajectory.samples * np.array([1.0] * 4 + [0.0] * 6))
    still = Trajectory("nowhere", 0.1, np.broadcast_to(still.samples[0], still.samples.shape))
    with pytest.raises(ValueError, match="'nowhere' never moves: give the steering angles"):
        lead(still, CHUNG)
    assert_allclose(lead(still, CHUNG, [0.1, 0.2, 0.3]).steering[-1], [0.1, 0.2, 0.3], atol=1e-15)


def test_fixed_heading_needs_no_yaw():
    """A robot that does not turn: every wheel's way is its pivot's, and the casters point along the path."""
    motion = lead(Circle(duration=20.0, heading=Fixed(angle=0.3)).trajectories(0.02)[0], CHUNG)
    assert_allclose(motion.steering - motion.steering[:, :1], 0.0, atol=1e-9)  # all pivots move alike
    assert_allclose(motion.steering[-1, 0] - motion.steering[0, 0], 2.0 * np.pi, atol=0.05)  # d / R lags
