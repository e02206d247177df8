"""caster_gym.paths.feasibility: motor use against the model and a pseudo-inverse, and advice that holds."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.paths import build_trajectories, read_paths
from caster_gym.paths.feasibility import check_feasible, motor_use
from caster_gym.paths.trailing import trailing_directions
from caster_gym.paths.trajectory import COLUMNS, Trajectory
from caster_gym.robot import Robot

ROBOT = load_robot("chung2008")
DEFAULTS = ("circle", "ellipse", "lemniscate", "rounded_square", "random_paths")


def trajectories(path, time_step=0.02):
    return tuple(t for one in read_paths(path) for t in one.trajectories(time_step))


def robot_with(**caster_changes):
    content = ROBOT.model_dump()
    content["casters"] = [{**caster, **caster_changes} for caster in content["casters"]]
    return Robot(**content)


def in_body(samples):
    """Twist and twist rate (K + 1, 3) in B."""
    c, s, omega, alpha = (samples[:, COLUMNS.index(name)] for name in ("cos", "sin", "omega", "alpha"))
    (vx, vy), (ax, ay) = samples[:, 4:6].T, samples[:, 7:9].T
    v, w = (c * vx + s * vy, c * vy - s * vx), (c * ax + s * ay, c * ay - s * ax)
    twist = np.stack([*v, omega], axis=1)
    return twist, np.stack([w[0] + omega * v[1], w[1] - omega * v[0], alpha], axis=1)


def steering_along(samples, robot):
    directions = trailing_directions(samples[None], robot)[0]
    return np.angle(directions / (samples[:, 2] + 1j * samples[:, 3])[:, None])


@pytest.mark.parametrize("path", [*DEFAULTS[:4], {"shape": "random_paths", "count": 5}])
def test_use_is_that_of_the_least_torques_that_give_the_model_its_wrench(path):
    """An independent way: Jacobian, inverse dynamics and a pseudo-inverse of shares of the greatest torques.

    The damping, 1e-6 of the mean square push, changes shares by about as much, hence 1e-4 with room for bad directions.
    """
    model = Model(ROBOT)
    size = np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in ROBOT.casters]).ravel()
    top = np.array([[caster.roll.max_speed, caster.steer.max_speed] for caster in ROBOT.casters]).ravel()
    found = motor_use(trajectories(path), ROBOT)
    for k, trajectory in enumerate(trajectories(path)):
        twist, twist_rate = in_body(trajectory.samples)
        steering = steering_along(trajectory.samples, ROBOT)
        push = np.swapaxes(model.jacobian(steering), -1, -2) * size  # wrench of each motor's greatest torque
        length = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in ROBOT.casters]))
        weights = np.array([1.0, 1.0, 1.0 / length])
        wrench = model.inverse_dynamics(steering, twist, twist_rate)
        shares = np.einsum("kij,kj->ki", np.linalg.pinv(push * weights[:, None]), wrench * weights)
        _, theta, delta = model.rates(steering, twist)
        speed = np.stack([theta, delta], axis=-1).reshape(shares.shape)
        left = 1.0 - np.maximum(np.sign(shares) * speed, 0.0) / top
        use = np.maximum(abs(shares) / left, abs(speed) / top)
        assert found.use[k] == pytest.approx(use.max(), rel=1e-4)
        moment, joint = np.unravel_index(use.argmax(), use.shape)
        assert (found.joint[k], found.time[k]) == (joint, pytest.approx(0.02 * moment))
        assert found.torque[k] == pytest.approx(size[joint] * shares[moment, joint], rel=1e-4, abs=1e-6)
        assert found.left[k] == pytest.approx(size[joint] * left[moment, joint])
        assert found.speed[k] == pytest.approx(speed[moment, joint])


def test_defaults_are_feasible_with_room_for_control():
    use = motor_use(
        trajectories(DEFAULTS) + trajectories({"shape": "random_paths", "count": 256, "seed": 1}), ROBOT
    ).use
    assert use.max() < 0.9


def test_trajectories_of_different_lengths_keep_their_order():
    mixed = trajectories(["circle", "ellipse", "circle"])
    together = motor_use(mixed, ROBOT).use
    assert_allclose(together, [motor_use((one,), ROBOT).use[0] for one in mixed], rtol=0.0)


def test_blocks_of_many_paths_give_what_each_path_gives_alone():
    many = trajectories({"shape": "random_paths", "count": 40})
    assert_allclose(motor_use(many, ROBOT).use[[0, 17, 39]], motor_use([many[i] for i in (0, 17, 39)], ROBOT).use)


def test_a_geared_motor_of_the_same_power_has_the_same_use():
    """Ten times the speed at a tenth of the torque, through a gear of ten."""
    gear, roll = ((10.0, 0.0), (0.0, 1.0)), {"max_torque": 0.02, "max_speed": 1000.0}
    plain, geared = (motor_use(trajectories("ellipse"), robot) for robot in (ROBOT, robot_with(gear=gear, roll=roll)))
    assert geared.use[0] == pytest.approx(plain.use[0], rel=1e-9)
    assert geared.torque[0] == pytest.approx(plain.torque[0] / 10.0, rel=1e-9)
    assert geared.speed[0] == pytest.approx(plain.speed[0] * 10.0, rel=1e-9)


@pytest.mark.parametrize("shape", ["circle", "rounded_square"])
def test_the_duration_that_an_error_offers_does_and_a_tenth_less_does_not(shape):
    with pytest.raises(ValueError, match="would do") as error:
        build_trajectories({"shape": shape, "duration": 2.0}, ROBOT, 0.02)
    duration = float(re.search(r"a duration of at least ([\d.]+) s would do", str(error.value)).group(1))
    assert build_trajectories({"shape": shape, "duration": duration}, ROBOT, 0.02)
    with pytest.raises(ValueError, match="would do"):
        build_trajectories({"shape": shape, "duration": 0.9 * duration}, ROBOT, 0.02)


def test_the_limits_that_an_error_offers_for_random_paths_do():
    wild = {"shape": "random_paths", "count": 20, "duration": 5.0, "max_acceleration": 20.0, "max_speed": 5.0}
    with pytest.raises(ValueError, match=r"path 'random_paths \d+' .* would do") as error:
        build_trajectories(wild, ROBOT, 0.02)
    offered = dict(re.findall(r"(max_\w+) ([\d.]+)", str(error.value)))
    assert set(offered) == {"max_speed", "max_acceleration", "max_yaw_rate"}
    assert build_trajectories({**wild, **{name: float(value) for name, value in offered.items()}}, ROBOT, 0.02)


def test_an_error_names_the_joint_the_time_and_both_torques():
    weak = robot_with(steer={"max_torque": 0.001, "max_speed": 100.0}, roll={"max_torque": 0.05, "max_speed": 100.0})
    hardest = motor_use(trajectories("ellipse"), weak)
    joint, asked, left = weak.joints[hardest.joint[0]], abs(hardest.torque[0]), hardest.left[0]
    expected = (
        f"path 'ellipse' asks {asked:.2g} N m of {joint} at {hardest.time[0]:.2f} s, where its motor has {left:.2g}"
    )
    with pytest.raises(ValueError, match=re.escape(expected)):
        build_trajectories("ellipse", weak, 0.02)


def test_a_motor_beyond_its_top_speed_is_named_with_both_speeds():
    slow = robot_with(roll={"max_torque": 0.2, "max_speed": 20.0})
    with pytest.raises(ValueError, match=r"turns the motor of roll_\d at \d+\.?\d* rad/s at .* s, beyond its 20 rad/s"):
        build_trajectories("circle", slow, 0.02)


def test_a_robot_that_cannot_push_everywhere_is_told_which_joints_are_driven():
    one_caster = ROBOT.with_actuation(("roll_1", "steer_1"))
    with pytest.raises(ValueError, match=r"needs .* N at .* s where the driven joints, roll_1, steer_1, cannot push"):
        build_trajectories("circle", one_caster, 0.02)


def test_friction_beyond_the_motors_cannot_be_helped_by_going_slower():
    stuck = robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "coulomb": 0.5})
    with pytest.raises(ValueError, match="going slower does not help"):
        build_trajectories("circle", stuck, 0.02)


def test_waypoints_in_millimetres_that_are_read_as_metres_are_told_how_long_they_take():
    """A hundred times the duration would do, and nothing at all for what lies beyond a million time steps."""
    path = {"shape": "spline", "waypoints": [(0, 0), (500, 0), (1000, 0)]}
    with pytest.raises(ValueError, match="would do") as error:
        build_trajectories(path, ROBOT, 0.1)
    duration = float(re.search(r"a duration of at least ([\d.]+) s would do", str(error.value)).group(1))
    assert build_trajectories({**path, "duration": duration}, ROBOT, 0.1)
    with pytest.raises(ValueError, match="takes more time steps than a path may have"):
        build_trajectories({**path, "waypoints": [(0, 0), (1e7, 0)], "duration": 6e4}, ROBOT, 0.1)


@pytest.mark.parametrize("path", [{"shape": "circle"}, {"shape": "spline", "waypoints": [[0, 0, 0], [2, 1, 1]]}])
def test_viscous_friction_falls_with_speed_and_the_slow_path_that_is_offered_is_driven(path):
    sticky = robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "viscous": 0.5})
    with pytest.raises(ValueError, match="would do") as error:
        build_trajectories(path, sticky, 0.02)
    duration = float(re.search(r"a duration of at least ([\d.]+) s would do", str(error.value)).group(1))
    assert build_trajectories({**path, "duration": duration}, sticky, 0.02)


def test_a_path_that_would_take_too_many_time_steps_is_told_how_much_slower_it_must_be():
    far = {"shape": "circle", "radius": 1e4, "duration": 1000.0}
    with pytest.raises(ValueError, match=r"must be driven \S+ times as slowly, .* more time steps than") as error:
        build_trajectories(far, ROBOT, 0.02)
    slower = float(re.search(r"driven (\S+) times", str(error.value)).group(1))
    assert build_trajectories({**far, "duration": 1000.0 * slower}, ROBOT, 0.05)


def test_a_feasible_path_passes_in_silence():
    (circle,) = read_paths("circle")
    assert check_feasible(circle, circle.trajectories(0.02), ROBOT) is None


def test_a_robot_at_rest_uses_nothing():
    still = np.zeros((11, len(COLUMNS)))
    still[:, COLUMNS.index("cos")] = 1.0
    assert motor_use((Trajectory("still", 0.02, still),), ROBOT).use[0] == 0.0
