"""Robot files: what stands in them, what is refused, and whether the robots that come with the package are sound."""

import copy

import numpy as np
import pytest
import yaml

from caster_gym import Model, Robot, load_robot
from caster_gym.configuration import ConfigurationError
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.shipped_files import names_of

ROBOTS = names_of("robots")
CASTER = {
    "x": 0.2,
    "y": 0.0,
    "trail": 0.02,
    "radius": 0.05,
    "wheel": {"mass": 0.5, "spin_inertia": 6e-4, "yaw_inertia": 3e-4},
    "link": {"mass": 1.0, "inertia": 1e-3},
    "roll": {"max_torque": 1.0, "max_speed": 20.0},
    "steer": {"max_torque": 1.0, "max_speed": 20.0},
}
GOOD = {
    "name": "two_casters",
    "platform": {"mass": 20.0, "inertia": 0.5, "footprint": {"disc": 0.3}},
    "casters": [CASTER, {**CASTER, "x": -0.2}],
}


def write(folder, change=None):
    """A robot file with one thing changed."""
    content = copy.deepcopy(GOOD)
    if change is not None:
        change(content)
    path = folder / "mine.yaml"
    path.write_text(yaml.safe_dump(content), encoding="utf-8")
    return path


def steering(robot, count=500):
    return np.random.default_rng(0).uniform(-np.pi, np.pi, (count, robot.caster_count))


def polygon(*corners):
    return lambda robot: robot["platform"].update(footprint={"polygon": [list(corner) for corner in corners]})


def rename_trail(robot):
    robot["casters"][1]["trial"] = robot["casters"][1].pop("trail")


REFUSED = {
    "negative mass": (lambda r: r["platform"].update(mass=-5.0), ["platform.mass", "greater than 0", "-5"]),
    "negative wheel mass": (lambda r: r["casters"][0]["wheel"].update(mass=-1.0), ["wheel.mass", "-1"]),
    "zero trail": (
        lambda r: r["casters"][0].update(trail=0),
        ["caster 1: 'trail' must be greater than 0, got 0", "swerve module", "behind its steering axis"],
    ),
    "misspelt key": (rename_trail, ["caster 2: unknown key 'trial'", "did you mean 'trail'"]),
    "key too much": (lambda r: r.update(colour="red"), ["colour"]),
    "missing key": (lambda r: r["platform"].pop("inertia"), ["platform.inertia", "missing"]),
    "not a number": (lambda r: r["casters"][0].update(x=float("nan")), ["x", "finite", "nan"]),
    "infinite": (lambda r: r["casters"][0]["roll"].update(max_speed=float("inf")), ["roll.max_speed", "inf"]),
    "a word for a number": (lambda r: r["casters"][0].update(radius="wide"), ["radius", "'wide'"]),
    "motors that turn together": (
        lambda r: r["casters"][0].update(gear=[[1.0, 2.0], [2.0, 4.0]]),
        ["gear", "invertible", "[[1.0, 2.0], [2.0, 4.0]]"],
    ),
    "gear of three columns": (
        lambda r: r["casters"][0].update(gear=[[1, 0, 0], [0, 1, 0]]),
        ["caster 1: number 1 of 'gear'", "should have 2 items, got 3"],
    ),
    "yes for a number": (lambda r: r["platform"].update(mass=True), ["'platform.mass' should be a number, got True"]),
    "a number in quotes": (lambda r: r["platform"].update(mass="5"), ["'platform.mass' should be a number, got '5'"]),
    "one caster": (lambda r: r["casters"].pop(), ["casters", "at least 2"]),
    "casters on one spot": (lambda r: r["casters"][1].update(x=0.2), ["casters", "different places"]),
    "unknown joint": (lambda r: r.update(actuation=["roll_1", "steer_9"]), ["steer_9", "roll_1, steer_1, roll_2"]),
    "joint named twice": (lambda r: r.update(actuation=["roll_1", "roll_1"]), ["twice", "roll_1"]),
    "no joint": (lambda r: r.update(actuation=[]), ["at least one joint"]),
    "unknown actuation": (
        lambda r: r.update(actuation="some"),
        ["'actuation' must be 'all' or a list of joints", "got 'some'"],
    ),
    "numbers for joints": (lambda r: r.update(actuation=[1, 2]), ["must be 'all' or a list of joints", "got [1, 2]"]),
    "dent in the outline": (
        polygon((0, 0), (1, 0), (0.2, 0.2), (0, 1)),
        ["'platform.footprint.polygon' must be convex, but it bends inwards at corner 3 at (0.2, 0.2)"],
    ),
    "clockwise outline": (
        polygon((0, 0), (0, 1), (1, 1), (1, 0)),
        ["'platform.footprint.polygon' must be listed counter-clockwise"],
    ),
    "outline that crosses itself": (
        polygon(*[(np.cos(a).item(), np.sin(a).item()) for a in 4.0 * np.pi / 5.0 * np.arange(5)]),
        ["'platform.footprint.polygon' must not cross itself, but its edges from corner 1 and from corner 3 cross"],
    ),
    "outline of two corners": (polygon((0, 0), (1, 0)), ["footprint.polygon", "at least 3"]),
    "two outlines": (
        lambda r: r["platform"]["footprint"].update(polygon=[[0, 0], [1, 0], [0, 1]]),
        ["footprint", "exactly one of 'disc'"],
    ),
    "no outline": (lambda r: r["platform"].update(footprint={}), ["footprint", "exactly one of 'disc'"]),
}


