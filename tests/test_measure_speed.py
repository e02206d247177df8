"""The arithmetic of the measurement of speed, and a smoke test of all that it measures in this process."""

from dataclasses import dataclass

import numpy as np
import pytest

from caster_gym import load_robot
from caster_gym.arena import Arena
from scripts.speed_accuracy import measure_accuracy
from scripts.speed_control import control_rows
from scripts.speed_growth import field, growth_table, line, with_casters
from scripts.speed_limits import Counted, limits_text, operations_of_a_step
from scripts.speed_page import RATIOS, Occasion, page
from scripts.speed_peers import MUJOCO_STEP, peer_rows
from scripts.speed_robots import COARSE_STEP, RK4_STEP, bare_rows, environment_rows, single_rows
from scripts.speed_timing import Ratio, Row, Work, at_least, at_most, rate, run, shown, spread

ROBOT = load_robot("chung2008")
TENSORS = {"torch", "torch_env", "torch_env_core", "cuda", "cuda_env"}  # keys of rows that are not measured here
SESSION = Occasion("python -m scripts.measure_speed", 1, 1e-9, 1, (0.0, 0.0), True)


@pytest.mark.parametrize(
    ("goal", "value", "reached"),
    [
        (at_least(25.0), 25.0, True),
        (at_least(25.0), 24.9, False),
        (at_most(5.0), 5.0, True),
        (at_most(5.0), 5.1, False),
    ],
)
def test_what_is_better_when_greater_must_be_great_and_the_rest_small(goal, value, reached):
    assert goal.reached(value) is reached


@dataclass
class Clock:
    """A clock that only moves when it is told to. [s]"""

    now: float = 0.0

    def pass_by(self, seconds: float) -> None:
        self.now += seconds


@pytest.fixture
def clock(monkeypatch):
    stopped = Clock()
    monkeypatch.setattr("scripts.speed_timing.time.perf_counter", lambda: stopped.now)
    return stopped


def test_rate_counts_steps_over_the_time_they_took(clock):
    """Ten steps in each half second; neither the first call nor what comes before a call counts."""
    durations = iter([100.0] + [0.5] * 100)

    def call():
        clock.pass_by(next(durations))
        return 10

    assert rate(Work(call, lambda: clock.pass_by(7.0)), 2.0) == 20.0


def test_every_row_is_measured_in_every_turn_or_in_as_many_as_it_wants():
    order = []

    def row(key, turns=None):
        def measured():
            order.append(key)
            return float(len(order))

        return Row(key, key, "s", measured, turns=turns)

    measured = run([row("a"), row("b"), row("c", turns=1)], 3)
    assert {key: len(values) for key, values in measured.items()} == {"a": 3, "b": 3, "c": 1}
    # interleaved: each turn, of three rows and then of two, holds every row of it once
    assert [sorted(order[:3]), sorted(order[3:5]), sorted(order[5:])] == [["a", "b", "c"], ["a", "b"], ["a", "b"]]


def test_two_rows_of_one_key_are_refused():
    with pytest.raises(ValueError, match="same key"):
        run([Row("a", "a", "s", lambda: 1.0)] * 2, 1)


def test_ratios_are_taken_turn_by_turn():
    """A machine that is twice as slow in one turn does not show, as it would in a ratio of medians' spreads."""
    measured = {"ours": [100.0, 50.0, 90.0], "theirs": [10.0, 5.0, 9.0], "other": [4.0]}
    assert Ratio("", "ours", "theirs", 2.0).values(measured) == [20.0, 20.0, 20.0]
    assert Ratio("", "ours", "other").values(measured) == [25.0]
    assert Ratio("", "ours", "not measured").values(measured) == []


@pytest.mark.slow
def test_what_limits_the_engines_is_told_of_torch_and_a_gpu_where_they_are(accuracy):
    """Shares are taken turn by turn: half of the speed in both turns is 50 %, though the second turn is a slow one."""
    ours = "bare bare_cores bare_one one one_beneath one_engine engine_cores env_fewer"
    fast = {key: [8.0, 2.0] for key in f"{ours} mujoco torch torch_env torch_env_core env cuda cuda_env".split()}
    measured = {**GROWTH, **fast, "bare_periods": [4.0, 1.0], "env_cores": [1.0, 0.25]}
    text = " ".join(limits_text(measured, accuracy, 4000).split())
    assert "50 % of the speed is left" in text
    assert "takes 50 % of a control period" in text
    assert "makes 1.00 times as many bare steps as Numba" in text
    assert "A second core makes it 1.00 times as fast" in text
    assert "The GPU makes 1.0 times" in text
    without = limits_text({**measured, "torch": [], "cuda": []}, accuracy, 4000)
    assert "Torch" not in without
    assert "GPU" not in without


def test_spread_is_the_middle_half():
    assert spread([0.0, 1.0, 2.0, 3.0, 100.0]) == "1 – 3"
    assert spread([1.0]) == ""


