"""caster_gym.wrappers.draws: numbers by counting, for many robots at once."""

import numpy as np
from numpy.testing import assert_array_equal
from scipy import stats

from caster_gym.envs.randomness import uniform, uniforms
from caster_gym.wrappers.draws import normals, seeds_of, stream, streams

KEYS = np.array([0, 1, 2**63, 2**64 - 1], dtype=np.uint64)
EPISODES = np.array([0, 5, 2**40, 1], dtype=np.uint64)
DRAWS = 200_000


def seeds(count, of=None):
    keys = np.arange(count, dtype=np.uint64)
    return seeds_of(keys, np.zeros(count, dtype=np.uint64), stream(0, "noise") if of is None else of)


def test_numbers_are_those_of_the_environments_generator():
    of, indices = stream(3, "payload"), np.array([0, 1, 77])
    numbers = uniforms(seeds_of(KEYS, EPISODES, of), indices)
    with np.errstate(over="ignore"):  # 64-bit numbers wrap on purpose
        expected = [
            [uniform(key ^ of, episode, np.uint64(index)) for index in indices]
            for key, episode in zip(KEYS, EPISODES, strict=True)
        ]
    assert_array_equal(numbers, expected)


def test_a_robot_draws_alone_what_it_draws_in_a_batch():
    rows = np.arange(40)[:, None] + np.arange(5)
    for draw in (uniforms, normals):
        together = draw(seeds(40), rows)
        assert_array_equal(together, np.concatenate([draw(seeds(40)[i : i + 1], rows[i : i + 1]) for i in range(40)]))


def test_normal_numbers_are_normal():
    """Kolmogorov and Smirnov: 1.95 / √n is passed once in a thousand samples; these are fixed."""
    for numbers in (normals(seeds(DRAWS), np.zeros(1, np.int64))[:, 0], normals(seeds(1), np.arange(DRAWS))[0]):
        assert stats.kstest(numbers, "norm").statistic < 1.95 / np.sqrt(DRAWS)
        assert np.isfinite(numbers).all()


def test_the_most_extreme_bits_give_finite_numbers(monkeypatch):
    for extreme in (0, 2**64 - 1):
        monkeypatch.setattr("caster_gym.wrappers.draws.bits", lambda x, _, extreme=extreme: np.full_like(x, extreme))
        assert np.abs(normals(seeds(1), np.zeros(1, np.int64))).item() < 9.0  # Φ⁻¹(2⁻⁵³) is −8.2


def test_features_share_no_numbers():
    """Streams differ by kind and among features of a kind, and their numbers are independent."""
    several = streams(["payload", "friction", "pushes"] * 4)
    assert len(set(several)) == len(several)
    first, second = (uniforms(seeds(DRAWS, of), np.zeros(1, np.int64))[:, 0] for of in several[:2])
    assert abs(np.corrcoef(first, second)[0, 1]) < 5.0 / np.sqrt(DRAWS)  # five standard deviations


def test_features_of_other_kinds_change_no_stream():
    assert streams(["payload", "friction", "payload"]) == [
        stream(0, "payload"),
        stream(0, "friction"),
        stream(1, "payload"),
    ]
    assert sorted(streams(["friction", "payload", "pushes", "payload"])[1::2]) == sorted(streams(["payload"] * 2))
