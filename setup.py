"""Which packages there are: agents/ and configs/ stand at the top of the repository and are installed in caster_gym."""

from setuptools import find_packages, setup

setup(
    packages=[
        *find_packages(include=["caster_gym", "caster_gym.*"], exclude=["caster_gym.agents*", "caster_gym.configs*"]),
        *(f"caster_gym.{name}" for name in find_packages(include=["agents", "agents.*", "configs"])),
    ]
)
