"""caster_gym.agents.learning.replay_files: a buffer comes back as it was, whatever was written after its state."""

import json

import numpy as np
import pytest
from gymnasium.spaces import Box
from stable_baselines3.common.buffers import ReplayBuffer

from caster_gym.agents.learning import replay_files
from caster_gym.agents.learning.replay_files import ARRAYS, ReplayFiles
from caster_gym.configuration import ConfigurationError

ROBOTS, SIZE = 2, 25  # control periods in the buffer


@pytest.fixture(autouse=True)
def short_files(monkeypatch):
    monkeypatch.setattr(replay_files, "ROWS", 10)


def empty_buffer():
    space = Box(-1.0, 1.0, (3,), np.float32)
    return ReplayBuffer(ROBOTS * SIZE, space, Box(-1.0, 1.0, (2,), np.float32), device="cpu", n_envs=ROBOTS)


def add(buffer, count, generator):
    for _ in range(count):
        observation, following = generator.random((2, ROBOTS, 3), dtype=np.float32)
        infos = [{"TimeLimit.truncated": bool(late)} for late in generator.random(ROBOTS) < 0.5]
        done = generator.random(ROBOTS) < 0.5
        buffer.add(observation, following, generator.random((ROBOTS, 2)), generator.random(ROBOTS), done, infos)


def same(first, second):
    """Whether two buffers are equal, where they hold something."""
    assert (first.pos, first.full) == (second.pos, second.full)
    length = SIZE if first.full else first.pos
    return all(np.array_equal(getattr(first, name)[:length], getattr(second, name)[:length]) for name in ARRAYS)


@pytest.mark.parametrize("steps", [(7,), (10, 3), (4, 9, 12), (30,), (8, 40, 5), (25, 25, 25), (3, 70, 1)])
def test_a_buffer_comes_back_as_it_was(tmp_path, steps):
    """Also where it has gone round, and where it went round more than once since it was saved."""
    buffer, generator, total = empty_buffer(), np.random.default_rng(0), 0
    files = ReplayFiles(tmp_path, buffer)
    for count in steps:
        add(buffer, count, generator)
        total += count
        kept = json.loads(json.dumps(files.save(total)))
        files.remove_old()
        fresh = empty_buffer()
        ReplayFiles(tmp_path, fresh, kept)
        assert same(fresh, buffer)
    assert len(list(tmp_path.iterdir())) <= SIZE // 10 + 2


def test_what_was_appended_after_the_state_does_not_count(tmp_path):
    """A process may be killed after it has appended, and before its state says so; the next writes something else."""
    buffer, generator = empty_buffer(), np.random.default_rng(0)
    files = ReplayFiles(tmp_path, buffer)
    add(buffer, 14, generator)
    kept = files.save(14)
    reference = empty_buffer()
    ReplayFiles(tmp_path, reference, kept)
    add(buffer, 30, generator)
    files.save(44)  # of which the state never hears; files are not removed before it does
    resumed = empty_buffer()
    again = ReplayFiles(tmp_path, resumed, kept)
    assert same(resumed, reference)
    add(resumed, 9, np.random.default_rng(5))
    kept = again.save(23)
    again.remove_old()
    fresh = empty_buffer()
    ReplayFiles(tmp_path, fresh, kept)
    assert same(fresh, resumed)


@pytest.mark.parametrize("damage", ["gone", "short", "changed"])
def test_a_damaged_file_is_named(tmp_path, damage):
    buffer = empty_buffer()
    files = ReplayFiles(tmp_path, buffer)
    add(buffer, 14, np.random.default_rng(0))
    kept = files.save(14)
    path = tmp_path / "replay-00000001.bin"
    content = bytearray(path.read_bytes())
    content[5] ^= 1
    if damage == "gone":
        path.unlink()
    else:
        path.write_bytes(content if damage == "changed" else content[:-1])
    with pytest.raises(ConfigurationError, match=r"replay-00000001\.bin is not the part of a replay buffer"):
        ReplayFiles(tmp_path, empty_buffer(), kept)
