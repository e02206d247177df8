"""Robot files whose numbers can hardly be meant are told by field and value; those that are in use are not."""

import copy
import warnings
from importlib.resources import files
from pathlib import Path

import numpy as np
import pytest
import yaml

from caster_gym import Robot, load_robot
from caster_gym.configuration import read_yaml
from caster_gym.plausibility import RobotWarning
from caster_gym.shipped_files import names_of
from tests.random_robots import CASTER_COUNTS, random_robot

FOLDER = Path(str(files("caster_gym.configs"))) / "robots"


def content(name="tidybot2"):
    return copy.deepcopy(yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8")))


def every(**fields):
    """Something in all casters: radius=50.8, or roll={"max_torque": 1.0} within a part."""

    def change(robot):
        for caster in robot["casters"]:
            for key, value in fields.items():
                caster[key] = {**caster[key], **value} if isinstance(value, dict) else value

    return change


def platform(**fields):
    return lambda robot: robot["platform"].update(fields)


def in_millimetres(robot):
    for caster in robot["casters"]:
        for key in ("x", "y", "trail", "offset", "radius"):
            caster[key] *= 1000.0
        caster["link"]["com"] = [1000.0 * x for x in caster["link"]["com"]]
    robot["platform"]["footprint"]["polygon"] = [
        [1e3 * x, 1e3 * y] for x, y in robot["platform"]["footprint"]["polygon"]
    ]


ODD = {
    "dry friction that hardly acts": (
        lambda robot: robot.update(coulomb_speed=30.0),
        ["'coulomb_speed' is 30 rad/s, where a motor turns at 40 rad/s at most"],
    ),
    "radius in millimetres": (every(radius=50.8), ["casters 1, 2, 3, 4: 'radius' is 50.8 m", "0.34 m from C"]),
    "trail in millimetres": (every(trail=14.0), ["'trail' is 14 m"]),
    "trail larger than the platform": (every(trail=0.4), ["'trail' is 0.4 m", "0.05 … 0.3"]),
    "offset in millimetres": (every(offset=-3.753), ["'offset' is -3.753 m"]),
    "caster metres away": (lambda r: r["casters"][1].update(x=19.0), ["caster 2: 'x, y' is 19.0008 m from C"]),
    "everything in millimetres": (in_millimetres, ["'platform.footprint'", "'platform.inertia'", "usual are 0.1 … 1"]),
    "inertia of nothing": (
        platform(mass=60.0, inertia=0.001),
        ["'platform.inertia' is 0.001 kg m²", "0.62 … 4.4 kg m²"],
    ),
    "inertia of a lorry": (platform(inertia=190.0), ["'platform.inertia' is 190 kg m²"]),
    "mass in grams": (platform(mass=50000.0), ["'platform.mass' is 50000 kg", "20 … 1000"]),
    "mass in tonnes": (platform(mass=0.05), ["'platform.mass' is 0.05 kg"]),
    "mass centre far away": (platform(com=[1.0, 0.0]), ["'platform.com' is 1 m from C"]),
    "wheel in grams": (every(wheel={"mass": 400.0}), ["'wheel.mass' is 400 kg", "ball of steel"]),
    "wheel of nothing": (every(wheel={"mass": 1e-5}), ["'wheel.mass' is 1e-05 kg"]),
    "wheel inertia in g m²": (every(wheel={"spin_inertia": 0.52}), ["'wheel.spin_inertia' is 0.52 kg m²", "0.5 … 0.8"]),
    "wheel without inertia": (every(wheel={"spin_inertia": 0.0}), ["'wheel.spin_inertia' is 0 kg m²"]),
    "yaw inertia in g m²": (every(wheel={"yaw_inertia": 0.29}), ["'wheel.yaw_inertia' is 0.29 kg m²"]),
    "link in grams": (every(link={"mass": 1200.0}), ["'link.mass' is 1200 kg"]),
    "link inertia in g m²": (every(link={"inertia": 2.0}), ["'link.inertia' is 2 kg m²"]),
    "link's mass centre in millimetres": (every(link={"com": [4.0, -1.0]}), ["'link.com' is 4.12311 m"]),
    "speed in rpm at a large wheel": (every(roll={"max_speed": 600.0}), ["'roll.max_speed' is 600 rad/s", "30.5 m/s"]),
    "steering without speed": (every(steer={"max_speed": 1e-3}), ["'steer.max_speed' is 0.001 rad/s"]),
    "torque in N mm": (every(roll={"max_torque": 1580.0}), ["'roll.max_torque' is 1580 N m", "m/s²"]),
    "torque in kN m": (every(roll={"max_torque": 1.58e-6}), ["'roll.max_torque' is 1.58e-06 N m"]),
    "steering torque in N mm": (every(steer={"max_torque": 99300.0}), ["'steer.max_torque' is 99300 N m"]),
    "height in millimetres": (lambda r: r["platform"].update(height=200.0), ["'platform.height' is 200 m"]),
    "armature in g m²": (every(roll={"armature": 33.2}), ["'roll.armature' is 33.2 kg m²", "weigh"]),
    "rotor in g m²": (every(roll={"rotor": 33.1}), ["'roll.rotor' is 33.1 kg m²", "through a gear of 1", "weigh"]),
    "friction beyond the motor": (every(roll={"coulomb": 5.0}), ["'roll.coulomb' is 5 N m", "1.6 N m at the joint"]),
    "viscous beyond the motor": (every(steer={"viscous": 10.0}), ["'steer.viscous' is 10 N m s/rad"]),
    "scrub beyond the weight": (every(scrub=50.0), ["'scrub' is 50 N m s/rad"]),
    "floor of glue": (lambda r: r.update(floor_friction=70.0), ["'floor_friction' is 70"]),
}


@pytest.mark.parametrize("case", ODD)
def test_numbers_that_can_hardly_be_meant_are_told(case, tmp_path):
    """From a file, from a mapping and from keywords alike, with what would be usual."""
    change, said = ODD[case]
    odd = content()
    change(odd)
    file = tmp_path / "mine.yaml"
    file.write_text(yaml.safe_dump(odd), encoding="utf-8")
    for made in (lambda: load_robot(file), lambda: Robot.model_validate(odd), lambda: Robot(**odd)):
        with pytest.warns(RobotWarning, match="robot 'tidybot2' can hardly be meant so") as told:
            made()
        assert len(told) == 1
        for words in said:
            assert words in str(told[0].message)


def test_only_the_number_in_question_is_told():
    odd = content()
    every(radius=50.8)(odd)
    with pytest.warns(RobotWarning) as told:
        Robot.model_validate(odd)
    assert "platform.mass" not in str(told[0].message)
    assert "x, y" not in str(told[0].message)


def ring(count, radius):
    """A robot whose casters, alike, stand around C."""
    robot = content()
    around = radius * np.exp(2j * np.pi * np.arange(count) / count)
    robot["casters"] = [{**robot["casters"][0], "x": z.real.item(), "y": z.imag.item()} for z in around]
    return robot


def test_casters_whose_wheels_collide_are_told():
    """Two whose pivots coincide; the wheels of a ring meet when neighbours stand closer than two radii."""
    same = content()
    same["casters"][1] |= {key: same["casters"][0][key] for key in ("x", "y")}
    radius = same["casters"][0]["radius"]
    with pytest.warns(RobotWarning, match=f"casters 1 and 2 stand 0 m apart, .* need {2.0 * radius:.2g} m in line"):
        Robot.model_validate(same)
    for share, crowded in ((0.99, True), (1.01, False)):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", RobotWarning)
            Robot.model_validate(ring(6, share * 2.0 * radius))  # neighbours are as far apart as from C
        assert ("casters 1 and 2 stand" in "".join(str(one.message) for one in told)) is crowded


def test_hosts_of_casters_are_told():
    with pytest.warns(RobotWarning, match=r"it has 150 casters; usual are 3 … 6; casters 1 and 2 .*; so do \d+ more"):
        Robot.model_validate(ring(150, 0.2))


def test_robots_in_use_are_not_doubted():
    with warnings.catch_warnings():
        warnings.simplefilter("error", RobotWarning)
        for name in names_of("robots"):
            robot = load_robot(name)
            assert robot.with_actuation("all").without_wheels()
            assert Robot.model_validate(read_yaml(FOLDER / f"{name}.yaml")) == robot
        for count in CASTER_COUNTS:
            for seed in range(50):
                random_robot(seed, count)


def test_an_odd_robot_is_a_robot():
    """A warning, which Python shows once for each place, is all there is to it."""
    odd = content()
    every(radius=0.5)(odd)
    with pytest.warns(RobotWarning):
        assert Robot.model_validate(odd).casters[0].radius == 0.5
