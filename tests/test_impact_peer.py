"""Impacts against MuJoCo, whose wheels roll or slip by the friction of its floor."""

from pathlib import Path

import numpy as np
import pytest

from caster_gym import Model, load_robot
from caster_gym.shipped_files import names_of
from scripts.impact_peer import (
    FRONT,
    RESTITUTION,
    SPEED,
    Impact,
    compare,
    damped_spring,
    page,
    run_into_wall,
    steering_of,
    write_table,
)

GRIP = 1e3  # friction of a floor on which nothing slips


@pytest.mark.slow
@pytest.mark.parametrize("name", names_of("robots"))
def test_on_a_floor_that_holds_mujocos_impulse_is_ours(name):
    """The wheels' inertia answers as the equations say; MuJoCo lets casters turn during its contact, by up to 20°."""
    robot = load_robot(name)
    for draw in range(4):
        steering = steering_of(robot, draw)
        ours, _ = Model(robot).collide(steering, [SPEED, 0.0, 0.0], [FRONT, 0.0], [-1.0, 0.0], RESTITUTION)
        theirs, _, loose = run_into_wall(robot, steering, GRIP)
        assert theirs == pytest.approx(ours[0], rel=0.08)
        assert ours[0] > loose


@pytest.mark.slow
def test_on_a_floor_that_cannot_hold_it_the_robot_is_nearly_free():
    """tidybot2 asks for 14 to 50 times what its floor has: its wheels slip, and the wall meets its body."""
    robot = load_robot("tidybot2")
    found = [compare(robot, draw) for draw in range(6)]
    for one in found:
        assert one.traction > 10.0
        # the floor gives a share of what it has within the contact: up to 17 N s in the direction of the wall
        assert one.loose_impulse < one.peer_impulse < one.loose_impulse + 20.0
        assert one.impulse > 1.3 * one.loose_impulse
    ours, theirs = (np.median([getattr(one, name) for one in found]) for name in ("sideways", "peer_sideways"))
    assert ours > 5.0 * theirs


def test_the_walls_spring_has_our_restitution():
    """Integrated in small steps, until it pulls."""
    damping, rate = damped_spring()
    x, v, h = 0.0, 1.0, 1e-7
    force = lambda: rate * rate * x + 2.0 * damping * rate * v  # noqa: E731
    while force() >= 0.0:
        v -= h * force()
        x += h * v
    assert -v == pytest.approx(RESTITUTION, rel=1e-3)  # of first order in a step of a hundred thousandth


def test_the_page_of_the_equations_shows_the_published_table():
    docs = Path(__file__).parents[1] / "docs"
    published = (docs / "truth" / "impacts.md").read_text(encoding="utf-8")
    rows = [line for line in published.splitlines() if line.startswith("| ")]
    assert len(rows) == 4
    assert "\n".join(rows[1:]) in (docs / "equations.md").read_text(encoding="utf-8")


def test_page_tells_what_was_compared(tmp_path):
    """Smoke of page and table."""
    one = Impact("chung2008", 0, 4.6, 0.05, 0.9, 4.7, 0.05, 4.4)
    write_table(tmp_path / "impacts.csv", [one])
    assert len((tmp_path / "impacts.csv").read_text().splitlines()) == 2
    assert "| chung2008 | 4.6 (4.6 – 4.6) | 4.7 " in page([one], "python -m scripts.impact_peer")
