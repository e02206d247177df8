"""Impulses at one contact and at several: which laws they keep, and that nobody's order or side is preferred."""

from itertools import chain, combinations
from typing import NamedTuple

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.testing import assert_allclose, assert_array_equal
from scipy.optimize import linprog

from caster_gym import Model, Robot, load_robot
from caster_gym.mechanics.contact_impulses import STILL, Pressure, press
from caster_gym.mechanics.dynamics import inertia
from caster_gym.mechanics.integration import State
from caster_gym.shipped_files import names_of
from tests.random_robots import CASTER_COUNTS, random_robot
from tests.walks import FLOOR, NEEDLE, TRIANGLE, Walk, around_it, corners_of, energy, floats, shaped, state_of

SQUARE = ((0.1, -0.1), (0.1, 0.1), (-0.1, 0.1), (-0.1, -0.1))
OUTLINES = {
    "disc": 0.2,
    "square": SQUARE,
    "box": ((0.25, -0.1), (0.25, 0.1), (-0.25, 0.1), (-0.25, -0.1)),
    "triangle": TRIANGLE,
}
ORDER = 1e-7  # m/s, rad/s: rounding in another order, which sweeps that do not settle make larger
SEEDS = range(240)


class Scene(NamedTuple):
    """A robot that touches straight walls."""

    robot: Robot
    outline: object
    normals: np.ndarray  # (K, 2) in W, out of the walls
    beta: float
    twist: np.ndarray
    steering: np.ndarray
    e: float
    mu: float


def scene(seed, mu=None, e=None):
    """One of: two walls at any angle, a wall flush with a side and perhaps another, three walls, a square corner."""
    rng = np.random.default_rng((seed, 61))
    robot = random_robot(seed, int(rng.integers(2, 5)))
    outline = OUTLINES[rng.choice(list(OUTLINES))]
    beta, first = rng.uniform(-np.pi, np.pi, 2)
    if seed % 4 == 0:
        angles = [first, first + rng.uniform(0.1, 3.0)]
    elif seed % 4 == 1:
        angles = [beta + 0.5 * np.pi * rng.integers(4)]
        angles += [angles[0] + rng.choice([-0.5, 0.5]) * np.pi] if rng.random() < 0.5 else []
    elif seed % 4 == 2:
        angles = [first, first + rng.uniform(0.3, 1.5), first + rng.uniform(1.5, 2.6)]
    else:
        angles = [first, first + 0.5 * np.pi]
    return Scene(
        robot,
        outline,
        np.stack((np.cos(angles), np.sin(angles)), -1),
        beta,
        rng.uniform(-1.0, 1.0, 3) * (1.0, 1.0, 2.0 * rng.integers(2)),
        rng.uniform(-np.pi, np.pi, robot.caster_count),
        float(rng.choice([0.0, 0.5, 1.0, rng.random()])) if e is None else e,
        float(rng.choice([0.1, 0.3, 0.5, 1.0, 3.0])) if mu is None else mu,
    )


def turned(points, angle):
    return np.asarray(points) @ np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])


def contacts_of(one):
    """N and T (C, 3) of all contact points in B, twice where a side lies flush, found from the outline alone."""
    rows = []
    for n in turned(one.normals, -one.beta):
        corners = np.zeros((1, 2)) if isinstance(one.outline, float) else np.asarray(one.outline)
        low = corners @ n
        for p in corners[low < low.min() + 1e-9]:
            x, y = p - (one.outline * n if isinstance(one.outline, float) else 0.0)
            rows.append([(n[0], n[1], x * n[1] - y * n[0]), (-n[1], n[0], x * n[0] + y * n[1])])
    return np.moveaxis(np.array(rows), 1, 0)


def struck(one, order=None) -> tuple[np.ndarray, Pressure, State]:
    """Twist after the impulses, what pressed, and the state before; the walls in another order."""
    corners = np.zeros((1, 2)) if isinstance(one.outline, float) else turned(one.outline, one.beta)
    radius = one.outline if isinstance(one.outline, float) else 0.0
    low = [(corners @ n).min() - radius for n in one.normals]
    walls = [{"point": (n * d).tolist(), "normal": n.tolist()} for n, d in zip(one.normals, low, strict=True)]
    walls = walls if order is None else [walls[i] for i in order]
    robot = shaped(one.robot, one.outline)
    velocity = turned(one.twist[:2], one.beta)
    start = floats(state_of(0.0, 0.0, one.beta, velocity, one.twist[2], one.steering))
    walk = Walk(robot, around_it(robot, {"half_planes": walls}, restitution=one.e, friction=one.mu), start)
    m = inertia(start.directions, walk.parameters)
    after, pressure = press(start, m, one.e, walk.hull, walk.obstacles, 0, len(walls))
    return np.array(after), pressure, start


