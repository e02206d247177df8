"""Which packages there are: agents/ and configs/ stand at the top of the repository and are installed in caster_gym.

The same sources make the same wheel, to the byte, wherever and whenever it is built.
"""

import os
from pathlib import Path

from setuptools import find_packages, setup
from setuptools.command.bdist_wheel import bdist_wheel

os.environ.setdefault("SOURCE_DATE_EPOCH", "315532800")  # [s] 1980, the first year that a zip file can tell


class ReproducibleWheel(bdist_wheel):
    """A wheel whose files have the same modes, whatever those of the checkout and the umask are."""

    def write_wheelfile(self, *arguments, **options):
        """Write the last file before all are packed."""
        super().write_wheelfile(*arguments, **options)
        for path in Path(self.bdist_dir).rglob("*"):
            path.chmod(0o755 if path.is_dir() else 0o644)


setup(
    cmdclass={"bdist_wheel": ReproducibleWheel},
    packages=[
        *find_packages(include=["caster_gym", "caster_gym.*"], exclude=["caster_gym.agents*", "caster_gym.configs*"]),
        *(f"caster_gym.{name}" for name in find_packages(include=["agents", "agents.*", "configs"])),
    ],
)
