"""Friction of the floor: the conditions of Coulomb's law, for single problems and along driven motions."""

from typing import Any

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.mechanics import floor_friction, slip
from caster_gym.mechanics.floor_friction import (
    Footing,
    Grip,
    final_impulses,
    grip,
    impulse_limit,
    newton_round,
    slide_ratio,
    unheld_velocity,
    used_share,
)
from caster_gym.mechanics.integration import State
from caster_gym.mechanics.parameters import GRAVITY, robot_parameters
from caster_gym.mechanics.scalars import pairs
from caster_gym.mechanics.slip_state import rolling_state
from caster_gym.shipped_files import names_of
from tests.random_robots import CASTER_COUNTS, random_robot

ROUNDS = (1.0, 1.0, 1.0, 0.5, 0.5, 0.25, *(0.0,) * 10)  # more than enough


def draw(seed, wheels):
    """A problem of so many wheels: slow, fast and resting ones, hard pushes, and now and then a wheel without load."""
    rng = np.random.default_rng((seed, wheels))
    footings, limits, slides = [], [], []
    a = rng.normal(size=(3, 3))
    inertia = a @ a.T + 5.0 * np.eye(3)
    for _ in range(wheels):
        k = rng.normal(size=(2, 2))
        k = 0.2 * k @ k.T + 0.05 * np.eye(2)
        before = rng.normal(size=2) * rng.choice((0.0, 1e-3, 0.1, 2.0))
        free = before + rng.normal(size=2) * rng.choice((1e-3, 0.1, 0.5))
        rows = rng.normal(size=(2, 3))
        along, across = rows.tolist()
        footings.append(Footing((free[0], free[1]), (tuple(along), tuple(across)), (k[0, 0], k[0, 1], k[1, 1])))
        limits.append(impulse_limit(1.0, rng.choice((0.0, 0.05, 0.5, 5.0)) * rng.uniform(0.5, 1.5)))
        slides.append(slide_ratio(tuple(before), limits[-1]))
    upper = tuple(inertia[np.triu_indices(3)])
    problem = (upper, tuple(rng.normal(size=3)), tuple(footings), tuple(limits))
    return problem, tuple(slides)


def solved(problem, slides, cautions, change=(0.0, 0.0, 0.0)):
    for caution in cautions:
        change, slides = newton_round(change, caution, problem, slides)
    return final_impulses(change, problem, slides)


def slips(change, grips, problem):
    """Velocities (N, 2) of the wheels over the floor."""
    found = []
    for footing, wheel in zip(problem[2], grips, strict=True):
        ff, fp, pp = footing.mobility
        w = np.array(unheld_velocity(change, footing))
        found.append(w + np.array([[ff, fp], [fp, pp]]) @ wheel.impulse)
    return np.array(found)


def off_the_law(change, grips, problem):
    """How far the wheels are from Coulomb's law [m/s]: zero if and only if each is held or slides against its limit."""
    worst = 0.0
    for u, footing, limit, wheel in zip(slips(change, grips, problem), problem[2], problem[3], grips, strict=True):
        stiff = footing.mobility[0] + footing.mobility[2]
        better = np.array(wheel.impulse) - u / stiff
        better *= min(1.0, limit.most / max(np.hypot(*better), 1e-300))
        worst = max(worst, stiff * float(np.hypot(*(better - wheel.impulse))))
    return worst


@pytest.mark.parametrize("wheels", CASTER_COUNTS)
def test_impulses_obey_coulombs_law(wheels):
    """(S12), (S13), (S14)"""
    for seed in range(60):
        problem, slides = draw(seed, wheels)
        change, grips = solved(problem, slides, ROUNDS)
        assert off_the_law(change, grips, problem) < 1e-9  # the rounds converge: rounding, in m/s of some m/s
        xx, xy, xz, yy, yz, zz = problem[0]
        momentum = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]) @ change
        given = np.array(problem[1])
        for footing, limit, wheel in zip(problem[2], problem[3], grips, strict=True):
            assert np.hypot(*wheel.impulse) <= limit.most * (1.0 + 1e-12)
            given = given + np.array(footing.rows).T @ wheel.impulse
        np.testing.assert_allclose(momentum, given, rtol=0.0, atol=1e-12 * np.abs(given).max())


@pytest.mark.parametrize("wheels", CASTER_COUNTS)
def test_friction_takes_energy(wheels):
    """Half of P · (u before + u after), of which P = 0 gives none: also where the rounds have not converged."""
    for seed in range(60):
        problem, slides = draw(seed, wheels)
        still = np.linalg.solve(*_system(problem))
        free = slips(tuple(still), [grip_without(footing) for footing in problem[2]], problem)
        change, grips = solved(problem, slides, (0.5, 0.0))
        after = slips(change, grips, problem)
        work = sum(0.5 * np.dot(wheel.impulse, u + v) for wheel, u, v in zip(grips, free, after, strict=True))
        assert work <= 1e-12


