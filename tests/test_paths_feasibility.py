"""caster_gym.paths.feasibility: motor use against the model and a pseudo-inverse, and advice that holds."""

import re
from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.paths import build_trajectories, read_paths
from caster_gym.paths.feasibility import check_feasible, motor_use, motor_uses_at
from caster_gym.paths.moments import sample_paths
from caster_gym.paths.trailing import trailing_directions
from caster_gym.paths.trajectory import COLUMNS, Trajectory
from caster_gym.robot import Robot
from caster_gym.shipped_files import names_of

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


def steering_along(trajectory, robot):
    samples = trajectory.samples
    directions = trailing_directions(samples[None], trajectory.time_step, robot)[0]
    return np.angle(directions / (samples[:, 2] + 1j * samples[:, 3])[:, None])


@pytest.mark.parametrize("path", [*DEFAULTS[:4], {"shape": "random_paths", "count": 5}])
def test_use_is_that_of_the_least_torques_that_give_the_model_its_wrench(path):
    """An independent way: Jacobian, inverse dynamics and a pseudo-inverse of shares of the greatest torques, at 2 ms.

    The damping, 1e-6 of the mean square push, changes shares by about as much, hence 1e-4 with room for bad directions;
    random paths are scaled by their greatest sample, which differs by 3e-4 between 20 ms and 2 ms.
    """
    model = Model(ROBOT)
    size = np.array([[caster.roll.max_torque, caster.steer.max_torque] for caster in ROBOT.casters]).ravel()
    top = np.array([[caster.roll.max_speed, caster.steer.max_speed] for caster in ROBOT.casters]).ravel()
    found = motor_use(trajectories(path), ROBOT)
    for k, trajectory in enumerate(trajectories(path, 0.002)):
        twist, twist_rate = in_body(trajectory.samples)
        steering = steering_along(trajectory, ROBOT)
        push = np.swapaxes(model.jacobian(steering), -1, -2) * size  # wrench of each motor's greatest torque
        length = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in ROBOT.casters]))
        weights = np.array([1.0, 1.0, 1.0 / length])
        wrench = model.inverse_dynamics(steering, twist, twist_rate)
        shares = np.einsum("kij,kj->ki", np.linalg.pinv(push * weights[:, None]), wrench * weights)
        _, theta, delta = model.rates(steering, twist)
        speed = np.stack([theta, delta], axis=-1).reshape(shares.shape)
        left = 1.0 - np.maximum(np.sign(shares) * speed, 0.0) / top
        use = np.maximum(abs(shares) / left, abs(speed) / top)
        assert found.use[k] == pytest.approx(use.max(), rel=1e-4 if len(found.use) == 1 else 5e-4)
        joint = found.joint[k]
        moment = round(found.time[k] / 0.002)
        assert use[moment, joint] == pytest.approx(use.max(), rel=2e-3)  # at most 1 ms away, where the use may fall
        assert found.torque[k] == pytest.approx(size[joint] * shares[moment, joint], rel=5e-3, abs=1e-9)
        assert found.left[k] == pytest.approx(size[joint] * left[moment, joint], rel=5e-3)
        assert found.speed[k] == pytest.approx(speed[moment, joint], rel=5e-3, abs=1e-9)


ROBOTS = names_of("robots")
WAYPOINTS = ((0.0, 0.0), (0.6, 0.3), (0.9, 1.0), (0.3, 1.4), (-0.5, 0.9), (-0.4, 0.1))
SPOTS = ((0, 0, 0), (1, 0, 0), (1, 0, 1.5), (1, 1, 1.5), (1, 1, 3.0), (0, 1, 3.0))
LOG = [(0.05 * k, round(np.cos(0.045 * k), 3), round(np.sin(0.065 * k), 3), round(0.025 * k, 3)) for k in range(120)]
STOPS = [(0, 0, 0, 0), (1.13, 0.5, 0.1, 0.3), (2.41, 1.2, 0.5, 0.8), (3.33, 1.2, 0.5, 0.8), (4.77, 0.3, 1.1, 0.2)]
PATHS: dict[str, Any] = {
    "circle": "circle",
    "ellipse": "ellipse",
    "lemniscate": "lemniscate",
    "spinning": {"shape": "circle", "heading": {"kind": "spinning", "turns": 3}},
    "waypoints": {"shape": "spline", "waypoints": WAYPOINTS},
    "turns on the spot": {"shape": "spline", "waypoints": SPOTS},
    "reversing": {"shape": "random_paths", "count": 1, "seed": 5, "reversing": 1.0},
    "log": {"shape": "timed", "poses": LOG},
    "poses with a stop": {"shape": "timed", "poses": STOPS},
}


