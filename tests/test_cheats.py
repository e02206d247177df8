"""Rewards of tasks along paths: nobody earns by a trick what computed torque earns by following."""

import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from caster_gym.agents.comparison.evaluation import bare, make_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.envs.plan import SPAN
from caster_gym.shipped_files import names_of, read_settings
from caster_gym.tasks.follow.environment import CasterFollowVectorEnv
from caster_gym.tasks.track.environment import CasterTrackVectorEnv
from tests.cheats import CHEATS, Cheat, FullTorque, scores

PATHS = [
    {"shape": "random_paths", "count": 2, "seed": 5, "reversing": 0.0, "min_radius": 0.25, "duration": 6.0},
    {"shape": "lemniscate", "width": 1.0, "duration": 9.0},
    {"shape": "circle", "radius": 0.4, "duration": 6.0},
]
ARENA = {"beside": {"pillars": 3, "walls": 2, "gap": [0.04, 0.12]}}
ROBOTS = 8  # two on each path, all from different starts
SEED = 0


@pytest.fixture(scope="module", params=[CasterFollowVectorEnv, CasterTrackVectorEnv], ids=["follow", "track"])
def task(request):
    """A batch with obstacles beside all paths, and what computed torque earns there (robots,)."""
    batch = request.param(ROBOTS, path=PATHS, arena=ARENA)
    agent = ComputedTorque(batch.engine.layout, 10.0, batch.task.control_period)
    return batch, scores(agent, batch, SEED)


def cheat(batch, name):
    return Cheat(batch.engine.layout, batch.task.control_period, CHEATS[name])


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEATS)
def test_no_cheat_earns_what_computed_torque_earns(task, name):
    """On no path and from no start; by a tenth at least, so that it is no matter of luck."""
    batch, honest = task
    assert (scores(cheat(batch, name), batch, SEED) < 0.9 * honest).all()


def test_full_torque_earns_little(task):
    batch, honest = task
    assert (scores(FullTorque(6), batch, SEED) < 0.5 * honest).all()


def test_computed_torque_earns_most_of_what_there_is(task):
    """Of progress and quality, beside the term `alive`; at the start there is the displacement to be overcome."""
    batch, honest = task
    steps = batch.engine.plan.source.spans[np.arange(ROBOTS) % 4, SPAN.periods]
    alive = batch.task.effort_weight + batch.task.impact_weight
    assert (honest - alive * steps > 0.7 * steps).all()


def test_a_parked_robot_earns_hardly_more_than_alive():
    """What little effort parking takes, and up to 3 cm of way from the start, which count in full once."""
    batch = CasterFollowVectorEnv(ROBOTS, path=PATHS, arena=ARENA)
    steps = batch.engine.plan.source.spans[np.arange(ROBOTS) % 4, SPAN.periods]
    earned = scores(cheat(batch, "park"), batch, SEED)
    assert (earned > 0.51 * steps).all()
    assert (earned < 0.52 * steps + 1.5).all()


@pytest.mark.parametrize(("name", "touching"), [("ram", ROBOTS), ("scrape", ROBOTS // 2)])
def test_cheats_that_should_touch_obstacles_do(name, touching):
    """They test the cost of impacts: who rams does on every path, who scrapes where there is something to lean on."""
    batch = CasterFollowVectorEnv(ROBOTS, path=PATHS, arena=ARENA)
    agent = cheat(batch, name)
    observations, _ = batch.reset(seed=SEED, options={"path": np.arange(ROBOTS) % 4})
    pressing = np.zeros(ROBOTS)
    for _ in range(120):
        observations, *_, info = batch.step(agent.act(observations))
        pressing += info["normal_impulse"]
    assert (pressing > 0.1).sum() >= touching


# most cheats steer by the path ahead; what tempts a robot that holds a pose is in tests/test_tasks_hold.py
TASKS = [name for name in names_of("tasks") if read_settings(TaskSettings, "tasks", name).task.preview]


@pytest.fixture(scope="module", params=TASKS)
def configured(request):
    """Eight validation paths of a task of the package, its rewards shaped, and what computed torque earns there.

    The honest one drives where the floor grips: on ice it fails on some paths, as it may.
    """
    settings = read_settings(TaskSettings, "tasks", request.param)
    few = tuple(path.model_copy(update={"count": ROBOTS}) for path in settings.validation)
    grips = settings.model_copy(update={"task": settings.task.model_copy(update={"floor": "grip"})})
    honest, batch = (
        make_batch(one, few, ROBOTS, AutoresetMode.NEXT_STEP, (*settings.wrappers, *settings.shaping))
        for one in (grips, settings)
    )
    plain = bare(batch)
    agent = ComputedTorque(plain.engine.layout, 10.0, plain.task.control_period)
    return batch, plain, scores(agent, honest, SEED)


@pytest.mark.slow
@pytest.mark.parametrize("name", CHEATS)
def test_no_cheat_is_paid_under_the_shaping_of_a_configuration(configured, name):
    """The same as above, of what a policy is trained on."""
    batch, plain, honest = configured
    assert (
        scores(Cheat(plain.engine.layout, plain.task.control_period, CHEATS[name]), batch, SEED) < 0.95 * honest
    ).all()
