"""caster_gym.report.provenance: versions in words and commands as they are typed."""

import platform
import shlex
import sys
from importlib.metadata import version

import yaml

from caster_gym.report.provenance import command_line, versions_in_words, write_provenance


def test_versions_name_what_is_installed_and_leave_out_the_rest():
    words = versions_in_words("numpy", "no-such-package")
    assert words == f"Python {platform.python_version()}, numpy {version('numpy')}"


def test_a_command_can_be_pasted_into_a_shell(monkeypatch):
    arguments = ["--out", "a folder/page.md", "--set", "x={y: 1}"]
    assert shlex.split(command_line("scripts.x", arguments)) == ["python", "-m", "scripts.x", *arguments]
    monkeypatch.setattr(sys, "argv", ["/somewhere/x.py", *arguments])
    assert command_line("scripts.x", None) == command_line("scripts.x", arguments)
    assert command_line("scripts.x", []) == "python -m scripts.x"


def test_the_command_of_a_run_stands_beside_its_results(monkeypatch, tmp_path):
    for program, name in (("/bin/caster-gym", "caster-gym"), ("/home/me/papers/__main__.py", "python -m papers")):
        monkeypatch.setattr(sys, "argv", [program, "kim2001", "--overwrite"])
        write_provenance(tmp_path / "run", paper="kim2001")
        run = yaml.safe_load((tmp_path / "run" / "run.yaml").read_text(encoding="utf-8"))
        assert (run["command"], run["paper"]) == (f"{name} kim2001 --overwrite", "kim2001")