def paced(path, factor):
    """A path that is driven in so many times its time."""
    if path.shape == "timed":
        return path.model_copy(update={"stretch": factor})
    changes = {"duration": factor * path.duration}
    if path.shape == "random_paths":
        changes |= {"max_speed": 0.8 / factor, "max_acceleration": 1.0 / factor**2, "max_yaw_rate": 1.5 / factor}
    return path.model_copy(update=changes)


def use_at(path, factor, steps_per_second, robot):
    """Greatest use with so many whole steps that none is rounded away."""
    slower = paced(path, factor)
    steps = round(slower.duration * steps_per_second)
    return motor_use(slower.trajectories(slower.duration / steps), robot).use.max()


@pytest.mark.parametrize(
    "name", ["chung2008", *(pytest.param(one, marks=pytest.mark.slow) for one in ("tidybot2", "xr4000"))]
)
@pytest.mark.parametrize("what", PATHS)
def test_the_shortest_time_for_a_path_is_the_same_for_coarse_and_fine_samples(what, name):
    """At 20 ms and at 1 ms, on casters with trails of 14 to 20 mm, which pivots pass by far in 20 ms.

    Uses agree to 0.15 % (random paths are scaled by their greatest sample), and no use falls less than the time grows.
    """
    robot, (path,) = load_robot(name), read_paths(PATHS[what])
    low, high = 0.1, 20.0
    while high > 1.0002 * low:
        middle = (low * high) ** 0.5
        low, high = (low, middle) if use_at(path, middle, 50.0, robot) <= 1.0 else (middle, high)
    assert use_at(path, high, 1000.0, robot) <= 1.001
    assert use_at(path, low / 1.002, 1000.0, robot) > 1.0


@pytest.mark.parametrize(
    "name", ["chung2008", *(pytest.param(one, marks=pytest.mark.slow) for one in ("tidybot2", "xr4000"))]
)
def test_nothing_between_samples_is_harder_than_what_is_found(name):
    """Against samples that lie 100 times as close together."""
    robot = load_robot(name)
    for path in PATHS.values():
        (coarse,), (fine,) = trajectories(path, 0.02), trajectories(path, 0.0002)
        found = motor_use((coarse,), robot).use[0]
        block = next(sample_paths((fine,), robot))
        seen = motor_uses_at(block.motion, robot_parameters(robot)).max()
        assert seen <= 1.0005 * found, path  # closer samples of a random path scale it by 3e-4
        assert found <= 1.002 * seen, path


def test_a_path_that_a_time_step_slows_down_is_judged_as_it_is_written():
    """8.690 s are 8.70 s at steps of 25 ms, and too fast; so is 8.71 s of which steps of 20 ms make 8.72 s no news."""
    tidybot = load_robot("tidybot2")
    (circle,) = read_paths({"shape": "circle", "duration": 8.685})
    rounded = motor_use(circle.trajectories(0.1), tidybot).use[0]
    assert rounded <= 1.0
    with pytest.raises(ValueError, match="would suffice"):
        check_feasible(circle, circle.trajectories(0.1), tidybot)


@pytest.mark.parametrize("time_step", [0.002, 0.05])
@pytest.mark.parametrize("shape", ["circle", "ellipse", "rounded_square"])
def test_advice_holds_at_other_time_steps_too(shape, time_step):
    tidybot = load_robot("tidybot2")
    with pytest.raises(ValueError, match="would suffice") as error:
        build_trajectories({"shape": shape, "duration": 4.0}, tidybot, 0.02)
    duration = float(re.findall(r"a duration of at least ([\d.]+) s would suffice", str(error.value))[0])
    exact = time_step * np.ceil(duration / time_step)  # a coarse step may shorten it, by half of itself
    assert build_trajectories({"shape": shape, "duration": exact}, tidybot, time_step)


