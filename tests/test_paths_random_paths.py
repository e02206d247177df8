"""caster_gym.paths.random_paths: the same for the same seed, within their limits, and different from each other."""

import numpy as np
import pytest
from numpy.testing import assert_allclose, assert_array_equal
from pydantic import ValidationError

from caster_gym.paths.random_paths import RandomPaths
from tests.motion_laws import derivative_error


def samples(time_step=0.02, **changes):
    return np.stack([t.samples for t in RandomPaths(**changes).trajectories(time_step)])


def speeds(table):
    return np.hypot(table[..., 4], table[..., 5])


def test_every_column_is_the_derivative_of_the_one_before():
    """Finite differences and the integration of the speed are of fourth order: half the step, 1/16 of the error."""
    coarse, fine = (derivative_error(RandomPaths(count=16).trajectories(h)) for h in (0.02, 0.01))
    assert coarse / fine > 12.0
    assert fine < 1e-5


def test_a_seed_makes_the_same_paths_again_and_another_seed_others():
    assert_array_equal(samples(count=4, seed=3), samples(count=4, seed=3))
    assert abs(samples(count=4, seed=3) - samples(count=4, seed=4)).max() > 0.1


def test_a_path_does_not_depend_on_how_many_there_are():
    assert_array_equal(samples(count=3, seed=5), samples(count=40, seed=5)[:3])


def test_paths_hardly_depend_on_the_time_step():
    """Only through where the peaks that set the scale are sampled: h²/8 times a second derivative of about 10."""
    assert_allclose(samples(count=20), samples(0.01, count=20)[:, ::2], atol=10 * 0.02**2)


def test_paths_keep_to_their_limits_and_one_limit_is_nearly_reached():
    limits = {"extent": 1.5, "max_speed": 0.6, "max_acceleration": 0.7, "max_yaw_rate": 1.2}
    table = samples(count=200, **limits)
    use = np.stack(
        [
            np.hypot(table[..., 0], table[..., 1]).max(axis=1) / 1.5,
            speeds(table).max(axis=1) / 0.6,
            np.hypot(table[..., 7], table[..., 8]).max(axis=1) / 0.7,
        ]
    )
    assert use.max() <= 1.0 + 1e-12 and abs(table[..., 6]).max() <= 1.2 + 1e-12
    hardest = use.max(axis=0)  # each path draws its share of the limits from 0.3 to 1
    assert hardest.min() >= 0.3 - 1e-12
    assert (np.histogram(hardest, bins=7, range=(0.3, 1.0))[0] > 10).all()  # 200 / 7 expected, 10 is 3.7 σ below


def test_paths_start_at_the_centre_and_rest_at_both_ends():
    table = samples(count=50, centre=(2.0, -1.0))
    assert_allclose(table[:, 0, 0:2], [[2.0, -1.0]] * 50, atol=0.0)
    assert_allclose(table[:, [0, -1], 4:], 0.0, atol=1e-14)


def test_turned_paths_have_the_turned_table():
    plain, turned = samples(count=10), samples(count=10, rotation=np.pi / 2)
    for start in (0, 2, 4, 7):
        x, y = plain[..., start], plain[..., start + 1]
        assert_allclose(turned[..., start : start + 2], np.stack([-y, x], axis=-1), atol=1e-14)
    assert_array_equal(turned[..., [6, 9]], plain[..., [6, 9]])


def test_paths_differ_in_speed_in_turns_and_in_direction():
    table = samples(count=200)
    assert speeds(table).max(axis=1).std() > 0.1
    velocity = table[..., 4] + 1j * table[..., 5]
    moving = velocity[:, 25:-25]
    turns = np.angle(moving[:, 1:] / moving[:, :-1])
    assert np.abs(turns.sum(axis=1)).std() > 0.5
    backwards = (abs(turns) > 0.5 * np.pi).any(axis=1)  # the velocity passes through zero and turns round
    assert 0.1 < backwards.mean() < 0.4  # a quarter draws it; some of those never change sign


def test_the_share_of_paths_that_reverse_can_be_chosen():
    for share, least, most in ((0.0, 0.0, 0.0), (1.0, 0.6, 1.0)):
        velocity = samples(count=100, reversing=share)[:, 25:-25, 4:6]
        back = ((velocity[:, 1:] * velocity[:, :-1]).sum(axis=-1) < 0.0).any(axis=1)
        assert least <= back.mean() <= most


def test_paths_that_do_not_reverse_are_the_same_whatever_the_share():
    table, forwards = samples(count=40), samples(count=40, reversing=0.0)
    same = (table == forwards).all(axis=(1, 2))
    assert 0.5 < same.mean() < 1.0  # three quarters expected, σ = 0.07


