"""caster_gym.agents.incomplete_models, and what it stands on, model_error and model_trials: the laws of the error."""

import re

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents import incomplete_models, model_trials
from caster_gym.agents.computed_torque import ComputedTorque, Gains, gains, known_model
from caster_gym.agents.model_error import Lack, lacks, predict, trailing_steering
from caster_gym.agents.model_trials import (
    FREQUENCIES,
    MODELS,
    PATHS,
    PERIOD,
    RESERVE,
    EqualStarts,
    SideBySide,
    TrailingStarts,
    exponents,
    run_trials,
    shortest,
    timed,
)
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.feasibility import motor_use
from caster_gym.paths.headings import Spinning
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.paths.shapes import Ellipse
from caster_gym.robot import load_robot

ROBOT = load_robot("chung2008")
CIRCLE, RANDOM = PATHS["circle"], RandomPaths(count=3, seed=2)
EXACT, WITHOUT_D1, WITHOUT_WHEELS = range(3)
SOFT, STIFF = range(2)
STIFFNESS = np.array([gains(f, PERIOD).stiffness for f in FREQUENCIES])


@pytest.fixture(scope="module")
def trials():
    """The circle and three random paths, each in 10 and in 20 s: trajectories 0, 1 and 2–4, 5–7."""
    paths = [timed(CIRCLE, 10.0), timed(CIRCLE, 20.0), timed(RANDOM, 10.0), timed(RANDOM, 20.0)]
    return run_trials(ROBOT, paths)


@pytest.fixture(scope="module")
def page():
    """The section with fewer, shorter and faster motions; its studies."""
    kept = []
    build = model_trials.study
    with pytest.MonkeyPatch.context() as patch:
        for name in model_trials.LONGEST:
            patch.setitem(model_trials.LONGEST, name, 12.0)
        patch.setitem(PATHS, "ellipse", Ellipse(semi_axes=(1.0, 0.6), heading=Spinning()))
        patch.setitem(PATHS, "random paths", RandomPaths(count=1, seed=2))
        patch.setattr(model_trials, "STARTS", 1)
        for module in (model_trials, incomplete_models):
            patch.setattr(module, "RUNGS", 2)
        patch.setattr(incomplete_models, "study", lambda name: kept.append(build(name)) or kept[-1])
        return incomplete_models.section(), kept


def test_side_by_side_every_robot_gets_the_torques_of_a_controller_of_its_own():
    count = 4 * len(MODELS) * len(FREQUENCIES)
    batch = EqualStarts(count, 4, path=RANDOM)
    observations, _ = batch.reset(seed=0)
    together = SideBySide(batch.engine.layout, count, PERIOD)
    for _ in range(5):
        alone = [
            ComputedTorque(batch.engine.layout, f, PERIOD, known).act(observations[4 * i : 4 * i + 4])
            for i, (known, f) in enumerate((known, f) for known in MODELS for f in FREQUENCIES)
        ]
        actions = together.act(observations)
        assert_array_equal(actions, np.concatenate(alone))
        observations, *_ = batch.step(actions)


def test_robots_a_whole_part_apart_start_alike():
    batch = EqualStarts(6, 3, path=RANDOM)
    observations, _ = batch.reset(seed=5, options={"path": np.arange(6) % 3})
    assert_array_equal(observations[:3], observations[3:])
    assert not np.array_equal(observations[0], observations[1])


def test_trailing_casters_point_where_their_pivots_begin_to_move():
    """On the circle of radius 1 m with one turn of the heading C moves with ω R along +y of B."""
    batch = TrailingStarts(2, 1, path=CIRCLE)
    observations, info = batch.reset(seed=0)
    velocity = np.array([[-caster.y, 1.0 + caster.x] for caster in ROBOT.casters])
    expected = (velocity / np.linalg.norm(velocity, axis=1, keepdims=True)).ravel()
    seen = batch.engine.layout.physical(observations, "directions")
    # the first period of the motion is not yet infinitely short: its way is 2e-5 of the radius
    assert_allclose(seen, np.tile(expected, (2, 1)), atol=1e-4)
    assert_allclose(batch.engine.states[:, 7:], seen, atol=1e-7)  # observations are float32
    assert_allclose(info["position_error"], 0.0, atol=1e-12)


