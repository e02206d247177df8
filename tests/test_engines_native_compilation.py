"""caster_gym.engines.native.compilation: what is compiled is announced, once, and found by all other processes."""

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from numba.core.errors import NumbaError

from caster_gym.engines import cache_folders
from caster_gym.engines.native import compiled_files
from caster_gym.engines.native.compilation import Work, compilations, included
from caster_gym.engines.native.compiler import compiled

ROOT = Path(__file__).resolve().parent.parent
ANNOUNCEMENT = "caster_gym: compiling for {}, about {} s, once on this machine\n"


@pytest.fixture(autouse=True)
def cache(tmp_path, monkeypatch):
    """A folder of its own for compiled code, empty."""
    monkeypatch.setattr(compiled_files._SETTINGS, "CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(cache_folders, "_said", set())
    (tmp_path / "cache").mkdir()
    return tmp_path / "cache"


def doubled(x):
    return x + x


def halved(x):
    return x // 2


def describe(types):
    return Work(f"a test of {types[0]}", 12.0)


def test_every_specialisation_is_announced_as_it_is_compiled(capfd):
    function = compiled(doubled, describe)
    assert capfd.readouterr().err == ""
    assert function(2) == 4
    assert capfd.readouterr().err == ANNOUNCEMENT.format("a test of int64", 10)
    assert function(3) == 6
    assert capfd.readouterr().err == ""
    assert function(2.5) == 5.0
    assert capfd.readouterr().err == ANNOUNCEMENT.format("a test of float64", 10)


def test_what_is_in_the_cache_is_neither_compiled_nor_announced(capfd):
    compiled(doubled, describe)(2)
    before = compilations()
    capfd.readouterr()
    again = compiled(doubled, describe)
    assert again(2) == 4
    assert compilations() == before
    assert sum(again.stats.cache_hits.values()) == 1
    assert capfd.readouterr().err == ""


def test_a_damaged_cache_is_mended(cache, capfd):
    """Also by code that is whole and no pickle, or was kept under the name of another function; one line tells it."""
    compiled(doubled, describe)(2), compiled(halved, describe)(2)
    file, other = sorted(cache.rglob("*.nbc"), key=lambda file: "halved" in file.name)
    content = file.read_bytes()
    for wrong in (content[:100], compiled_files._checksum(b"no pickle") + b"no pickle", other.read_bytes()):
        file.write_bytes(wrong)
        cache_folders._said.clear()
        capfd.readouterr()
        assert compiled(doubled, describe)(2) == 4
        told = capfd.readouterr().err.splitlines()
        assert len(told) == 2 and "is damaged" in told[0] and "compiling for a test" in told[1]
        assert file.read_bytes()[compiled_files._CHECKSUM :] != wrong[compiled_files._CHECKSUM :]
        assert compiled(doubled, describe)(2) == 4 and capfd.readouterr().err == ""


def test_what_belongs_to_an_announcement_is_not_announced_again(capfd):
    with included():
        compiled(doubled, describe)(2)
    assert capfd.readouterr().err == ""


def test_a_cache_that_cannot_be_kept_is_told_once(monkeypatch, cache, tmp_path, capfd):
    """The advice helps: with a folder that can be written, nothing is said."""
    (tmp_path / "file").touch()
    monkeypatch.setattr(compiled_files, "roots", lambda: iter([tmp_path / "file"]))
    function = compiled(doubled, describe)
    assert (function(2), function(2.0)) == (4, 4.0)
    told = capfd.readouterr().err
    assert told.count("cannot be kept") == told.count("set NUMBA_CACHE_DIR to a folder that can be written") == 1
    monkeypatch.setattr(compiled_files, "roots", lambda: iter([cache]))
    cache_folders._said.clear()
    compiled(doubled, describe)(2)
    assert "NUMBA_CACHE_DIR" not in capfd.readouterr().err


def test_without_any_folder_it_runs_with_one_warning(monkeypatch, capfd):
    """As where home can only be read and there are no temporary files."""
    monkeypatch.setattr(compiled_files, "roots", lambda: iter([]))
    function = compiled(doubled, describe)
    assert (function(2), function(2.0)) == (4, 4.0)
    assert capfd.readouterr().err.count("cannot be kept") == 1


def broken(x):
    return x.nothing_of_this_name


def test_after_a_failure_others_may_try(cache):
    function = compiled(broken, describe)
    with pytest.raises(NumbaError):
        function(2)
    assert function._cache._turn is None
    assert not list(cache.rglob("*.turn"))


TOGETHER = """
from caster_gym.engines.native.compilation import Work
from caster_gym.engines.native.compiler import compiled

def tripled(x):
    return x + x + x

print(compiled(tripled, lambda types: Work("a test", 1.0))(2))
"""


@pytest.mark.slow
def test_processes_that_start_together_compile_once(tmp_path):
    """One compiles and says so, the others wait and may say that."""
    (tmp_path / "together.py").write_text(TOGETHER)
    command = [sys.executable, str(tmp_path / "together.py")]
    environment = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "shared"), "PYTHONPATH": str(ROOT)}
    started = [
        subprocess.Popen(command, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
        for _ in range(4)
    ]
    results = [process.communicate(timeout=300) for process in started]
    assert [out for out, _ in results] == ["6\n"] * 4
    told = "".join(complaints for _, complaints in results).splitlines(keepends=True)
    assert told.count(ANNOUNCEMENT.format("a test", 1)) == 1
    assert set(told) <= {
        ANNOUNCEMENT.format("a test", 1),
        "caster_gym: another process is compiling for a test, waiting for it\n",
    }


FLEET = """
import json
import numpy as np
import caster_gym
from caster_gym.engines.native import fleet as numba_fleet
robot = caster_gym.load_robot("chung2008")
robot = robot.model_copy(update={"casters": robot.casters[:2]})
numba_fleet.Fleet(robot, 2).step(np.zeros((2, 4)), 1e-3)
stats = numba_fleet._compiled_step_blocks.stats
print(json.dumps([caster_gym.__file__, sum(stats.cache_hits.values()), sum(stats.cache_misses.values())]))
"""


@pytest.fixture(scope="module")
def fleets(tmp_path_factory):
    """Output and complaints of a process, of the next one, and of one in an environment of another place."""
    folder = tmp_path_factory.mktemp("fleets")
    copy = folder / "site-packages"
    ignored = shutil.ignore_patterns("__pycache__")
    shutil.copytree(ROOT / "caster_gym", copy / "caster_gym", ignore=ignored)
    kept = {name: value for name, value in os.environ.items() if name not in ("NUMBA_CACHE_DIR", "PYTHONPATH")}

    def run(place):
        environment = kept | {"XDG_CACHE_HOME": str(folder / "user"), "PYTHONPATH": str(place)}
        command = [sys.executable, "-P", "-c", FLEET]
        done = subprocess.run(command, env=environment, cwd=folder, check=True, capture_output=True, text=True)
        return json.loads(done.stdout), done.stderr

    return run(ROOT), run(ROOT), run(copy), folder


@pytest.mark.slow
def test_the_first_process_compiles_and_says_so(fleets):
    (_, hits, misses), told = fleets[0]
    assert (hits, misses) == (0, 1)
    assert told.startswith("caster_gym: compiling for 2 casters (mechanics), about ")
    assert told.count("\n") == 1


@pytest.mark.slow
@pytest.mark.parametrize("process", [1, 2], ids=["the same environment", "another environment"])
def test_the_next_process_compiles_nothing_and_says_nothing(fleets, process):
    (_, hits, misses), told = fleets[process]
    assert (hits, misses, told) == (1, 0, "")


@pytest.mark.slow
def test_the_other_environment_lies_elsewhere(fleets):
    assert fleets[0][0][0] != fleets[2][0][0]


@pytest.mark.slow
def test_compiled_code_lies_in_the_cache_of_the_user(fleets):
    assert list((fleets[3] / "user" / "caster_gym").rglob("*.nbc"))
