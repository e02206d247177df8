"""caster_gym.agents.evaluation: metrics of hand-made episodes, and the same episodes for every agent."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal

from caster_gym.agents.computed_torque import ComputedTorque
from caster_gym.agents.evaluation import Episodes, Metrics, measure, roll_out, test_batch, training_batch
from caster_gym.agents.settings import TaskSettings
from caster_gym.configuration import parse

test_batch.__test__ = False  # a name that pytest would take for a test

PERIOD = 0.5
STEPS = 6  # three seconds, of which the first two are transient
SETTLING = 2.0
MOTORS = 4
DRIVEN = [0, 2]
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


def episodes(lengths=(STEPS,), **changed):
    """Episodes of zeros that last so many steps, with NaN behind; changed fields must have their full shape."""
    count = len(lengths)
    shapes = {
        "position_error": (STEPS, count),
        "heading_error": (STEPS, count),
        "torque": (STEPS, count, MOTORS),
        "share": (STEPS, count, MOTORS),
        "command": (STEPS, count, len(DRIVEN)),
        "pose": (STEPS, count, 4),
        "reference": (STEPS, count, 4),
        "reward": (STEPS, count),
    }
    fields = {name: np.array(np.broadcast_to(changed.get(name, 0.0), shape)) for name, shape in shapes.items()}
    for field in fields.values():
        for episode, length in enumerate(lengths):
            field[length:, episode] = np.nan
    failed = np.array([length < STEPS for length in lengths])
    return Episodes(("path",) * count, PERIOD, **fields, failed=failed)


def measured(*arguments, **changed):
    return measure(episodes(*arguments, **changed), SETTLING, DRIVEN)


def column(*values):
    return np.array(values, dtype=np.float64)[:, None]


def test_transient_and_steady_errors_are_apart():
    found = measured(position_error=column(1, 1, 1, 5, 3, 4), heading_error=column(2, -2, 2, -2, 0.3, -0.4))
    assert found.position_rmse == pytest.approx([np.sqrt((9 + 16) / 2)])
    assert found.heading_rmse == pytest.approx([np.sqrt((0.09 + 0.16) / 2)])
    assert found.worst_position == pytest.approx([4.0])
    assert found.position_rmse_transient == pytest.approx([np.sqrt((1 + 1 + 1 + 25) / 4)])
    assert found.heading_rmse_transient == pytest.approx([2.0])
    assert found.failed.tolist() == [0.0]


def test_what_comes_after_the_end_of_an_episode_does_not_count():
    """The first ends a step after settling, the second not at all."""
    found = measured((5, STEPS), position_error=np.repeat(column(1, 1, 1, 1, 3, 7), 2, axis=1), reward=2.0)
    assert found.position_rmse == pytest.approx([3.0, np.sqrt((9 + 49) / 2)])
    assert found.worst_position == pytest.approx([3.0, 7.0])
    assert found.reward == pytest.approx([2.0, 2.0])
    assert found.failed.tolist() == [1.0, 0.0]


def test_a_failure_before_settling_has_no_steady_values():
    found = measured((3,), position_error=column(1, 2, 2, 9, 9, 9))
    for name in ("position_rmse", "heading_rmse", "worst_position"):
        assert np.isnan(getattr(found, name)).all()
    assert found.position_rmse_transient == pytest.approx([np.sqrt(3.0)])
    assert found.failed.tolist() == [1.0]
    others = [name for name in Metrics._fields if name not in ("position_rmse", "heading_rmse", "worst_position")]
    assert all(np.isfinite(getattr(found, name)).all() for name in others)


def test_torque_variation_is_the_way_of_the_shares_per_second():
    """One driven motor goes up and down by 0.5 in every step, the other rests; motors that are not driven are not
    asked."""
    share = np.zeros((STEPS, 1, MOTORS))
    share[::2, 0, 0] = 0.5
    share[:, 0, 1] = np.arange(STEPS)
    way = 0.5 * (STEPS - 1) / (STEPS * PERIOD)
    assert measured(share=share).torque_variation == pytest.approx([way / 2])
    short = share.repeat(2, axis=1)
    ways = measured((3, STEPS), share=short).torque_variation
    assert ways == pytest.approx([0.5 * 2 / (3 * PERIOD) / 2, way / 2])


def test_effort_and_peak_torque():
    share = np.zeros((STEPS, 1, MOTORS))
    share[..., 0], share[..., 2] = 0.6, -0.8
    torque = 0.2 * share
    torque[2, 0, 2] = -0.7
    found = measured(share=share, torque=torque)
    assert found.effort == pytest.approx([(0.36 + 0.64) / 2])
    assert found.peak_torque == pytest.approx([0.7])


def test_saturation_counts_commands_at_the_limit_and_torques_that_were_cut():
    """One of twelve was asked at the limit, one got less than it asked for."""
    share = np.zeros((STEPS, 1, MOTORS))
    command = np.zeros((STEPS, 1, 2))
    command[0, 0, 0], share[0, 0, 0] = 1.0, 1.0
    command[3, 0, 1], share[3, 0, 2] = -0.8, -0.5
    command[4, 0, 1], share[4, 0, 2] = 0.4, 0.4
    assert measured(share=share, command=command).saturation == pytest.approx([2 / 12])
    assert measured((2,), share=share, command=command).saturation == pytest.approx([1 / 4])


class Rest:
    """Asks for nothing; keeps what it saw first."""

    name = "rest"
    first = None

    def act(self, observations):
        self.first = observations.copy() if self.first is None else self.first
        return np.zeros((len(observations), 6), dtype=np.float32)


def tracker(batch, frequency=10.0):
    return ComputedTorque(batch.engine.layout, frequency, batch.task.control_period)


def assert_same(first, second):
    for name, mine, other in zip(Episodes._fields, first, second, strict=True):
        assert_array_equal(mine, other, name)


def test_every_path_gets_its_starts_and_every_agent_the_same():
    batch = test_batch(TASK, TASK.test, starts=2)
    mine, other = (roll_out(tracker(batch, frequency), batch, seed=4) for frequency in (5.0, 15.0))
    assert mine.names == other.names == ("random_paths 0", "random_paths 1", "circle") * 2
    assert_array_equal(mine.reference, other.reference)
    assert_array_equal(mine.reference[0], np.array([one.samples[1, :4] for one in batch.engine.trajectories] * 2))
    assert np.any(mine.pose[10] != other.pose[10], axis=1).all()
    rest, again, different = Rest(), Rest(), Rest()
    for agent, seed in ((rest, 4), (again, 4), (different, 5)):
        roll_out(agent, batch, seed)
    assert_array_equal(rest.first, again.first)
    assert np.any(rest.first != different.first, axis=1).all()
    assert np.any(rest.first[:3] != rest.first[3:], axis=1).all()  # starts on one path differ


def test_a_roll_out_repeats_to_the_last_bit():
    batch = test_batch(TASK, TASK.test, starts=1)
    first = roll_out(tracker(batch), batch, seed=4)
    assert_same(first, roll_out(tracker(batch), batch, seed=4))
    assert_same(first, roll_out(tracker(batch), test_batch(TASK, TASK.test, starts=1), seed=4))


def test_series_last_as_long_as_their_paths():
    batch = test_batch(TASK, TASK.test, starts=1)
    found = roll_out(tracker(batch), batch, seed=4)
    lengths = [round(one.duration / found.period) for one in batch.engine.trajectories]
    assert lengths == [150, 150, 400]
    assert not found.failed.any()
    for name in ("position_error", "heading_error", "torque", "share", "command", "pose", "reference", "reward"):
        series = getattr(found, name).reshape(len(found.reward), 3, -1)
        assert np.isfinite(series).all(axis=2).sum(axis=0).tolist() == lengths
    for robot, one in enumerate(batch.engine.trajectories):
        assert_array_equal(found.reference[: lengths[robot], robot], one.samples[1:, :4])
    gap = np.linalg.norm((found.reference - found.pose)[..., :2], axis=-1)
    assert_allclose(gap, found.position_error, atol=1e-12)  # round-off of positions of 1 m
    limits = [motor.max_torque for caster in batch.robot.casters for motor in (caster.roll, caster.steer)]
    assert_array_equal(found.share, found.torque / np.array(limits))


def test_a_failure_ends_its_series_and_is_tagged():
    """A robot that rests is left behind by paths that go further than the corridor reaches."""
    tight = TASK.model_copy(update={"task": TASK.task.model_copy(update={"corridor": 0.1})})
    batch = test_batch(tight, TASK.test, starts=1)
    found = roll_out(Rest(), batch, seed=4)
    assert found.failed.all()
    lengths = np.isfinite(found.reward).sum(axis=0)
    full = np.array([len(one.samples) - 1 for one in batch.engine.trajectories])
    assert np.all(lengths < full)
    for robot, length in enumerate(lengths):
        assert found.position_error[length - 1, robot] > 0.1
        assert np.all(found.position_error[: length - 1, robot] <= 0.1)
        assert np.isnan(found.position_error[length:, robot]).all()
    assert len(found.reward) == lengths.max()  # no step is taken for nobody


def test_a_series_that_ends_in_time_has_not_failed():
    batch = test_batch(TASK, TASK.train, starts=1)
    assert not roll_out(tracker(batch), batch, seed=0).failed.any()


def test_training_runs_on_training_paths():
    batch = training_batch(TASK, 5)
    assert batch.num_envs == 5
    assert [one.name for one in batch.engine.trajectories] == [f"random_paths {k}" for k in range(3)]
    held_out = [one.samples for one in test_batch(TASK, TASK.test, starts=1).engine.trajectories]
    for one in batch.engine.trajectories:
        assert not any(np.array_equal(one.samples, other) for other in held_out)