@pytest.mark.parametrize("path", [*PATHS.values(), RANDOM])
def test_a_motion_in_twice_the_time_goes_the_same_way_at_half_the_speed(path):
    fast, slow = timed(path, 8.0).trajectories(0.02), timed(path, 16.0).trajectories(0.04)
    for a, b in zip(fast, slow, strict=True):
        assert_allclose(a.samples[:, :4], b.samples[:, :4], atol=1e-12)  # round-off
        assert_allclose(a.samples[:, 4:7], 2.0 * b.samples[:, 4:7], atol=1e-12)
        assert_allclose(a.samples[:, 7:], 4.0 * b.samples[:, 7:], atol=1e-11)


def test_only_motions_that_own_their_time_can_be_driven_in_another():
    class Tape:
        shape = "tape"

    with pytest.raises(ValueError, match="shape or random paths, got 'tape'"):
        timed(Tape(), 8.0)


def test_the_shortest_time_leaves_the_motors_their_reserve_and_no_more():
    duration = shortest(CIRCLE, ROBOT, 30.0)
    use = [float(motor_use(timed(CIRCLE, f * duration).trajectories(PERIOD), ROBOT).use[0]) for f in (1.0, 0.98)]
    assert use[0] <= RESERVE < use[1]  # it is sought to 1 %
    with pytest.raises(ValueError, match=r"'chung2008' cannot drive path 'circle' in 3 s .* longer time would do"):
        shortest(CIRCLE, ROBOT, 3.0)


def test_the_exact_model_lacks_nothing_and_without_d1_no_inertia():
    (exact,), (printed,), (bare,) = lacks(timed(CIRCLE, 10.0), ROBOT, MODELS, PERIOD)
    assert_array_equal(exact.push, 0.0)
    for one in (exact, printed):
        assert_allclose(one.grip, np.broadcast_to(np.eye(3), one.grip.shape), atol=1e-12)  # round-off of a solution
    assert np.abs(printed.push).max() > 1e-3
    grip = np.linalg.eigvals(bare.grip).real
    assert 0.0 < grip.min() < grip.max() < 1.0  # wheels add inertia in every direction


@pytest.mark.parametrize("known", MODELS[1:])
def test_the_power_of_what_a_model_lacks_is_the_rate_of_the_energy_that_it_lacks(known):
    """Without friction Δ·ν = d/dt (T − T̂); none for (D1), which needs no power."""
    step = 0.002
    for path in (timed(CIRCLE, 10.0), timed(RANDOM, 10.0)):
        trajectories = path.trajectories(step)
        for one, missing in zip(trajectories, lacks(path, ROBOT, [known], step)[0], strict=True):
            samples = one.samples
            steering = trailing_steering(samples[None], ROBOT)[0]
            back = samples[:, 2] - 1j * samples[:, 3]
            velocity, push = (back * (x[:, 0] + 1j * x[:, 1]) for x in (samples[:, 4:6], missing.push))
            twist = np.stack([velocity.real, velocity.imag, samples[:, 6]], axis=1)
            push = np.stack([push.real, push.imag, missing.push[:, 2]], axis=1)
            power = np.einsum("ki,kij,kj->k", twist, Model(ROBOT).inertia(steering), push)
            models = Model(ROBOT), known_model(ROBOT, known)
            energy, known_energy = (model.kinetic_energy(steering, twist) for model in models)
            rate = np.gradient(energy - known_energy, step)
            # differences of second order, and casters that are followed in steps of 2 ms
            assert_allclose(power, rate, atol=0.01 * np.abs(np.gradient(energy, step)).max())


@pytest.mark.parametrize("known", MODELS[1:])
def test_what_a_model_lacks_grows_with_the_square_of_the_speed(known):
    for path in (CIRCLE, RANDOM):
        (fast,), (slow,) = lacks(timed(path, 8.0), ROBOT, [known], 0.02), lacks(timed(path, 16.0), ROBOT, [known], 0.04)
        for a, b in zip(fast, slow, strict=True):
            # casters are followed in steps of the same ways
            assert_allclose(a.push, 4.0 * b.push, atol=1e-9 * np.abs(a.push).max())