@settings(deadline=None, max_examples=60)
@given(
    seed=st.integers(0, 10**6),
    casters=st.sampled_from(CASTER_COUNTS),
    outline=st.sampled_from([0.2, TRIANGLE, NEEDLE]),
    e=st.floats(0.0, 1.0),
    mu=st.sampled_from([0.0, 0.1, 0.5, 2.0]),
    law=st.sampled_from(["stronge", "chatterjee_ruina"]),
)
def test_one_contact_is_struck_as_a_single_one_and_loses_the_energy_that_it_must(seed, casters, outline, e, mu, law):
    """(C2), exactly without friction; with it, what the law of a single contact says."""
    rng = np.random.default_rng(seed)
    robot = shaped(random_robot(seed, casters), outline)
    model, around = Model(robot), around_it(robot, FLOOR, restitution=e, friction=mu, impact_law=law)
    beta, angles = rng.uniform(-np.pi, np.pi), rng.uniform(-np.pi, np.pi, casters)
    lowest = min(corners_of(outline, state_of(0.0, 0.0, beta, (0.0, 0.0), 0.0, ()))[:, 1])
    height = outline if isinstance(outline, float) else -lowest
    velocity, omega = rng.uniform(-10.0, 10.0, 2), rng.uniform(-20.0, 20.0)
    walk = Walk(robot, around, floats(state_of(0.0, height, beta, velocity, omega, angles)))
    state = walk.state
    c, s = state.heading
    n = np.array([s, c])
    corners = np.zeros((1, 2)) if isinstance(outline, float) else np.asarray(outline)
    touching = corners @ n <= (corners @ n).min() + 1e-4
    if touching.sum() > 1:
        return  # two contacts at once are another test
    point = corners[touching][0] - (outline * n if isinstance(outline, float) else 0.0)
    arm = np.array([n[0], n[1], point[0] * n[1] - point[1] * n[0]])
    mobility, v_n = arm @ np.linalg.solve(model.inertia(angles), arm), arm @ state.twist
    m = inertia(state.directions, walk.parameters)
    after, pressure = press(state, m, e, walk.hull, walk.obstacles, 0, 1)
    if v_n >= 0.0:
        assert_array_equal(after, state.twist)
        assert pressure.normal == 0.0
        return
    e = e if v_n < -0.01 else 0.0
    impulse, expected = model.collide(angles, state.twist, point, n, e, mu, law)
    assert_allclose(after, expected, rtol=0.0, atol=1e-9)  # places of contacts are rounded at 1e-16 m
    assert_allclose(pressure.normal, impulse[0], rtol=1e-9)
    before_J, after_J = energy(model, state), model.kinetic_energy(angles, after)
    if mu == 0.0:
        assert_allclose(arm @ after, -e * v_n, rtol=0.0, atol=1e-10)  # rounding of arms of 0.3 m and twists of 20
        lost = 0.5 * (1.0 - e * e) * v_n**2 / mobility
        assert_allclose(before_J - after_J, lost, rtol=0.0, atol=1e-12 * max(before_J, 1.0))


@pytest.mark.parametrize("mu", [0.0, pytest.param(None, marks=pytest.mark.slow)])
def test_the_order_of_walls_does_not_matter(mu):
    """Flush sides, corners of all angles, three walls; smooth and rough."""
    for seed in SEEDS:
        one = scene(seed, mu)
        after, pressure, _ = struck(one)
        for order in (range(len(one.normals))[::-1], np.roll(np.arange(len(one.normals)), 1)):
            again, other, _ = struck(one, order)
            assert_allclose(again, after, rtol=0.0, atol=ORDER)
            assert_allclose(other.normal, pressure.normal, rtol=1e-6)


def test_a_wall_that_is_listed_twice_is_one_wall():
    for seed in SEEDS[::3]:
        one = scene(seed)
        after, pressure, _ = struck(one)
        again, other, _ = struck(one, [0, *range(len(one.normals)), 0])
        assert_allclose(again, after, rtol=0.0, atol=ORDER)
        assert_allclose(other.normal, pressure.normal, rtol=1e-6)
        assert_allclose(other.point, pressure.point, rtol=0.0, atol=ORDER)


def mirrored(one):
    """The same scene seen in a mirror, left and right exchanged."""
    casters = tuple(
        c.model_copy(
            update={
                "y": -c.y,
                "offset": -c.offset,
                "link": c.link.model_copy(update={"com": (c.link.com[0], -c.link.com[1])}),
                "gear": ((c.gear[0][0], -c.gear[0][1]), (-c.gear[1][0], c.gear[1][1])),
            }
        )
        for c in one.robot.casters
    )
    com = one.robot.platform.com
    platform = one.robot.platform.model_copy(update={"com": (com[0], -com[1])})
    flat = isinstance(one.outline, float)
    return one._replace(
        robot=one.robot.model_copy(update={"casters": casters, "platform": platform}),
        outline=one.outline if flat else tuple((x, -y) for x, y in one.outline[::-1]),
        normals=one.normals * (1.0, -1.0),
        beta=-one.beta,
        twist=one.twist * (1.0, -1.0, -1.0),
        steering=-one.steering,
    )


