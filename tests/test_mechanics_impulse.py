"""(C1) to (C4): laws of the impact."""

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from caster_gym import Model
from tests.kane import Kane
from tests.random_robots import random_motion, random_robot

ROUNDING = 1e-11  # relative to the greatest term: a 3×3 solve and some ten products


def impact(seed, caster_count=3):
    """A robot, its steering, and twist, place and normal of a contact that closes."""
    robot = random_robot(seed, caster_count)
    rng = np.random.default_rng((seed, 51))
    steering, twist, _, _ = random_motion(seed, robot)
    angle = rng.uniform(-np.pi, np.pi)
    point, normal = rng.uniform(-0.4, 0.4, 2), np.array([np.cos(angle), np.sin(angle)])
    n, _ = contact_rows(point, normal)
    return Model(robot), steering, -np.sign(n @ twist) * twist, point, normal


def contact_rows(point, normal):
    """What gives the contact point's velocity along normal and tangent from the twist."""
    tangent = np.array([-normal[1], normal[0]])
    return tuple(np.array([*u, point[0] * u[1] - point[1] * u[0]]) for u in (normal, tangent))


impacts = st.builds(impact, st.integers(0, 400), st.integers(2, 5))
restitutions = st.floats(0.0, 1.0)
frictions = st.floats(0.0, 2.0)
many = settings(max_examples=150, deadline=None)


@settings(max_examples=30, deadline=None)
@given(impacts, restitutions)
def test_frictionless_impulse_is_that_of_the_effective_mass(case, e):
    """(C1), with Λ from the oracle's inertia matrix."""
    model, steering, twist, point, normal = case
    n, _ = contact_rows(point, normal)
    answer = np.linalg.solve(Kane(model.robot).inertia(steering), n)
    expected = -(1.0 + e) * (n @ twist) / (n @ answer)
    impulse, after = model.collide(steering, twist, point, normal, e)
    assert_allclose(impulse, [expected, 0.0], rtol=1e-9)
    assert_allclose(after, twist + answer * expected, rtol=0.0, atol=1e-9)  # m/s, rad/s


@many
@given(impacts, restitutions, frictions)
def test_twist_changes_by_the_impulse_through_the_inertia(case, e, mu):
    """M Δν = N J_n + T J_t."""
    model, steering, twist, point, normal = case
    n, t = contact_rows(point, normal)
    impulse, after = model.collide(steering, twist, point, normal, e, mu)
    gained = model.inertia(steering) @ (after - twist)
    assert_allclose(gained, n * impulse[0] + t * impulse[1], rtol=0.0, atol=ROUNDING * (1.0 + np.abs(impulse).max()))


@many
@given(impacts, restitutions, frictions)
def test_contact_point_leaves_at_the_restituted_speed(case, e, mu):
    """Newton's restitution, with friction or without: the part that friction adds does not act along the normal."""
    model, steering, twist, point, normal = case
    n, _ = contact_rows(point, normal)
    _, after = model.collide(steering, twist, point, normal, e, mu)
    assert_allclose(n @ after, -e * (n @ twist), rtol=0.0, atol=ROUNDING * (1.0 + np.abs(after).max()))


@many
@given(impacts, restitutions)
def test_frictionless_impact_loses_the_energy_of_restitution(case, e):
    """(C2): ½ (1 − e²) v_n² Λ, so nothing for e = 1."""
    model, steering, twist, point, normal = case
    n, _ = contact_rows(point, normal)
    _, after = model.collide(steering, twist, point, normal, e)
    energy = model.kinetic_energy(steering, twist)
    loss = energy - model.kinetic_energy(steering, after)
    effective = 1.0 / (n @ np.linalg.solve(model.inertia(steering), n))
    assert_allclose(loss, 0.5 * (1.0 - e**2) * (n @ twist) ** 2 * effective, rtol=0.0, atol=ROUNDING * energy)


@pytest.mark.parametrize("e", [0.0, 1.0])
def test_a_plastic_impact_stops_the_contact_and_an_elastic_one_keeps_the_energy(e):
    """(C2) at its ends."""
    model, steering, twist, point, normal = impact(52)
    n, _ = contact_rows(point, normal)
    _, after = model.collide(steering, twist, point, normal, e)
    if e == 0.0:
        assert_allclose(n @ after, 0.0, atol=1e-12)  # m/s, rounding
    else:
        energy = model.kinetic_energy(steering, twist)
        assert_allclose(model.kinetic_energy(steering, after), energy, rtol=1e-12)  # rounding


@many
@given(impacts, restitutions, frictions)
def test_energy_never_rises(case, e, mu):
    """(C4): whatever restitution and friction."""
    model, steering, twist, point, normal = case
    _, after = model.collide(steering, twist, point, normal, e, mu)
    energy = model.kinetic_energy(steering, twist)
    assert model.kinetic_energy(steering, after) <= energy * (1.0 + ROUNDING)