def _system(problem):
    xx, xy, xz, yy, yz, zz = problem[0]
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]), np.array(problem[1])


def grip_without(footing):
    """A wheel that the floor leaves alone."""
    return floor_friction.Grip((0.0, 0.0), 0.0, (0.0, 0.0, 0.0))


def test_stiffness_is_the_derivative_of_the_impulse():
    """(S14): by central differences of the impulse of a wheel that is held, and of one that slides."""
    footing = Footing((0.3, -0.4), ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), (0.4, 0.1, 0.3))
    for most, slide in ((10.0, 0.0), (0.2, 1.0)):
        limit = impulse_limit(1.0, most)

        def impulse(x, y, limit=limit, slide=slide):
            for _ in range(12):
                wheel = grip((x, y, 0.0), 0.0, footing, limit, slide)
                slide = wheel.slide
            return np.array(wheel.impulse), wheel

        _, wheel = impulse(0.0, 0.0)
        assert (wheel.slide > 0.0) == (most < 1.0)
        h = 1e-5
        columns = [
            (impulse(h, 0.0)[0] - impulse(-h, 0.0)[0]) / (2 * h),
            (impulse(0.0, h)[0] - impulse(0.0, -h)[0]) / (2 * h),
        ]
        xx, xy, yy = wheel.stiffness
        np.testing.assert_allclose(
            -np.array(columns).T, [[xx, xy], [xy, yy]], rtol=0.0, atol=1e-8
        )  # h² and rounding / h


ROBOTS = [load_robot(name) for name in names_of("robots")]
ROBOTS += [random_robot(seed, count) for seed in range(2) for count in CASTER_COUNTS]


def hard_problems(monkeypatch, h=5e-3):
    """All friction problems of robots that are driven far beyond what the floor holds, as a step meets them."""
    met: list[Any] = []

    def first(change, caution, problem, slides):
        if not met or met[-1][1] is not problem:
            met.append((change, problem, slides))
        return newton_round(change, caution, problem, slides)

    monkeypatch.setattr(slip, "newton_round", first)
    rng = np.random.default_rng(5)
    for robot in ROBOTS:
        numbers, n = robot_parameters(robot), robot.caster_count
        numbers = numbers._replace(platform=numbers.platform._replace(height=0.1))
        for friction in (0.05, 0.3, 0.7):
            angles = rng.uniform(-np.pi, np.pi, n)
            f = tuple((np.cos(angle), np.sin(angle)) for angle in angles)
            state = rolling_state(State((0.0, 0.0), (1.0, 0.0), tuple(rng.uniform(-1, 1, 3)), f), numbers)
            push = friction * GRAVITY * numbers.platform.mass / n
            levers = np.array([(caster.radius, caster.trail) for caster in robot.casters]).ravel()
            for step in range(30):
                if step % 10 == 0:
                    torques = pairs(tuple(push * levers * rng.uniform(-2.0, 2.0, 2 * n)))
                state, _ = slip.slip_step(state, torques, (0.0, 0.0, 0.0), h, (friction,) * n, numbers)
                if max(abs(rate) for own in state.rates for rate in own) > 100.0:
                    break  # no motor turns that fast
    return met


@pytest.mark.slow
def test_two_rounds_suffice_for_robots_that_slip_in_every_way(monkeypatch):
    """What they leave in the second stage, which decides: distance of all slips from those of many rounds."""
    met = hard_problems(monkeypatch)[1::2]
    left = []
    for change, problem, slides in met:
        exact = solved(problem, slides, ROUNDS, change)
        found = solved(problem, slides, (0.5, 0.0), change)
        ours, theirs = (slips(change, grips, problem) for change, grips in (found, exact))
        left.append(np.abs(ours - theirs).max())
    assert len(left) > 700
    assert np.median(left) < 1e-11  # [m/s]
    assert np.quantile(left, 0.99) < 3e-5
    assert max(left) < 2e-3


def test_a_wheel_uses_no_more_than_all():
    """Not even by rounding."""
    angles = np.random.default_rng(9).uniform(-np.pi, np.pi, 10_000)
    limit = impulse_limit(1.0, 0.3)
    impulses = 0.3 * np.cos(angles), 0.3 * np.sin(angles)
    assert (np.hypot(*impulses) * limit.inverse).max() > 1.0  # so there is rounding to be cut
    uses = used_share(Grip(impulses, 0.0 * angles, (0.0 * angles,) * 3), limit)
    assert uses.max() == 1.0
    assert uses.min() > 1.0 - 1e-12
