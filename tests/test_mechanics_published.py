"""Numbers and figures that Chung et al. (2008) print, out of the corrected equations."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot

PRINTED_INERTIA = np.array([[5.4329, 0.0537, -0.00078], [0.0537, 7.5379, 0.0107], [-0.00078, 0.0107, 0.0397]])


@pytest.fixture
def model():
    return Model(load_robot("chung2008"))


def steering_on_a_circle(model, radius):
    """Casters that trail steadily (η̇ = ω, nothing steers) while C runs round a circle with the x-axis radial."""
    angles = []
    for caster in model.robot.casters:
        # the wheel's centre moves along f: the pivot's velocity has the part d ω across f
        velocity = np.array([-caster.y, radius + caster.x])
        across = np.arcsin(caster.trail / np.hypot(*velocity))
        angles.append(np.arctan2(velocity[1], velocity[0]) - across)
    return np.array(angles)


def test_inertia_matrix_with_wheel_dynamics(model):
    """(D3): the printed matrix, all entries within 2e-4, two units of their last printed digit."""
    steering = steering_on_a_circle(model, 1.0)
    assert_allclose(model.rates(steering, [0.0, 1.0, 1.0])[2], 0.0, atol=1e-12)  # η̇ = ω
    assert (model.rates(steering, [0.0, 1.0, 1.0])[1] > 0.0).all()  # trailing
    assert_allclose(np.degrees(np.pi - steering), [94.70, 93.95, 85.71], atol=0.005)  # φ = π − δ, to two decimals
    assert_allclose(model.inertia(steering), PRINTED_INERTIA, rtol=0.0, atol=2e-4)


def test_inertia_matrix_without_wheel_dynamics(model):
    """(50) of the paper, at any steering."""
    bare = Model(model.robot.without_wheels())
    assert_allclose(bare.inertia([0.3, 1.0, -2.0]), np.diag([5.0, 5.0, 0.025]), rtol=0.0, atol=1e-15)


def impulses(model, phi, directions=360):
    """Impulses at C over all directions of a motion of 1 m/s against a wall, e = 0.8; φ of the paper in degrees."""
    angle = np.linspace(-np.pi, np.pi, directions, endpoint=False)
    normal = np.stack((np.cos(angle), np.sin(angle)), -1)
    twist = np.concatenate((-normal, np.zeros((directions, 1))), -1)
    steering = np.broadcast_to(np.pi - np.radians(phi), (directions, 3))
    impulse, _ = model.collide(steering, twist, np.zeros((directions, 2)), normal, 0.8)
    return impulse[:, 0]


def test_impulse_is_uniform_at_the_steering_of_figure_18(model):
    """(C1): steering (240°, 120°, 0°) makes the ellipse a circle, but for the rounding of √3/2 · 0.1 m to 0.0865 m."""
    uniform = impulses(model, (240.0, 120.0, 0.0))
    assert_allclose(uniform, uniform.mean(), rtol=1e-6)


@pytest.mark.parametrize("phi", [(0.0, 0.0, 0.0), (45.0, 45.0, 45.0), (120.0, 240.0, 0.0)])
def test_impulse_is_not_uniform_at_other_steering(model, phi):
    """Figures 16 and 17, and the mirror image of 18 that tells the paper's sign of φ."""
    sizes = impulses(model, phi)
    assert sizes.max() > 1.02 * sizes.min()


def test_impulse_of_the_mirrored_figure_18(model):
    sizes = impulses(model, (120.0, 240.0, 0.0))
    assert_allclose((sizes.min(), sizes.max()), (11.16, 11.67), atol=0.005)  # N s, to the digits given


def test_impulse_is_greatest_along_parallel_wheels(model):
    """Figure 16, by hand: along the wheels all of their mass moves and they spin up, across they only turn about."""
    sizes = impulses(model, (0.0, 0.0, 0.0))  # from −180° on, one a degree
    along = 5.0 + 3.0 * (0.5 + 0.1 + 1.5625e-4 / 0.025**2)
    across = 5.0 + 3.0 * (7.813e-5 + 2.604e-6 + 0.1 * (0.025 / 3.0) ** 2) / 0.025**2
    assert_allclose(sizes[[180, 90]], [1.8 * along, 1.8 * across], rtol=1e-9)  # the file rounds p = d / 3 at 1e-12
    assert_allclose((sizes.max(), sizes.min()), sizes[[180, 90]], rtol=1e-12)
