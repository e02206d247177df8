"""What a model lacks, and the law of the error that it makes."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents.control.computed_torque import Gains, gains, known_model
from caster_gym.engines.numpy_model import Model
from caster_gym.paths.random_paths import RandomPaths
from caster_gym.robot import load_robot
from papers.chung2008.model_error import Lack, lacks, predict, trailing_steering
from papers.chung2008.model_trials import MODELS, PATHS, PERIOD, timed

ROBOT = load_robot("chung2008")
CIRCLE, RANDOM = PATHS["circle"], RandomPaths(count=3, seed=2)


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
            steering = trailing_steering(samples[None], PERIOD, ROBOT)[0]
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
