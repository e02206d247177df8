"""caster_gym.envs.tensor.state: what is kept, given and told, taken apart as it was put together."""

import torch

from caster_gym.envs.report import RECORD
from caster_gym.envs.tensor.state import TaskOutcome, TaskState, empty_record, record_parts


def test_a_detached_state_has_the_same_numbers_and_no_past():
    bodies = torch.ones((13, 2), requires_grad=True)
    whole = torch.arange(2)
    state = TaskState(2.0 * bodies, bodies.sum(0), bodies[0], whole, whole, whole, whole)
    for cut, kept in zip(state.detached(), state, strict=True):
        assert torch.equal(cut, kept) and not cut.requires_grad
    assert state.bodies.requires_grad


def test_the_parts_of_a_record_are_all_of_it_in_their_order():
    for casters, slipping in ((3, 0), (3, 3), (4, 4)):
        record = empty_record(torch.ones((7 + 2 * casters, 5)), casters, slipping)
        assert not record.any() and not record.requires_grad
        torques, numbers, slips = parts = record_parts(record, casters)
        assert (len(torques), len(numbers), len(slips)) == (2 * casters, len(RECORD), slipping)
        rows = torch.arange(float(len(record)))[:, None].expand(-1, 5)
        assert torch.equal(torch.cat(record_parts(rows, casters)), rows)
        assert all(part.shape[1] == 5 for part in parts)


def test_a_record_wants_gradients_where_bodies_do():
    bodies = torch.ones((13, 2), dtype=torch.float64, requires_grad=True)
    record = empty_record(bodies, 3, 0)
    assert record.requires_grad and record.is_leaf and record.dtype is torch.float64


def test_an_episode_is_over_when_it_fails_or_its_time_is_up():
    failed, late = torch.tensor([False, True, False, True]), torch.tensor([False, False, True, True])
    none = torch.zeros(4)
    assert TaskOutcome(none, none, failed, late, none).ended.tolist() == [False, True, True, True]