def test_plans_whose_accelerations_jump_are_judged_by_what_they_say():
    """A bang-bang plan at 50 Hz: a quintic through its samples would swing beyond its accelerations by a sixth."""
    steps, h = 100, 0.02
    t = h * np.arange(steps + 1)
    switch = 0.5 * steps * h + 0.3 * h
    top = 0.8
    a = np.where(t < switch, top, -top * switch / (steps * h - switch))
    v = np.where(t < switch, top * t, top * switch + a * (t - switch))
    x = np.where(
        t < switch, 0.5 * top * t**2, 0.5 * top * switch**2 + (top * switch + 0.5 * a * (t - switch)) * (t - switch)
    )
    table = np.zeros((steps + 1, len(COLUMNS)))
    for name, column in (("x", x), ("cos", 1.0), ("vx", v), ("ax", a)):
        table[:, COLUMNS.index(name)] = column
    plan = Trajectory("plan", h, table)
    at_samples = motor_uses_at(next(sample_paths((plan,), ROBOT)).motion, robot_parameters(ROBOT)).max()
    assert motor_use((plan,), ROBOT).use[0] == pytest.approx(at_samples, rel=1e-4)


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
    with pytest.raises(ValueError, match="would suffice") as error:
        build_trajectories({"shape": shape, "duration": 2.0}, ROBOT, 0.02)
    duration = float(re.findall(r"a duration of at least ([\d.]+) s would suffice", str(error.value))[0])
    assert build_trajectories({"shape": shape, "duration": duration}, ROBOT, 0.02)
    with pytest.raises(ValueError, match="would suffice"):
        build_trajectories({"shape": shape, "duration": 0.9 * duration}, ROBOT, 0.02)


def test_the_limits_that_an_error_offers_for_random_paths_do():
    wild = {"shape": "random_paths", "count": 20, "duration": 5.0, "max_acceleration": 20.0, "max_speed": 5.0}
    with pytest.raises(ValueError, match=r"path 'random_paths \d+' .* would suffice") as error:
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


@pytest.mark.slow
def test_waypoints_in_millimetres_that_are_read_as_metres_are_told_how_long_they_take():
    """A hundred times the duration would suffice, and nothing at all beyond the time steps that a path may have."""
    path = {"shape": "spline", "waypoints": [(0, 0), (500, 0), (1000, 0)]}
    with pytest.raises(ValueError, match="would suffice") as error:
        build_trajectories(path, ROBOT, 0.1)
    duration = float(re.findall(r"a duration of at least ([\d.]+) s would suffice", str(error.value))[0])
    assert build_trajectories({**path, "duration": duration}, ROBOT, 0.1)
    with pytest.raises(ValueError, match="takes more time steps than a path may have"):
        build_trajectories({**path, "waypoints": [(0, 0), (1e7, 0)], "duration": 3e4}, ROBOT, 0.1)


@pytest.mark.parametrize("path", [{"shape": "circle"}, {"shape": "spline", "waypoints": [[0, 0, 0], [2, 1, 1]]}])
def test_viscous_friction_falls_with_speed_and_the_slow_path_that_is_offered_is_driven(path):
    sticky = robot_with(roll={"max_torque": 0.2, "max_speed": 100.0, "viscous": 0.5})
    with pytest.raises(ValueError, match="would suffice") as error:
        build_trajectories(path, sticky, 0.02)
    duration = float(re.findall(r"a duration of at least ([\d.]+) s would suffice", str(error.value))[0])
    assert build_trajectories({**path, "duration": duration}, sticky, 0.02)


@pytest.mark.slow
def test_a_path_that_would_take_too_many_time_steps_is_told_how_much_slower_it_must_be():
    far = {"shape": "circle", "radius": 1e4, "duration": 1000.0}
    with pytest.raises(ValueError, match=r"must be driven \S+ times as slowly, .* more time steps than") as error:
        build_trajectories(far, ROBOT, 0.02)
    slower = float(re.findall(r"driven (\S+) times", str(error.value))[0])
    assert build_trajectories({**far, "duration": 1000.0 * slower}, ROBOT, 0.15)


def test_a_feasible_path_passes_in_silence():
    (circle,) = read_paths("circle")
    check_feasible(circle, circle.trajectories(0.02), ROBOT)


def test_a_robot_at_rest_uses_nothing():
    still = np.zeros((11, len(COLUMNS)))
    still[:, COLUMNS.index("cos")] = 1.0
    assert motor_use((Trajectory("still", 0.02, still),), ROBOT).use[0] == 0.0
