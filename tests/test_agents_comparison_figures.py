"""caster_gym.agents.comparison.figures: what is drawn is what there was."""

import matplotlib as mpl
import numpy as np
import pytest
from numpy.testing import assert_allclose

mpl.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.patches import Circle, Polygon

from caster_gym.agents.comparison.evaluation import bare, evaluation_batch, roll_out
from caster_gym.agents.comparison.figures import draw_learning, draw_obstacles, draw_path, draw_speeds, learning_curves
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.comparison.validation import Validation
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.configuration import parse
from caster_gym.tasks.follow.metrics import FollowVerdict
from caster_gym.tasks.task import Pictures

PATHS = {"train": [{"shape": "ellipse"}], "validation": [{"shape": "lemniscate"}], "test": [{"shape": "circle"}]}
ARENA = {
    "half_planes": [{"point": [0.0, -2.0], "normal": [0.0, 1.0]}],
    "pillars": [{"centre": [0.0, 0.2], "radius": 0.3}],
    "walls": [{"start": [2.0, -1.0], "end": [2.0, 1.0], "thickness": 0.2}],
}
COLOURS = {"computed torque": "red"}


@pytest.fixture(scope="module")
def driven():
    """A plan with a circle among obstacles, and an episode of a controller on it."""
    settings = parse(TaskSettings, {**PATHS, "environment": "follow", "arena": ARENA}, "task")
    batch = evaluation_batch(settings, settings.test, starts=1)
    engine, task = bare(batch).engine, bare(batch).task
    return engine.plan, {
        "computed torque": roll_out(ComputedTorque(engine.layout, 10.0, task.control_period), batch, 3)
    }


@pytest.fixture
def axis():
    figure, axis = plt.subplots()
    yield axis
    plt.close(figure)


def test_obstacles_stand_where_they_are(driven, axis):
    draw_obstacles(axis, driven[0], 0)
    circles = [patch for patch in axis.patches if isinstance(patch, Circle)]
    assert [(patch.center, patch.radius) for patch in circles] == [((0.0, 0.2), 0.3)]
    (wall,) = (patch for patch in axis.patches if isinstance(patch, Polygon))
    corners = {(round(x, 9), round(y, 9)) for x, y in wall.get_xy()}
    assert corners == {(1.9, -1.0), (2.1, -1.0), (2.1, 1.0), (1.9, 1.0)}
    (line,) = axis.lines  # of the half-plane
    assert_allclose([line.get_xy1()[1], line.get_xy2()[1]], -2.0)


def test_paths_are_drawn_as_they_were_driven(driven, axis):
    plan, episodes = driven
    draw_path(axis, episodes, 0, COLOURS, plan, Pictures())
    lines = {line.get_label(): line.get_xydata() for line in axis.lines}
    assert_allclose(np.hypot(*lines["path"].T), 1.0)
    assert_allclose(lines["computed torque"], episodes["computed torque"].pose[:, 0, :2])


def test_speeds_are_drawn_over_the_way(driven, axis):
    """A controller keeps to the time law, in its middle to 1 %."""
    plan, episodes = driven
    draw_speeds(axis, episodes, 0, COLOURS, plan)
    lines = {line.get_label(): line.get_xydata() for line in axis.lines}
    law, mine = lines["time law"], lines["computed torque"]
    assert_allclose(law[-1, 0], 2.0 * np.pi, rtol=1e-4)
    middle = mine[(mine[:, 0] > 1.0) & (mine[:, 0] < 5.0)]
    assert len(middle) > 100
    assert_allclose(middle[:, 1], np.interp(middle[:, 0], *law.T), rtol=0.01)


def test_learning_shows_each_seed_where_it_has_a_number(axis):
    verdicts = [FollowVerdict(share, 0.01, 0.1, 0.0, 0, 0, 1.0) for share in (np.inf, 1.2, 0.9)]
    history = [Validation(k, 10.0 * k, verdict) for k, verdict in enumerate(verdicts)]
    curves = learning_curves({"seed 0": history})
    assert list(curves) == ["lap_share", "cross_track_rmse"]
    draw_learning(axis, {"seed 0": history, "seed 1": history[1:]}, "lap_share", curves["lap_share"])
    first, second = (line.get_xydata() for line in axis.lines)
    assert_allclose(first, [[0.0, np.nan], [10.0, 120.0], [20.0, 90.0]])
    assert_allclose(second, [[10.0, 120.0], [20.0, 90.0]])
    assert learning_curves({}) == {}
