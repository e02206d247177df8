"""The package as others install it: whole, under one name, and light to import."""

import json
import os
import re
import shutil
import subprocess
import sys
import tomllib
import zipfile
from pathlib import Path

import pytest

from caster_gym.__main__ import main

ROOT = Path(__file__).resolve().parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
HOMES = {"agents": "caster_gym.agents", "configs": "caster_gym.configs"}  # folders that stand at the top
FOLDERS = {file.parent.relative_to(ROOT) for top in ("caster_gym", *HOMES) for file in (ROOT / top).rglob("*.py")}
PACKAGES = sorted(
    ".".join(folder.parts if folder.parts[0] == "caster_gym" else ("caster_gym", *folder.parts)) for folder in FOLDERS
)
HEAVY = ("torch", "stable_baselines3", "matplotlib", "numba", "scipy", "mujoco")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, built from a copy of what the sources need, so that the checkout stays as it is."""
    return build(copy_sources(tmp_path_factory.mktemp("source")), tmp_path_factory.mktemp("wheel"))


def copy_sources(folder):
    """A folder with a copy of all that a wheel is made of."""
    for name in ("pyproject.toml", "setup.py", "README.md", "LICENSE"):
        shutil.copy(ROOT / name, folder)
    for name in ("caster_gym", *HOMES):
        shutil.copytree(ROOT / name, folder / name, ignore=shutil.ignore_patterns("__pycache__"))
    return folder


def build(source, out):
    """The wheel of some sources."""
    pip("wheel", "--no-build-isolation", "--wheel-dir", out, source)
    (built,) = out.glob("*.whl")
    return built


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """A folder with the wheel installed and nothing else."""
    folder = tmp_path_factory.mktemp("installed")
    pip("install", "--target", folder, wheel)
    return folder


def run(command, **options):
    """What a command prints; its complaint if it fails."""
    result = subprocess.run(command, capture_output=True, text=True, check=False, **options)
    assert result.returncode == 0, result.stderr
    return result.stdout


def pip(command, *arguments):
    """A command of pip that touches no network and no dependency."""
    options = ("--quiet", "--no-deps", "--no-index", "--disable-pip-version-check")
    run([sys.executable, "-m", "pip", command, *options, *map(str, arguments)])


def python(code, path, folder):
    """What a fresh interpreter prints that sees `path` before its site-packages, the checkout not at all."""
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    environment["PYTHONPATH"] = str(path)
    return run([sys.executable, "-P", "-c", code], cwd=folder, env=environment)


def test_every_folder_with_sources_is_a_package():
    """One without this file is missing from the wheel, although it works in the checkout."""
    assert [folder for folder in FOLDERS if not (ROOT / folder / "__init__.py").is_file()] == []


def test_wheel_holds_one_top_level_package(wheel):
    """A top-level `agents` would overwrite that of another distribution."""
    names = zipfile.ZipFile(wheel).namelist()
    tops = {name.split("/")[0] for name in names}
    assert {top for top in tops if not top.endswith(".dist-info")} == {"caster_gym"}


def test_wheel_holds_every_source_and_every_configuration(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    expected = {"caster_gym/py.typed"}
    for top in ("caster_gym", *HOMES):
        home = HOMES.get(top, top).replace(".", "/")
        for pattern in ("*.py", "*.yaml"):
            files = (ROOT / top).rglob(pattern)
            expected |= {f"{home}/{file.relative_to(ROOT / top).as_posix()}" for file in files}
    assert expected - names == set()


@pytest.mark.slow
def test_the_same_sources_make_the_same_wheel_to_the_byte(wheel, tmp_path):
    """In a checkout at another place, of another age, with other modes and by a user with another umask."""
    (tmp_path / "a checkout at another place").mkdir()
    other = copy_sources(tmp_path / "a checkout at another place")
    for file in other.rglob("*"):
        file.chmod(0o700 if file.is_dir() else 0o600)
        os.utime(file, (1.5e9, 1.5e9))
    before = os.umask(0o077)
    try:
        again = build(other, tmp_path / "out")
    finally:
        os.umask(before)
    assert again.read_bytes() == wheel.read_bytes()


@pytest.mark.slow
def test_installed_wheel_works_without_the_checkout(installed, tmp_path):
    code = (
        "import importlib, json, caster_gym\n"
        f"files = [importlib.import_module(name).__file__ for name in {PACKAGES!r}]\n"
        "robots = {name: caster_gym.load_robot(name).caster_count for name in ('chung2008', 'tidybot2', 'xr4000')}\n"
        "print(json.dumps([files, robots]))\n"
    )
    files, robots = json.loads(python(code, installed, tmp_path))
    assert len(files) == len(PACKAGES)
    assert all(Path(file).is_relative_to(installed) for file in files), files
    assert robots == {"chung2008": 3, "tidybot2": 4, "xr4000": 4}


@pytest.mark.parametrize(
    "code", ["import caster_gym", "import caster_gym; caster_gym.Model(caster_gym.load_robot('chung2008'))"]
)
def test_import_leaves_heavy_libraries_alone(installed, tmp_path, code):
    loaded = python(f"{code}\nimport sys\nprint(*sys.modules)", installed, tmp_path).split()
    assert "caster_gym" in loaded
    assert set(HEAVY) & set(loaded) == set()


WITHOUT_TYPER = (
    "import importlib.util, runpy, sys\n"
    "find = importlib.util.find_spec\n"
    "importlib.util.find_spec = lambda name, *rest: None if name == 'typer' else find(name, *rest)\n"
    "sys.argv = ['caster-gym', *{arguments!r}]\n"
    "runpy.run_module('caster_gym', run_name='__main__')\n"
)


@pytest.mark.parametrize("arguments", [[], ["train"], ["--help"]])
def test_the_core_alone_says_which_extra_the_command_needs(installed, tmp_path, arguments):
    environment = {**os.environ, "PYTHONPATH": str(installed)}
    result = subprocess.run(
        [sys.executable, "-P", "-c", WITHOUT_TYPER.format(arguments=arguments)],
        capture_output=True,
        text=True,
        check=False,
        cwd=tmp_path,
        env=environment,
    )
    assert (result.returncode, result.stdout) == (2, "")
    assert result.stderr == (
        "caster-gym: the command needs typer, which simulation does without: pip install 'caster_gym[train]'\n"
    )


def test_the_core_alone_knows_its_version(installed, tmp_path):
    code = WITHOUT_TYPER.format(arguments=["--version"])
    assert python(code, installed, tmp_path) == f"caster_gym {PROJECT['project']['version']}\n"


def test_the_package_runs_as_the_command(installed, tmp_path):
    code = "import runpy, sys\nsys.argv = ['x', '-h']\nrunpy.run_module('caster_gym', run_name='__main__')"
    assert python(code, installed, tmp_path).startswith("Usage: caster-gym ")
    module, function = PROJECT["project"]["scripts"]["caster-gym"].split(":")
    assert (module, function) == ("caster_gym.__main__", "main")


def test_an_interrupt_while_the_command_loads_ends_it_quietly(monkeypatch, capsys):
    def interrupted(_):
        raise KeyboardInterrupt

    monkeypatch.setattr("caster_gym.__main__.import_module", interrupted)
    with pytest.raises(SystemExit) as end:
        main()
    assert end.value.code == 130
    assert capsys.readouterr().err == "caster-gym: interrupted; nothing was written\n"


def test_dir_shows_the_public_names(installed, tmp_path):
    names = python("import caster_gym\nprint(*dir(caster_gym))", installed, tmp_path).split()
    assert {"Model", "Robot", "load_robot", "wrappers"} <= set(names)  # all of them: tests/test_api.py
    assert "__version__" in names


@pytest.mark.slow
def test_papers_run_in_a_clone_beside_the_installed_package(installed, tmp_path):
    """They are no part of the wheel, which holds one top-level package; nothing but their folder is needed."""
    shutil.copytree(ROOT / "papers", tmp_path / "papers", ignore=shutil.ignore_patterns("__pycache__"))
    code = (
        "import runpy, sys\n"
        f"sys.path.insert(0, {str(tmp_path)!r})\n"
        "sys.argv = ['papers', '--help']\n"
        "from papers.kim2001.isotropy_search import printed_cells\n"
        "assert len(printed_cells(1)) == 25\n"
        "runpy.run_module('papers', run_name='__main__')\n"
    )
    assert "Usage: python -m papers [OPTIONS] {paper}" in python(code, installed, tmp_path)
    assert not list(installed.rglob("kim2001"))  # the folder of one of them


def test_environments_are_registered_by_the_import(installed, tmp_path):
    code = "import caster_gym, gymnasium\nprint(*(name for name in gymnasium.registry if name.startswith('Caster')))"
    assert "CasterTrack-v0" in python(code, installed, tmp_path).split()


def test_version_is_told_once_and_for_all():
    import caster_gym

    assert caster_gym.__version__ == PROJECT["project"]["version"]


def bounds():
    """Lowest version of each library in pyproject.toml, without the tools for style and types."""
    project = PROJECT["project"]
    extras = [line for name, lines in project["optional-dependencies"].items() if name != "dev" for line in lines]
    lines = [*project["dependencies"], *(line for line in extras if not line.startswith("caster_gym["))]
    return {name.lower(): lowest for name, _, lowest in (line.partition(">=") for line in lines)}


def test_the_lowest_versions_tested_are_those_declared():
    """`make lowest` installs constraints-lowest.txt, whose versions may have more zeros than the bounds."""
    text = (ROOT / "constraints-lowest.txt").read_text(encoding="utf-8")
    pins = dict(line.lower().split("==") for line in text.splitlines() if not line.startswith("#"))
    assert pins.keys() == bounds().keys()
    for name, lowest in bounds().items():
        assert pins[name] == lowest or pins[name].removeprefix(lowest).strip(".0") == "", (name, lowest, pins[name])


def test_all_that_the_checks_install_is_locked_with_hashes():
    """`make lock` makes requirements.lock, and from it the versions for pip, which takes no hashes beside `-e`."""
    text = (ROOT / "requirements.lock").read_text(encoding="utf-8")
    locked = re.findall(
        r"^(([\w.-]+)==[^\\\n]*?) *\\\n((?: +--hash=sha256:[0-9a-f]{64}(?: \\)?\n)+)", text, re.MULTILINE
    )
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    assert [line for line, _, _ in locked] == lines == re.findall(r"^(\w.*?) *\\$", text, re.MULTILINE)
    names = {name for _, name, _ in locked}
    extras = [line for lines in PROJECT["project"]["optional-dependencies"].values() for line in lines]
    asked = {re.split("[>=; ]", line)[0].lower() for line in extras if not line.startswith("caster_gym[")}
    assert asked | bounds().keys() <= names
