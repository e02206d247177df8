"""caster_gym.identification.fit: the truth is found, its intervals hold it, and what cannot be told is said."""

from dataclasses import replace

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.engines.numpy_model import Model
from caster_gym.identification.fit import identify
from caster_gym.identification.recording import Noise, Recording, record
from caster_gym.identification.unknowns import robot_with
from caster_gym.robot import load_robot
from tests.random_robots import random_robot

CHUNG = load_robot("chung2008")
PAIR = CHUNG.model_copy(update={"casters": CHUNG.casters[:2]})  # for speed
WINDOW = 0.5  # [s] half the usual length: half the time
NOISE = Noise(position=1e-3, heading=2e-3, velocity=1e-2, yaw_rate=1e-2, steering=2e-3)
LOAD = {"payload_mass": 1.0, "payload_x": 0.03, "payload_y": -0.02}
FRICTION = {"roll_viscous": 3e-4, "roll_coulomb": 4e-3, "steer_viscous": 2e-4, "steer_coulomb": 2e-3, "scrub": 3e-4}
TRUTH = {
    "chung2008": {**LOAD, **FRICTION, "trail": 0.027},
    "tidybot2": {
        "payload_mass": 8.0,
        "payload_x": 0.1,
        "payload_y": -0.05,
        "payload_inertia": 0.2,
        "roll_coulomb": 0.03,
        "scrub": 0.03,
        "trail": 0.0145,
    },
}


def noisy(recording, seed):
    return recording.noisy(NOISE, np.random.default_rng(seed))


@pytest.fixture(scope="module")
def loaded():
    return record(robot_with(CHUNG, LOAD), 2.5, 0.02, seed=3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "seed", "starts", "with_twist"),
    [
        ("chung2008", 1, {}, True),
        ("chung2008", 2, {"payload_mass": 2.5, "payload_x": -0.05, "trail": 0.032}, False),
        ("tidybot2", 1, {}, True),
    ],
)
def test_without_noise_the_truth_is_found(name, seed, starts, with_twist):
    robot, truth = load_robot(name), TRUTH[name]
    recording = record(robot_with(robot, truth), 4.0, 0.02, seed=seed)
    found = identify(
        robot, recording if with_twist else replace(recording, twist=None), tuple(truth), starts, window=WINDOW
    )
    # the fit's steps are corrected to the finer ones of the recording to first order, and friction's law may be another
    assert_allclose(found.estimates, list(truth.values()), rtol=1e-2)
    assert_allclose(found.estimates[[0, 1, 2, -1]], np.array(list(truth.values()))[[0, 1, 2, -1]], rtol=1e-4)
    assert found.untold == ()
    assert found.warnings == ()
    assert found.robot.casters == robot_with(robot, dict(zip(truth, found.estimates, strict=True))).casters
    assert found.robot.platform.mass == pytest.approx(robot.platform.mass + found.estimates[0], rel=1e-12)


@pytest.mark.slow
def test_a_recording_of_finer_time_steps_is_told_within_one_percent():
    truth, count, finer = {**LOAD, "trail": 0.027}, 126, 16
    robot = robot_with(CHUNG, truth)
    coarse = record(robot, 2.5, 0.02, seed=4)
    assert coarse.twist is not None
    first = np.concatenate([coarse.pose[0], coarse.twist[0], coarse.steering[0]])
    held = np.repeat(coarse.torque[:-1], finer, axis=0)
    states = Model(robot).simulate(first, held, 0.02 / finer, len(held))[::finer]
    assert len(states) == count
    recording = Recording(0.02, states[:, :3], states[:, 6:], coarse.torque, states[:, 3:6])
    found = identify(CHUNG, recording, tuple(truth), window=WINDOW)
    assert_allclose(found.estimates, list(truth.values()), rtol=1e-2)


ZEROS = {"steering_zero_1": 0.014, "steering_zero_2": -0.02, "steering_zero_3": 0.008}


