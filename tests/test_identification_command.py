"""caster_gym.identification.command: what the command reads and what it leaves behind."""

import csv
from dataclasses import replace

import numpy as np
import pytest
import yaml

from caster_gym.configuration import ConfigurationError
from caster_gym.identification.command import (
    PAYLOAD,
    features_yaml,
    identify_file,
    in_words,
    number_words,
    page,
    read_identify,
    write_example,
    write_identification,
)
from caster_gym.identification.fit import identify
from caster_gym.identification.recording_check import ContradictionError
from caster_gym.identification.recording_table import read_recording
from caster_gym.identification.unknowns import unknowns
from caster_gym.robot import load_robot
from caster_gym.tasks.track.environment import CasterTrackEnv
from caster_gym.wrappers import MotorLag, SteeringOffset, read_features, wrap

FILES = [".caster-gym", "features.yaml", "identified.csv", "identified.md", "identified.png", "robot.yaml", "run.yaml"]
NAMES = ("payload_mass", "scrub")


@pytest.fixture(scope="module")
def example(tmp_path_factory):
    path = tmp_path_factory.mktemp("example") / "example.csv"
    words = write_example(path, "chung2008", 0, overwrite=False)
    assert "payload_mass 1 kg, payload_x 0.04 m, payload_y -0.02 m" in words
    return path


@pytest.fixture(scope="module")
def short(example):
    """The first two seconds, for speed."""
    path = example.with_name("short.csv")
    path.write_text("\n".join(example.read_text().splitlines()[:101]) + "\n")
    return path


@pytest.fixture(scope="module")
def settings():
    load = {"payload_mass": 0.8, "payload_x": 0.04, "payload_y": -0.02}
    return read_identify("chung2008", NAMES, {"start": load})


@pytest.fixture(scope="module")
def found(short, settings):
    robot = load_robot("chung2008")
    return identify(robot, read_recording(short, robot), settings.unknowns, settings.start)


@pytest.mark.slow
def test_the_command_leaves_all_that_is_promised_or_nothing(short, settings, tmp_path):
    out, told = tmp_path / "out", []
    words = identify_file(short, settings, out, False, lambda: told.append(1))
    assert sorted(path.name for path in out.iterdir()) == FILES
    assert (out / "identified.png").read_bytes().startswith(b"\x89PNG")
    assert words.startswith("payload_mass 1.0")
    assert len(told) >= 4  # two fits of two steps at least
    with pytest.raises(ValueError, match="is not empty"):
        identify_file(short, settings, out, False)
    (tmp_path / "wrong.csv").write_text("time [s]\n0\n")
    with pytest.raises(ValueError, match="are missing"):
        identify_file(tmp_path / "wrong.csv", settings, out, True)
    assert (out / "identified.md").is_file()  # what was there before
    (out / "mine.csv").write_text(short.read_text())
    with pytest.raises(ValueError, match=r"mine\.csv lies in it"):
        identify_file(out / "mine.csv", settings, out, True)