def test_a_constant_lack_is_balanced_by_the_known_inertia_times_k_p():
    """e → M̂⁻¹ Δ / k_p, whatever the period; shorter runs end in NaN."""
    rng = np.random.default_rng(0)
    grip = np.eye(3) - 0.3 * np.diag(rng.random(3)) + 0.05 * rng.random((3, 3))
    push = rng.normal(size=3)
    long, short = (Lack(np.tile(push, (n, 1)), np.tile(grip, (n, 1, 1))) for n in (601, 11))
    for period in (0.02, 0.005):
        of = gains(8.0, period)
        errors = predict([long, short], [of, of], period)
        # 3 s at 8 rad/s or more: the transient has fallen by e⁻¹⁵
        assert_allclose(errors[-1, 0], np.linalg.solve(grip, push) / of.stiffness, rtol=1e-4)
        assert np.isfinite(errors[:11, 1]).all()
        assert np.isnan(errors[12:, 1]).all()


def test_the_first_steps_of_a_prediction_are_those_of_a_pushed_mass():
    """Without feedback e = ½ a t²."""
    lack = Lack(np.tile([1.0, -2.0, 3.0], (11, 1)), np.tile(np.eye(3), (11, 1, 1)))
    errors = predict([lack], [Gains(0.0, 0.0)], 0.1)
    time = 0.1 * np.arange(11)[:, None]
    assert_allclose(errors[:, 0], 0.5 * time**2 * [1.0, -2.0, 3.0], rtol=1e-12)


def test_no_motor_is_at_its_limit_and_no_robot_fails(trials):
    """The law is linear: it needs this."""
    assert trials.saturation.max() == 0.0
    assert trials.failed.max() == 0.0


def test_the_exact_model_tracks_better_by_an_order_than_one_without_wheels(trials):
    assert (10.0 * trials.position[EXACT] < trials.position[WITHOUT_WHEELS]).all()
    assert (trials.position[EXACT] < trials.position[WITHOUT_D1]).all()
    assert_array_equal(trials.apart[EXACT], 0.0)


def test_the_law_predicts_what_the_model_alone_does(trials):
    """From the reference alone, for every model, bandwidth, path and speed."""
    paths = [timed(CIRCLE, 10.0), timed(CIRCLE, 20.0), timed(RANDOM, 10.0), timed(RANDOM, 20.0)]
    for m, known in enumerate(MODELS[1:], start=1):
        lacking = [one for path in paths for one in lacks(path, ROBOT, [known], PERIOD)[0]]
        for q, frequency in enumerate(FREQUENCIES):
            errors = predict(lacking, [gains(frequency, PERIOD)] * len(lacking), PERIOD)
            distance = np.sqrt(np.nanmean(np.square(errors[1:, :, :2]).sum(axis=-1), axis=0))
            # what holding torques does beside it, at most 2 % here
            assert_allclose(distance, trials.apart[m, q, 0], rtol=0.03)


def test_under_stiff_feedback_the_error_grows_with_the_square_of_the_speed(trials):
    apart = trials.apart[1:, STIFF, 0]
    # feedback of 30 rad/s follows motions of 10 s up to some per cent of their changes
    assert_allclose(apart[:, 0] / apart[:, 1], 4.0, rtol=0.02)
    assert_allclose(apart[:, 2:5] / apart[:, 5:8], 4.0, rtol=0.06)


def test_the_error_falls_with_the_square_of_the_bandwidth(trials):
    """With k_p, which is ω_n² for short periods; on the slow circle soft feedback follows too."""
    soft, stiff = trials.apart[1:, :, 0, 1].T
    assert_allclose(soft / stiff, STIFFNESS[STIFF] / STIFFNESS[SOFT], rtol=0.06)


def test_the_exact_models_own_error_comes_from_holding_torques(trials):
    """Times k_p it grows with the period and with the third power of the speed."""
    usual = trials.position[EXACT, :, 0]
    half = run_trials(ROBOT, [timed(CIRCLE, 10.0)], 0.5 * PERIOD, MODELS[:1]).position[EXACT, :, 0, 0]
    finer = np.array([gains(f, 0.5 * PERIOD).stiffness for f in FREQUENCIES])
    # of first order in the period, so that the next order is some per cent
    assert_allclose(usual[:, 0] * STIFFNESS, 2.0 * half * finer, rtol=0.05)
    assert_allclose(usual[STIFF, 0] / usual[STIFF, 1], 8.0, rtol=0.05)