@pytest.mark.parametrize(("value", "text"), [(1234567.0, "1,230,000"), (999.7, "1,000"), (12.34, "12.3"), (0.5, "0.5")])
def test_three_digits_are_shown(value, text):
    assert shown(value) == text


def test_operations_are_counted_once_each():
    Counted.done = 0
    x = Counted(3.0)
    assert 2.0 * x + x / 4.0 - 1.0 == 5.75
    assert Counted.done == 4  # one of each sign


def test_operations_grow_in_proportion_to_casters():
    """A step is a part for the platform and the same part for each caster."""
    two, three, four = (operations_of_a_step(with_casters(ROBOT, count)) for count in (2, 3, 4))
    assert four - three == three - two > 0


def test_casters_of_the_growing_robot_stand_on_a_circle():
    robot = with_casters(ROBOT, 7)
    places = np.array([(caster.x, caster.y) for caster in robot.casters])
    np.testing.assert_allclose(np.hypot(*places.T), np.hypot(ROBOT.casters[0].x, ROBOT.casters[0].y), rtol=1e-12)
    sides = np.hypot(*(places - np.roll(places, 1, axis=0)).T)
    np.testing.assert_allclose(sides, sides[0], rtol=1e-12)  # rounding of sines


def test_fields_of_more_pillars_hold_those_of_fewer():
    few, many = (set(Arena.model_validate(field(count)).pillars) for count in (4, 64))
    assert field(0) is None
    assert few < many
    assert len(many) == 64


@pytest.fixture(scope="module")
def accuracy():
    return measure_accuracy(ROBOT, 3)


@pytest.mark.slow
def test_ours_is_exact_where_mujoco_slips(accuracy):
    """A thousandth of MuJoCo's error at more than twice its step; the wheels of its robot slip, but mostly roll."""
    assert MUJOCO_STEP < 0.5 * RK4_STEP
    assert accuracy.over.min() > 1000.0
    assert all(0.001 < slip < 0.05 for slip in accuracy.slips)


@pytest.mark.slow
def test_ours_is_of_fourth_order(accuracy):
    """Half of the step leaves a sixteenth of the error; steps this long leave room for higher orders."""
    order = accuracy.ours[COARSE_STEP] / accuracy.ours[RK4_STEP]
    assert ((order > 12.0) & (order < 24.0)).all()


GROWTH = {
    **{f"robots_{kind}_{count}": [10.0 * count] for kind in ("bare", "env") for count in (1, 64, 1024)},
    **{f"casters_bare_{count}": [1e6 / count] for count in (2, 8)},
    **{f"obstacles_{kind}_{count}": [1e6 / (1 + count)] for kind in ("bare", "env") for count in (0, 64)},
}


def test_lines_of_growth_are_found_among_all_rows():
    assert line({**GROWTH, "bare": [1.0]}, "casters", "bare") == {2: [5e5], 8: [1.25e5]}
    assert "| robots | 1,024 | 1.02e+04 | 1.02e+04 |" in growth_table(GROWTH)
    assert "| casters | 8 | 1.25e+05 |  |" in growth_table(GROWTH)


@pytest.fixture(scope="module")
def sections():
    """All rows that need no process and no compiler of their own."""
    name = "chung2008"
    ours = [*bare_rows(ROBOT, 1, 1e-9), *environment_rows(name, 1, 1e-9), *single_rows(name, 1e-9)]
    ours += control_rows(ROBOT, 1e-9)
    return [("Ours", "Ours.", ours), ("Peers", "Theirs.", peer_rows(ROBOT, name, 1, 1e-9))]


@pytest.mark.slow
def test_everything_is_measured_and_shown(sections, accuracy):
    """Smoke: one call of each row; every goal has its verdict, every ratio of what was measured its line."""
    rows = [row for _, _, those in sections for row in those]
    measured = {**run(rows, 1), **GROWTH}
    assert all(value > 0.0 for values in measured.values() for value in values)
    text = page(sections, measured, accuracy, "chung2008", 4000, "speed", SESSION)
    assert all(f"| {row.name} |" in text for row in rows)
    ratios = [ratio for ratio in RATIOS if {ratio.over, ratio.under} <= measured.keys()]
    assert all((f"| {ratio.name} |" in text) is (ratio in ratios) for ratio in RATIOS)
    of_errors = 2  # MuJoCo's over ours, and ours
    verdicts = text.count("| reached |") + text.count("| **missed** |")
    assert verdicts == sum(one.goal is not None for one in [*rows, *ratios]) + of_errors
    assert "nan" not in text


@pytest.mark.slow
def test_rows_that_ratios_compare_exist(sections):
    """A key with a spelling mistake would make its ratio vanish from the page. Torch and a GPU may be missing here."""
    keys = {row.key for _, _, those in sections for row in those} | TENSORS
    assert all({ratio.over, ratio.under} <= keys for ratio in RATIOS)