def test_a_least_radius_bounds_the_turns_of_tangent_and_heading():
    """Turns over way, |ω| / v, at all samples but those at rest; without a bound there are tighter ones."""
    sharpest = []
    for radius in (0.3, None):
        table = samples(count=100, reversing=0.0, min_radius=radius)[:, 1:-1]
        speed, velocity = speeds(table), table[..., 4] + 1j * table[..., 5]
        turn = (velocity.conj() * (table[..., 7] + 1j * table[..., 8])).imag / speed**2  # [rad/s] of the tangent
        sharpest.append([(abs(turn) / speed).max(axis=1), (abs(table[..., 6]) / speed).max(axis=1)])
    (bound_tangent, bound_heading), (tangent, heading) = sharpest
    assert max(bound_tangent.max(), bound_heading.max()) <= (1.0 + 1e-6) / 0.3  # quotients of small numbers at the ends
    assert (tangent > 1.0 / 0.3).any() and (heading > 1.0 / 0.3).any()
    assert_allclose(bound_heading.max(), 1.0 / 0.3, rtol=1e-6)  # one that was too sharp turns just as it may


def test_bounded_paths_keep_to_their_limits():
    table = samples(count=100, reversing=0.0, min_radius=0.5, extent=2.0)
    assert np.hypot(table[..., 0], table[..., 1]).max() <= 2.0 + 1e-12
    assert speeds(table).max() <= 0.8 + 1e-12
    assert np.hypot(table[..., 7], table[..., 8]).max() <= 1.0 + 1e-12


def test_a_least_radius_where_paths_reverse_is_refused():
    with pytest.raises(ValidationError, match=r"a min_radius of 0\.2 m needs reversing 0, got 0\.25"):
        RandomPaths(min_radius=0.2)


def test_the_default_paths_stay_what_they_are():
    """Where the first three end: results are published for them."""
    ends = np.array(
        [
            [1.190711159885, 0.954523598291, 0.884315465611, -0.46688987704],
            [-2.197769866037, 1.685336644953, -0.996383648089, 0.084968381305],
            [1.912764541813, 2.035005540056, 0.891657758518, -0.452710107768],
        ]
    )
    assert_allclose(samples(count=3)[:, -1, :4], ends, atol=1e-9)


def test_any_draws_all_kinds_of_heading():
    table = samples(count=100, heading="any")
    fixed = (abs(table[..., 6]).max(axis=1) == 0.0).mean()
    assert 0.1 < fixed < 0.4  # a quarter expected, σ = 0.043


def test_fixed_headings_stand_still_and_differ():
    table = samples(count=20, heading="fixed")
    assert not table[..., [6, 9]].any()
    assert table[:, 0, 2].std() > 0.3


def test_tangent_headings_point_along_or_against_the_velocity():
    table = samples(count=20, heading="tangent")
    velocity, heading = table[..., 4] + 1j * table[..., 5], table[..., 2] + 1j * table[..., 3]
    assert_allclose((velocity / heading).imag, 0.0, atol=1e-14)


def test_spinning_headings_turn_by_the_quintic():
    table = samples(count=20, heading="spinning", duration=8.0)
    tau = np.linspace(0.0, 1.0, table.shape[1])
    bell = 16.0 * tau**2 * (1.0 - tau) ** 2
    assert_allclose(table[..., 6], table[:, 200, 6, None] * bell, atol=1e-13)


def test_profile_headings_turn_to_and_fro():
    omega = samples(count=20, heading="profile")[..., 6]
    assert ((omega.max(axis=1) > 0.0) & (omega.min(axis=1) < 0.0)).mean() > 0.5


def test_names_number_the_paths():
    assert [t.name for t in RandomPaths(count=2).trajectories(0.02)] == ["random_paths 0", "random_paths 1"]


def test_easing_lowers_all_rates_and_rounds_them_down_to_two_digits():
    eased = RandomPaths(max_speed=0.8, max_acceleration=1.0, max_yaw_rate=1.5).ease(1.2)
    assert (eased.max_speed, eased.max_acceleration, eased.max_yaw_rate) == (0.66, 0.83, 1.2)
    assert eased.remedy == "max_speed 0.66 m/s, max_acceleration 0.83 m/s² and max_yaw_rate 1.2 rad/s"


@pytest.mark.parametrize(
    "wrong",
    [{"count": 0}, {"seed": -1}, {"extent": 0.0}, {"max_speed": -1.0}, {"heading": "sideways"}, {"reversing": 1.1}],
)
def test_numbers_without_meaning_are_refused(wrong):
    with pytest.raises(ValidationError):
        RandomPaths(**wrong)
