"""Impulses at contacts: the energy that they must take."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym import Model
from caster_gym.mechanics.contact_impulses import press
from caster_gym.mechanics.separation import separation
from tests.random_robots import CASTER_COUNTS, random_robot
from tests.walks import (
    FLOOR,
    NEEDLE,
    TRIANGLE,
    Walk,
    around_it,
    corners_of,
    energy,
    floats,
    shaped,
    state_of,
)


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 10**6),
    casters=st.sampled_from(CASTER_COUNTS),
    outline=st.sampled_from([0.2, TRIANGLE, NEEDLE]),
    e=st.floats(0.0, 1.0),
    mu=st.sampled_from([0.0, 0.1, 0.5, 2.0]),
)
def test_an_impact_loses_the_energy_that_it_must(seed, casters, outline, e, mu):
    """(C2): exactly that without friction, at least that with it; the contact leaves at e times its approach."""
    rng = np.random.default_rng(seed)
    robot = shaped(random_robot(seed, casters), outline)
    model, around = Model(robot), around_it(robot, FLOOR, restitution=e, friction=mu)
    beta, angles = rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi, casters)
    lowest = min(corners_of(outline, state_of(0.0, 0.0, beta, (0.0, 0.0), 0.0, ()))[:, 1])
    height = outline if isinstance(outline, float) else -lowest
    velocity, omega = rng.uniform(-10.0, 10.0, 2), rng.uniform(-20.0, 20.0)
    walk = Walk(robot, around, floats(state_of(0.0, height, beta, velocity, omega, angles)))
    state, obstacles = walk.state, walk.obstacles
    apart = separation(state.position, state.heading, walk.hull, obstacles, 0)
    c, s = state.heading
    n = np.array([s, c])
    corners = np.zeros((1, 2)) if isinstance(outline, float) else np.asarray(outline)
    touching = corners @ n <= (corners @ n).min() + 1e-4
    if touching.sum() > 1 or abs(apart.gap) > 1e-9:
        return  # two contacts at once are another test
    point = corners[touching][0] - (outline * n if isinstance(outline, float) else 0.0)
    arm = np.array([n[0], n[1], point[0] * n[1] - point[1] * n[0]])
    mobility = arm @ np.linalg.solve(model.inertia(angles), arm)
    v_n = arm @ state.twist
    after, pressure = press(state, e, walk.parameters, walk.hull, obstacles, 0, 1)
    before_J, after_J = energy(model, state), model.kinetic_energy(angles, after)
    rounding = 1e-12 * max(before_J, 1.0)
    if v_n >= 0.0:
        assert_array_equal(after, state.twist)
        assert pressure.normal == 0.0
        return
    e = e if v_n < -0.01 else 0.0
    assert_allclose(arm @ after, -e * v_n, rtol=0.0, atol=1e-10)  # rounding of arms of 0.3 m and twists of 20
    lost = 0.5 * (1.0 - e * e) * v_n**2 / mobility
    if mu == 0.0:
        assert_allclose(before_J - after_J, lost, rtol=0.0, atol=rounding)
    assert before_J - after_J >= lost - rounding
