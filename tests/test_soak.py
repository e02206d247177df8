"""scripts.soak: a long run looks at every step of every robot, and finds what is wrong."""

import numpy as np
import pytest

from scripts import soak
from scripts.soak_laws import not_finite
from scripts.soak_page import GROWTH, faults_of
from scripts.soak_scenes import KINDS, TASKS, draw_leg


def test_legs_are_drawn_from_seed_and_number_and_kinds_take_turns():
    legs = [draw_leg(0, number) for number in range(KINDS)]
    assert len({(leg.robot, leg.task) for leg in legs}) == KINDS
    assert {leg.task for leg in legs} == set(TASKS)
    assert draw_leg(0, 5) == legs[5] != draw_leg(1, 5)


def test_numbers_that_are_not_finite_are_found_wherever_they_are():
    infos = {"a": np.zeros(2), "b": {"c": np.array([0.0, np.nan])}, "d": np.array([None, np.array([np.inf])], object)}
    assert list(not_finite("infos", infos)) == ["infos['b']['c']", "infos['d']"]


@pytest.mark.slow
def test_a_short_run_finds_nothing_and_goes_on(tmp_path):
    """Of the first kind of legs alone, whose code other tests compile too."""
    page, few = tmp_path / "soak.md", ["--robots", "8", "--periods", "20"]
    assert soak.main([*few, "--steps", "160", "--out", str(page)]) == 0
    with pytest.raises(SystemExit, match="go on with --resume"):
        soak.main([*few, "--steps", "160", "--out", str(page)])
    first = soak.read_rows(tmp_path / "soak" / "legs.csv")
    assert [(row.leg, row.steps, row.faults) for row in first] == [(0, 160, "")]
    assert soak.main([*few, "--steps", "160", "--out", str(page), "--resume"]) == 0  # nothing is left to do
    assert soak.read_rows(tmp_path / "soak" / "legs.csv") == first
    assert "Nothing was found." in page.read_text(encoding="utf-8")


@pytest.mark.slow
def test_energy_from_nowhere_and_walls_that_are_passed_are_found(monkeypatch):
    """As if the motors had done no work, and the walls stood 10 m further in."""
    monkeypatch.setattr(soak, "EXPLAINED", -2.0)
    monkeypatch.setattr(soak, "DEEPEST", -10.0)
    row = soak.run_leg(draw_leg(0, 0), 0, 8, 2, 1)
    assert "from nowhere" in row.faults and "inside an obstacle" in row.faults


def test_memory_that_grows_after_the_first_round_is_found(tmp_path):
    """What a round of kinds compiles is no growth, nor what the processes before this one held."""
    row = soak.Row._make(kind() for kind in soak.Row.__annotations__.values())
    first = [row._replace(process=1, memory=100.0 * (1 + number)) for number in range(KINDS)]
    steady = [row._replace(process=1, memory=memory) for memory in (1210.0, 1190.0, 1205.0) * 3]
    other = [row._replace(process=2, memory=900.0)]
    assert faults_of(first + steady) == faults_of(first + steady + other) == []
    grown = [one._replace(memory=one.memory * (1.0 + 2.0 * GROWTH)) for one in steady]
    assert faults_of([*first, *steady, *grown, *grown]) == ["memory grew from 1205 to 1326 MB"]