@pytest.mark.parametrize("case", REFUSED)
def test_bad_file_is_refused_by_key_value_and_file(tmp_path, case):
    change, said = REFUSED[case]
    path = write(tmp_path, change)
    with pytest.raises(ConfigurationError) as caught:
        load_robot(path)
    for words in ["mine.yaml", *said]:
        assert words in str(caught.value)


def test_bad_caster_is_not_called_a_missing_one(tmp_path):
    path = write(tmp_path, lambda robot: robot["casters"][1].update(trail=-0.02))
    with pytest.raises(ConfigurationError) as caught:
        load_robot(path)
    assert str(caught.value) == f"{path}: caster 2: 'trail' should be greater than 0, got -0.02"


def test_problem_of_the_whole_robot_is_told_without_its_content(tmp_path):
    path = write(tmp_path, lambda robot: robot["casters"][1].update(x=0.2))
    with pytest.raises(ConfigurationError) as caught:
        load_robot(path)
    assert str(caught.value) == f"{path}: at least two casters must stand at different places"


def test_good_file_is_loaded_by_its_path(tmp_path):
    path = write(tmp_path)
    robot = load_robot(path)
    assert robot == load_robot(str(path)) == Robot.model_validate(GOOD)
    assert load_robot(robot) is robot


def test_a_robot_may_be_a_mapping_or_a_file_with_an_upper_case_suffix(tmp_path):
    file = write(tmp_path).rename(tmp_path / "ROBOT.YAML")
    assert load_robot(GOOD) == load_robot(file) == load_robot(str(file)) == load_robot(load_robot(GOOD).model_dump())
    with pytest.raises(ConfigurationError, match=r"robot: unknown key 'plattform'; did you mean 'platform'\?"):
        load_robot({**GOOD, "plattform": {}})


def test_unknown_name_is_answered_with_the_known_ones():
    known = ", ".join(ROBOTS)
    with pytest.raises(ConfigurationError, match=rf"unknown robot 'tidybot3'; known are {known}, or give the path"):
        load_robot("tidybot3")


@pytest.mark.parametrize("nothing", [None, 3, b"chung2008", ["chung2008"]])
def test_what_names_no_robot_is_refused(nothing):
    with pytest.raises(ConfigurationError, match=r"a robot is a name, the path of a YAML file, .* got "):
        load_robot(nothing)