@many
@given(impacts, restitutions, frictions)
def test_energy_loss_is_that_of_restitution_and_that_of_friction(case, e, mu):
    """(C2), (C4): ½ (1 − e²) v_n² Λ + ½ κ (2 − κ) |D|², D the step from frictionless to sticking, |·| in M⁻¹."""
    model, steering, twist, point, normal = case
    rows = np.stack(contact_rows(point, normal))
    mobility = rows @ np.linalg.solve(model.inertia(steering), rows.T)
    v = rows @ twist
    frictionless = np.array([-v[0] / mobility[0, 0], 0.0])
    step = -np.linalg.solve(mobility, v) - frictionless
    assume(abs(step[1]) > 1e-6)  # N s: else nothing tells κ
    impulse, after = model.collide(steering, twist, point, normal, e, mu)
    share = impulse[1] / step[1]
    energy = model.kinetic_energy(steering, twist)
    loss = 0.5 * (1.0 - e**2) * v[0] ** 2 / mobility[0, 0] + 0.5 * share * (2.0 - share) * (step @ mobility @ step)
    assert_allclose(energy - model.kinetic_energy(steering, after), loss, rtol=0.0, atol=ROUNDING * energy)
    assert -ROUNDING <= share <= 1.0 + ROUNDING


@many
@given(impacts, restitutions, frictions)
def test_impulse_pushes_and_stays_in_the_friction_cone(case, e, mu):
    """(C4): a contact does not pull, and what it holds across is bounded by what it presses."""
    model, steering, twist, point, normal = case
    (j_n, j_t), _ = model.collide(steering, twist, point, normal, e, mu)
    assert j_n >= 0.0
    assert abs(j_t) <= mu * j_n + ROUNDING * (1.0 + j_n)


@many
@given(impacts, restitutions, frictions)
def test_contact_sticks_or_uses_all_of_the_cone(case, e, mu):
    """(C3), (C4): sticking leaves only the sliding that the bounce's normal impulse causes, e w_nt J_n(e = 0)."""
    model, steering, twist, point, normal = case
    n, t = contact_rows(point, normal)
    answer = np.linalg.solve(model.inertia(steering), n)
    (j_n, j_t), after = model.collide(steering, twist, point, normal, e, mu)
    left = t @ after - e * (t @ answer) * -(n @ twist) / (n @ answer)
    sticks = abs(left) < 1e-9 * (1.0 + np.abs(after).max())  # m/s, above rounding
    on_the_edge = abs(abs(j_t) - mu * j_n) < 1e-9 * (1.0 + j_n)  # N s, above rounding
    assert sticks or on_the_edge


def test_a_rough_plastic_impact_stops_the_contact_point():
    """(C3): with friction enough and e = 0 nothing of the contact's velocity is left."""
    model, steering, twist, point, normal = impact(53)
    _, after = model.collide(steering, twist, point, normal, 0.0, 1e6)
    assert_allclose(np.stack(contact_rows(point, normal)) @ after, 0.0, atol=1e-11)  # m/s, rounding


@settings(max_examples=30, deadline=None)
@given(impacts, restitutions, frictions)
def test_a_separating_contact_is_left_alone(case, e, mu):
    model, steering, twist, point, normal = case
    impulse, after = model.collide(steering, -twist, point, normal, e, mu)
    assert_allclose(impulse, 0.0, rtol=0.0, atol=0.0)
    assert_allclose(after, -twist, rtol=0.0, atol=0.0)


def test_a_mirrored_impact_has_the_mirrored_impulse():
    """(C4): mirror the robot about its x-axis; the tangential impulse changes sign, the normal one stays."""
    model, steering, twist, point, normal = impact(54)
    casters = tuple(
        c.model_copy(
            update={
                "y": -c.y,
                "offset": -c.offset,
                "link": c.link.model_copy(update={"com": (c.link.com[0], -c.link.com[1])}),
                "gear": ((c.gear[0][0], -c.gear[0][1]), (-c.gear[1][0], c.gear[1][1])),  # steering turns the other way
            }
        )
        for c in model.robot.casters
    )
    com = model.robot.platform.com
    platform = model.robot.platform.model_copy(update={"com": (com[0], -com[1])})
    mirrored = Model(model.robot.model_copy(update={"casters": casters, "platform": platform}))
    flip = np.array([1.0, -1.0])
    ours, _ = model.collide(steering, twist, point, normal, 0.5, 0.3)
    theirs, _ = mirrored.collide(-steering, twist * [1.0, -1.0, -1.0], point * flip, normal * flip, 0.5, 0.3)
    assert_allclose(theirs, ours * flip, rtol=1e-12)  # rounding