@pytest.mark.slow
@pytest.mark.parametrize("with_rolling", [True, False])
def test_radius_and_steering_zeros_are_found_without_noise(with_rolling):
    truth = {"radius": 0.0256, **ZEROS}
    recording = record(robot_with(CHUNG, {"radius": 0.0256}), 2.0, 0.02, seed=5, with_rolling=with_rolling)
    recording = replace(recording, steering=recording.steering + list(ZEROS.values()))
    found = identify(CHUNG, recording, tuple(truth), window=WINDOW)
    assert_allclose(found.estimates, list(truth.values()), rtol=1e-4, atol=1e-5)  # where the fit settles
    assert found.warnings == ()
    assert {caster.radius for caster in found.robot.casters} == {float(found.estimates[0])}


def test_straight_motion_by_hand_tells_mass_radius_and_zeros():
    """Newton's law by hand: (m + Σ (I_s + J)/r²) v̇ = Σ τ / r, torques held, so that ways are parabolas; θ = x / r."""
    radius, load, count, step = 0.0262, 1.3, 80, 0.02
    casters = CHUNG.casters
    mass = CHUNG.platform.mass + load + sum(one.wheel.mass + one.link.mass for one in casters)
    mass += sum(one.wheel.spin_inertia + one.roll.armature for one in casters) / radius**2
    torque = np.zeros((count, 6))
    torque[:, ::2] = 0.08 * np.sin(np.linspace(0.0, 6.0, count))[:, None]
    acceleration = torque.sum(axis=1) / radius / mass
    speed = np.concatenate([[0.0], np.cumsum(acceleration[:-1] * step)])
    way = np.concatenate([[0.0], np.cumsum(speed[:-1] * step + 0.5 * acceleration[:-1] * step**2)])
    nothing = np.zeros(count)
    steering = np.tile(list(ZEROS.values()), (count, 1))
    recording = Recording(
        step,
        np.column_stack([way, nothing, nothing]),
        steering,
        torque,
        np.column_stack([speed, nothing, nothing]),
        np.tile(way[:, None] / radius, (1, 3)),
    )
    truth = {"payload_mass": load, "radius": radius, **ZEROS}
    found = identify(CHUNG, recording, tuple(truth), window=WINDOW)
    assert found.untold == ()
    assert_allclose(found.estimates, list(truth.values()), rtol=1e-4, atol=1e-5)  # where the fit settles


@pytest.mark.slow
def test_casters_of_different_sizes_keep_them_while_something_else_is_identified():
    robot = random_robot(3, 2)
    assert robot.casters[0].trail != robot.casters[1].trail
    mass = 0.2 * robot.platform.mass
    recording = record(robot_with(robot, {"payload_mass": mass}), 2.0, 0.02, seed=1)
    found = identify(robot, recording, ("payload_mass",), window=WINDOW)
    assert_allclose(found.estimates, mass, rtol=1e-6)
    assert found.robot.casters == robot.casters


@pytest.mark.slow
def test_what_is_hardly_told_apart_is_named_with_its_correlation():
    """Straight ahead a force moves masses; friction that is known parts torques from them, a little."""
    robot = robot_with(CHUNG, {"roll_viscous": 2e-4})
    count = 100
    torque = np.zeros((count, 6))
    torque[:, ::2] = 0.08 * np.sin(np.linspace(0.0, 6.0, count))[:, None]
    states = Model(robot).simulate(np.zeros(9), np.repeat(torque[:-1], 2, axis=0), 0.01, 198)[::2]
    recording = Recording(0.02, states[:, :3], states[:, 6:], torque, states[:, 3:6])
    quiet = Noise(position=1e-6, heading=1e-6, velocity=1e-5, yaw_rate=1e-5, steering=1e-6)
    still = {"payload_mass": 0.1}
    found = identify(
        robot, recording.noisy(quiet, np.random.default_rng(0)), ("payload_mass", "roll_strength"), still, window=WINDOW
    )
    correlation = found.correlations[0, 1]
    assert correlation > 0.98
    (note,) = found.notes
    assert note.startswith("payload_mass and roll_strength can hardly be separated")
    assert f"a correlation of {correlation:+.3f}," in note


