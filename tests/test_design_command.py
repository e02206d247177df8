"""caster_gym.design.command: what the command reads and what it leaves behind."""

import csv
import re
from importlib.resources import files
from pathlib import Path

import pytest
import yaml

from caster_gym.configuration import ConfigurationError
from caster_gym.design.command import COLUMNS, design, in_words, make_design, page, read_design, write_design
from caster_gym.design.sizing import require
from caster_gym.robot import load_robot

JOINTS = ("roll_1", "steer_1", "roll_2", "steer_2")
CHANGES = {"objective": "isotropy", "paths": [], "actuation": list(JOINTS)}


@pytest.fixture(scope="module")
def report():
    return make_design(read_design("indoor", changes=CHANGES))


@pytest.fixture(scope="module")
def folder(report, tmp_path_factory):
    folder = tmp_path_factory.mktemp("design")
    write_design(report, folder)
    return folder


def test_all_that_is_promised_is_written_and_nothing_else(folder):
    names = sorted(path.name for path in folder.iterdir())
    assert names == ["design.md", "design.png", "motors.csv", "robot.yaml", "run.yaml"]
    assert (folder / "design.png").read_bytes().startswith(b"\x89PNG")


def test_the_robot_file_is_the_robot_that_was_evaluated(report, folder):
    robot = load_robot(folder / "robot.yaml")
    assert robot == report.design.robot
    assert robot.driven == JOINTS
    original = load_robot("chung2008")
    assert robot.platform == original.platform  # the payload is no part of the robot
    assert [caster.roll for caster in robot.casters] == [caster.roll for caster in original.casters]
    assert {(caster.radius, caster.trail) for caster in robot.casters} == {(report.design.radius, report.design.trail)}


def test_the_table_of_motors_is_the_requirement_of_the_robot_file(report, folder):
    with (folder / "motors.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    again = require(load_robot(folder / "robot.yaml"), report.settings, report.design.motions)
    assert list(rows[0]) == list(COLUMNS)
    assert [row["joint"] for row in rows] == list(JOINTS)
    for row, motor in zip(rows, again.motors, strict=True):
        assert float(row["torque_Nm"]) == motor.torque
        assert float(row["use"]) == motor.use
        assert row["enough"] == str(motor.enough)


def test_the_page_holds_the_numbers_of_the_design(report, folder):
    text = (folder / "design.md").read_text(encoding="utf-8")
    assert text == page(report)
    assert f"| **best** | {1e3 * report.design.radius:.1f} | {1e3 * report.design.trail:.1f} " in text
    assert f"| as it was | 25.0 | 25.0 | {report.design.own[2]:.3f} |" in text
    assert re.search(r"\(0.03, 0\) m", text)
    assert not re.search(r"\bnan\b|\binf\b", text)
    for motor in report.after.motors:
        assert f"| {motor.joint} | {motor.torque:.3g} | {motor.speed:.3g} | {motor.power:.3g} |" in text


def test_the_settings_stand_beside_the_results(report, folder):
    run = yaml.safe_load((folder / "run.yaml").read_text(encoding="utf-8"))
    assert run["settings"] == report.settings.model_dump(mode="json")
    assert "numpy" in run["versions"]


def test_the_command_leaves_all_or_nothing(tmp_path):
    settings = read_design("indoor", changes=CHANGES)
    told: list[float] = []
    words = design(settings, tmp_path / "out", False, told.append)
    assert (tmp_path / "out" / "robot.yaml").is_file()
    assert told[-1] == 1.0
    radius = load_robot(tmp_path / "out" / "robot.yaml").casters[0].radius
    assert f"Wheels of {1e3 * radius:.1f} mm radius instead of 25.0 mm" in words
    with pytest.raises(ValueError, match="is not empty"):
        design(settings, tmp_path / "out", False, told.append)
    impossible = settings.model_copy(update={"trail": (0.08, 0.1)})
    with pytest.raises(ValueError, match="could touch"):
        design(impossible, tmp_path / "out", True, told.append)
    assert (tmp_path / "out" / "design.md").is_file()  # what was there before
    with pytest.raises(ValueError, match=r"robot\.yaml lies in it"):
        design(
            settings.model_copy(update={"robot": str(tmp_path / "out" / "robot.yaml")}), tmp_path / "out", True, print
        )
    assert [path.name for path in tmp_path.iterdir()] == ["out"]


def test_the_words_name_the_motors_that_are_too_weak(report):
    lacking = [motor.joint for motor in report.after.motors if not motor.enough]
    assert (", ".join(lacking) if lacking else "strong enough") in in_words(report)


@pytest.mark.parametrize(
    "path", sorted(Path(str(files("caster_gym.configs"))).glob("designs/*.yaml")), ids=lambda path: path.stem
)
def test_every_packaged_target_is_for_a_robot_that_exists(path):
    settings = read_design(path.stem)
    robot = load_robot(settings.robot)
    assert settings == read_design(str(path))
    for sizes, own in ((settings.radius, robot.casters[0].radius), (settings.trail, robot.casters[0].trail)):
        assert sizes[0] < own < sizes[1]


def test_options_go_before_the_file():
    settings = read_design("indoor", robot="tidybot2", changes={"speed": 0.4, "margin": 2.0})
    assert (settings.robot, settings.speed, settings.margin) == ("tidybot2", 0.4, 2.0)


@pytest.mark.parametrize(
    ("target", "changes", "words"),
    [
        ("outdoor", {}, "there is no 'outdoor' in designs; known are indoor, mobile_manipulator"),
        ("indoor", {"wheels": 4}, "wheels"),
        ("indoor", {"objective": "speed"}, "objective"),
        ("indoor", {"trail": [0.05, 0.01]}, "the first bound must be below the second"),
    ],
)
def test_wrong_settings_are_refused_by_a_sentence_that_names_them(target, changes, words):
    with pytest.raises(ConfigurationError, match=words):
        read_design(target, changes=changes)


@pytest.mark.parametrize(
    ("robot", "changes", "words"),
    [
        ("nope", {}, "unknown robot 'nope'"),
        (None, {"actuation": ["roll_1", "roll_2", "roll_9"]}, "unknown joint 'roll_9'"),
        (None, {"actuation": ["roll_1", "roll_2", "roll_3"]}, "; drive roll_1, steer_1, roll_2, steer_2$"),
        (None, {"trail": [0.08, 0.1]}, "could touch"),
        (None, {"radius": [1e-4, 2e-4]}, "too uneven"),
    ],
)
def test_what_cannot_be_designed_is_refused_when_settings_are_read(robot, changes, words):
    with pytest.raises(ValueError, match=words):
        read_design("indoor", robot, changes)


@pytest.mark.slow
def test_the_page_of_least_torque_says_at_what_speed_it_is_bought():
    bounds = {"radius": [0.02, 0.03], "trail": [0.02, 0.03], "paths": []}
    report = make_design(read_design("indoor", changes={"objective": "torque", **bounds}))
    text, fastest = page(report), max(report.after.motors, key=lambda motor: motor.speed)  # all top speeds are alike
    assert f"{fastest.joint} turns at up to {fastest.speed:.3g} rad/s" in text
    assert f"{100 * fastest.speed / fastest.has_speed:.0f} % of its top speed" in text
    assert "at the least radius and at the least trail: beyond it there may be better ones" in text
