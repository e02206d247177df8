"""The section on lines of any robot: its samples are what it says."""

import numpy as np
import pytest

from papers.analysis.action_lines import action_lines, meeting
from papers.kim2001.lines import compare_random, compare_singular, section, singular_configurations


def test_the_geometry_and_the_rank_say_the_same():
    """(L4) on robots of the section's own making."""
    found = compare_random(seed=5, robots=20, configurations=100)
    assert found.gap.shape == found.singular_value.shape == found.joints.shape == (2000,)
    low, high = found.bounds
    assert low > 1.0 - 1e-9 and high < 1.0 + 1e-9  # the bounds themselves, up to rounding
    assert set(found.joints) >= {3.0, 4.0, 5.0}


def test_configurations_made_singular_are():
    found = compare_singular(seed=6, robots=50)
    assert found.gap.shape == (50,)
    assert found.met.all()
    assert found.gap.max() < 1e-12 and found.singular_value.max() < 1e-12  # rounding


def test_configurations_made_singular_are_of_three_kinds():
    """Lines that meet far away, or are parallel, one a caster; and both of one caster with others through its wheel."""
    made = list(singular_configurations(np.random.default_rng(8), 60))
    for k, (robot, joints, steering) in enumerate(made):
        casters = [joint.split("_")[1] for joint in joints]
        met = meeting(action_lines(robot, steering, joints), 1.0)
        assert len(joints) >= 3
        assert len(set(casters)) == len(casters) - (k % 3 == 2)
        assert met.singular and met.parallel == (k % 3 == 1)
    assert any(len({joint.split("_")[1] for joint in joints}) < robot.caster_count for robot, joints, _ in made)


def test_turning_away_goes_through_all_sizes():
    found = compare_singular(seed=7, robots=20, away=True)
    assert found.gap.min() < 1e-13 and found.gap.max() > 0.1
    counts, _ = np.histogram(np.log10(found.gap), bins=np.arange(-13.0, 0.0))
    assert (counts > 0).all()


def test_every_statement_agrees():
    made = section()
    assert len(made.checks) == 2 and all(check.agrees for check in made.checks)
    assert "100,000 random configurations" in made.text
    assert len(made.pictures) == 1


@pytest.mark.parametrize("seed", [0, 1])
def test_the_same_seed_gives_the_same_page(seed):
    first, second = (compare_random(seed, robots=3, configurations=10) for _ in range(2))
    np.testing.assert_array_equal(first.gap, second.gap)
