"""CONTRIBUTING.md: its recipes give what they promise."""

import re
import textwrap
from pathlib import Path

import gymnasium as gym
import numpy as np
from numpy.testing import assert_allclose

import caster_gym
from caster_gym.arena import arena, distances

TEXT = (Path(__file__).resolve().parent.parent / "CONTRIBUTING.md").read_text(encoding="utf-8")


def recipe(title, language):
    """The first block of code of a section."""
    section = TEXT[TEXT.index(f"## {title}\n") :]
    block = re.search(rf"^ *```{language}\n(.*?)^ *```", section, re.M | re.S)
    return textwrap.dedent(block[1])


def test_the_five_caster_robot_can_be_driven(tmp_path, recwarn):
    file = tmp_path / "five.yaml"
    file.write_text(recipe("Add a robot", "yaml"), encoding="utf-8")
    robot = caster_gym.load_robot(file)
    pivots = np.array([complex(caster.x, caster.y) for caster in robot.casters])
    assert_allclose(pivots, 0.25 * np.exp(2j * np.pi * np.arange(5) / 5), atol=1e-4)  # as many digits as the file has
    assert gym.make("caster_gym:CasterTrack-v0", robot=str(file), path="circle").action_space.shape == (10,)
    assert not list(recwarn)  # none of its numbers is implausible, and its motors can always push it


def test_the_new_kind_of_obstacle_is_where_it_says():
    known = dict(vars(arena))
    exec(recipe("Add an obstacle kind", "python"), known)
    barrel = known["Barrel"](start=(1.0, -1.0), end=(1.0, 1.0), radius=0.2)

    class Yard(arena.Arena):
        @property
        def obstacles(self):
            return ((f"barrel 1 {barrel}", barrel),)

    robot = caster_gym.load_robot("chung2008")  # a disc of 0.15 m
    gaps, _ = distances(Yard(), robot, [[0.0, 0.0, 0.0], [1.0, 2.0, 0.0], [3.0, 2.0, 0.0]])
    by_hand = np.array([1.0, 1.0, np.hypot(2.0, 1.0)]) - 0.2 - 0.15  # to the side, beyond the end, from the corner
    assert_allclose(gaps[:, 0], by_hand, rtol=1e-12)  # rounding