@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    """Of 50 intervals of 95 %, 42 or more hold the truth in all but one in 20,000 samples, were they independent."""
    truth = {**LOAD, "trail": 0.0255, "roll_viscous": 2e-4}
    recording = record(robot_with(PAIR, truth), 2.0, 0.02, seed=5)
    apart, alarms = [], 0
    for seed in range(10):
        found = identify(PAIR, noisy(recording, seed), tuple(truth), window=0.25)
        apart.append((found.estimates - list(truth.values())) / found.half_widths)
        alarms += len(found.warnings)
    assert (np.abs(apart) <= 1.0).sum() >= 42
    # squared errors over their variance have mean 1 and, over 50, standard deviation 0.2: no interval is far too wide
    assert 0.4 < np.mean(np.square(apart)) * 1.96**2 < 1.8
    assert alarms == 0


@pytest.mark.slow
def test_the_noise_is_found_in_each_kind_and_intervals_are_as_wide_as_was_asked(loaded):
    found = identify(CHUNG, noisy(loaded, 1), tuple(LOAD), LOAD, window=WINDOW, confidence=0.9973)
    for one in found.agreements:
        truth = getattr(NOISE, one.kind)
        assert one.left == pytest.approx(truth, rel=0.2)  # of 100 samples or more: three standard deviations
        assert one.noise == pytest.approx(truth, rel=0.3)
        assert one.explained
    assert_allclose(found.half_widths, 3.0 * found.deviations, rtol=1e-3)  # the digits of 0.9973


@pytest.mark.slow
@pytest.mark.parametrize("noise", [None, NOISE])
def test_a_model_that_does_not_explain_the_recording_is_warned_of(noise):
    recording = noisy(record(robot_with(CHUNG, LOAD), 2.5, 0.02, seed=3, dynamics="chung2008"), 0)
    wrong = identify(CHUNG, recording, tuple(LOAD), noise=noise, window=WINDOW)
    right = identify(CHUNG, recording, tuple(LOAD), noise=noise, window=WINDOW, dynamics="chung2008")
    assert any("does not explain the recording" in sentence for sentence in wrong.warnings)
    assert right.warnings == ()
    assert (wrong.half_widths > 2.0 * right.half_widths).all()
    assert (np.abs(right.estimates - list(LOAD.values())) < 2.0 * right.half_widths).all()


def still(count=60):
    return Recording(
        0.02, np.zeros((count, 3)), np.tile([0.3, 0.4, 0.5], (count, 1)), np.zeros((count, 6)), np.zeros((count, 3))
    )


@pytest.mark.parametrize(
    "recording", [still(), pytest.param(noisy(still(), 0), marks=pytest.mark.slow)], ids=["exact", "noisy"]
)
def test_a_robot_that_stands_still_tells_nothing(recording):
    names = (*LOAD, "scrub")
    found = identify(CHUNG, recording, names, window=WINDOW)
    assert sorted(found.untold) == sorted(f"The recording does not determine {name}." for name in names)
    assert not found.is_told.any()
    assert_allclose(found.estimates, [one.start for one in found.unknowns], atol=1e-3)  # where they started
    assert found.warnings == ()


