"""(C1) to (C8): laws of the impact."""

from functools import cache

import numpy as np
import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.engines.tensor.model import TorchModel
from caster_gym.mechanics.impulse import Mobility, stronge
from caster_gym.mechanics.impulse import impact as struck
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
laws = st.sampled_from(["stronge", "chatterjee_ruina"])
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
@given(impacts, restitutions, frictions, laws)
def test_twist_changes_by_the_impulse_through_the_inertia(case, e, mu, law):
    """M Δν = N J_n + T J_t."""
    model, steering, twist, point, normal = case
    n, t = contact_rows(point, normal)
    impulse, after = model.collide(steering, twist, point, normal, e, mu, law)
    gained = model.inertia(steering) @ (after - twist)
    assert_allclose(gained, n * impulse[0] + t * impulse[1], rtol=0.0, atol=ROUNDING * (1.0 + np.abs(impulse).max()))


@many
@given(impacts, restitutions, frictions)
def test_contact_point_leaves_at_the_restituted_speed(case, e, mu):
    """(C8): Newton's restitution, by the algebraic law: the part that friction adds does not act along the normal."""
    model, steering, twist, point, normal = case
    n, _ = contact_rows(point, normal)
    _, after = model.collide(steering, twist, point, normal, e, mu, "chatterjee_ruina")
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
@given(impacts, restitutions, frictions, laws)
def test_energy_never_rises(case, e, mu, law):
    """(C6), (C8): whatever restitution and friction."""
    model, steering, twist, point, normal = case
    _, after = model.collide(steering, twist, point, normal, e, mu, law)
    energy = model.kinetic_energy(steering, twist)
    assert model.kinetic_energy(steering, after) <= energy * (1.0 + ROUNDING)


@many
@given(impacts, restitutions, frictions)
def test_energy_loss_is_that_of_restitution_and_that_of_friction(case, e, mu):
    """(C2), (C8): ½ (1 − e²) v_n² Λ + ½ κ (2 − κ) |D|², D the step from frictionless to sticking, |·| in M⁻¹."""
    model, steering, twist, point, normal = case
    rows = np.stack(contact_rows(point, normal))
    mobility = rows @ np.linalg.solve(model.inertia(steering), rows.T)
    v = rows @ twist
    frictionless = np.array([-v[0] / mobility[0, 0], 0.0])
    step = -np.linalg.solve(mobility, v) - frictionless
    assume(abs(step[1]) > 1e-6)  # N s: else nothing tells κ
    impulse, after = model.collide(steering, twist, point, normal, e, mu, "chatterjee_ruina")
    share = impulse[1] / step[1]
    energy = model.kinetic_energy(steering, twist)
    loss = 0.5 * (1.0 - e**2) * v[0] ** 2 / mobility[0, 0] + 0.5 * share * (2.0 - share) * (step @ mobility @ step)
    assert_allclose(energy - model.kinetic_energy(steering, after), loss, rtol=0.0, atol=ROUNDING * energy)
    assert -ROUNDING <= share <= 1.0 + ROUNDING


@many
@given(impacts, restitutions, frictions, laws)
def test_impulse_pushes_and_stays_in_the_friction_cone(case, e, mu, law):
    """(C4), (C8): a contact does not pull, and what it holds across is bounded by what it presses."""
    model, steering, twist, point, normal = case
    (j_n, j_t), _ = model.collide(steering, twist, point, normal, e, mu, law)
    assert j_n >= 0.0
    assert abs(j_t) <= mu * j_n + ROUNDING * (1.0 + j_n)


@many
@given(impacts, restitutions, frictions)
def test_contact_sticks_or_uses_all_of_the_cone(case, e, mu):
    """(C7), (C8): sticking leaves only the sliding that the bounce's normal impulse causes, e w_nt J_n(e = 0)."""
    model, steering, twist, point, normal = case
    n, t = contact_rows(point, normal)
    answer = np.linalg.solve(model.inertia(steering), n)
    (j_n, j_t), after = model.collide(steering, twist, point, normal, e, mu, "chatterjee_ruina")
    left = t @ after - e * (t @ answer) * -(n @ twist) / (n @ answer)
    sticks = abs(left) < 1e-9 * (1.0 + np.abs(after).max())  # m/s, above rounding
    on_the_edge = abs(abs(j_t) - mu * j_n) < 1e-9 * (1.0 + j_n)  # N s, above rounding
    assert sticks or on_the_edge