def test_a_folder_or_a_name_without_its_suffix_gets_a_hint(tmp_path):
    with pytest.raises(ConfigurationError, match=rf"'{tmp_path}' is a folder, not a robot; known are "):
        load_robot(tmp_path)
    (tmp_path / "mine.yaml").touch()
    with pytest.raises(ConfigurationError, match=r"unknown robot '.*mine'; did you mean the file '.*mine\.yaml'\?"):
        load_robot(tmp_path / "mine")


def test_missing_file_is_named():
    with pytest.raises(ConfigurationError, match=r"no file .*nowhere\.yaml"):
        load_robot("nowhere.yaml")


def test_joints_alternate_between_rolling_and_steering(tmp_path):
    robot = load_robot(write(tmp_path))
    assert robot.joints == ("roll_1", "steer_1", "roll_2", "steer_2")
    assert robot.driven == robot.joints
    some = robot.with_actuation(["steer_2", "roll_1"])
    assert some.driven == ("roll_1", "steer_2")
    assert some.driven_indices == [0, 3]
    assert robot.with_actuation(["roll_1"]).with_actuation("all") == robot
    with pytest.raises(ConfigurationError, match="steer_3"):
        robot.with_actuation(["steer_3"])


@pytest.mark.parametrize("name", ROBOTS)
def test_robot_without_wheels_weighs_as_much_as_its_platform(name):
    bare = load_robot(name).without_wheels()
    p = bare.platform
    cx, cy = p.com
    expected = [
        [p.mass, 0.0, -p.mass * cy],
        [0.0, p.mass, p.mass * cx],
        [-p.mass * cy, p.mass * cx, p.inertia + p.mass * (cx**2 + cy**2)],
    ]
    # nothing is left to add to the platform's matrix, so only its own rounding remains
    np.testing.assert_allclose(Model(bare).inertia(steering(bare, 5)), np.broadcast_to(expected, (5, 3, 3)), atol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_inertia_is_positive_definite_and_no_less_than_the_mass(name):
    robot = load_robot(name)
    mass = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
    matrices = Model(robot).inertia(steering(robot))
    assert np.linalg.eigvalsh(matrices).min() > 0.0
    # a caster resists by its own mass at least along its wheel; across it, its pivot moves less than the wheel's mass
    assert matrices[:, 0, 0].min() > robot.platform.mass
    assert matrices[:, 0, 0].mean() > 0.9 * mass


@pytest.mark.parametrize("name", ROBOTS)
def test_weight_rests_on_all_wheels(name):
    robot = load_robot(name)
    mass = robot.platform.mass + sum(caster.wheel.mass + caster.link.mass for caster in robot.casters)
    loads = Model(robot).wheel_loads(steering(robot))
    assert loads.min() > 0.05 * 9.81 * mass  # none is about to lift
    np.testing.assert_allclose(loads.sum(axis=-1), 9.81 * mass, rtol=1e-12)


@pytest.mark.parametrize("name", ROBOTS)
def test_motors_can_push_in_every_direction_at_a_sensible_rate(name):
    """At rest, 1 to 30 m/s² with the least-squares sharing of the motors' torques: neither toy nor missile."""
    robot = load_robot(name)
    model = Model(robot)
    limits = np.array([[c.roll.max_torque, c.steer.max_torque] for c in robot.casters]).ravel()
    gear = np.zeros((len(limits), len(limits)))
    for i, caster in enumerate(robot.casters):
        gear[2 * i : 2 * i + 2, 2 * i : 2 * i + 2] = caster.gear
    for angles in steering(robot, 20):
        wrenches = model.jacobian(angles).T @ gear.T * limits  # of each motor at its greatest torque
        for heading in np.linspace(0.0, 2.0 * np.pi, 8, endpoint=False):
            one = model.inertia(angles) @ [np.cos(heading), np.sin(heading), 0.0]  # for 1 m/s²
            share = abs(np.linalg.pinv(wrenches) @ one).max()
            assert 1.0 < 1.0 / share < 30.0


@pytest.mark.parametrize("name", ROBOTS)
def test_wheels_stand_under_the_robot(name):
    """Every pivot lies inside the footprint, so that a wall is met by the outline."""
    robot = load_robot(name)
    outline = robot.platform.footprint
    pivots = np.array([[caster.x, caster.y] for caster in robot.casters])
    if outline.disc is not None:
        assert np.hypot(*pivots.T).max() < outline.disc
    else:
        corners = np.array(outline.polygon)
        edges = np.roll(corners, -1, axis=0) - corners
        to_pivots = pivots[:, None] - corners
        assert (edges[:, 0] * to_pivots[..., 1] - edges[:, 1] * to_pivots[..., 0] > 0.0).all()


def test_tidybot_wheel_rolls_about_the_point_its_makers_publish():
    """Its wheel centre is (−0.014008, −0.003753) m from the pivot along and left of the rolling direction."""
    robot = load_robot("tidybot2")
    rng = np.random.default_rng(0)
    for angles, twist in zip(steering(robot, 20), rng.uniform(-1.0, 1.0, (20, 3)), strict=True):
        eta, theta, _ = Model(robot).rates(angles, twist)
        for i, caster in enumerate(robot.casters):
            f = np.exp(1j * angles[i])  # plane vectors as complex numbers: turning by 90° is multiplying by j
            pivot = complex(twist[0], twist[1]) + 1j * twist[2] * complex(caster.x, caster.y)
            centre = pivot + 1j * eta[i] * complex(-0.014008, -0.003753) * f
            assert centre == pytest.approx(0.0508 * theta[i] * f, abs=1e-12)  # rounding of about 1 m/s


def test_tidybot_motors_turn_as_its_gears_say():
    """Motor speeds per joint rate, published: drive (50/14)(δ̇ − (19/25)(45/15) θ̇), steering (32/15)(60/10) δ̇."""
    (drive_roll, drive_steer), steer = load_robot("tidybot2").casters[0].gear
    first, second, third = 50.0 / 14.0, 19.0 / 25.0, 45.0 / 15.0
    assert drive_steer / drive_roll == pytest.approx(first / -(first * second * third), rel=1e-12)
    assert steer == (0.0, 1.0)


def seen_rotors(name):
    """Energies of all that turns in a caster but its wheel, times 2, for random rolling and steering rates (500, 2)."""
    caster = robot_parameters(load_robot(name)).casters[0]
    theta, delta = np.random.default_rng(0).uniform(-1.0, 1.0, (2, 500))
    ours = caster.roll_armature * theta**2 + caster.steer_armature * delta**2
    return theta, delta, ours + 2.0 * caster.cross_armature * theta * delta


def test_tidybot_rotors_turn_as_its_gears_say():
    """Both rotors are estimated at 5e-5 kg m² and turn as the published gears lead them."""
    theta, delta, ours = seen_rotors("tidybot2")
    drive = 50.0 / 14.0 * (delta - 19.0 / 25.0 * 45.0 / 15.0 * theta)
    steering = 32.0 / 15.0 * 60.0 / 10.0 * delta
    np.testing.assert_allclose(ours, 5e-5 * (drive**2 + steering**2), rtol=1e-4)  # the file holds six digits


def test_xr4000_casters_are_the_published_bodies():
    """Wheel and link together: 2.72 kg, 0.010 m behind the pivot, 3.32e-3 kg m²."""
    caster = load_robot("xr4000").casters[0]
    wheel, link = caster.wheel, caster.link
    mass = wheel.mass + link.mass
    behind = (wheel.mass * caster.trail + link.mass * link.com[0]) / mass
    yaw = (
        wheel.yaw_inertia
        + link.inertia
        + wheel.mass * (caster.trail - behind) ** 2
        + link.mass * (link.com[0] - behind) ** 2
    )
    assert mass == pytest.approx(2.72, rel=1e-12)
    assert behind == pytest.approx(0.010, rel=1e-5)  # the file holds six digits
    assert yaw == pytest.approx(3.32e-3, rel=1e-5)


XR4000_GEARS = {"larger": 4.78e-4, "smaller": 1.74e-5, "steering": 7.11e-5, "drive": 8.53e-5}  # [kg m²]


def test_xr4000_rotors_and_gears_turn_as_its_makers_say():
    """Relative to the platform: the larger gear with the drive motor, the smaller one the other way round."""
    theta, delta, ours = seen_rotors("xr4000")
    larger, smaller, steering, drive = XR4000_GEARS.values()
    led = delta - 2.0 * theta
    theirs = drive * (85.0 / 35.0 * led) ** 2 + larger * led**2 + smaller * (delta + 2.0 * theta) ** 2
    np.testing.assert_allclose(ours, theirs + steering * (4.0 * delta) ** 2, rtol=1e-4)  # the file holds six digits


def test_xr4000_has_the_mass_matrix_of_its_makers():
    """Theirs is in steering rate, rolling rate and yaw of the platform, rotors and gears turning with that yaw as well.

    One entry is corrected: the drive rotor resists steering by its ratio squared, as it does rolling, not by its ratio.
    Its cross term alone is 2.3 % of accelerations (median), that of the gears as much again.
    """
    robot = load_robot("xr4000")
    model, angles = Model(robot), steering(robot)
    larger, smaller, steer, drive = XR4000_GEARS.values()
    to_steer, to_shaft, to_wheel, radius = 4.0, 85.0 / 35.0, 2.0, 0.055
    yaw = 2.72 * (0.0199 - 0.010) ** 2 + 3.32e-3 + larger + smaller  # about the wheel's centre
    turning = [
        [
            yaw + steer * to_steer**2 + drive * to_shaft**2,
            (smaller - larger - drive * to_shaft**2) * to_wheel,
            yaw - steer * to_steer - drive * to_shaft,
        ],
        [0.0, 2.72 * radius**2 + (smaller + larger + drive * to_shaft**2) * to_wheel**2 + 4e-4, 0.0],
        [0.0, (smaller - larger + drive * to_shaft) * to_wheel, yaw + steer + drive],
    ]
    a = np.array(turning)
    a[1, 0], a[2, 0], a[1, 2] = a[0, 1], a[0, 2], a[2, 1]
    theirs = np.broadcast_to(np.diag([50.8, 50.8, 3.15755]), (len(angles), 3, 3)).copy()
    rows = model.jacobian(angles)
    for i in range(4):
        about = np.broadcast_to([[0.0, 0.0, 1.0]], (len(angles), 1, 3))
        rates = np.concatenate([rows[:, 2 * i + 1 : 2 * i + 2], rows[:, 2 * i : 2 * i + 1], about], axis=1)
        theirs += rates.mT @ a @ rates
    push = np.random.default_rng(1).uniform(-1.0, 1.0, (len(angles), 8)) * np.tile([4.27, 3.52], 4)
    wrench = np.einsum("kij,ki->kj", rows, push)[..., None]
    ours, exact = (np.linalg.solve(m, wrench)[..., 0] for m in (model.inertia(angles), theirs))
    off = np.linalg.norm(ours - exact, axis=1) / np.linalg.norm(exact, axis=1)
    assert np.median(off) < 3e-3
    assert off.max() < 1.5e-2


def test_the_reach_holds_the_wheels_however_they_are_steered():
    """By trying all directions of every caster."""
    robot = load_robot("tidybot2")
    angles = np.linspace(0.0, 2.0 * np.pi, 721)
    f = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    across = f @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    far = 0.0
    for caster in robot.casters:
        wheel = np.array([caster.x, caster.y]) - caster.trail * f + caster.offset * across
        far = max(far, np.hypot(*(wheel + caster.radius * f).T).max(), np.hypot(*(wheel - caster.radius * f).T).max())
    assert robot.reach >= far and robot.platform.footprint.polygon is not None
    assert robot.reach < 1.05 * max(far, *(np.hypot(*corner) for corner in robot.platform.footprint.polygon))


def test_casters_are_not_endless():
    """Every pair of them is compared."""
    robot = load_robot("chung2008").model_dump()
    robot["casters"] = [{**robot["casters"][0], "x": 0.1 * k} for k in range(201)]
    with pytest.raises(ConfigurationError, match="'casters' should have at most 200 items"):
        load_robot(robot)
