"""A batch that cannot fit is refused in a sentence, before the machine is out of memory."""

import gymnasium as gym
import pytest

import caster_gym
from caster_gym.engines.memory import check_memory
from caster_gym.engines.native.fleet import Fleet

TOO_MANY = 10**10  # 5 TB of states alone


def test_a_batch_that_fits_is_no_matter():
    check_memory(65_536, 300)


def test_the_message_says_how_many_would_fit():
    with pytest.raises(ValueError, match=r"a batch of 10,000,000,000 robots needs [\d,]+ GB of memory") as caught:
        check_memory(TOO_MANY, 300)
    most = int(str(caught.value).split("GB: ")[1].split()[0].replace(",", ""))
    check_memory(most, 300)
    with pytest.raises(ValueError, match="robots at most"):
        check_memory(most + 1, 300)


def test_fleets_and_environments_refuse_it():
    with pytest.raises(ValueError, match="robots at most"):
        Fleet(caster_gym.load_robot("chung2008"), TOO_MANY)
    with pytest.raises(ValueError, match="robots at most"):
        gym.make_vec("caster_gym:CasterTrack-v0", num_envs=TOO_MANY)
