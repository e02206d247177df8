"""The term (D1), against a mass at the pivots and against the momenta of all bodies."""

import numpy as np
import pytest
from numpy.testing import assert_allclose

from caster_gym import Model, load_robot
from caster_gym.paths.headings import Spinning
from caster_gym.paths.shapes import Ellipse
from papers.analysis.driven_motion import DrivenMotion, inertial_force, lead
from papers.analysis.model_comparison import carried_mass, force_by_momenta, force_size, missing_force
from tests.random_robots import random_motion, random_robot

CHUNG = load_robot("chung2008")
ROBOTS = [CHUNG, *(random_robot(seed, count) for seed, count in ((0, 2), (1, 4)))]
INNER = slice(2, -2)


def on_ellipse(robot, time_step=0.01):
    path = Ellipse(semi_axes=(2.0, 1.0), duration=20.0, heading=Spinning(angle=0.4))
    return lead(path.trajectories(time_step)[0], robot)


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_missing_force_is_that_of_masses_at_the_pivots(robot):
    """(F5): m_l p / d at each pivot, pushed by η̇ ẑ × v_A: across its way, so without power."""
    steering, twist, _, _ = random_motion(3, robot, 100)
    eta = Model(robot).rates(steering, twist)[0]
    expected = np.zeros_like(twist)
    for i, caster in enumerate(robot.casters):
        mass = caster.link.mass * (caster.trail - caster.link.com[0]) / caster.trail
        vx, vy = twist[:, 0] - twist[:, 2] * caster.y, twist[:, 1] + twist[:, 2] * caster.x
        fx, fy = -mass * eta[:, i] * vy, mass * eta[:, i] * vx
        expected += np.stack((fx, fy, caster.x * fy - caster.y * fx), axis=-1)
    missing = missing_force(robot, steering, twist)
    assert_allclose(missing, expected, rtol=0.0, atol=1e-11)  # round-off of forces of order 10
    assert np.abs(missing).max() > 1e-2
    assert_allclose((missing * twist).sum(axis=-1), 0.0, atol=1e-11)


def test_carried_mass_by_hand():
    """(F5): three links of 0.1 kg whose mass centres lie a third of the trail before the axle."""
    assert_allclose(carried_mass(CHUNG), 3 * 0.1 / 3, rtol=1e-9)  # the file rounds p = d / 3


@pytest.mark.parametrize("robot", ROBOTS, ids=lambda robot: robot.name)
def test_momenta_of_all_bodies_decide_for_the_exact_model(robot):
    """(F6): Newton and Euler, body by body, with momenta differentiated along the motion."""
    motion = on_ellipse(robot)
    force = force_by_momenta(motion, robot)
    exact, printed = (inertial_force(motion, Model(robot, dynamics))[INNER] for dynamics in ("exact", "chung2008"))
    size = np.abs(force).max()
    assert_allclose(force, exact, rtol=0.0, atol=1e-5 * size)  # differences of fourth order at 0.01 s
    assert np.abs(force - printed).max() > 5e-3 * size  # the links of these robots are light


def test_error_of_the_momenta_falls_with_the_fourth_power_of_the_time_step():
    robot = ROBOTS[1]
    errors = []
    for time_step in (0.08, 0.04):
        motion = on_ellipse(robot, time_step)
        errors.append(np.abs(force_by_momenta(motion, robot) - inertial_force(motion, Model(robot))[INNER]).max())
    assert 10.0 < errors[0] / errors[1] < 20.0  # 16, with the next order in it


def test_size_of_a_force_counts_moments_at_the_pivots_distance():
    length = np.sqrt(np.mean([caster.x**2 + caster.y**2 for caster in CHUNG.casters]))
    assert_allclose(force_size(CHUNG, np.array([[3.0, 4.0, 0.0], [0.0, 0.0, length]])), [5.0, 1.0], rtol=1e-14)


def test_momenta_need_even_samples_and_enough():
    motion = on_ellipse(CHUNG, 0.1)
    short = DrivenMotion(*(getattr(motion, name)[:4] for name in DrivenMotion.__dataclass_fields__))
    with pytest.raises(ValueError, match="at least 5 samples at equal time steps, got 4 samples"):
        force_by_momenta(short, CHUNG)
    parts = {name: getattr(motion, name) for name in DrivenMotion.__dataclass_fields__}
    with pytest.raises(ValueError, match="equal time steps"):
        force_by_momenta(DrivenMotion(**{**parts, "time": parts["time"] ** 2}), CHUNG)
