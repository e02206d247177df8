"""The search for the first contact: a sweep that goes through both ends, and never a step over a contact."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from caster_gym.mechanics.first_contact import FOUND, first_contact, free_time, sweep_between, value
from caster_gym.mechanics.integration import rk4_step
from caster_gym.mechanics.parameters import robot_parameters
from caster_gym.mechanics.separation import separation
from tests.random_robots import random_robot
from tests.walks import (
    BOX,
    NEEDLE,
    around_it,
    floats,
    shaped,
    state_of,
)


def random_step(seed, h, outline=BOX):
    """Two ends of a fast time step, with casters in any direction."""
    rng = np.random.default_rng(seed)
    robot = shaped(random_robot(seed, 3), outline)
    x, y = rng.uniform(-0.4, 0.4, 2)
    start = floats(
        state_of(
            x,
            y,
            rng.uniform(-3, 3),
            rng.uniform(-10, 10, 2),
            rng.uniform(-30, 30),
            rng.uniform(-3, 3, 3),
        )
    )
    torques = tuple((float(a), float(b)) for a, b in rng.uniform(-0.5, 0.5, (3, 2)))
    return robot, start, rk4_step(start, torques, (0.0, 0.0, 0.0), h, robot_parameters(robot))


@settings(deadline=None, max_examples=50)
@given(seed=st.integers(0, 10**6))
def test_the_sweep_goes_through_both_ends_and_no_point_accelerates_more_than_it_says(seed):
    """(O5): values and rates of both ends; accelerations by finite differences stay below the bound and reach it."""
    h = 2e-3
    _, start, end = random_step(seed, h)
    sweep = sweep_between(start, end, h, 0.17)
    polynomials = (sweep.x, sweep.y, sweep.c, sweep.s)
    for t, there in ((0.0, start), (h, end)):
        c, s = there.heading
        u, v, omega = there.twist
        rates = (c * u - s * v, s * u + c * v, -s * omega, c * omega)
        assert_allclose([value(p, t) for p in polynomials], [*there.position, c, s], rtol=0.0, atol=1e-14)
        for p, rate in zip(polynomials, rates, strict=True):
            small = 1e-6
            slope = (value(p, t + small) - value(p, t - small)) / (2.0 * small)
            assert_allclose(slope, rate, rtol=0.0, atol=1e-6)  # cubic: small² times jerks of 1e6 m/s³
    times = np.linspace(0.0, h, 41)
    bends = [[2.0 * p[2] + 6.0 * p[3] * t for p in polynomials] for t in times]
    accelerations = [np.hypot(b[0], b[1]) + 0.17 * np.hypot(b[2], b[3]) for b in bends]
    assert max(accelerations) <= sweep.acceleration * (1.0 + 1e-12)
    assert sweep.acceleration <= 2.0 * max(accelerations)  # both greatest values need not be at the same end


@settings(deadline=None, max_examples=60)
@given(seed=st.integers(0, 10**6), outline=st.sampled_from([0.02, BOX, NEEDLE]))
def test_no_contact_happens_in_the_time_that_is_free(seed, outline):
    """(O6): at 200 moments of it the robot of the sweep is still apart."""
    h = 2e-3
    robot, start, end = random_step(seed, h, outline)
    rng = np.random.default_rng((seed, 1))
    a = rng.uniform(-0.6, 0.6, 2)
    angle = rng.uniform(0.0, 6.3)
    b = a + rng.uniform(0.02, 0.5) * np.array([np.cos(angle), np.sin(angle)])
    around = around_it(robot, {"walls": [{"start": a.tolist(), "end": b.tolist(), "thickness": 0.005}]})
    hull, obstacles = around
    sweep = sweep_between(start, end, h, hull.reach)
    apart = separation(start.position, start.heading, hull, obstacles, 0)
    if apart.gap <= 0.0:
        return
    surely = free_time(sweep, 0.0, apart, 0.0, hull)
    contact = first_contact(sweep, h, hull, obstacles, 0, 1)
    assert contact >= min(surely, h)
    for until, share in ((min(surely, h), 1.0), (contact, 1.0)):
        t = np.linspace(0.0, share * until, 200)
        pose = (value(sweep.x, t), value(sweep.y, t)), (value(sweep.c, t), value(sweep.s, t))
        # the last moment touches, up to rounding
        assert separation(*pose, hull, obstacles, 0).gap.min() > -1e-12
    if contact < h:
        x, y, c, s = (value(p, contact) for p in (sweep.x, sweep.y, sweep.c, sweep.s))
        assert separation((x, y), (c, s), hull, obstacles, 0).gap < 2.0 * FOUND