def test_a_rough_plastic_impact_stops_the_contact_point():
    """(C4): with friction enough and e = 0 nothing of the contact's velocity is left."""
    model, steering, twist, point, normal = impact(53)
    _, after = model.collide(steering, twist, point, normal, 0.0, 1e6)
    assert_allclose(np.stack(contact_rows(point, normal)) @ after, 0.0, atol=1e-11)  # m/s, rounding


@settings(max_examples=30, deadline=None)
@given(impacts, restitutions, frictions, laws)
def test_a_separating_contact_is_left_alone(case, e, mu, law):
    model, steering, twist, point, normal = case
    impulse, after = model.collide(steering, -twist, point, normal, e, mu, law)
    assert_allclose(impulse, 0.0, rtol=0.0, atol=0.0)
    assert_allclose(after, -twist, rtol=0.0, atol=0.0)


@pytest.mark.parametrize("law", ["stronge", "chatterjee_ruina"])
def test_a_mirrored_impact_has_the_mirrored_impulse(law):
    """Mirror the robot about its x-axis; the tangential impulse changes sign, the normal one stays."""
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
    ours, _ = model.collide(steering, twist, point, normal, 0.5, 0.3, law)
    theirs, _ = mirrored.collide(-steering, twist * [1.0, -1.0, -1.0], point * flip, normal * flip, 0.5, 0.3, law)
    assert_allclose(theirs, ours * flip, rtol=1e-12)  # rounding


@cache
def contacts(count):
    """Speeds (count,) along normal and tangent before an impact, and mobilities, of many robots' contacts."""
    rng = np.random.default_rng(1)
    speeds, mobilities = [], []
    for i in range(count):
        model, steering, twist, point, normal = impact(int(rng.integers(10**6)), int(rng.integers(2, 6)))
        rows = np.stack(contact_rows(point, normal))
        mobilities.append(rows @ np.linalg.solve(model.inertia(steering), rows.T))
        speeds.append(rows @ twist * (1.0, rng.choice([0.0, 0.2, 1.0]) if i % 2 else 1.0))
    (v_n, v_t), w = np.transpose(speeds), np.transpose(mobilities, (1, 2, 0))
    return v_n, v_t, w[0, 0], w[0, 1], w[1, 1]


def integrated(v_n, v_t, nn, nt, tt, e, mu, steps=2000):
    """Impulses (2, count) by small equal steps of the normal impulse, friction holding or sliding in each.

    Also by how much the slip has turned round, and whether friction ever pressed the contact together.
    """
    d = -v_n / nn / steps
    along, across, taken, regained = (np.zeros_like(v_n) for _ in range(4))
    start, turned, jammed = np.sign(v_t), np.zeros_like(v_n), np.zeros(len(v_n), dtype=bool)
    going, compressing = np.ones(len(v_n), dtype=bool), np.ones(len(v_n), dtype=bool)
    while going.any():
        push = np.clip(-(v_t + nt * d) / tt, -mu * d, mu * d) * going
        press = d * going
        faster = nn * press + nt * push
        jammed |= going & (faster < 0.0)
        work = (v_n + 0.5 * faster) * press
        v_n, v_t = v_n + faster, v_t + nt * press + tt * push
        along, across = along + press, across + push
        turned = np.maximum(turned, -start * v_t)
        taken, regained = taken - work * compressing, regained + work * ~compressing
        compressing &= v_n < 0.0
        going &= compressing | (regained < e * e * taken)
    return np.stack((along, across)), turned, jammed


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("mu", [0.1, 0.5, *(pytest.param(one, marks=pytest.mark.slow) for one in (2.0, 5.0))])
def test_stronges_law_is_the_integral_along_the_impulse(e, mu):
    """(C3), (C4), (C5), (C6): against thousands of small steps; contacts slide, stick, turn round and jam."""
    v_n, v_t, nn, nt, tt = contacts(300)
    expected, turned, jammed = integrated(v_n, v_t, nn, nt, tt, e, mu)
    ours = np.stack(stronge(v_n[:, None], v_t[:, None], Mobility(nn[:, None], nt[:, None], tt[:, None]), e, mu))[..., 0]
    # a step is 1/2000 of the frictionless impulse, and events are found to a step or two of it
    assert (np.abs(ours - expected) <= 5e-3 * np.abs(expected).max(axis=0)).all()
    if mu <= 0.1:
        assert (turned > 1e-3).sum() > 10
    if mu >= 2.0:
        assert jammed.sum() > 3


