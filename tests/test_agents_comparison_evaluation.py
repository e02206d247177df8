"""agents.comparison.evaluation: the same episodes for every agent, in every environment, with and without features."""

from typing import Any

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal, assert_equal

from caster_gym.agents.comparison.evaluation import bare, evaluation_batch, roll_out, training_batch
from caster_gym.agents.comparison.task_settings import TaskSettings
from caster_gym.agents.control.computed_torque import ComputedTorque
from caster_gym.configuration import parse
from caster_gym.tasks.episodes import Episodes
from tests.counting import Counting

TASK = parse(
    TaskSettings,
    {
        "train": [{"shape": "random_paths", "seed": 0, "count": 3, "duration": 3.0, "max_speed": 0.3}],
        "validation": [{"shape": "random_paths", "seed": 1, "count": 2, "duration": 3.0, "max_speed": 0.3}],
        "test": [
            {"shape": "random_paths", "seed": 2, "count": 2, "duration": 3.0, "max_speed": 0.3},
            {"shape": "circle", "duration": 8.0, "radius": 0.5},
        ],
    },
    "task",
)


class Rest:
    """Asks for nothing; keeps what it saw first."""

    name = "rest"
    first: Any = None

    def act(self, observations):
        self.first = observations.copy() if self.first is None else self.first
        return np.zeros((len(observations), 6), dtype=np.float32)


def tracker(batch, frequency=10.0):
    return ComputedTorque(bare(batch).engine.layout, frequency, bare(batch).task.control_period)


FOLLOW = parse(
    TaskSettings,
    {
        "environment": "follow",
        "arena": {"beside": {"pillars": 2, "walls": 1}},
        **{
            kind: [{"shape": "random_paths", "seed": seed, "count": 2, "reversing": 0.0, "min_radius": 0.3}]
            for seed, kind in enumerate(("train", "validation", "test"))
        },
    },
    "task",
)


def assert_same(first, second):
    for name, mine, other in zip(Episodes._fields, first, second, strict=True):
        assert_equal(mine, other, name)


def test_every_path_gets_its_starts_and_every_agent_the_same():
    batch = evaluation_batch(TASK, TASK.test, starts=2)
    mine, other = (roll_out(tracker(batch, frequency), batch, seed=4) for frequency in (5.0, 15.0))
    assert mine.names == other.names == ("random_paths 0", "random_paths 1", "circle") * 2
    assert_array_equal(mine.reference, other.reference)
    assert_array_equal(mine.reference[0], np.array([one[1, :4] for one in bare(batch).engine.plan.tables] * 2))
    assert np.any(mine.pose[10] != other.pose[10], axis=1).all()
    rest, again, different = Rest(), Rest(), Rest()
    for agent, seed in ((rest, 4), (again, 4), (different, 5)):
        roll_out(agent, batch, seed)
    assert_array_equal(rest.first, again.first)
    assert np.any(rest.first != different.first, axis=1).all()
    assert np.any(rest.first[:3] != rest.first[3:], axis=1).all()  # starts on one path differ


def test_agents_with_memory_are_told_which_robots_begin_an_episode():
    """Robots leave the corridor after different times, and begin another episode while others still drive."""
    batch, agent = evaluation_batch(TASK, TASK.test, starts=1), Counting()
    episodes = roll_out(agent, batch, seed=4)
    counts = np.rint(100.0 * np.array(agent.given))
    lengths = np.isfinite(episodes.torque[..., 0]).sum(axis=0)
    assert len(set(lengths)) == 3
    for robot, length in enumerate(lengths):  # the action after the last one comes with the reset, and is ignored
        expected = np.concatenate([np.arange(1, length + 2), np.arange(1, len(counts) + 1)])[: len(counts)]
        assert_array_equal(counts[: length + 20, robot], expected[: length + 20])
    assert_same(roll_out(agent, batch, seed=4), episodes)


def test_a_roll_out_repeats_to_the_last_bit():
    batch = evaluation_batch(TASK, TASK.test, starts=1)
    first = roll_out(tracker(batch), batch, seed=4)
    assert_same(first, roll_out(tracker(batch), batch, seed=4))
    assert_same(first, roll_out(tracker(batch), evaluation_batch(TASK, TASK.test, starts=1), seed=4))


def test_series_last_as_long_as_their_paths():
    batch = evaluation_batch(TASK, TASK.test, starts=1)
    found = roll_out(tracker(batch), batch, seed=4)
    lengths = [len(one) - 1 for one in bare(batch).engine.plan.tables]
    assert lengths == [150, 150, 400]
    assert not found.failed.any()
    facts = ("names", "period", "driven", "failed", "allowed", "facts")
    for name in (name for name in Episodes._fields if name not in facts):
        series = getattr(found, name).reshape(len(found.reward), 3, -1)
        assert (~np.isnan(series)).all(axis=2).sum(axis=0).tolist() == lengths
    for robot, one in enumerate(bare(batch).engine.plan.tables):
        assert_array_equal(found.reference[: lengths[robot], robot], one[1:, :4])
    gap = np.linalg.norm((found.reference - found.pose)[..., :2], axis=-1)
    assert_allclose(gap, found.position_error, atol=1e-12)  # round-off of positions of 1 m
    limits = [motor.max_torque for caster in bare(batch).robot.casters for motor in (caster.roll, caster.steer)]
    assert_array_equal(found.share, found.torque / np.array(limits))