@pytest.mark.slow
def test_a_mirrored_scene_has_mirrored_impulses():
    for seed in SEEDS:
        one = scene(seed)
        after, pressure, _ = struck(one)
        seen, other, _ = struck(mirrored(one))
        assert_allclose(seen * (1.0, -1.0, -1.0), after, rtol=0.0, atol=ORDER)
        assert_allclose(other.normal, pressure.normal, rtol=1e-6)


def test_energy_never_rises_and_nothing_approaches_any_more():
    """(O9): whatever restitution and friction; and M Δν is the wrench of the impulses."""
    for seed in SEEDS:
        for mu in (None, 0.0, 1e3):
            one = scene(seed, mu)
            after, pressure, start = struck(one)
            model = Model(one.robot)
            before_J = model.kinetic_energy(one.steering, one.twist)
            assert model.kinetic_energy(one.steering, after) <= before_J * (1.0 + 1e-12)  # rounding
            n, _ = contacts_of(one)
            assert (n @ after).min() > -10.0 * STILL
            gained = model.inertia(one.steering) @ (after - start.twist)
            assert_allclose(pressure.wrench, gained, rtol=0.0, atol=1e-9)  # N s, rounding in sums of hundreds of terms


def cone_projection(m, n, v):
    """The twist nearest to v, in the metric of m, that lets no contact approach: by trying all sets of contacts."""
    best, least = None, np.inf
    for some in chain.from_iterable(combinations(range(len(n)), k) for k in range(4)):
        rows = n[list(some)]
        w = rows @ np.linalg.solve(m, rows.T)
        if some and np.linalg.cond(w) > 1e10:
            continue
        reached = v - np.linalg.solve(m, rows.T) @ np.linalg.solve(w, rows @ v) if some else v
        far = (reached - v) @ m @ (reached - v)
        if (n @ reached > -1e-12).all() and far < least:
            best, least = reached, far
    return best


def test_smooth_contacts_follow_moreaus_law():
    """(O7), (O8): ν⁺ = (1 + e) proj ν − e ν, the projection found by brute force."""
    several = 0
    for seed in SEEDS:
        one = scene(seed, mu=0.0)
        n, _ = contacts_of(one)
        if (n @ one.twist > -STILL).all():
            continue
        m = Model(one.robot).inertia(one.steering)
        expected = (1.0 + one.e) * cone_projection(m, n, one.twist) - one.e * one.twist
        if (n @ expected < -1e-9).any() or (abs(n @ one.twist) < 0.02).any():
            continue  # another round follows, or a contact that is too slow to bounce
        several += (n @ one.twist < 0.0).sum() > 1
        after, _, _ = struck(one)
        assert_allclose(
            after, expected, rtol=0.0, atol=1e-6
        )  # sweeps end at 1e-9 m/s, where walls are all but parallel
    assert several > 60


def test_rough_contacts_that_do_not_bounce_obey_coulombs_law():
    """(O7): some impulses in the friction cones, against the sliding that is left, give what came out."""
    missed = []
    for seed in SEEDS:
        one = scene(seed, e=0.0)
        n, t = contacts_of(one)
        if (n @ one.twist < -STILL).sum() < 2:
            continue
        after, pressure, _ = struck(one)
        v_n, v_t = n @ after, t @ after
        edges = np.where(np.abs(v_t) > 1e-5, np.sign(v_t), 0.0)
        high = np.where(v_n > 1e-5, 0.0, np.inf)
        k = len(n)
        # unknowns J_n, J_t and the greatest misfit; J_t = −μ sign(v_t) J_n where it slides
        cone = np.vstack([np.hstack([-one.mu * np.eye(k), sign * np.eye(k), np.zeros((k, 1))]) for sign in (1, -1)])
        sliding = np.hstack([one.mu * np.diag(edges), np.eye(k), np.zeros((k, 1))])[edges != 0.0]
        sums = np.hstack([n.T, t.T])
        misfit = np.vstack([np.hstack([sign * sums, -np.ones((3, 1))]) for sign in (1, -1)])
        limits = np.concatenate([np.zeros(2 * k), pressure.wrench, -np.array(pressure.wrench)])
        bounds = [(0.0, h) for h in high] + [(None, None)] * k + [(0.0, None)]
        found = linprog(
            [0.0] * 2 * k + [1.0],
            np.vstack([cone, misfit]),
            limits,
            sliding if len(sliding) else None,
            np.zeros(len(sliding)) if len(sliding) else None,
            bounds,
        )
        missed.append(found.fun / np.abs(pressure.wrench).max())
    assert len(missed) > 60
    assert (np.array(missed) < 1e-4).mean() > 0.97  # sweeps may end before the impulses settle, in wedges for instance