def test_dry_friction_in_steering_adds_to_the_law():
    """Its compensation is held as well, and a controller without wheels has the weaker feedback against that error."""
    given, path = load_robot("xr4000"), timed(RandomPaths(count=4, seed=2), 12.0)
    easy = tuple(
        caster.model_copy(update={"steer": caster.steer.model_copy(update={"coulomb": 0.0})})
        for caster in given.casters
    )
    off = []
    for robot in (given, given.model_copy(update={"casters": easy})):
        apart = run_trials(robot, [path], models=("exact", "without wheels")).apart[1, STIFF, 0]
        lacking = lacks(path, robot, ["without wheels"], PERIOD)[0]
        errors = predict(lacking, [gains(FREQUENCIES[STIFF], PERIOD)] * len(lacking), PERIOD)
        law = np.sqrt(np.mean(np.square(errors[1:, :, :2]).sum(axis=-1), axis=0))
        off.append(np.abs(law / apart - 1.0))
    assert (off[1] < 0.1).all()
    assert off[1].mean() < 0.5 * off[0].mean()


def test_exponents_are_those_of_power_laws():
    speeds = np.array([[0.1, 0.2, 0.7], [0.3, 0.4, 0.5]])
    errors = np.stack([5.0 * speeds**2, 0.1 * speeds**3])
    assert_allclose(exponents(errors, speeds), [[2.0, 2.0], [3.0, 3.0]], rtol=1e-12)


def test_every_check_agrees_or_names_an_erratum(page):
    section, _ = page
    assert [check.agrees for check in section.checks] == [True, True, True, False, False]
    for check in section.checks:
        assert check.agrees or re.match(r"E\d+:", check.remark)
    assert {difference.tag for difference in section.differences} == {"E3"}


def test_checks_tables_and_text_tell_what_was_measured(page):
    section, (own, other) = page
    assert (own.robot, other.robot) == ("chung2008", "xr4000")
    worse = own.position[WITHOUT_WHEELS] / own.position[EXACT]
    assert f"position RMSE {worse.min():.1f} … {worse.max():.1f} times" in section.checks[0].ours
    tables = {table.name: table for table in section.tables}
    cases = 2 * len(PATHS) * len(FREQUENCIES)
    assert [len(table.rows) for table in section.tables] == [2 * cases, 2 * cases, 3 * cases, 8, cases]
    assert all(len(row) == len(table.columns) for table in section.tables for row in table.rows)
    assert_allclose(tables["incomplete_models"].rows[0][4:7], 1e3 * own.position[:, SOFT, 0, 0], rtol=1e-12)
    assert tables["incomplete_models"].rows[0][8] == pytest.approx(worse[SOFT, 0, 0])
    row = dict(zip(tables["incomplete_models_all"].columns, tables["incomplete_models_all"].rows[1], strict=True))
    assert row["predicted [mm], without wheels"] == pytest.approx(1e3 * own.predicted[WITHOUT_WHEELS, SOFT, 0, 1])
    assert row["heading RMSE [mrad], exact"] == pytest.approx(1e3 * own.heading[EXACT, SOFT, 0, 1])
    assert f"at least {min((s.position[2] / s.position[0]).min() for s in (own, other)):.1f} times" in " ".join(
        section.text.split()
    )


def test_the_order_of_the_models_is_the_same_from_disturbed_starts(page):
    for study in page[1]:
        exact, printed, bare = study.disturbed
        assert (exact < printed).all()
        assert (2.0 * printed < bare).all()


def test_the_picture_has_a_panel_for_every_robot_and_path(page, tmp_path):
    (picture,) = page[0].pictures
    assert len(picture.figure.axes) == 2 * len(PATHS)
    picture.figure.savefig(tmp_path / "picture.png")
    assert (tmp_path / "picture.png").stat().st_size > 10_000


def test_a_shared_model_answers_as_the_models_do():
    rng = np.random.default_rng(1)
    steering, twist, rate = rng.normal(size=(6, 3)), rng.normal(size=(6, 3)), rng.normal(size=(6, 3))
    shared = model_trials.SharedModel(ROBOT, MODELS)
    first = Model(ROBOT).inverse_dynamics(steering[:2], twist[:2], rate[:2])
    assert_array_equal(shared.inverse_dynamics(steering, twist, rate)[:2], first)
    assert_array_equal(shared.motor_wrenches(steering), Model(ROBOT).motor_wrenches(steering))
