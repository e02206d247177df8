"""Vectors of the platform in B and in W."""

import numpy as np
from numpy.testing import assert_allclose

from caster_gym.analysis.frames import motion_in_body, rate_in_body, turn_planar
from caster_gym.paths.headings import Spinning
from caster_gym.paths.shapes import Ellipse


def test_a_heading_turns_as_its_matrix_does_and_its_conjugate_back():
    rng = np.random.default_rng(0)
    beta, vector = rng.uniform(-np.pi, np.pi, 20), rng.normal(size=(20, 3))
    c, s, o, e = np.cos(beta), np.sin(beta), np.zeros(20), np.ones(20)
    matrix = np.moveaxis(np.array([[c, -s, o], [s, c, o], [o, o, e]]), -1, 0)
    world = turn_planar(vector, np.exp(1j * beta))
    assert_allclose(world, np.einsum("kij,kj->ki", matrix, vector), atol=1e-14)  # rounding
    assert_allclose(turn_planar(world, np.exp(-1j * beta)), vector, atol=1e-14)
    assert_allclose(turn_planar(vector[0], np.exp(1j * beta[0])), world[0], atol=1e-15)


def test_uniform_circling_with_the_heading_along_the_way_has_no_rate_in_the_body():
    """vx = R ω in B throughout; over ground it accelerates at R ω² towards the left."""
    twist = np.array([2.0 * 3.0, 0.0, 3.0])
    assert_allclose(rate_in_body(np.array([0.0, 2.0 * 3.0**2, 0.0]), twist), 0.0, atol=1e-15)


def test_rates_are_the_derivatives_of_the_components():
    """By differences along an ellipse with a turning heading; a translation over ground has rates in B all the same."""
    step = 1e-3
    samples = Ellipse(semi_axes=(2.0, 1.0), duration=10.0, heading=Spinning(angle=0.4)).trajectories(step)[0].samples
    twist, rate = motion_in_body(samples)
    slopes = (twist[2:] - twist[:-2]) / (2.0 * step)
    assert_allclose(rate[1:-1], slopes, atol=1e-5)  # differences of second order: step² times third derivatives of ~1
    back = np.einsum("ki,ki->k", twist[:, :2], twist[:, :2])
    assert_allclose(back, (samples[:, 4:6] ** 2).sum(axis=1), atol=1e-13)
