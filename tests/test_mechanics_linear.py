"""Systems of three equations and eigenvalues, against LAPACK."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym.mechanics.linear import dot, extreme_eigenvalues, factors, multiply, solve, substitute

EPS = np.finfo(float).eps


def packed(matrix):
    """(…, 3, 3) -> xx, xy, xz, yy, yz, zz."""
    return tuple(matrix[..., i, j] for i, j in ((0, 0), (0, 1), (0, 2), (1, 1), (1, 2), (2, 2)))


def with_eigenvalues(values, count, seed=61):
    """Symmetric matrices (count, 3, 3) of given eigenvalues (…, 3) in random frames."""
    rng = np.random.default_rng(seed)
    frames, _ = np.linalg.qr(rng.normal(size=(count, 3, 3)))
    matrices = frames * np.broadcast_to(values, (count, 3))[:, None, :] @ np.swapaxes(frames, 1, 2)
    return 0.5 * (matrices + np.swapaxes(matrices, 1, 2))


def test_solve_agrees_with_lapack():
    """Relative to the condition number, as any stable solver."""
    rng = np.random.default_rng(62)
    matrices = with_eigenvalues(10.0 ** rng.uniform(-3.0, 3.0, (500, 3)), 500)
    right = rng.normal(size=(500, 3))
    ours = np.stack(solve(packed(matrices), tuple(right.T)), -1)
    theirs = np.linalg.solve(matrices, right[..., None])[..., 0]
    error = np.abs(ours - theirs).max(-1) / np.abs(theirs).max(-1)
    assert (error < 50.0 * EPS * np.linalg.cond(matrices)).all()


def test_multiply_and_dot_are_those_of_arrays():
    rng = np.random.default_rng(63)
    matrices, vectors = with_eigenvalues([1.0, 2.0, -3.0], 20), rng.normal(size=(20, 3))
    product = np.stack(multiply(packed(matrices), tuple(vectors.T)), -1)
    assert_allclose(product, np.einsum("bij,bj->bi", matrices, vectors), atol=1e-14)  # rounding
    assert_allclose(dot(tuple(vectors.T), tuple(product.T)), (vectors * product).sum(-1), atol=1e-13)


def assert_eigenvalues(matrices, tolerance):
    """Least and greatest eigenvalue agree with LAPACK's within a share of the greatest."""
    least, greatest = extreme_eigenvalues(packed(matrices))
    exact = np.linalg.eigvalsh(matrices)
    scale = np.abs(exact).max(-1)
    assert (np.abs(least - exact[..., 0]) <= tolerance * scale).all()
    assert (np.abs(greatest - exact[..., 2]) <= tolerance * scale).all()


def test_eigenvalues_of_general_matrices():
    rng = np.random.default_rng(64)
    assert_eigenvalues(with_eigenvalues(rng.uniform(0.0, 1.0, (2000, 3)), 2000), 1e-7)  # half the digits near doubles


@pytest.mark.parametrize("values", [(1.0, 1.0, 4.0), (1.0, 4.0, 4.0), (0.0, 0.0, 1.0), (0.0, 1.0, 1.0)])
def test_eigenvalues_that_are_double(values):
    """A double root of a cubic is known to half the digits only."""
    assert_eigenvalues(with_eigenvalues(values, 300), 3.0 * EPS**0.5)


@pytest.mark.parametrize("gap", [0.0, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3])
def test_eigenvalues_that_are_nearly_triple(gap):
    assert_eigenvalues(with_eigenvalues(np.array([1.0, 1.0 + 0.4 * gap, 1.0 + gap]), 300), 3.0 * EPS**0.5)


def test_eigenvalues_of_diagonal_and_zero_matrices():
    assert extreme_eigenvalues((2.0, 0.0, 0.0, 2.0, 0.0, 2.0)) == (2.0, 2.0)
    assert extreme_eigenvalues((0.0, 0.0, 0.0, 0.0, 0.0, 0.0)) == (0.0, 0.0)
    assert_allclose(extreme_eigenvalues((-1.0, 0.0, 0.0, 5.0, 0.0, 2.0)), (-1.0, 5.0), rtol=1e-14)


def test_eigenvalues_do_not_depend_on_the_unit():
    matrix = with_eigenvalues([0.2, 0.5, 3.0], 50)
    one = np.stack(extreme_eigenvalues(packed(matrix)))
    assert_allclose(np.stack(extreme_eigenvalues(packed(1e-8 * matrix))), 1e-8 * one, rtol=1e-9)
    assert_allclose(np.stack(extreme_eigenvalues(packed(1e8 * matrix))), 1e8 * one, rtol=1e-9)


def test_factors_serve_several_right_sides():
    """As `solve` does, against NumPy's elimination."""
    rng = np.random.default_rng(8)
    a = rng.normal(size=(50, 3, 3))
    matrix, sides = a @ a.swapaxes(-1, -2) + np.eye(3), rng.normal(size=(2, 50, 3))
    found = factors(packed(matrix))
    for b in sides:
        x = np.stack(substitute(found, tuple(b.T)), -1)
        expected = np.linalg.solve(matrix, b[..., None])[..., 0]
        assert_allclose(x, expected, rtol=0.0, atol=1e-12 * np.abs(expected).max())  # rounding of sums and conditioning