@pytest.mark.parametrize("mu", [0.0, 0.3, 2.0])
@pytest.mark.parametrize("name", names_of("robots"))
def test_a_flush_side_that_does_not_bounce_leaves_nothing_along_the_normal(name, mu):
    """One end at least rests, both where the robot is not heavier on one side of the wall's normal."""
    robot = load_robot(name)
    outline = tuple((3.0 * x, 3.0 * y) for x, y in SQUARE)
    rng = np.random.default_rng(62)
    for side, askew in ((side, askew) for side in range(4) for askew in (False, True) for _ in range(10)):
        normal = turned([[1.0, 0.0]], 0.5 * np.pi * side)
        across = rng.uniform(-0.5, 0.5) if askew else 0.0
        twist = np.array([*turned([-0.5, across], 0.5 * np.pi * side), 0.0])
        steering = rng.uniform(-np.pi, np.pi, robot.caster_count) if askew else np.zeros(robot.caster_count)
        one = Scene(robot, outline, normal, 0.0, twist, steering, 0.0, mu)
        after, _, _ = struck(one)
        assert_allclose((contacts_of(one)[0] @ after).min(), 0.0, atol=STILL)
        if not askew:
            assert_allclose(contacts_of(one)[0] @ after, 0.0, atol=STILL)
            assert abs(after[2]) < STILL / 0.3


@pytest.mark.parametrize("e", [0.0, 0.5, 1.0])
@pytest.mark.parametrize("outline", [SQUARE, 0.1], ids=["square", "disc"])
def test_a_symmetric_robot_keeps_the_share_of_restitution(outline, e):
    """All wheels along the motion: e² of the energy is left, and it does not turn."""
    twist = np.array([0.5, 0.0, 0.0])
    one = Scene(load_robot("chung2008"), outline, np.array([[-1.0, 0.0]]), 0.0, twist, np.zeros(3), e, 0.0)
    after, pressure, _ = struck(one)
    assert_allclose(after, (-0.5 * e, 0.0, 0.0), rtol=0.0, atol=1e-9)
    assert_allclose(pressure.point, (0.1, 0.0), atol=1e-9)  # the middle of the side


@pytest.mark.parametrize("order", [(0, 1), (1, 0)])
def test_a_disc_leaves_a_corner_as_it_came(order):
    """xr4000 at 45° into a corner with e = 0.5: (−0.25, −0.25), however its wheels stand."""
    rng = np.random.default_rng(63)
    walls = np.array([[-1.0, 0.0], [0.0, -1.0]])
    for _ in range(20):
        steering = rng.uniform(-np.pi, np.pi, 4)
        one = Scene(load_robot("xr4000"), 0.31, walls, 0.0, np.array([0.5, 0.5, 0.0]), steering, 0.5, 0.0)
        assert_allclose(struck(one, order)[0][:2], (-0.25, -0.25), rtol=0.0, atol=1e-7)


def test_a_robot_in_a_batch_is_struck_as_it_is_alone():
    """To the last bit, although the others need more sweeps and rounds."""
    robot = shaped(load_robot("chung2008"), SQUARE)
    corner = [{"point": [0.1, 0.0], "normal": [-1.0, 0.0]}, {"point": [0.0, 0.1], "normal": [0.0, -1.0]}]
    around = around_it(robot, {"half_planes": corner}, restitution=0.5, friction=0.4)
    rng, count = np.random.default_rng(64), 40
    velocity, omega = rng.uniform(-0.2, 0.5, (2, count)), rng.uniform(-1.0, 1.0, count)
    x = np.where(rng.random(count) < 0.3, -0.01, 0.0)  # some touch one wall only
    together = state_of(x, 0.0 * x, 0.0 * x, velocity, omega, rng.uniform(-3.0, 3.0, (3, count)))
    walk = Walk(robot, around, together)
    after, _ = press(together, inertia(together.directions, walk.parameters), 0.5, walk.hull, walk.obstacles, 0, 2)
    for i in range(count):
        position, heading, twist = (tuple(v[i : i + 1] for v in part) for part in together[:3])
        alone = State(
            position,
            heading,
            twist,
            tuple((c[i : i + 1], s[i : i + 1]) for c, s in together.directions),
        )
        single, _ = press(alone, inertia(alone.directions, walk.parameters), 0.5, walk.hull, walk.obstacles, 0, 2)
        assert_array_equal(np.concatenate(single), np.stack(after)[:, i])