@pytest.mark.slow
def test_the_files_hold_the_numbers_of_the_identification(found, short, settings, tmp_path):
    write_identification(found, short, settings, tmp_path)
    text = (tmp_path / "identified.md").read_text(encoding="utf-8")
    assert text == page(found, short)
    with (tmp_path / "identified.csv").open(encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert [row["name"] for row in rows] == list(NAMES)
    for row, value, half, one in zip(rows, found.estimates, found.half_widths, found.unknowns, strict=True):
        assert (float(row["estimate"]), float(row["start"]), row["determined"]) == (value, one.start, "True")
        assert float(row["high"]) - float(row["low"]) == pytest.approx(2.0 * half)
        assert f"| {one.name} | {one.start:.6g} | {number_words(value, half)} | {one.unit} |" in text
    for one in found.agreements:
        assert f"| {one.kind} | {one.unit} | {one.before:.3g} | {one.left:.3g} | {one.noise:.3g} | yes |" in text
    run = yaml.safe_load((tmp_path / "run.yaml").read_text(encoding="utf-8"))
    assert run["settings"] == settings.model_dump(mode="json")
    assert run["recording"] == str(short)


def test_a_contradiction_is_refused_with_the_files_name_and_can_be_overruled(short, settings, tmp_path):
    header, *lines = short.read_text(encoding="utf-8").splitlines()
    place = header.split(",").index("steering_1 [rad]")
    rows = [line.split(",") for line in lines]
    for row in rows:
        row[place] = str(-float(row[place]))
    wrong = tmp_path / "wrong.csv"
    wrong.write_text("\n".join([header, *map(",".join, rows)]) + "\n", encoding="utf-8")
    with pytest.raises(ContradictionError, match=r"wrong\.csv: .*steering_1 has the other sign.*--set check=false"):
        identify_file(wrong, settings, tmp_path / "out", False)
    assert not (tmp_path / "out").exists()


@pytest.mark.slow
def test_zeros_and_lag_are_features_that_wrappers_read(found, short):
    told = replace(
        found,
        unknowns=unknowns(load_robot("chung2008"), ("steering_zero_2", "motor_lag", "torque_delay")),
        estimates=np.array([0.02, 0.03, 0.004]),
        deviations=np.ones(3),
    )
    text = features_yaml(told, short)
    offset, lag = read_features(yaml.safe_load(text))
    assert isinstance(offset, SteeringOffset) and isinstance(lag, MotorLag)
    assert (offset.angle, offset.zeros, lag.time_constant) == (0.0, (0.0, 0.02, 0.0), 0.03)
    assert "# torque_delay: 0.004 s" in text
    none = read_features(yaml.safe_load(features_yaml(found, short)))
    assert none == ()
    assert wrap(CasterTrackEnv(found.robot), *none).reset(seed=0)[0].ndim == 1  # as docs/identification.md does
    at_once = features_yaml(replace(told, estimates=np.array([0.02, 0.0, 0.004])), short)
    assert len(read_features(yaml.safe_load(at_once))) == 1
    assert "# motor_lag: 0 s; motors that follow at once need no wrapper" in at_once


@pytest.mark.slow
def test_the_robot_file_is_the_robot_with_its_payload_and_nothing_else_lost(found, short, settings, tmp_path):
    write_identification(found, short, settings, tmp_path)
    robot, original = load_robot(tmp_path / "robot.yaml"), load_robot("chung2008")
    assert robot == found.robot
    assert robot.platform.mass == pytest.approx(original.platform.mass + found.estimates[0])
    assert {caster.scrub for caster in robot.casters} == {max(found.estimates[1], 0.0)}
    as_before = [caster.model_copy(update={"scrub": 0.0}) for caster in robot.casters]
    assert as_before == list(original.casters)
    assert robot.platform.footprint == original.platform.footprint


@pytest.mark.slow
def test_what_is_not_told_is_said_and_has_no_interval(short, tmp_path):
    still = short.with_name("still.csv")
    rows = short.read_text().splitlines()
    time = [row.split(",")[0] for row in rows]
    first = rows[1].split(",")[1:]
    still.write_text("\n".join([rows[0], *(",".join([t, *first[:3], "0", "0", "0", *first[6:9], *["0"] * 9])
                                          for t in time[1:])]))  # fmt: skip
    robot = load_robot("chung2008")
    found = identify(robot, read_recording(still, robot), PAYLOAD[:1])
    write_identification(found, still, read_identify("chung2008", PAYLOAD[:1]), tmp_path)
    text = (tmp_path / "identified.md").read_text(encoding="utf-8")
    assert "| payload_mass | 0.5 | not determined | kg |" in text
    assert "**The recording does not determine payload_mass.**" in text
    assert in_words(found) == "The recording does not determine payload_mass."
    with (tmp_path / "identified.csv").open(encoding="utf-8") as file:
        (row,) = csv.DictReader(file)
    assert (row["determined"], row["low"], row["high"]) == ("False", "", "")


@pytest.mark.parametrize(
    ("value", "half", "words"),
    [
        (1.23456, 0.0234, "1.235 ± 0.023"),
        (-0.99, 12.3, "-1 ± 12"),
        (2.5e-5, 3.1e-7, "(2.500 ± 0.031) × 10^-5"),
        (-9.6e-7, 9.4e-7, "(-9.6 ± 9.4) × 10^-7"),
        (1.23456789, np.inf, "1.23457"),
    ],
)
def test_numbers_are_written_with_two_digits_of_their_uncertainty(value, half, words):
    assert number_words(value, half) == words


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"wheels": 3}, "unknown key 'wheels'"),
        ({"window": 0.0}, "'window'"),
        ({"confidence": 95}, "'confidence'"),
        ({"noise": {"pose": 0.1}}, "unknown key 'noise.pose'"),
        ({"dynamics": "kim2001"}, "'dynamics'"),
    ],
)
def test_wrong_settings_are_refused_by_a_sentence_that_names_them(changes, words):
    with pytest.raises(ConfigurationError, match=words):
        read_identify("chung2008", PAYLOAD, changes)


def test_an_example_does_not_replace_a_file(example):
    with pytest.raises(ValueError, match="is there already"):
        write_example(example, "chung2008", 0, overwrite=False)
