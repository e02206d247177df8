"""A floor that wheels slip on, against MuJoCo's elliptic cone."""

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.shipped_files import names_of
from scripts.slip_peer import draw_courses, page, write_table
from scripts.slip_runs import (
    OUR_STEPS,
    SOFTNESS,
    STEPS,
    Comparison,
    Rate,
    measure,
    off,
    on_three,
    ours,
    peer,
    scenarios,
    until,
)

FINE = 1.25e-4  # [s] MuJoCo's
HARD = (
    SOFTNESS / 2
)  # [s] time constant of its contacts where less than 20 ms are measured: they lag behind by about that
FASTEST = 2.0  # [m/s] of a wheel that slides: on a faster one, MuJoCo's contacts hop more, the harder they are


def scene_of(robot, name):
    return next(one for one in scenarios(load_robot(robot), 0) if one.name == name)


@pytest.mark.slow
@pytest.mark.parametrize("robot", names_of("robots"))
@pytest.mark.parametrize(
    ("name", "tolerance", "softness"),
    [
        ("onset of slip", 0.06, SOFTNESS),  # creep reaches 20 mm/s some ms before the limit does
        ("spin-up of a wheel", 0.05, SOFTNESS),  # loads build up in 5 ms of 150
        ("regrip", 0.06, HARD),  # the last mm/s of a contact that is a spring and a damper
        ("braking", 0.06, SOFTNESS),  # loads that swing while the robot pitches
    ],
)
def test_slip_starts_grows_and_ends_as_in_mujoco(robot, name, tolerance, softness):
    scene = scene_of(robot, name)
    mine, theirs = ours(scene, 1e-3), peer(scene, FINE, softness)
    assert measure(scene, mine) == pytest.approx(measure(scene, theirs), rel=tolerance)
    assert mine.slip.max() > 0.2


@pytest.mark.slow
@pytest.mark.parametrize("robot", names_of("robots"))
def test_drifts_end_where_mujocos_do(robot):
    """A way of some dm, up to where a wheel slides at 2 m/s: MuJoCo's contacts hop then."""
    scene = scene_of(robot, "drift")
    whole = ours(scene, 1e-3)
    fast = whole.slip.max(axis=1) > FASTEST
    end = whole.time[np.argmax(fast)] if fast.any() else scene.duration
    mine, theirs = until(whole, end), until(peer(scene, FINE), end)
    way = float(np.hypot(*np.diff(mine.pose[:, :2], axis=0).T).sum())
    assert way > 0.02
    assert off(theirs, mine) < 0.15 * way
    assert np.sort(mine.slip.max(axis=0))[-2] > 0.3  # two wheels of three
    assert mine.time[-1] == pytest.approx(theirs.time[-1], abs=FINE)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["onset of slip", "drift", "spin-up of a wheel", "regrip", "braking"])
def test_a_step_of_the_tasks_is_nearer_to_the_limit_than_mujoco_at_a_finer_one(name):
    """Ours at 5 ms, MuJoCo at 1 ms, from ours at 0.25 ms."""
    for robot in ("xr4000", "tidybot2"):
        scene = scene_of(robot, name)
        exact = ours(scene, OUR_STEPS[-1])
        assert off(ours(scene, OUR_STEPS[0]), exact) < 0.5 * off(peer(scene, STEPS[1]), exact)


def test_three_casters_stand_around_the_mass_centre():
    robot = on_three(load_robot("xr4000"))
    assert np.abs(np.sum([(c.x, c.y) for c in robot.casters], axis=0)).max() < 1e-12
    assert robot.caster_count == 3


def test_page_tells_what_was_compared(tmp_path):
    """Smoke of page, table and figure."""
    scenes = [one._replace(duration=0.02) for one in scenarios(load_robot("chung2008"), 0)]
    compared = []
    for scene in scenes:
        mine, theirs = ours(scene, 1e-3), peer(scene, 1e-3)
        compared.append(Comparison(scene, mine, theirs, np.array([1e-5, 1e-6, 1e-7]), np.full(len(STEPS), 1e-3)))
    write_table(tmp_path / "slip.csv", compared)
    draw_courses(tmp_path / "slip.png", compared)
    lines = (tmp_path / "slip.csv").read_text().splitlines()
    assert len(lines) == 1 + len(scenes) * (len(OUR_STEPS) + len(STEPS))
    text = page(compared, [Rate("chung2008", 3e4, 3e3, np.full(len(STEPS), 100.0))], "python -m scripts.slip_peer")
    assert "| onset of slip | first slip above 20 mm/s [ms] | chung2008 |" in text
    assert "300 (batch), 30 (one)" in text