@pytest.mark.parametrize("e", [0.0, 0.3, 1.0])
def test_a_contact_that_is_infinitely_rough_does_not_slide_away(e):
    """(C4): nothing is left of the speed along the wall, unless to stop it would pull the contact off before."""
    model = Model(load_robot("tidybot2"))
    rng = np.random.default_rng(55)
    angle, steering = rng.uniform(-np.pi, np.pi, 500), rng.uniform(-np.pi, np.pi, (500, 4))
    normal, point = np.stack((np.cos(angle), np.sin(angle)), -1), rng.uniform(-0.25, 0.25, (500, 2))
    rows = np.stack([np.stack(contact_rows(p, n)) for p, n in zip(point, normal, strict=True)])
    twist = rng.uniform(-1.0, 1.0, (500, 3))
    twist *= -np.sign((rows[:, 0] * twist).sum(-1))[:, None]
    w = rows @ np.linalg.solve(model.inertia(steering), rows.transpose(0, 2, 1))
    v_n, v_t = np.moveaxis(rows @ twist[..., None], 1, 0)[..., 0]
    stays = v_n - w[:, 0, 1] / w[:, 1, 1] * v_t < -e * v_n
    assert stays.mean() > 0.8
    _, after = model.collide(steering, twist, point, normal, e, 1e6)
    assert_allclose(
        (rows[:, 1] * after).sum(-1)[stays], 0.0, atol=1e-9
    )  # m/s: rounding, and what slides at 1e-6 of the impulse


def test_hardly_sliding_contacts_end_as_those_that_do_not_slide():
    """(C3), (C4): the sign of nothing does not matter."""
    _, _, nn, nt, tt = contacts(300)
    w, v_n = Mobility(nn, nt, tt), -np.ones(300)
    for mu in (0.1, 0.5, 2.0):
        still = np.stack(stronge(v_n, np.zeros(300), w, 0.7, mu))
        for slip in (1e-9, -1e-9):
            moving = np.stack(stronge(v_n, np.full(300, slip), w, 0.7, mu))
            assert_allclose(moving, still, rtol=0.0, atol=1e-6 * still.max())  # such a slip changes that little


def test_a_contact_that_neither_approaches_nor_recedes_is_left_alone():
    """Also where friction would hold its speed along the normal, in Python's numbers, which cannot divide by zero."""
    for v_n in (0.0, 0.5):
        for w in (Mobility(1.0, 0.5, 1.0), Mobility(1.0, -0.5, 1.0)):
            for v_t in (-1.0, 0.0, 1.0):
                assert struck(v_n, v_t, w, 0.5, 2.0, 0.0) == (0.0, 0.0)


def test_regained_work_is_that_of_restitution():
    """(C5), (C6): friction at most takes; with it a contact may leave faster or slower than e times its approach."""
    v_n, v_t, nn, nt, tt = contacts(300)
    along, across = stronge(v_n, v_t, Mobility(nn, nt, tt), 0.6, 0.4)
    ratio = -(v_n + nn * along + nt * across) / v_n
    assert (ratio > 0.0).all()
    assert ratio.min() < 0.59
    assert ratio.max() > 0.61


@pytest.mark.parametrize("law", ["stronge", "chatterjee_ruina"])
def test_impulses_have_gradients(law):
    """Against central differences, for contacts of all modes."""
    for seed in range(12):
        model, steering, twist, point, normal = impact(seed)
        tensors = TorchModel(model.robot)
        for mu in (0.0, 0.1, 0.6, 3.0):
            v = torch.tensor(twist, requires_grad=True)
            tensors.collide(steering, v, point, normal, 0.5, mu, law)[0].sum().backward()
            steps = 1e-6 * np.eye(3)
            sums = [model.collide(steering, twist + d, point, normal, 0.5, mu, law)[0].sum() for d in (*steps, *-steps)]
            slopes = (np.array(sums[:3]) - sums[3:]) / 2e-6
            # differences are off by rounding of 10 N s over 1e-6, and by curvature
            assert v.grad is not None
            assert_allclose(v.grad, slopes, rtol=1e-5, atol=1e-6)


def test_an_unknown_law_is_refused_by_name():
    model, steering, twist, point, normal = impact(55)
    with pytest.raises(ValueError, match="law must be one of stronge, chatterjee_ruina, got 'newton'"):
        model.collide(steering, twist, point, normal, 0.5, 0.1, "newton")