@pytest.mark.slow
@pytest.mark.parametrize("with_noise", [False, True])
def test_straight_motion_tells_the_mass_and_how_far_aside_it_is_but_not_how_far_ahead(with_noise):
    """No yaw, no steering: the moment of the inertial force is all that the place changes, m a y."""
    truth = {"payload_mass": 1.0, "payload_x": 0.03, "payload_y": 0.0}
    count = 100
    torque = np.zeros((count, 6))
    torque[:, ::2] = 0.08 * np.sin(np.linspace(0.0, 6.0, count))[:, None]
    torque[:, 0] = torque[:, 2]  # as much on the left as on the right of C, where one caster stands on the axis
    states = Model(robot_with(CHUNG, truth)).simulate(np.zeros(9), np.repeat(torque[:-1], 2, axis=0), 0.01, 198)[::2]
    recording = Recording(0.02, states[:, :3], states[:, 6:], torque, states[:, 3:6])
    found = identify(CHUNG, noisy(recording, 0) if with_noise else recording, (*truth, "scrub"), window=WINDOW)
    assert_array_equal(found.is_told, [True, False, True, False])
    assert set(found.untold) == {f"The recording does not determine {name}." for name in ("payload_x", "scrub")}
    reached = np.abs(found.estimates - [*truth.values(), 0.0])[[0, 2]]
    assert (reached <= np.maximum(2.0 * found.half_widths[[0, 2]], 1e-6)).all()


def test_unknowns_that_only_show_together_are_named_together():
    """At one speed all the time, a viscous and a dry friction of the same torque are the same."""
    truth = {"roll_viscous": 1e-4, "roll_coulomb": 4e-3}
    speed, count = 0.3, 40
    state = np.array([0.0, 0.0, 0.0, speed, 0.0, 0.0, 0.0, 0.0, 0.0])
    rate = speed / CHUNG.casters[0].radius
    torque = np.zeros((count, 6))
    torque[:, ::2] = truth["roll_viscous"] * rate + truth["roll_coulomb"] * rate / np.hypot(rate, 0.1)
    states = np.tile(state, (count, 1))
    states[:, 0] = speed * 0.02 * np.arange(count)
    recording = Recording(0.02, states[:, :3], states[:, 6:], torque, states[:, 3:6])
    found = identify(CHUNG, recording, tuple(truth), truth)
    (sentence,) = found.untold
    assert sentence.startswith("The recording cannot separate roll_viscous and roll_coulomb")
    viscous, dry = (float(sentence.split(f"{name} ")[-1].split()[0]) for name in truth)
    assert viscous * rate == pytest.approx(-dry, rel=0.01)  # three digits are written
    assert not found.is_told.any()


@pytest.mark.slow
def test_a_bound_that_holds_an_unknown_is_told_and_no_interval_given(loaded):
    starts, bounds = {**LOAD, "payload_mass": 0.3}, {"payload_mass": (0.0, 0.5)}
    found = identify(CHUNG, noisy(loaded, 0), ("payload_mass",), starts, bounds, window=WINDOW)
    assert found.estimates[0] == 0.5
    assert np.isinf(found.half_widths[0])
    assert any("payload_mass went to its bound of 0.5 kg" in sentence for sentence in found.warnings)


@pytest.mark.parametrize(
    ("names", "options", "words"),
    [
        (("payload_weight",), {}, "unknown quantity 'payload_weight'"),
        (("payload_mass",), {"starts": {"weight": 1.0}}, "unknown quantity 'weight'"),
        (("payload_mass",), {"confidence": 1.0}, "confidence must lie between 0 and 1"),
        (("payload_mass",), {"window": -1.0}, "window must be positive, got -1 s"),
        (("payload_mass",), {"window": 1e9}, r"window must be at most \S+ s, as the recording lasts, got 1e\+09 s"),
    ],
)
def test_questions_that_make_no_sense_are_refused(loaded, names, options, words):
    with pytest.raises(ValueError, match=words):
        identify(CHUNG, loaded, names, **options)


def test_a_recording_of_another_robot_is_refused(loaded):
    with pytest.raises(ValueError, match="3 steering angles, but robot 'tidybot2' has 4 casters"):
        identify(load_robot("tidybot2"), loaded, ("payload_mass",))


def test_casters_that_differ_cannot_share_an_unknown(loaded):
    first, *others = CHUNG.casters
    robot = CHUNG.model_copy(update={"casters": (first.model_copy(update={"trail": 0.03}), *others)})
    with pytest.raises(ValueError, match=r"must have the same trail .* got 0\.025 … 0\.03 m"):
        identify(robot, loaded, ("trail",))