def test_a_failure_ends_its_series_and_is_tagged():
    """A robot that rests is left behind by paths that go further than the corridor reaches."""
    tight = TASK.model_copy(update={"task": TASK.task.model_copy(update={"corridor": 0.1})})
    batch = evaluation_batch(tight, TASK.test, starts=1)
    found = roll_out(Rest(), batch, seed=4)
    assert found.failed.all()
    lengths = np.isfinite(found.reward).sum(axis=0)
    full = np.array([len(one) - 1 for one in bare(batch).engine.plan.tables])
    assert np.all(lengths < full)
    for robot, length in enumerate(lengths):
        assert found.position_error[length - 1, robot] > 0.1
        assert np.all(found.position_error[: length - 1, robot] <= 0.1)
        assert np.isnan(found.position_error[length:, robot]).all()
    assert len(found.reward) == lengths.max()  # no step is taken for nobody


def test_a_series_that_ends_in_time_has_not_failed():
    batch = evaluation_batch(TASK, TASK.train, starts=1)
    assert not roll_out(tracker(batch), batch, seed=0).failed.any()


def test_training_runs_on_training_paths():
    batch = training_batch(TASK, 5)
    assert batch.num_envs == 5
    assert list(bare(batch).engine.plan.names) == [f"random_paths {k}" for k in range(3)]
    held_out = bare(evaluation_batch(TASK, TASK.test, starts=1)).engine.plan.tables
    for one in bare(batch).engine.plan.tables:
        assert not any(np.array_equal(one, other) for other in held_out)


def test_following_ends_at_goals_that_can_be_reached():
    """A controller arrives, within an arrival of the end and near the time of the law; one that rests does not."""
    batch = evaluation_batch(FOLLOW, FOLLOW.test, starts=2)
    found = roll_out(tracker(batch), batch, seed=4)
    assert np.isfinite(found.reward).sum(axis=0).tolist() == found.allowed.tolist()
    periods = found.allowed * found.period
    assert_allclose(periods, 1.5 * found.facts["law"], atol=found.period)  # rounded up to whole ones
    reached = np.nanmax(found.progress, axis=0)
    assert np.all(reached >= found.facts["goal"])
    assert_allclose(reached, found.facts["goal"], atol=0.011)  # an arrival of 1 cm before the end, which none passes
    arrived = (found.progress >= found.facts["goal"]).argmax(axis=0) * found.period
    assert_allclose(arrived, found.facts["law"], rtol=0.1)
    assert np.all(np.nanmin(found.clearance, axis=0) > 0.0)
    rest = roll_out(Rest(), batch, seed=4)
    assert np.all(np.nanmax(rest.progress, axis=0) < rest.facts["goal"])


def test_a_timetable_has_no_goal():
    batch = evaluation_batch(TASK, TASK.test, starts=1)
    found = roll_out(tracker(batch), batch, seed=4)
    assert not found.facts
    assert found.allowed.tolist() == [150, 150, 400]
    assert np.all(np.isnan(found.clearance) | np.isinf(found.clearance))


def with_features(settings, **features):
    return parse(TaskSettings, {**settings.model_dump(mode="json"), **features}, "task")


@pytest.mark.slow
@pytest.mark.parametrize("settings", [TASK, FOLLOW], ids=["track", "follow"])
def test_rewards_are_those_of_the_task_alone(settings):
    """Terms that wrappers or shaping add change no episode and no reward that is told."""
    term = {"kind": "tolerance", "quantity": "position_error", "margin": 0.1, "weight": 5.0}
    batch = evaluation_batch(settings, settings.test, starts=1)
    plain = roll_out(tracker(batch), batch, seed=4)
    shaped = with_features(settings, shaping=[term])
    assert_same(plain, roll_out(tracker(batch), evaluation_batch(shaped, settings.test, starts=1), seed=4))
    wrapped = with_features(settings, wrappers=[term])
    found = roll_out(tracker(batch), evaluation_batch(wrapped, settings.test, starts=1), seed=4)
    assert_array_equal(found.reward, plain.reward)
    assert_array_equal(found.pose, plain.pose)


def test_shaping_is_for_training_and_wrappers_are_for_both():
    term = {"kind": "tolerance", "quantity": "position_error", "margin": 0.1, "weight": 5.0}
    settings = with_features(FOLLOW, shaping=[term], wrappers=["motor_lag"])
    batches: list[Any] = [training_batch(settings, 2), evaluation_batch(settings, settings.test, starts=1)]
    kinds = [[feature.model_dump()["kind"] for feature in batch.features] for batch in batches]
    assert kinds == [["motor_lag", "tolerance"], ["motor_lag"]]


def test_what_wrappers_make_of_actions_is_no_saturation():
    """Motors that lag give less than what was asked, though no limit cuts it."""
    settings = with_features(TASK, wrappers=[{"kind": "motor_lag", "time_constant": 0.05}])
    batch = evaluation_batch(settings, settings.test, starts=1)
    found = roll_out(tracker(batch), batch, seed=4)
    assert_array_equal(found.command, found.share)
